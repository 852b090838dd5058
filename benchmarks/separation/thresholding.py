"""Compare the threshold optimisers with the exact optimum on nine images, with equal budgets.

  python -m benchmarks.separation.thresholding -o DIR [--runs 50] [--evaluations 20000]

Writes thresholding.csv (one row per optimiser, image and number of thresholds), thresholding.md
(tables) and PNG figures: the mutation rate; the bifurcation, density and uniformised distribution
of the logistic map; the dependence of its consecutive values; the convergence of the searches. The
images are those of scikit-image.
"""

import argparse
import csv
import time
from collections.abc import Callable
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np
from scipy.stats import mannwhitneyu
from skimage import data
from skimage.color import rgb2gray

from benchmarks.program import run_program
from isc_core.thresholding import Optimum, OtsuObjective, exact, maximise, particle_swarm
from isc_core.thresholding.clonal_selection import ClonalOptions, mutation_rate, search
from isc_core.thresholding.logistic_map import (
    DEGENERATE,
    ChaoticNumbers,
    bifurcation,
    density,
    orbit,
    uniformised,
)

from ..plots import COLOURS, AxesOptions, png_axes

IMAGES = ("camera", "coins", "moon", "page", "brick", "grass", "gravel", "clock", "astronaut")
COUNTS = (3, 4, 5)
HIT = 1e-12  # relative: sets of thresholds with equal classes differ by rounding


class OneOrbit:
    """Uniform numbers from consecutive values of one chaotic orbit, with their dependence.

    Parameters
    ----------
    seed : int
        Chooses the start of the orbit.
    """

    def __init__(self, seed: int) -> None:
        self._x = 0.1 + 0.8 * ((seed + 1) * 0.618034 % 1)

    def uniform(self, shape: tuple[int, ...]) -> np.ndarray:
        """Return the next numbers of the orbit.

        Parameters
        ----------
        shape : tuple of int
            Shape of the array.

        Returns
        -------
        ndarray
            Of the given shape, in [0, 1).
        """
        x, values = self._x, []
        for _ in range(int(np.prod(shape))):
            x = 4 * x * (1 - x)
            x = 0.1234567 if x in DEGENERATE else x
            values.append(x)
        self._x = x
        return np.minimum(uniformised(np.array(values)), np.nextafter(1, 0)).reshape(shape)


def _one_orbit(objective: OtsuObjective, count: int, evaluations: int, seed: int) -> Optimum:
    return search(objective, count, evaluations, OneOrbit(seed), ClonalOptions())


def _falling_swarm(objective: OtsuObjective, count: int, evaluations: int, seed: int) -> Optimum:
    return particle_swarm.maximise(
        objective, count, evaluations, seed, particle_swarm.DECREASING_INERTIA
    )


def _named(name: str) -> Callable[[OtsuObjective, int, int, int], Optimum]:
    return lambda objective, count, evaluations, seed: maximise(
        name, objective, count, evaluations=evaluations, seed=seed
    )


OPTIMISERS: dict[str, Callable[[OtsuObjective, int, int, int], Optimum]] = {
    "chaotic_clonal": _named("chaotic_clonal"),
    "clonal_selection": _named("clonal_selection"),
    "particle_swarm": _named("particle_swarm"),
    "swarm, falling inertia": _falling_swarm,
    "chaotic, one orbit": _one_orbit,
}


@dataclass(frozen=True)
class ThresholdRow:
    """Result of the runs of one optimiser on one image.

    Attributes
    ----------
    optimiser, image : str
        Names.
    count : int
        Number of thresholds.
    exact : float
        Value of the exact optimum.
    runs, hits : int
        Runs, and runs that reached the optimum.
    mean, deviation, lowest : float
        Of the values reached.
    median_evaluations, most_evaluations : float
        Until the optimum, over the hits; NaN without hits.
    used : int
        Evaluations of a run.
    milliseconds : float
        Time of a run.
    """

    optimiser: str
    image: str
    count: int
    exact: float
    runs: int
    hits: int
    mean: float
    deviation: float
    lowest: float
    median_evaluations: float
    most_evaluations: float
    used: int
    milliseconds: float


def levels(name: str) -> np.ndarray:
    """Return a grey test image.

    Parameters
    ----------
    name : str
        One of `IMAGES`.

    Returns
    -------
    (H, W) ndarray
        uint8.
    """
    stored = getattr(data, name)()
    return stored if stored.ndim == 2 else np.rint(255 * rgb2gray(stored)).astype(np.uint8)


def to_optimum(found: Optimum, best: float) -> float:
    """Count the evaluations until a run reached the optimum.

    Parameters
    ----------
    found : Optimum
        The run.
    best : float
        Value of the optimum.

    Returns
    -------
    float
        Evaluations; NaN if the run never reached it.
    """
    reached = found.history[:, 1] >= best * (1 - HIT)
    return float(found.history[np.argmax(reached), 0]) if reached.any() else float("nan")


