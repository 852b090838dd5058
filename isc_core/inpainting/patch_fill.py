"""Inpainting with texture from the rest of the image (Wexler, Shechtman & Irani 2007).

Problem: fill missing pixels of a textured image such that every patch that touches the hole
resembles some patch outside it.

Equation: alternate until convergence: each patch p that touches the hole finds its nearest source
patch (`coherency_sensitive_hashing`), at squared distance d_p; each missing pixel becomes the mean
of its votes, with weights g^-e_p exp(-d_p / (2 s)): s is the upper quartile of the distances, e_p
the depth of the patch's centre in the hole, g = 1.3 (`voting`). A pyramid begins at a level where
the hole is small; its top is filled smoothly (`pull_push`), and each level is initialised from the
one above.

Citation: Y. Wexler, E. Shechtman and M. Irani, "Space-time completion of video", IEEE TPAMI 29(3),
463-476 (2007), doi:10.1109/TPAMI.2007.60.

Limits: the fill is plausible, not the truth. Patches of 8 x 8 pixels are copied without change of
brightness, so that a shading that occurs nowhere else is not extrapolated. Where no source patch
exists, the fill is smooth.
"""

from dataclasses import dataclass, field

import numpy as np

from ..errors import InputError
from ..filters.distance import distance_to
from ..imaging.bounding_box import mask_slices
from ..imaging.tiles import Place
from ..progress import Monitor
from .coherency_sensitive_hashing import (
    CshOptions,
    CshSearch,
    Patches,
    patches_touching,
    patches_within,
)
from .pull_push import fill, pull, pushed_at
from .voting import vote
from .walsh_hadamard import PATCH

# Factor by which a vote's weight decreases per pixel of its patch's depth in the hole.
_DEPTH_LOSS = 1.3


@dataclass(frozen=True)
class PatchFillOptions:
    """Options of the fill.

    Attributes
    ----------
    iterations : int
        Matching and voting on the finest level, at least 1; each coarser level has one more.
    most_iterations : int
        Upper limit on any level, at least `iterations`.
    matching : CshOptions
        Its seed determines all random choices.
    """

    iterations: int = 2
    most_iterations: int = 6
    matching: CshOptions = field(default_factory=lambda: CshOptions(tables=3, candidates=3))


def fill_patches(
    image: np.ndarray,
    known: np.ndarray,
    wanted: np.ndarray,
    options: PatchFillOptions | None = None,
    monitor: Monitor | None = None,
) -> np.ndarray:
    """Fill the wanted pixels from the known ones.

    Parameters
    ----------
    image : (H, W, C) ndarray
        Values that are neither known nor wanted are never read.
    known, wanted : (H, W) bool ndarray
    options : PatchFillOptions, optional
    monitor : Monitor, optional

    Returns
    -------
    (H, W, C) float32 ndarray
        Known pixels are unchanged, and wanted ones estimated; others have no meaning.

    Raises
    ------
    InputError
        If nothing is known, a pixel is both, or options are out of range.
    Cancelled
        If the user cancels.
    """
    options = options or PatchFillOptions()
    if not 1 <= options.iterations <= options.most_iterations:
        raise InputError("iterations must be at least 1, most_iterations no less")
    if not known.any() or (known & wanted).any():
        raise InputError(
            "a hole needs known pixels around it, and no pixel can be both known and missing: "
            "check the mask"
        )
    values = np.where(known[..., None], image, 0).astype(np.float32)
    return _filled(values, known, wanted, None, options, 0, monitor or Monitor())


def _filled(
    values: np.ndarray,
    known: np.ndarray,
    wanted: np.ndarray,
    needed: Place | None,
    options: PatchFillOptions,
    level: int,
    monitor: Monitor,
) -> np.ndarray:
    """One level of the pyramid, 0 the finest, after the coarser ones, in place.

    Only the wanted pixels, their surroundings and the part that the finer level needs are filled.
    """
    if not wanted.any() or min(known.shape) < 2 * PATCH:
        return fill(values, known)
    smaller, still_known = pull(values, known)
    missing = _any_of_four(wanted) & ~still_known
    near = mask_slices(wanted, PATCH - 1)  # contains all patches with a wanted pixel
    part = _both(near, needed)
    read = _read_from(part, still_known.shape)
    above = _filled(smaller, still_known, missing, read, options, level + 1, monitor)
    at = tuple(index + one.start for index, one in zip(np.nonzero(~known[part]), part, strict=True))
    values[at] = pushed_at(above, at)
    source = patches_within(values, known)
    if not len(source):
        return values
    search = CshSearch(source, options.matching)
    depth = distance_to(known)[near]
    filled, unknown = values[near], ~known[near]
    count = min(options.iterations + level, options.most_iterations)
    matches = None
    for turn in range(count):
        # A level has a quarter of the pixels of the one below it.
        monitor.report("filling holes", 0.25**level * (0.25 + 0.75 * turn / count))
        target = patches_touching(filled, wanted[near])
        matches = search.match(target, None if matches is None else matches.source)
        means, has_votes = vote(values, target, source, matches, _depth_penalty(target, depth))
        np.copyto(filled, means, where=(has_votes & unknown)[..., None], casting="same_kind")
    return values


def _both(one: Place, other: Place | None) -> Place:
    """The smallest part that contains one or two."""
    if other is None:
        return one
    rows, columns = (
        slice(min(a.start, b.start), max(a.stop, b.stop)) for a, b in zip(one, other, strict=True)
    )
    return rows, columns


def _read_from(part: Place, shape: tuple[int, ...]) -> Place:
    """The part of the next coarser level, of `shape`, from which `part` is interpolated."""
    rows, columns = (
        slice(max(one.start // 2 - 1, 0), min((one.stop + 1) // 2 + 1, size))
        for one, size in zip(part, shape, strict=True)
    )
    return rows, columns


def _any_of_four(flags: np.ndarray) -> np.ndarray:
    """Which 2 x 2 blocks of `flags` (H, W) bool have a set pixel; an odd last row or column forms
    separate blocks.
    """
    padded = np.pad(flags, [(0, n % 2) for n in flags.shape])
    return padded[::2, ::2] | padded[1::2, ::2] | padded[::2, 1::2] | padded[1::2, 1::2]


def _depth_penalty(target: Patches, depth: np.ndarray) -> np.ndarray:
    """Penalty of the votes of `target` patches (see `voting`): the `depth` (H, W) of their centres
    in the hole, in pixels, times log g.
    """
    return np.log(_DEPTH_LOSS) * depth[target.rows + PATCH // 2, target.columns + PATCH // 2]
