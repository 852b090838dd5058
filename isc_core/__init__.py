"""Intrinsic scene characteristics from one photo of a glossy object.

The Python interface consists of `decompose`, `separate`, `save` and `load`. They accept `Settings`,
`KnownInputs` and `Monitor`, work on `Photo`, `Decomposition` and `Separation`, and raise
`InputError` and `Cancelled`. Nothing is imported before its first use, not even `typing`, because
this module runs before the command can handle Ctrl-C.
"""

TYPE_CHECKING = False  # type checkers know the name
if TYPE_CHECKING:
    from .api import decompose, load, save, separate
    from .decomposition.settings import Settings
    from .errors import Cancelled, InputError
    from .photo.photo import Photo
    from .progress import Monitor, ProgressEvent
    from .scene.decomposition import Decomposition, Separation
    from .scene.known_inputs import KnownInputs

_MODULES = {
    "Cancelled": ".errors",
    "Decomposition": ".scene.decomposition",
    "InputError": ".errors",
    "KnownInputs": ".scene.known_inputs",
    "Monitor": ".progress",
    "Photo": ".photo.photo",
    "ProgressEvent": ".progress",
    "Separation": ".scene.decomposition",
    "Settings": ".decomposition.settings",
    "decompose": ".api",
    "load": ".api",
    "save": ".api",
    "separate": ".api",
}


def __getattr__(name: str) -> object:
    from .lazy import exports

    return exports(__name__, _MODULES)(name)


__version__ = "0.1.0"
__all__ = [
    "decompose",
    "separate",
    "save",
    "load",
    "Settings",
    "KnownInputs",
    "Monitor",
    "ProgressEvent",
    "Photo",
    "Decomposition",
    "Separation",
    "InputError",
    "Cancelled",
    "__version__",
]