def measure(
    name: str, image: str, objective: OtsuObjective, count: int, runs: int, evaluations: int
) -> tuple[ThresholdRow, np.ndarray]:
    """Run an optimiser with many seeds.

    Parameters
    ----------
    name : str
        Key of `OPTIMISERS`.
    image : str
        Name of the image.
    objective : OtsuObjective
        Of the image.
    count : int
        Number of thresholds.
    runs, evaluations : int
        Number of runs, and budget of each.

    Returns
    -------
    row : ThresholdRow
        The result.
    needed : (runs,) ndarray
        Evaluations until the optimum; NaN where it was missed.
    """
    best = exact(objective, count).value
    start = time.perf_counter()
    found = [OPTIMISERS[name](objective, count, evaluations, seed) for seed in range(runs)]
    milliseconds = 1e3 * (time.perf_counter() - start) / runs
    values = np.array([f.value for f in found])
    needed = np.array([to_optimum(f, best) for f in found])
    hit = needed[np.isfinite(needed)]
    median, most = (
        (float(np.median(hit)), float(hit.max())) if len(hit) else (float("nan"), float("nan"))
    )
    used = max(f.evaluations for f in found)
    spread = (float(values.mean()), float(values.std()), float(values.min()))
    return ThresholdRow(
        name, image, count, best, runs, len(hit), *spread, median, most, used, milliseconds
    ), needed


def summary(rows: list[ThresholdRow], needed: dict[str, np.ndarray]) -> str:
    """Format the results over all images, and a test of the difference that chaos makes.

    Parameters
    ----------
    rows : list of ThresholdRow
        All results.
    needed : dict of str to ndarray
        Evaluations until the optimum, by optimiser.

    Returns
    -------
    str
        Markdown.
    """
    lines = [
        "| optimiser | K=3 | K=4 | K=5 | missed runs "
        "| evaluations to the optimum, median / 95 % / maximum | ms per run |",
        "|---|---|---|---|---|---|---|",
    ]
    for name in OPTIMISERS:
        mine = [row for row in rows if row.optimiser == name]
        rates = [
            100
            * sum(r.hits for r in mine if r.count == k)
            / sum(r.runs for r in mine if r.count == k)
            for k in COUNTS
        ]
        missed = sum(r.runs - r.hits for r in mine)
        hit = needed[name][np.isfinite(needed[name])]
        cost = f"{np.median(hit):.0f} / {np.percentile(hit, 95):.0f} / {hit.max():.0f}"
        cells = [
            *(f"{rate:.1f} %" for rate in rates),
            f"{missed} of {sum(r.runs for r in mine)}",
            cost,
        ]
        lines.append(
            f"| {name} | {' | '.join(cells)} | {np.mean([r.milliseconds for r in mine]):.0f} |"
        )
    lines.append("")
    for name in ("clonal_selection", "chaotic, one orbit"):
        # A missed run counts as slower than any other.
        pair = [np.nan_to_num(needed[which], nan=np.inf) for which in ("chaotic_clonal", name)]
        test = mannwhitneyu(*pair)
        share = test.statistic / (len(pair[0]) * len(pair[1]))
        lines.append(
            f"Chaotic ClonalG needs more evaluations than {name} in {100 * share:.1f} % of pairs "
            f"of runs (50 %: no difference; p = {test.pvalue:.2g})."
        )
    return "\n".join(lines) + "\n"


def details(rows: list[ThresholdRow]) -> str:
    """Format hits and standard deviations per image as a Markdown table.

    Parameters
    ----------
    rows : list of ThresholdRow
        One per image, number of thresholds and optimiser.

    Returns
    -------
    str
        One line per image and number of thresholds.
    """
    lines = [
        "| image | K | exact optimum | "
        + " | ".join(f"{name}: hits, deviation" for name in OPTIMISERS)
        + " |",
        "|---|---|---|" + "---|" * len(OPTIMISERS),
    ]
    for image in IMAGES:
        for count in COUNTS:
            mine = {row.optimiser: row for row in rows if (row.image, row.count) == (image, count)}
            cells = [
                f"{100 * mine[name].hits / mine[name].runs:.0f} %, {mine[name].deviation:.4f}"
                for name in OPTIMISERS
            ]
            lines.append(
                f"| {image} | {count} | {mine['chaotic_clonal'].exact:.3f} | {' | '.join(cells)} |"
            )
    return "\n".join(lines) + "\n"


