"""What is not a highlight: light that methods take off painted bodies, matt and glossy.

  python -m benchmarks.separation.prints WORLD --panoramas DIR [--part PART] [--count N]
  [--seed N] [--plain] [--methods isc,network,joint,marked,chain,joint@ODDS] [--sheet JPG]
  [--json FILE]
  python -m benchmarks.separation.prints WORLD --photos DIR --sheet JPG

WORLD is a folder of `isc world build`; the photos are those of `print_set`. Constants are fitted on
`Part.TRAINING` (`print_rule`), rules are chosen on `Part.VALIDATION`, figures are reported on
`Part.TEST`. `isc` and `network` are separators, `joint` the layers of `isc decompose` before
reflectance is continued, `chain` all of `isc decompose` (minutes). `marked` is `joint` with one
click: at the strongest highlight of a glossy body, as a person sees it; none on a matt one.
`joint@1` and `isc@0` have other odds than the default.

Matt: share of the light taken off, and its RMS over the photo's. Glossy: squared error of the
specular light over that of none. 1 is what doing nothing reaches; intervals are of resampled
bodies. `--photos` draws masked photos instead: each above what colour takes off and what the joint
model keeps.
"""

import argparse
import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image
from scipy import ndimage

from benchmarks.bootstrap import bootstrap_samples, interval
from isc_core.decomposition.joint import JointOptions, SupportedLayers, supported_layers
from isc_core.decomposition.pipeline import Settings, decompose
from isc_core.errors import InputError
from isc_core.imaging.bounding_box import mask_slices
from isc_core.imaging.srgb import linear_to_srgb
from isc_core.photo import Photo, PhotoSource, WholeFrame, read_photo
from isc_core.photo.highlight_marks import HighlightMarks
from isc_core.separation import COLOUR_ALONE, separate

from .print_set import Part, PrintScene, print_scenes

METHODS = ("isc", "network", "joint")
_COLUMNS = 10
_SHEET_SIDE, _PHOTO_COLUMNS = 200, 7


def removed_light(scene: PrintScene, method: str) -> np.ndarray:
    """Return the light that a method takes off a photo.

    Parameters
    ----------
    scene : PrintScene
    method : str
        "chain", "joint", "marked" or a separation method; "joint@ODDS", "isc@ODDS".

    Returns
    -------
    (H, W, 3) ndarray
    """
    photo, mask = scene.photo, scene.mask
    if method == "chain":
        source = PhotoSource("", (mask.shape[1], mask.shape[0]), 8, "srgb", "file")
        whole = Photo(photo, mask, 1 / 255, scene.clipped, source)
        return decompose(whole, Settings(threads=1)).specular
    name, _, odds = method.partition("@")
    if name in ("joint", "marked"):
        colour = separate("isc", photo, mask, scene.clipped, changes=COLOUR_ALONE)
        marks = strongest_highlight(scene) if name == "marked" else None
        options = JointOptions(odds=float(odds)) if odds else None
        layers = supported_layers(
            photo, colour, mask, options=options, clipped=scene.clipped, marks=marks
        )
        return _taken(layers, photo)
    changes = {"odds": float(odds)} if odds else None
    return separate(name, photo, mask, scene.clipped, changes=changes).specular


def _taken(layers: SupportedLayers, photo: np.ndarray) -> np.ndarray:
    """Specular light of the joint model's layers."""
    return layers.split.specular if layers.residual is None else photo - layers.diffuse


def strongest_highlight(scene: PrintScene) -> HighlightMarks:
    """Mark the strongest highlight of a photo.

    Parameters
    ----------
    scene : PrintScene

    Returns
    -------
    HighlightMarks
        One, in the middle of the brightest 3 x 3 pixels; none on a matt body.
    """
    light = np.where(scene.mask, (scene.photo - scene.diffuse).mean(axis=2), 0)
    if not light.any():
        return HighlightMarks()
    means = ndimage.uniform_filter(light, 3)
    row, column = np.unravel_index(int(np.where(scene.mask, means, 0).argmax()), light.shape)
    return HighlightMarks(((float(column) + 0.5, float(row) + 0.5),))


