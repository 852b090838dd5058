"""The optimisers of thresholds against the exact optimum, on nine images and three numbers of
thresholds, with equal budgets.

  python -m benchmarks.separation.thresholding -o DIR [--runs 50] [--evaluations 20000]

Writes thresholding.csv (a row for each optimiser, image and number of thresholds), thresholding.md
(tables), and PNG figures: the mutation rate, the logistic map's bifurcation, density and
uniformised distribution, the dependence of its consecutive values, and how the searches converge.
The images are those that scikit-image brings along.
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

from ..plots import COLOURS, Plot

IMAGES = ("camera", "coins", "moon", "page", "brick", "grass", "gravel", "clock", "astronaut")
COUNTS = (3, 4, 5)
HIT = 1e-12  # relative: sets of thresholds with equal classes differ by rounding


class OneOrbit:
    """Uniform numbers as a straightforward reading gives them: each value of one orbit after the
    other, dependent as they are.
    """

    def __init__(self, seed: int) -> None:
        self._x = 0.1 + 0.8 * ((seed + 1) * 0.618034 % 1)

    def uniform(self, shape: tuple[int, ...]) -> np.ndarray:
        """The next numbers, of `shape`."""
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
    return particle_swarm.maximise(objective, count, evaluations, seed, particle_swarm.FALLING)


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
class Row:
    """What the runs of one optimiser on one image with `count` thresholds did.

    `mean`, `deviation`, `lowest` of the values found; `median_evaluations`, `most_evaluations`
    until the optimum, over the runs that found it (NaN where none did); `used` evaluations and
    milliseconds of a run.
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
    """A grey image (H, W), uint8."""
    stored = getattr(data, name)()
    return stored if stored.ndim == 2 else np.rint(255 * rgb2gray(stored)).astype(np.uint8)


def to_optimum(found: Optimum, best: float) -> float:
    """Evaluations until a run reached the value `best`; NaN if it never did."""
    reached = found.history[:, 1] >= best * (1 - HIT)
    return float(found.history[np.argmax(reached), 0]) if reached.any() else float("nan")


def measure(
    name: str, image: str, objective: OtsuObjective, count: int, runs: int, evaluations: int
) -> tuple[Row, np.ndarray]:
    """The row, and the evaluations to the optimum (runs,) with NaN where it was missed."""
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
    return Row(
        name, image, count, best, runs, len(hit), *spread, median, most, used, milliseconds
    ), needed


