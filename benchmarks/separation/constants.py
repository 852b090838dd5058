"""Cross-validate the constants of `--method isc`: choose without an object, measure on it.

  python -m benchmarks.separation.constants --data ../shared/data -o constants.csv [--candidates 60]

Candidates are the shipped constants and seeded random changes of them: each number of a few chosen
at random is scaled; ramps are moved and stretched. Each candidate is measured once on every photo
with known layers and on every diffuse image. Then, for each object, the candidate that is best on
all other objects counts. The score to minimise is

    sum log max(ratio, .05) + 20 sum max(0, ratio - 1.0005) + 1.5 sum min(max(0, change - .5), 3),

where ratio is the squared error over that of the unchanged photo, and change the percentage of a
diffuse image that is taken for highlights. The output file keeps all measurements; an interrupted
run continues.

Limits: the shipped constants were chosen on these photos, and the candidates lie around them. This
measures how much the last choice overfits, not the design, which used all photos.
"""

import argparse
import csv
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.program import run_program
from isc_core.datasets.highlight_set import SeparationTruth
from isc_core.imaging.bounding_box import mask_slices
from isc_core.separation.isc import VARIANTS, IscOptions, separate

from .specular_removal import photo_cases

_SEED = 20160101
_CHANGED = 6
_COLUMNS = ("candidate", "group", "name", "value")


def candidates(count: int) -> list[IscOptions]:
    """Return the shipped options, followed by random changes of them.

    Parameters
    ----------
    count : int
        Number of candidates, of which `count` - 1 are random.

    Returns
    -------
    list of IscOptions
        The same in every run.
    """
    shipped, random = VARIANTS["improved"], np.random.default_rng(_SEED)
    return [shipped] + [_changed(shipped, random) for _ in range(count - 1)]


def _changed(options: IscOptions, random: np.random.Generator) -> IscOptions:
    names = random.choice(
        [field.name for field in fields(options) if field.type is not bool],
        size=_CHANGED,
        replace=False,
    )
    changes: dict[str, Any] = {name: _moved(getattr(options, name), random) for name in names}
    return replace(options, **changes)


def _moved(value: Any, random: np.random.Generator) -> Any:
    if isinstance(value, tuple):
        width = (value[1] - value[0]) * random.uniform(0.6, 1.6)
        middle = (value[0] + value[1]) / 2 * random.uniform(0.85, 1.15)
        return (middle - width / 2, middle + width / 2)
    scaled = value * float(np.exp(random.uniform(-0.5, 0.5)))
    return (
        max(6, round(scaled))
        if isinstance(value, int)
        else min(scaled, 0.9 if scaled < 2 else scaled)
    )


@cache
def _photos(data: Path) -> tuple[tuple[str, SeparationTruth], ...]:
    """Group and truth of every photo, cropped to its mask."""
    return tuple((case.group, _cut(case.load())) for case in photo_cases(data, None))


def _cut(truth: SeparationTruth) -> SeparationTruth:
    box = mask_slices(truth.mask)
    layers: dict[str, Any] = {
        name: np.ascontiguousarray(getattr(truth, name)[box])
        for name in ("image", "mask", "diffuse", "specular", "clipped")
    }
    return replace(truth, **layers)


def measure(data: Path, options: IscOptions) -> list[tuple[str, str, float]]:
    """Measure one candidate on every photo.

    Parameters
    ----------
    data : Path
        Root of the data sets.
    options : IscOptions
        The candidate.

    Returns
    -------
    list of tuple
        Group, name and value: the error ratio or, without highlights, the change in per cent.
    """
    return [(group, truth.name, _value(truth, options)) for group, truth in _photos(data)]


