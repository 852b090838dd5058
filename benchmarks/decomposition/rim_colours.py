"""How far are the colours at the rim of found masks from those of the object?

  python -m benchmarks.decomposition.rim_colours WORLD --panoramas DIR [--photos DIR]
  [--part A|B] [--count N] [--seed N] [--side PIXELS]

Composites of held-out objects (`training.masks.held_out`) have true colours beyond the outline: in
a second picture by the same camera, the colour of the nearest fully covered pixel continues there.
Compared are the photo, `photo.decontamination.unmixed`, and `estimate_foreground`, with the found
mask and with the true coverage. The error is the mean absolute difference of sRGB values in [0, 1],
in the mask's outer three pixels and in its outermost one, up to three pixels beyond the true
outline. Masks that would be refused, and those with an overlap below .5, are left out. The interval
is that of resampled photos.

Limits: those of `training.masks.held_out`; at a side above 320 pixels, objects are blurred.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from scipy import ndimage

from benchmarks.bootstrap import bootstrap_samples, interval
from benchmarks.program import run_program
from isc_core.imaging.srgb import linear_to_srgb
from isc_core.masking.confidence import mask_overlap
from isc_core.masking.refusal import refusal_reason
from isc_core.masking.search import find_mask
from isc_core.networks.mask_network import Count
from isc_core.photo.decontamination import estimate_foreground, unmixed
from training.masks.composites import CompositeDraws, Composites, as_photographed, ground_truth
from training.masks.held_out import PARTS, held_out_ingredients
from training.masks.packs import Ingredients

_BATCH = 8
_BAND = 3  # pixels
_COVERED = 0.95  # coverage from which a pixel shows the object alone
_LEAST = 50  # such pixels of an object
_RIGHT = 0.5  # overlap of a mask that is right
_METHODS = {
    "photo": lambda image, cover: image,
    "unmixed": unmixed,
    "unmixed and limited": estimate_foreground,
}
Sample = tuple[np.ndarray, np.ndarray, np.ndarray]


def samples(ingredients: Ingredients, number: int, seed: int, side: int) -> Iterator[Sample]:
    """Compose photos of one object with continued colours.

    Parameters
    ----------
    ingredients : Ingredients
    number : int
    seed : int
    side : int
        Pixels.

    Yields
    ------
    light : (H, W, 3) float32 ndarray
    continued : (H, W, 3) float32 ndarray
        The same photo with the colours of the target everywhere.
    cover : (H, W) float32 ndarray
        Coverage by the target.
    """
    shares = tuple(float(kind == Count.ONE) for kind in Count)
    draw, rng = CompositeDraws(_BATCH, hinted=0, shares=shares), np.random.default_rng([seed, 1])
    compose, made = Composites(ingredients, draw, side), 0
    torch.manual_seed(seed)  # noise of the backgrounds
    while made < number:
        drawn = draw(rng)
        scene = compose.pasted(drawn)
        mask = ground_truth(scene, drawn)[0]
        continued = scene.light.clone()
        for k in torch.nonzero(drawn.objects.target)[:, 0]:
            covered = (scene.cover[k, 0] > _COVERED).numpy()
            if covered.sum() >= _LEAST:
                colours = (scene.foreground[k] / scene.cover[k].clamp(min=1e-6)).numpy()
                rows, columns = ndimage.distance_transform_edt(
                    ~covered, return_distances=False, return_indices=True
                )
                at = drawn.objects.photo[k]
                continued[at] = torch.from_numpy(np.ascontiguousarray(colours[:, rows, columns]))
        photos = []
        for light in (scene.light, continued):
            torch.manual_seed(seed)  # the same noise
            photos.append(as_photographed(light, scene.frame, drawn.cameras, scene.light))
        for k in range(min(_BATCH, number - made)):
            frame = scene.frame[k, 0].numpy() > 0
            place = np.ix_(frame.any(1), frame.any(0))
            shown, true = (np.moveaxis(one[k].numpy(), 0, 2)[place] for one in photos)
            yield np.ascontiguousarray(shown), true, mask[k, 0].numpy()[place]
            made += 1


def rim_errors(sample: Sample, cover: np.ndarray) -> np.ndarray:
    """Compute the errors of all methods.

    Parameters
    ----------
    sample : tuple
        See `samples`.
    cover : (H, W) float32 ndarray
        Coverage that the methods use.

    Returns
    -------
    (3, 2) ndarray
        Of each method, in the outer three pixels and in the outermost one.
    """
    light, continued, true_cover = sample
    mask = np.pad(cover >= 0.5, 1, constant_values=True)
    depth = ndimage.distance_transform_edt(mask)[1:-1, 1:-1]
    near = ndimage.distance_transform_edt(true_cover < 0.5) <= _BAND
    bands = [(depth > 0) & (depth <= width) & near for width in (_BAND, 1)]
    rows, true = [], linear_to_srgb(continued)
    for method in _METHODS.values():
        error = np.abs(linear_to_srgb(method(light, cover)) - true).mean(axis=2)
        rows.append([error[band].mean() for band in bands])
    return np.array(rows)


def report(title: str, errors: np.ndarray) -> None:
    """Print a table.

    Parameters
    ----------
    title : str
    errors : (N, 3, 2) ndarray
        See `rim_errors`.
    """
    print(f"\n| {title}, {len(errors)} photos | outer {_BAND} pixels | outermost pixel |")
    print("|---|---|---|")
    for name, row in zip(_METHODS, errors.mean(axis=0), strict=True):
        print(f"| {name} | {row[0]:.4f} | {row[1]:.4f} |")
    change = errors[:, 2, 0] - errors[:, 1, 0]
    low, high = interval(bootstrap_samples(change, count=4000).mean(axis=1))
    print(
        f"\nLimits change the error of the outer pixels by {change.mean():+.4f} "
        f"({low:+.4f} to {high:+.4f}), and lower it on {(change < 0).mean():.0%} of the photos."
    )


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("world", type=Path)
    parser.add_argument("--panoramas", type=Path, required=True)
    parser.add_argument("--photos", type=Path)
    parser.add_argument("--part", choices=PARTS, default="B")
    parser.add_argument("--count", type=int, default=48)
    parser.add_argument("--seed", type=int, default=22)
    parser.add_argument("--side", type=int, default=320)
    given = parser.parse_args()
    ingredients = held_out_ingredients(given.world, given.panoramas, given.part, given.photos)
    of_found, of_true = [], []
    for sample in samples(ingredients, given.count, given.seed, given.side):
        found, true = find_mask(sample[0]), sample[2] >= 0.5
        if mask_overlap(found.mask, true) >= _RIGHT and not refusal_reason(found):
            of_found.append(rim_errors(sample, found.cover))
            of_true.append(rim_errors(sample, sample[2]))
    report("found mask", np.array(of_found))
    report("true coverage", np.array(of_true))


if __name__ == "__main__":
    run_program(main)
