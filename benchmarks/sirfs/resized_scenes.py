"""What does a smaller photo cost where truth is known: rendered scenes, and the same ones reduced.

  python -m benchmarks.sirfs.resized_scenes -o FOLDER [--first 300] [--count 40]
  [--sizes 192,128] [--before ROWS]

Scenes are those of `benchmarks.refinement.scenes`, their objects 384 pixels long. Each is
decomposed as it is, and as a photo that is reduced to each of the sizes, by the defaults of
`isc decompose`. Errors: mean angle of the normals, degrees, and mean square errors of shading and
reflectance after one scale; change: median angle of the normals to those of 384 pixels. The table
has geometric means of the errors over those at 384, with their 95 % intervals over scenes, and the
median and the largest change. FOLDER keeps what was rendered, and the rows of each scene in
rows.jsonl. `--before`: the same file of another version, and the errors over its.

Limits: shapes and lights are made from seeds.
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.program import run_program
from benchmarks.records import append_row, read_rows
from benchmarks.refinement.scenes import photo_of, rendered
from isc_core.decomposition.pipeline import decompose
from isc_core.evaluation.evaluate import paired_bootstrap
from isc_core.evaluation.metrics import scaled_mse
from isc_core.imaging.area_resize import AreaFilter, resize_separately
from isc_core.photo import Photo
from isc_core.scene.decomposition import Decomposition

from .scale import change_of_normals

ERRORS = ("normal", "shading", "reflectance")
_SIDE = 436  # pixels of the frame: objects are 384 pixels long
_WHOLE = 384


def errors_of(d: Decomposition, truth: Mapping[str, np.ndarray]) -> list[float]:
    """Return the errors of a result.

    Parameters
    ----------
    d : Decomposition
    truth : mapping of str to ndarray
        Maps by `ERRORS`; normals of any length.

    Returns
    -------
    list of float
        By `ERRORS`.
    """
    mask = d.mask
    normal = truth["normal"][mask]
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    cosine = np.clip((normal * d.normal[mask]).sum(axis=1), -1, 1)
    of_maps = (scaled_mse(truth[name][mask], getattr(d, name)[mask]) for name in ERRORS[1:])
    return [float(np.degrees(np.arccos(cosine)).mean()), *of_maps]


def reduced(truth: Mapping[str, np.ndarray], photo: Photo, small: Photo) -> dict[str, np.ndarray]:
    """Average true maps over the pixels of a smaller photo.

    Parameters
    ----------
    truth : mapping of str to ndarray
        Maps by `ERRORS`.
    photo, small : Photo
        The photo of these maps, and the same one reduced.

    Returns
    -------
    dict of str to ndarray
    """
    if small.scale == photo.scale:
        return {name: truth[name] for name in ERRORS}
    area = AreaFilter.of(photo.mask.shape, small.scale / photo.scale)
    return {name: resize_separately(truth[name], photo.mask, small.mask, area) for name in ERRORS}


def row_of(folder: Path, number: int, sizes: Sequence[int]) -> dict[str, Any]:
    """Decompose one scene at all sizes.

    Parameters
    ----------
    folder : Path
        Where scenes are kept.
    number : int
        Number of the scene.
    sizes : sequence of int
        Pixels.

    Returns
    -------
    dict
        For each size, as text, the errors and the change.
    """
    file = folder / f"scene{number:04d}.npz"
    if not file.exists():
        np.savez(file, **rendered(number, _SIDE, ("image", "mask", *ERRORS)))
    with np.load(file, allow_pickle=False) as stored:
        truth = {name: stored[name] for name in stored.files}
    photo = photo_of(truth)
    whole = decompose(photo)
    row: dict[str, Any] = {"scene": number, str(_WHOLE): [*errors_of(whole, truth), 0.0]}
    for size in sizes:
        small = photo.resized_to_object(size)
        found = decompose(small)
        errors = errors_of(found, reduced(truth, photo, small))
        row[str(size)] = [*errors, change_of_normals(found, whole)]
    return row


def ratios(over: Sequence[Sequence[float]], under: Sequence[Sequence[float]]) -> str:
    """Format the ratios of errors.

    Parameters
    ----------
    over, under : sequence of sequence of float
        Of each scene, by `ERRORS`.

    Returns
    -------
    str
        Geometric means with their intervals.
    """
    cells = []
    for k, name in enumerate(ERRORS):
        logs = [np.log([row[k] for row in rows]) for rows in (over, under)]
        one = paired_bootstrap(logs[0], logs[1], seed=0)
        cells.append(f"{name} x{one.ratio:.3f} ({one.low:.3f} to {one.high:.3f})")
    return ", ".join(cells)


def main() -> None:
    """Run the measurement."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--first", type=int, default=300)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--sizes", default="192,128", help="pixels")
    parser.add_argument("--before", type=Path, metavar="ROWS")
    given = parser.parse_args()
    sizes = [int(size) for size in given.sizes.split(",")]
    given.output.mkdir(parents=True, exist_ok=True)
    file = given.output / "rows.jsonl"
    done = {row["scene"]: row for row in read_rows(file)}
    numbers = range(given.first, given.first + given.count)
    for number in numbers:
        if number not in done:
            done[number] = row_of(given.output, number, sizes)
            append_row(file, done[number])
    earlier = {row["scene"]: row for row in read_rows(given.before)} if given.before else {}
    for size in map(str, sizes):
        here = [done[number][size] for number in numbers]
        print(f"{size} over {_WHOLE}: {ratios(here, [done[k][str(_WHOLE)] for k in numbers])}")
        changes = [row[-1] for row in here]
        print(f"    normals change by {np.median(changes):.2f} degrees, {max(changes):.2f} at most")
        if earlier:
            print(f"    over before: {ratios(here, [earlier[k][size] for k in numbers])}")


if __name__ == "__main__":
    run_program(main)
