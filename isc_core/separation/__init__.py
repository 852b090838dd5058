"""Separation of a photo into diffuse and specular light: one method a file, found by its name.

A method's module is imported when the method is first used, so that a program starts fast and
without the dependencies of other methods. Each module has `separate`, a dataclass of options, and
`VARIANTS`, named settings. "improved", the first, is recommended: statistics inside the mask alone,
guards relative to the object's brightness. "paper" is the method as published, and "sihr" as the
public toolbox of that name behaves, from which most published comparisons come.

To add a method, write its module here (or in `published`) and add its name to `METHODS`.
"""

import dataclasses
import importlib
from collections.abc import Mapping
from types import ModuleType

import numpy as np

from ..errors import InputError
from ..imaging.bounding_box import mask_slices
from ..progress import Monitor
from ..scene.decomposition import Separation
from .support.checks import check_arrays

PUBLISHED = (
    "tan_2005",
    "mallick_2006",
    "yoon_2006",
    "shen_2009",
    "yang_2010",
    "kim_2013",
    "shen_2013",
    "akashi_2016",
)
METHODS = (
    "none",
    *PUBLISHED,
    "chaotic_segmentation",
    "sparse_coding",
    "network",
    "isc",
)
BEST = "isc"
IMPROVED = "improved"
# The toolbox knows the whole frame only, and nothing of clipping: its figures are found again no
# other way.
_TOOLBOX = "sihr"


def separate(
    method: str,
    image: np.ndarray,
    mask: np.ndarray,
    clipped: np.ndarray | None = None,
    *,
    variant: str = IMPROVED,
    changes: Mapping[str, object] | None = None,
    prior: np.ndarray | None = None,
    monitor: Monitor | None = None,
) -> Separation:
    """Separate a photo under white light into its diffuse and specular layer.

    Parameters
    ----------
    method : str
        One of `METHODS`.
    image : (H, W, 3) ndarray
        Linear light. Only the mask's box is used, except by "sihr".
    mask : (H, W) bool ndarray
    clipped : (H, W) bool ndarray, optional
        Pixels whose true value lies above the recorded one; "sihr" ignores it.
    variant : str
        One of `variants(method)`.
    changes : mapping, optional
        Options of the method that differ from the variant.
    prior : (H, W) ndarray, optional
        For "isc" alone: probability of a visible highlight, in [0, 1]; 0.5 where unknown.
    monitor : Monitor, optional

    Returns
    -------
    Separation

    Raises
    ------
    InputError
        If a name, an option or an array is invalid, or the method cannot handle the photo.
    Cancelled
        If the user asked to stop.
    """
    options = method_options(method, variant, changes)
    check_arrays(image, mask, clipped)
    if prior is not None and (method != BEST or prior.shape != mask.shape):
        raise InputError(
            f"a prior is for the method {BEST} alone, and has the photo's size {mask.shape}"
        )
    toolbox = variant == _TOOLBOX
    part = np.s_[:, :] if toolbox else mask_slices(mask)
    inside = image[part], mask[part], None if clipped is None or toolbox else clipped[part]
    if options is None:
        split = _module(method).separate(inside[0], inside[1], clipped=inside[2])
    else:
        extra = {} if prior is None else {"prior": prior[part]}
        split = _module(method).separate(
            inside[0], inside[1], options, clipped=inside[2], monitor=monitor, **extra
        )
    return Separation(
        *(
            _placed(layer, part, mask.shape)
            for layer in (split.diffuse, split.specular, split.residual, split.confidence)
        )
    )


def variants(method: str) -> tuple[str, ...]:
    """Return the names of a method's settings, the recommended one first.

    Parameters
    ----------
    method : str

    Returns
    -------
    tuple of str

    Raises
    ------
    InputError
        If the name is not one of `METHODS`.
    """
    return tuple(getattr(_module(method), "VARIANTS", (IMPROVED,)))


def method_options(
    method: str, variant: str = IMPROVED, changes: Mapping[str, object] | None = None
) -> object | None:
    """Return a method's options: those of the variant, with changes.

    Parameters
    ----------
    method : str
    variant : str
    changes : mapping, optional
        Values by field name; the method itself checks them.

    Returns
    -------
    dataclass or None
        None for a method without options.

    Raises
    ------
    InputError
        If the method, variant or option does not exist.
    """
    known = getattr(_module(method), "VARIANTS", {IMPROVED: None})
    if variant not in known:
        raise InputError(f"{method} has no variant {variant!r}: choose {' or '.join(known)}")
    options = known[variant]
    fields = [] if options is None else [field.name for field in dataclasses.fields(options)]
    for name in changes or {}:
        if name not in fields:
            raise InputError(
                f"{method} has no option {name!r}: "
                + (f"choose one of {', '.join(fields)}" if fields else "it has none")
            )
    return dataclasses.replace(options, **changes) if changes else options


def _module(method: str) -> ModuleType:
    if method not in METHODS:
        raise InputError(
            f"unknown separation method {method!r}: choose one of {', '.join(METHODS)}"
        )
    folder = ".published" if method in PUBLISHED else ""
    return importlib.import_module(f"{folder}.{method}", __package__)


def _placed(layer: np.ndarray, part: tuple[slice, slice], shape: tuple[int, ...]) -> np.ndarray:
    whole = np.zeros((*shape, *layer.shape[2:]), layer.dtype)
    whole[part] = layer
    return whole