def draw_map(folder: Path) -> None:
    """Draw the mutation rate and the logistic map (figures 3.5 to 3.8 of the thesis).

    Parameters
    ----------
    folder : Path
        Where to write the PNG files.
    """
    affinity = np.linspace(0, 1, 200)
    options = AxesOptions("Mutation rate", "affinity f", "exp(-rho f)", (0, 1), (0, 1))
    with png_axes(folder / "mutation_rate.png", options) as axes:
        for decay, colour in zip((2, 3, 4, 5), COLOURS, strict=False):
            label = f"rho = {decay}"
            axes.plot(affinity, mutation_rate(affinity, decay), color=colour, label=label)
    rates = np.linspace(2.8, 4, 1000)
    ends = bifurcation(rates)
    options = AxesOptions("Bifurcation of the logistic map", "r", "x", (2.8, 4), (0, 1))
    with png_axes(folder / "bifurcation.png", options) as axes:
        axes.plot(np.broadcast_to(rates, ends.shape).ravel(), ends.ravel(), ",", color=COLOURS[0])
    x = orbit(0.1234, 100_000)
    _draw_densities(folder, x)
    options = AxesOptions("Consecutive numbers", "u", "next u", (0, 1), (0, 1.25))
    mixed, raw = ChaoticNumbers(0).uniform((4000,)), uniformised(x[:4000])
    with png_axes(folder / "consecutive.png", options) as axes:
        for values, colour, label in (
            (mixed, COLOURS[0], "many orbits, every eighth value"),
            (raw, COLOURS[1], "one orbit, every value"),
        ):
            axes.plot(values[:-1], values[1:], ".", markersize=2, color=colour, label=label)


def _draw_densities(folder: Path, x: np.ndarray) -> None:
    edges = np.linspace(0, 1, 51)
    inner = np.linspace(0.002, 0.998, 500)
    options = AxesOptions("Values of the logistic map at r = 4", "x", "density", (0, 1), (0, 5))
    with png_axes(folder / "logistic_density.png", options) as axes:
        heights = np.histogram(x, edges, density=True)[0]
        axes.stairs(heights, edges, color=COLOURS[0], label="an orbit of 100,000 values")
        axes.plot(inner, density(inner), color=COLOURS[1], label="1 / (pi sqrt(x (1 - x)))")
    title = "The uniformised map and a pseudo-random generator"
    options = AxesOptions(title, "u", "density", (0, 1), (0, 2))
    with png_axes(folder / "uniformised.png", options) as axes:
        for values, colour, label in (
            (uniformised(x), COLOURS[0], "(2 / pi) asin(sqrt(x)) of the orbit"),
            (np.random.default_rng(0).random(100_000), COLOURS[1], "pseudo-random"),
            (ChaoticNumbers(0).uniform((100_000,)), COLOURS[2], "many orbits, every eighth value"),
        ):
            heights = np.histogram(values, edges, density=True)[0]
            axes.stairs(heights, edges, color=colour, label=label)


def draw_convergence(
    folder: Path, objectives: dict[str, OtsuObjective], runs: int, evaluations: int
) -> None:
    """Draw the mean shortfall of each optimiser for five thresholds.

    Parameters
    ----------
    folder : Path
        Where to write convergence.png.
    objectives : dict of str to OtsuObjective
        By image.
    runs, evaluations : int
        Number of runs, and budget of each.
    """
    grid = np.arange(100, evaluations + 1, 100)
    options = AxesOptions(
        "Five thresholds, mean of nine images",
        "evaluations",
        "log10 (relative shortfall + 1e-6)",
        (0, evaluations),
        (-6, -1),
    )
    with png_axes(folder / "convergence.png", options) as axes:
        for name, colour in zip(OPTIMISERS, COLOURS, strict=False):
            shortfalls = []
            for objective in objectives.values():
                best = exact(objective, 5).value
                for seed in range(runs):
                    history = OPTIMISERS[name](objective, 5, evaluations, seed).history
                    last = np.searchsorted(history[:, 0], grid, side="right") - 1
                    shortfalls.append(1 - history[np.maximum(last, 0), 1] / best)
            mean = np.maximum(np.mean(shortfalls, axis=0), 0)
            axes.plot(grid, np.log10(mean + 1e-6), color=colour, label=name)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder to write to")
    parser.add_argument("--runs", type=int, default=50, help="runs per case")
    parser.add_argument("--evaluations", type=int, default=20_000, help="budget of a run")
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    draw_map(given.output)
    objectives = {image: OtsuObjective.of(levels(image)) for image in IMAGES}
    rows, needed = [], {}
    for name in OPTIMISERS:
        cases = [
            measure(name, i, o, k, given.runs, given.evaluations)
            for i, o in objectives.items()
            for k in COUNTS
        ]
        rows += [row for row, _ in cases]
        needed[name] = np.concatenate([each for _, each in cases])
        print(
            f"{name}: {np.isfinite(needed[name]).sum()} of {needed[name].size} runs "
            "reached the optimum",
            flush=True,
        )
    with (given.output / "thresholding.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(
            [[field.name for field in fields(ThresholdRow)], *map(astuple, rows)]
        )
    text = summary(rows, needed) + "\n" + details(rows)
    (given.output / "thresholding.md").write_text(text, encoding="utf-8")
    print(text)
    draw_convergence(given.output, objectives, min(given.runs, 20), given.evaluations)


if __name__ == "__main__":
    run_program(main)
