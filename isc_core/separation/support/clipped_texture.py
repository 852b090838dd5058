"""The diffuse layer under clipped highlights, inpainted with the texture of the paint around.

Problem: where the sensor saturates, nothing of the paint is recorded. A smooth fill loses stripes
and print; a copy of other patches is at times far off, where the paint repeats nowhere.

Equation: two fills of the clipped pixels from all others,

    A = pull-push of D,    P = S exp(patch fill of log(D / S)),

D the diffuse layer and S the expected shading, without which patches from brighter places would not
fit. For each connected hole, both also fill the hole and a ring of known pixels around it. P fills
the hole if its mean squared error of log D on the ring is below 0.8 of that of A; otherwise, ties
included, A does. The fill is at most the image. What `clipped` finds from the channels that are
left does not help: the mean of both was worse (docs/methods/print.md).

Citation: Y. Wexler, E. Shechtman and M. Irani 2007, doi:10.1109/TPAMI.2007.60; choice by held-out
values: M. Stone 1974, doi:10.1111/j.2517-6161.1974.tb00994.x.

Objects whose box has more than a million pixels are filled hole by hole, each from its
surroundings, half as wide as the hole.

Limits: specular light that the separation has left around a hole is copied into it. A hole without
known pixels around it is filled smoothly.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from ...filters.components import boxes, labelled
from ...filters.extrema import window_maximum
from ...filters.morphology import dilated
from ...imaging.bounding_box import mask_slices
from ...imaging.channels import averaged_if_grey, total
from ...imaging.tiles import Place
from ...inpainting.pull_push import fill_at

_RING = 4  # pixels held out around a hole, half a patch
_BETTER = 0.8  # of the smooth fill's error on the ring, to be undercut by patches
_DARK = 1e-3  # of the brightest value: the least in logarithms
_LARGEST_WHOLE = 1 << 20  # pixels: objects with a larger box are not searched as a whole
_CELL = 64  # pixels: holes that are nearer than about two cells are filled together


def inpaint_clipped(
    diffuse: np.ndarray,
    image: np.ndarray,
    clipped: np.ndarray,
    mask: np.ndarray,
    log_shading: np.ndarray,
    largest_whole: int = _LARGEST_WHOLE,
) -> np.ndarray:
    """Inpaint the diffuse layer of clipped pixels from its surroundings.

    Parameters
    ----------
    diffuse, image : (H, W, 3) ndarray
        Linear; `diffuse` is at most `image`.
    clipped, mask : (H, W) ndarray of bool
    log_shading : (H, W, 3) ndarray
        Expected; read inside the mask. The channels count by their mean where the image is grey.
    largest_whole : int, optional
        Pixels of the largest box of an object that is searched as a whole.

    Returns
    -------
    (H, W, 3) ndarray
        `diffuse` outside of clipped pixels, and everywhere where no pixel of the mask is known.
    """
    holes, known = clipped & mask, mask & ~clipped
    if not holes.any() or not known.any():
        return diffuse
    log_shading = averaged_if_grey(log_shading, image, mask)
    filled, dark = diffuse.copy(), _DARK * image[mask].max()
    for place, own in _windows(mask, holes, known, largest_whole):
        shading = np.where(mask[place][..., None], log_shading[place], 0).astype(np.float32)
        given = np.asarray(diffuse[place], np.float32)
        there = _continued(given, known[place], holes[place], shading, dark)
        filled[place][own] = np.clip(there[own[holes[place]]], 0, image[place][own])
    return filled


def _windows(
    mask: np.ndarray, holes: np.ndarray, known: np.ndarray, largest_whole: int
) -> Iterator[tuple[Place, np.ndarray]]:
    """Parts of the object to fill holes from, each with those of its holes that belong to it: the
    whole object, or the surroundings of holes that are near each other on a large one.
    """
    box = mask_slices(mask)
    if holes[box].size <= largest_whole:
        yield box, holes[box]
        return
    of_box = holes[box]
    padded = np.pad(of_box, [(0, -n % _CELL) for n in of_box.shape])
    rows, columns = (n // _CELL for n in padded.shape)
    cells = padded.reshape(rows, _CELL, columns, _CELL).any(axis=(1, 3))
    labels, count = labelled(dilated(cells, square=True), corners=True)
    for k, part in enumerate(boxes(labels, count), 1):
        length = _CELL * max(1, max(one.stop - one.start for one in part) // 2)
        while True:
            near = tuple(
                slice(max(_CELL * one.start - length, 0), min(_CELL * one.stop + length, size))
                for one, size in zip(part, of_box.shape, strict=True)
            )
            place = _moved(near[0], box[0].start), _moved(near[1], box[1].start)
            if known[place].any():
                break
            length *= 2
        group = labels == k
        own = group.repeat(_CELL, axis=0).repeat(_CELL, axis=1)[near] & of_box[near]
        yield place, own


def _moved(part: slice, by: int) -> slice:
    return slice(part.start + by, part.stop + by)


def _continued(
    diffuse: np.ndarray, known: np.ndarray, holes: np.ndarray, shading: np.ndarray, dark: float
) -> np.ndarray:
    """The pixels (n, 3) of `holes`, each hole filled by the better of the two fills."""
    albedo = np.log(np.maximum(diffuse, dark)) - shading
    ring = dilated(holes, _RING, square=True) & known
    smooth = fill_at(diffuse, known, holes)
    rest = known & ~ring
    if not ring.any() or not rest.any():
        return smooth
    from ...inpainting.patch_fill import fill_patches

    with ThreadPoolExecutor(1) as aside:
        tried = aside.submit(fill_patches, albedo, rest, holes | ring)
        copied = np.exp((fill_patches(albedo, known, holes) + shading)[holes])
        smooth_ring = np.log(np.maximum(fill_at(diffuse, rest, ring), dark))
        both = smooth_ring, (tried.result() + shading)[ring]
    truth = (albedo + shading)[ring]
    errors = [total(np.square(one - truth)) for one in both]
    labels, count = labelled(holes, corners=True)
    near = window_maximum(labels, 2 * _RING + 1)[ring]
    of_smooth, of_copied = (np.bincount(near, one, count + 1) for one in errors)
    better = of_copied < _BETTER * of_smooth
    return np.where(better[labels[holes]][:, None], copied, smooth)