def matt_errors(scene: PrintScene, removed: np.ndarray) -> tuple[float, float]:
    """Compute the share of the light taken off a matt body, and its RMS over the photo's.

    Parameters
    ----------
    scene : PrintScene
    removed : (H, W, 3) ndarray

    Returns
    -------
    share, rms : float
    """
    off, photo = removed[scene.mask], scene.photo[scene.mask]
    rms = np.sqrt(np.square(off).sum(dtype=float) / np.square(photo).sum(dtype=float))
    return float(off.sum(dtype=float) / photo.sum(dtype=float)), float(rms)


def glossy_error(scene: PrintScene, removed: np.ndarray) -> float:
    """Compute the squared error of the specular light of a glossy body over that of none.

    Parameters
    ----------
    scene : PrintScene
    removed : (H, W, 3) ndarray

    Returns
    -------
    float
    """
    truth = (scene.photo - scene.diffuse)[scene.mask]
    wrong = np.square(removed[scene.mask] - truth).sum(dtype=float)
    return float(wrong / np.square(truth).sum(dtype=float))


def table(matt: dict[str, np.ndarray], glossy: dict[str, np.ndarray]) -> str:
    """Format the errors.

    Parameters
    ----------
    matt : dict of str to (N, 2) ndarray
        Shares and RMS of each method.
    glossy : dict of str to (N,) ndarray

    Returns
    -------
    str
        A Markdown table.
    """
    lines = [
        "| method | matt: share, mean | worst | over 1 % | RMS, worst "
        "| glossy: MSE, mean (95 %) | median | worst | above 1 |",
        "|---" * 9 + "|",
    ]
    rng = np.random.default_rng(0)
    for method, errors in glossy.items():
        share, rms = matt[method].T
        low, high = interval(bootstrap_samples(errors, rng).mean(axis=1))
        lines.append(
            f"| {method} | {share.mean():.2%} | {share.max():.1%} | {(share > 0.01).sum()} "
            f"| {rms.max():.1%} | {errors.mean():.3f} ({low:.2f}-{high:.2f}) "
            f"| {np.median(errors):.3f} | {errors.max():.2f} | {(errors > 1 + 1e-6).sum()} |"
        )
    return "\n".join(lines)


def write_sheet(path: Path, scenes: Sequence[PrintScene], rows: Sequence[np.ndarray]) -> None:
    """Write a sheet: each photo above what was taken off.

    Parameters
    ----------
    path : Path
    scenes : sequence of PrintScene
    rows : sequence of (H, W, 3) ndarray
        Light, one for each scene.
    """
    tiles = [np.vstack([scene.photo, removed]) for scene, removed in zip(scenes, rows, strict=True)]
    tiles += [np.zeros_like(tiles[0])] * (-len(tiles) % _COLUMNS)
    sheet = np.vstack([np.hstack(tiles[k : k + _COLUMNS]) for k in range(0, len(tiles), _COLUMNS)])
    codes = np.rint(255 * linear_to_srgb(np.clip(sheet, 0, 1))).astype(np.uint8)
    Image.fromarray(codes).save(path, quality=70)


