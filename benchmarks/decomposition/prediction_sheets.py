"""Sheets of what the scene network predicts, and of results before and after a change.

  python -m benchmarks.decomposition.prediction_sheets bodies WORLD --panoramas DIR [--weights NPZ]
  -o SHEET.jpg
  python -m benchmarks.decomposition.prediction_sheets results BEFORE AFTER -o SHEET.jpg

`bodies`: 24 held-out bodies under held-out panoramas, two to a row; of each the photo, predicted
and true normals, predicted and true diffuse image, predicted and true shading. `results`: each
folder of BEFORE, as `isc decompose` wrote it, beside the one of the same name in AFTER: photo, then
normals, shading and reflectance of both.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from isc_core.errors import InputError
from isc_core.imaging.srgb import linear_to_srgb
from isc_core.networks.scene_network import SceneNetwork, predict_scene
from isc_core.result_files.result_folder import load
from isc_core.scene.decomposition import Decomposition

_BODIES, _SIDE, _GAP = 24, 128, 4
_WHITE = 99.0  # percentile of the light that becomes white


def toned(light: np.ndarray, mask: np.ndarray, white: float | None = None) -> np.ndarray:
    """Make a picture of linear light.

    Parameters
    ----------
    light : (H, W, 3) ndarray
    mask : (H, W) ndarray of bool
    white : float, optional
        Becomes white; by default a high percentile.

    Returns
    -------
    (H, W, 3) uint8 ndarray
        White outside the mask.
    """
    level = white or max(float(np.percentile(light[mask].max(axis=1), _WHITE)), 1e-9)
    tone = linear_to_srgb(np.clip(light / level, 0, 1))
    return np.where(mask[..., None], np.rint(255 * tone), 255).astype(np.uint8)


def coloured(normal: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Make a picture of normals, as normal maps are shown.

    Parameters
    ----------
    normal : (H, W, 3) ndarray
    mask : (H, W) ndarray of bool

    Returns
    -------
    (H, W, 3) uint8 ndarray
    """
    length = np.linalg.norm(normal, axis=2, keepdims=True).clip(1e-6)
    return np.where(
        mask[..., None], np.rint(127.5 * (normal / length + 1)).clip(0, 255), 255
    ).astype(np.uint8)


def body_rows(
    world: Path, panoramas: Path, network: SceneNetwork | None, seed: int
) -> list[list[np.ndarray]]:
    """Pictures of held-out bodies, a row each.

    Parameters
    ----------
    world : Path
    panoramas : Path
    network : SceneNetwork or None
    seed : int

    Returns
    -------
    list of list of ndarray
    """
    from benchmarks.sirfs.prediction_weights import lit_bodies

    rows = []
    for lit in lit_bodies(world, panoramas, _BODIES, seed):
        mask, seen = lit.mask, predict_scene(lit.photo, lit.mask, network)
        white = float(np.percentile(lit.photo[mask].max(axis=1), _WHITE))
        shading, true_shading = (
            np.exp(part - np.median(part[mask]))
            for part in (seen.shading.log_shading, lit.log_shading)
        )
        bright = float(np.percentile(true_shading[mask].max(axis=1), _WHITE))
        rows.append(
            [
                toned(lit.photo, mask, white),
                coloured(seen.normals.normal, mask),
                coloured(lit.normal, mask),
                toned(lit.photo * np.exp(-seen.log_ratio), mask, white),
                toned(lit.diffuse, mask, white),
                toned(shading, mask, bright),
                toned(true_shading, mask, bright),
            ]
        )
    return rows


def result_rows(before: Path, after: Path) -> list[list[np.ndarray]]:
    """Pictures of results, a row each.

    Parameters
    ----------
    before, after : Path
        Folders of result folders.

    Returns
    -------
    list of list of ndarray

    Raises
    ------
    InputError
        If no name is in both.
    """
    names = sorted(one.name for one in before.iterdir() if (after / one.name).is_dir())
    if not names:
        raise InputError(f"{before} and {after} have no results of the same name")
    rows = []
    for name in names:
        old, new = load(before / name), load(after / name)
        rows.append([toned(old.image, old.mask), *_maps_of(old), *_maps_of(new)])
    return rows


def _maps_of(found: Decomposition) -> list[np.ndarray]:
    return [
        coloured(found.normal, found.mask),
        toned(found.shading, found.mask),
        toned(found.reflectance, found.mask),
    ]


def sheet(rows: Sequence[Sequence[np.ndarray]], columns: int) -> Image.Image:
    """Lay pictures out.

    Parameters
    ----------
    rows : sequence of sequence of ndarray
        Pictures that belong together.
    columns : int
        How many such rows stand beside each other.

    Returns
    -------
    PIL.Image.Image
    """
    wide = len(rows[0])
    lines, step = -(-len(rows) // columns), _SIDE + _GAP
    canvas = Image.new("RGB", (columns * (wide * step + 2 * _GAP), lines * step), "white")
    for k, row in enumerate(rows):
        left = (k % columns) * (wide * step + 2 * _GAP)
        for column, pixels in enumerate(row):
            picture = Image.fromarray(pixels)
            picture.thumbnail((_SIDE, _SIDE), Image.Resampling.LANCZOS)
            canvas.paste(picture, (left + column * step, k // columns * step))
    return canvas


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    kinds = parser.add_subparsers(dest="kind", required=True)
    bodies = kinds.add_parser("bodies", help="held-out bodies")
    bodies.add_argument("world", type=Path, metavar="WORLD", help="folder of isc world build")
    bodies.add_argument("--panoramas", type=Path, required=True, metavar="DIR")
    bodies.add_argument("--weights", type=Path, metavar="NPZ", help="default: the shipped network")
    bodies.add_argument("--seed", type=int, default=0)
    results = kinds.add_parser("results", help="results before and after")
    results.add_argument("before", type=Path, metavar="BEFORE")
    results.add_argument("after", type=Path, metavar="AFTER")
    for one in (bodies, results):
        one.add_argument("-o", "--output", type=Path, required=True, help="JPEG file to write")
    given = parser.parse_args()
    try:
        if given.kind == "bodies":
            network = None if given.weights is None else SceneNetwork.read(given.weights)
            made = sheet(body_rows(given.world, given.panoramas, network, given.seed), 2)
        else:
            made = sheet(result_rows(given.before, given.after), 1)
    except InputError as error:
        parser.error(str(error))
    made.save(given.output, quality=88)


if __name__ == "__main__":
    main()
