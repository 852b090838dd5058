"""The pipeline: from one photo to its intrinsic scene characteristics."""

from typing import TYPE_CHECKING

from ..lazy import exports
from .settings import Settings

if TYPE_CHECKING:
    from ..scene.known_inputs import KnownInputs
    from .pipeline import decompose
else:
    __getattr__ = exports(
        __name__, {"KnownInputs": "..scene.known_inputs", "decompose": ".pipeline"}
    )

__all__ = ["KnownInputs", "Settings", "decompose"]