def write_photo_sheet(path: Path, folder: Path) -> None:
    """Write a sheet of masked photos, what colour takes off them, and what the joint model does.

    Parameters
    ----------
    path : Path
        JPEG to write.
    folder : Path
        PNG and BMP photos with their masks in alpha, or on black; others show their whole frame.
    """
    tiles = []
    for file in sorted([*folder.glob("*.png"), *folder.glob("*.[bp][mp][pm]")]):
        if file.stem.endswith("_gt"):
            continue
        whole = read_photo(
            file, whole_frame=WholeFrame.NEVER if file.suffix == ".png" else WholeFrame.WITHOUT_MASK
        )
        photo = whole.resized_to_object(_SHEET_SIDE)
        image, mask = np.where(photo.mask[..., None], photo.image, 0), photo.mask
        colour = separate("isc", image, mask, photo.clipped, changes=COLOUR_ALONE)
        layers = supported_layers(image, colour, mask, clipped=photo.clipped)
        kept = _taken(layers, image)
        unit = max(float(np.quantile(image[mask], 0.995)), 1e-6)
        box = mask_slices(mask)
        column = [_padded(one[box] / unit) for one in (image, colour.specular, kept)]
        tiles.append(np.vstack(column))
    rows = -(-len(tiles) // _PHOTO_COLUMNS)
    tiles += [np.zeros_like(tiles[0])] * (rows * _PHOTO_COLUMNS - len(tiles))
    sheet = np.vstack(
        [np.hstack(tiles[k * _PHOTO_COLUMNS :][:_PHOTO_COLUMNS]) for k in range(rows)]
    )
    codes = np.rint(255 * linear_to_srgb(np.clip(sheet, 0, 1))).astype(np.uint8)
    size = (2 * codes.shape[1] // 3, 2 * codes.shape[0] // 3)
    small = Image.fromarray(codes).resize(size, Image.Resampling.LANCZOS)
    small.save(path, quality=50, optimize=True)


def _padded(light: np.ndarray) -> np.ndarray:
    """An image in the middle of a black square."""
    side = _SHEET_SIDE + 8
    rows, columns = (min(n, side) for n in light.shape[:2])
    square = np.zeros((side, side, 3))
    top, left = (side - rows) // 2, (side - columns) // 2
    square[top : top + rows, left : left + columns] = light[:rows, :columns]
    return square


def measured(
    scenes: Sequence[PrintScene],
    methods: Sequence[str],
    error: Callable[[PrintScene, np.ndarray], object],
) -> dict[str, np.ndarray]:
    """Run every method on every photo.

    Parameters
    ----------
    scenes : sequence of PrintScene
    methods : sequence of str
    error : callable
        `matt_errors` or `glossy_error`.

    Returns
    -------
    dict of str to ndarray
        Errors by method, one row a photo.
    """
    return {
        method: np.array([error(scene, removed_light(scene, method)) for scene in scenes])
        for method in methods
    }


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("world", type=Path, metavar="WORLD", help="folder of isc world build")
    add("--panoramas", type=Path, metavar="DIR", help="panoramas")
    add("--part", type=Part, default=Part.TEST, choices=list(Part), help="which bodies")
    add("--count", type=int, default=60, help="photos of each set (default: %(default)s)")
    add("--seed", type=int, default=0, help="of paint, light and sides (default: %(default)s)")
    add("--plain", action="store_true", help="bodies of one colour instead of painted ones")
    add("--methods", default=",".join(METHODS), help="default: %(default)s")
    add("--photos", type=Path, metavar="DIR", help="photos to draw instead")
    add("--sheet", type=Path, help="JPEG of the photos and what the last method takes off")
    add("--json", type=Path, help="file to write")
    given = parser.parse_args()
    methods = given.methods.split(",")
    if given.photos is not None and given.sheet is not None:
        write_photo_sheet(given.sheet, given.photos)
        return
    if given.panoramas is None:
        parser.error("name a folder of panoramas with --panoramas, or photos and a sheet")
    given_set = given.world, given.panoramas, given.part, given.count
    try:
        matt, glossy = (
            list(print_scenes(*given_set, glossy=shiny, seed=given.seed, painted=not given.plain))
            for shiny in (False, True)
        )
    except InputError as error:
        parser.error(str(error))
    shares, ratios = measured(matt, methods, matt_errors), measured(glossy, methods, glossy_error)
    if given.sheet:
        both = [*matt, *glossy]
        write_sheet(given.sheet, both, [removed_light(scene, methods[-1]) for scene in both])
    if given.json:
        found = {"matt": shares, "glossy": ratios}
        text = {key: {m: v.tolist() for m, v in part.items()} for key, part in found.items()}
        given.json.write_text(json.dumps(text), encoding="utf-8")
    print(table(shares, ratios))


if __name__ == "__main__":
    main()