def summary(rows: list[Row], needed: dict[str, np.ndarray]) -> str:
    """Markdown: each optimiser over all images, by number of thresholds; and whether chaos makes a
    difference.
    """
    lines = [
        "| optimiser | K=3 | K=4 | K=5 | runs that missed | evaluations to the optimum, median / 95 % / most | ms a run |",
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
        # A run that missed counts as one that needed longer than any.
        pair = [np.nan_to_num(needed[which], nan=np.inf) for which in ("chaotic_clonal", name)]
        test = mannwhitneyu(*pair)
        share = test.statistic / (len(pair[0]) * len(pair[1]))
        lines.append(
            f"Chaotic ClonalG needs more than {name} in {100 * share:.1f} % of pairs of runs (50 %: alike; p = {test.pvalue:.2g})."
        )
    return "\n".join(lines) + "\n"


def details(rows: list[Row]) -> str:
    """Markdown: hits and standard deviation of every image and number of thresholds, the optimisers
    side by side.
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
    """The mutation rate and the logistic map (figures 3.5 to 3.8 of the thesis)."""
    affinity = np.linspace(0, 1, 200)
    plot = Plot("Mutation rate", "affinity f", "exp(-rho f)", (0, 1), (0, 1))
    for decay, colour in zip((2, 3, 4, 5), COLOURS, strict=False):
        plot.line(affinity, mutation_rate(affinity, decay), colour, f"rho = {decay}")
    plot.save(folder / "mutation_rate.png")
    rates = np.linspace(2.8, 4, 1000)
    ends = bifurcation(rates)
    plot = Plot("Bifurcation of the logistic map", "r", "x", (2.8, 4), (0, 1))
    plot.dots(np.broadcast_to(rates, ends.shape).ravel(), ends.ravel(), COLOURS[0])
    plot.save(folder / "bifurcation.png")
    edges = np.linspace(0, 1, 51)
    x = orbit(0.1234, 100_000)
    plot = Plot("Values of the logistic map at r = 4", "x", "density", (0, 1), (0, 5))
    plot.bars(
        edges, np.histogram(x, edges, density=True)[0], COLOURS[0], "an orbit of 100,000 values"
    )
    inner = np.linspace(0.002, 0.998, 500)
    plot.line(inner, density(inner), COLOURS[1], "1 / (pi sqrt(x (1 - x)))")
    plot.save(folder / "logistic_density.png")
    plot = Plot("The uniformised map and a pseudo-random generator", "u", "density", (0, 1), (0, 2))
    plot.bars(
        edges,
        np.histogram(uniformised(x), edges, density=True)[0],
        COLOURS[0],
        "(2 / pi) asin(sqrt(x)) of the orbit",
    )
    plot.bars(
        edges,
        np.histogram(np.random.default_rng(0).random(100_000), edges, density=True)[0],
        COLOURS[1],
        "pseudo-random",
    )
    plot.bars(
        edges,
        np.histogram(ChaoticNumbers(0).uniform((100_000,)), edges, density=True)[0],
        COLOURS[2],
        "many orbits, each eighth value",
    )
    plot.save(folder / "uniformised.png")
    plot = Plot("Consecutive numbers", "u", "next u", (0, 1), (0, 1.25))
    mixed, raw = ChaoticNumbers(0).uniform((4000,)), uniformised(x[:4000])
    plot.dots(mixed[:-1], mixed[1:], COLOURS[0], "many orbits, each eighth value")
    plot.dots(raw[:-1], raw[1:], COLOURS[1], "one orbit, each value")
    plot.save(folder / "consecutive.png")


def draw_convergence(
    folder: Path, objectives: dict[str, OtsuObjective], runs: int, evaluations: int
) -> None:
    """How far from the exact optimum each optimiser is on average, by evaluations, for five
    thresholds.
    """
    grid = np.arange(100, evaluations + 1, 100)
    plot = Plot(
        "Five thresholds, mean of nine images",
        "evaluations",
        "log10 (relative shortfall + 1e-6)",
        (0, evaluations),
        (-6, -1),
    )
    for name, colour in zip(OPTIMISERS, COLOURS, strict=False):
        shortfalls = []
        for objective in objectives.values():
            best = exact(objective, 5).value
            for seed in range(runs):
                history = OPTIMISERS[name](objective, 5, evaluations, seed).history
                last = np.searchsorted(history[:, 0], grid, side="right") - 1
                shortfalls.append(1 - history[np.maximum(last, 0), 1] / best)
        plot.line(grid, np.log10(np.maximum(np.mean(shortfalls, axis=0), 0) + 1e-6), colour, name)
    plot.save(folder / "convergence.png")


def main() -> None:
    """Measures, prints the summary, writes the files."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument(
        "-o", "--output", type=Path, required=True, help="folder for the tables and figures"
    )
    options.add_argument("--runs", type=int, default=50)
    options.add_argument("--evaluations", type=int, default=20_000)
    given = options.parse_args()
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
            f"{name}: {np.isfinite(needed[name]).sum()} of {needed[name].size} runs found the optimum",
            flush=True,
        )
    with (given.output / "thresholding.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([[field.name for field in fields(Row)], *map(astuple, rows)])
    text = summary(rows, needed) + "\n" + details(rows)
    (given.output / "thresholding.md").write_text(text, encoding="utf-8")
    print(text)
    draw_convergence(given.output, objectives, min(given.runs, 20), given.evaluations)


if __name__ == "__main__":
    main()
