"""Separation of a photo into diffuse and specular light: one module per method, looked up by name.

A method's module is imported when the method is first used, so that a program starts fast and
without the dependencies of other methods. Each module has `separate`, a dataclass of options, and
`VARIANTS`, named settings. "improved", the first, is recommended: statistics inside the mask alone,
guards relative to the object's brightness. "paper" is the method as published, and "sihr" as the
public toolbox of that name behaves, from which most published comparisons come.

To add a method, write its module here (or in `published`) and add its name and one line to
`SUMMARIES`.
"""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Mapping
from types import ModuleType
from typing import TYPE_CHECKING

from ..errors import InputError

if TYPE_CHECKING:
    import numpy as np

    from ..progress import Monitor
    from ..scene.decomposition import Separation

# One line for the help of the commands.
SUMMARIES = {
    "none": "no separation: everything is diffuse",
    "tan_2005": "derivatives compared with a specular-free image (Tan and Ikeuchi 2005)",
    "mallick_2006": "erosion of the angle between colour and white (Mallick et al. 2006)",
    "yoon_2006": "ratios of neighbours in the two-band image (Yoon et al. 2006)",
    "shen_2009": "one gain for the modified specular-free image (Shen and Cai 2009)",
    "yang_2010": "smoothing of the largest chromaticity (Yang et al. 2010)",
    "kim_2013": "dark channel and maximum a posteriori estimation (Kim et al. 2013)",
    "shen_2013": "intensity ratio of clustered pixels (Shen and Zheng 2013)",
    "akashi_2016": "sparse non-negative matrix factorisation (Akashi and Okatani 2016)",
    "chaotic_segmentation": "chaotic multilevel thresholds and inpainting (Akbar 2016)",
    "sparse_coding": "sparse coding over specular-free images (Akbar 2016)",
    "network": "the highlight network of this project",
    "isc": "removes only what colour proves to be a highlight (this project; default)",
}
METHODS = tuple(SUMMARIES)
PUBLISHED = tuple(name for name in METHODS if name[-4:].isdigit())
BEST = "isc"
COLOUR_ALONE = {"odds": 0.0}  # changes options of `BEST`: form is ignored
IMPROVED = "improved"
# That light is a highlight and no paint, to be exceeded (`support.highlight_evidence`).
HIGHLIGHT_ODDS = 4.0
# The toolbox processes the whole frame and ignores clipping; its published figures can only be
# reproduced that way.
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
        If the user cancels.
    """
    from ..imaging.bounding_box import mask_slices
    from ..scene.decomposition import Separation
    from .support.checks import check_arrays

    options = method_options(method, variant, changes)
    check_arrays(image, mask, clipped)
    if prior is not None and (method != BEST or prior.shape != mask.shape):
        raise InputError(
            f"only the method {BEST} takes a prior, and it must have the photo's size {mask.shape}"
        )
    toolbox = variant == _TOOLBOX
    box = (slice(None), slice(None)) if toolbox else mask_slices(mask)
    cropped = image[box], mask[box], None if clipped is None or toolbox else clipped[box]
    if options is None:
        split = _module(method).separate(cropped[0], cropped[1], clipped=cropped[2])
    else:
        extra = {} if prior is None else {"prior": prior[box]}
        split = _module(method).separate(
            cropped[0], cropped[1], options, clipped=cropped[2], monitor=monitor, **extra
        )
    diffuse, specular, residual, confidence = (
        _uncrop(layer, box, mask.shape)
        for layer in (split.diffuse, split.specular, split.residual, split.confidence)
    )
    return Separation(diffuse, specular, residual, confidence, split.abstention)


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
    available = getattr(_module(method), "VARIANTS", {IMPROVED: None})
    if variant not in available:
        raise InputError(f"{method} has no variant {variant!r}: choose {' or '.join(available)}")
    options = available[variant]
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


def _uncrop(layer: np.ndarray, box: tuple[slice, slice], shape: tuple[int, ...]) -> np.ndarray:
    import numpy as np

    full = np.zeros((*shape, *layer.shape[2:]), layer.dtype)
    if layer.any():  # zero pages that are never written need no memory
        full[box] = layer
    return full
