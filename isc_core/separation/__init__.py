"""Splitting a photo into diffuse and specular: one method a file, and one function that knows their
names.

A method's module is imported when the method is first used, so that a program starts fast and
without what only one of them needs. Each has `separate`, a dataclass of options, and `VARIANTS`:
the settings that have a name. "improved", the first, is what we recommend: statistics inside the
mask alone, guards relative to the object's brightness. "paper" is the method as published, and
"sihr" as the public toolbox of that name behaves, from which most published comparisons come.
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
    """Splits `image` (H, W, 3), linear, under white light, inside `mask` (H, W) bool, by a method.

    `clipped` (H, W) bool marks pixels whose true value lies above the recorded one. `variant`: one
    of `variants(method)`; `changes`: options of the method that differ from it. `prior` (H, W) in
    [0, 1]: for "isc" alone, how probable a visible highlight is, .5 where nothing is known. Nothing
    outside the mask's box is looked at, but by "sihr", which ignores `clipped`. Raises `InputError`
    for unknown names, unfit options and arrays, a photo that the method can do nothing with;
    `Cancelled`.
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
    """The names of a method's settings, the recommended one first.

    Raises `InputError` for a name that is not one of `METHODS`.
    """
    return tuple(getattr(_module(method), "VARIANTS", (IMPROVED,)))


def method_options(
    method: str, variant: str = IMPROVED, changes: Mapping[str, object] | None = None
) -> object | None:
    """A method's options: those of the variant, with changes by field name; None for a method that
    has none.

    Raises `InputError` for a method, variant or option that does not exist; whether values make
    sense the method checks itself.
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