def _value(truth: SeparationTruth, options: IscOptions) -> float:
    image, diffuse, mask = truth.image, truth.diffuse, truth.mask
    answer = separate(image, mask, options, clipped=truth.clipped).diffuse
    highlight = np.square((image - diffuse)[mask]).sum(dtype=float)
    if highlight == 0:
        return float(
            100
            * np.sqrt(
                np.square((answer - image)[mask]).sum(dtype=float)
                / np.square(image[mask]).sum(dtype=float)
            )
        )
    return float(np.square((answer - diffuse)[mask]).sum(dtype=float) / highlight)


def score(figures: dict[tuple[str, str], float]) -> float:
    """Return the score of a candidate; lower is better.

    Parameters
    ----------
    figures : dict of (str, str) to float
        Values by group and name: of groups without highlights, the RMS of the removed light in per
        cent; of others, the squared error over that of the unchanged photo.

    Returns
    -------
    float
        Sum of the log ratios, plus penalties for harmed photos.
    """
    clean = [value for (group, _), value in figures.items() if "clean" in group]
    ratios = np.array([value for (group, _), value in figures.items() if "clean" not in group])
    harm = (
        20 * np.maximum(ratios - 1.0005, 0).sum() + 1.5 * np.clip(np.array(clean) - 0.5, 0, 3).sum()
    )
    return float(np.log(np.maximum(ratios, 0.05)).sum() + harm)


def left_out(
    table: dict[int, dict[tuple[str, str], float]],
) -> Iterator[tuple[str, str, float, float, int]]:
    """Choose the constants without each object in turn.

    Parameters
    ----------
    table : dict
        Values by candidate, then by group and name.

    Yields
    ------
    group, name : str
        The photo.
    shipped, chosen : float
        Its values with the shipped constants and with those chosen without its object.
    candidate : int
        Number of the latter.
    """
    for subject in sorted({_object(name) for _, name in table[0]}):
        others = {
            c: score({key: value for key, value in row.items() if _object(key[1]) != subject})
            for c, row in table.items()
        }
        best = min(others, key=lambda c: others[c])
        for group, photo in table[0]:
            if _object(photo) == subject:
                yield group, photo, table[0][group, photo], table[best][group, photo], best


def _object(name: str) -> str:
    """The object of a photo: names of diffuse images begin with the light."""
    return name.split()[-1]


def _read(path: Path) -> dict[int, dict[tuple[str, str], float]]:
    table: dict[int, dict[tuple[str, str], float]] = {}
    if path.is_file():
        with path.open(newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                table.setdefault(int(row["candidate"]), {})[row["group"], row["name"]] = float(
                    row["value"]
                )
    return table


def main() -> None:
    """Run the command line."""
    given = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    given.add_argument(
        "--data", type=Path, required=True, help="folder with highlight/ and mit_berkeley_train/"
    )
    given.add_argument(
        "-o", "--output", type=Path, required=True, help="CSV file of all measurements"
    )
    given.add_argument("--candidates", type=int, default=60, help="candidates to measure")
    given.add_argument("--processes", type=int, default=2, help="parallel processes")
    options = given.parse_args()
    table, wanted = _read(options.output), candidates(options.candidates)
    missing = [number for number in range(len(wanted)) if number not in table]
    with (
        ProcessPoolExecutor(options.processes) as pool,
        options.output.open("a", newline="", encoding="utf-8") as file,
    ):
        writer = csv.writer(file)
        if not table:
            writer.writerow(_COLUMNS)
        found = pool.map(
            measure, [options.data] * len(missing), [wanted[number] for number in missing]
        )
        for number, rows in zip(missing, found, strict=True):
            writer.writerows((number, *row) for row in rows)
            file.flush()
            table[number] = {(group, name): value for group, name, value in rows}
            print(f"candidate {number}: {score(table[number]):.3f}", flush=True)
    print("| photo | shipped | chosen without its object | candidate |\n|---|---|---|---|")
    for group, name, shipped, chosen, best in left_out(table):
        print(f"| {group} {name} | {shipped:.3f} | {chosen:.3f} | {best} |")


if __name__ == "__main__":
    run_program(main)
