"""Filter statistics as a prior of the separation (thesis, section 3.6.5.1): fitted, drawn as in
figure 3.12, and measured by an ablation.

  python -m benchmarks.separation.filter_statistics fit SCENES -o FILE [--of seen|layers]    histograms and
  temperature from SCENES/train python -m benchmarks.separation.filter_statistics figure SCENES -o DIR
  diffuse against specular layers, one picture a filter python -m benchmarks.separation.filter_statistics
  ablation SCENES --data DATA -o FILE      `isc` with and without, a Markdown table

SCENES is a folder of `isc synth`. `layers` takes the statistics of true diffuse and true specular
layers, as the thesis does; `seen` those of the photo where a highlight is a quarter of the light or
more, and where it is a twentieth or less. The temperature is the one that five groups of objects,
each left out in turn, find most probable, both kinds of pixel weighing the same.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage

from isc_core.datasets.highlight_set import SeparationTruth, load_rendered
from isc_core.errors import InputError
from isc_core.io.atomic import new_file
from isc_core.separation import separate
from isc_core.separation.support.filter_statistics import (
    BINS,
    FILTERS,
    FilterTable,
    bin_edges,
    bins,
    filter_outputs,
    highlight_prior,
    pooled_evidence,
    read_table,
)

from ..plots import COLOURS, Plot
from .specular_removal import cases

_SEEN, _NONE = 0.25, 0.05  # of the light is specular
_FOLDS = 5
_FEW = 30  # pixels of either kind, below which a photo has no area of its own
_TEMPERATURES = np.geomspace(0.1, 30, 51)
_PRIOR_COUNT = 2.0  # pixels that every bin has before it is counted, per thousand
_TESTS = ("test_objects", "test_materials", "test_lights", "test")


@dataclass(frozen=True)
class Sample:
    """A scene: intensity (H, W), mask, and the pixels that count as `highlight` or `without`;
    outputs (N, F, 2) of either kind.
    """

    thing: str
    intensity: np.ndarray
    mask: np.ndarray
    highlight: np.ndarray
    without: np.ndarray
    of_highlight: np.ndarray
    of_without: np.ndarray


def scenes(folder: Path, splits: Sequence[str]) -> list[Path]:
    """The scenes' folders. Raises `InputError` where there are none."""
    found = [path for split in splits for path in sorted((folder / split).glob("*/"))]
    if not found:
        raise InputError(f"{folder} has no scenes in {', '.join(splits)}: make some with isc synth")
    return found


def sample(folder: Path, of: str) -> Sample:
    """Outputs of a rendered photo (`of` "seen") or of its layers ("layers") in the pixels whose
    kind is clear.
    """
    return sample_of(load_rendered(folder), of)


def sample_of(truth: SeparationTruth, of: str) -> Sample:
    """The same of any photo whose layers are known."""
    image, specular = truth.image.mean(axis=2), truth.specular.mean(axis=2)
    share = specular / np.maximum(image, 1e-9)
    highlight, without = truth.mask & (share >= _SEEN), truth.mask & (share <= _NONE)
    if of == "layers":
        kinds = (
            filter_outputs(specular, truth.mask),
            filter_outputs(truth.diffuse.mean(axis=2), truth.mask),
        )
        chosen = (highlight[truth.mask], slice(None))
    else:
        kinds = (filter_outputs(image, truth.mask),) * 2
        chosen = (highlight[truth.mask], without[truth.mask])
    return Sample(
        truth.name.split("_")[0],
        image,
        truth.mask,
        highlight,
        without,
        kinds[0][chosen[0]],
        kinds[1][chosen[1]],
    )


def fitted(samples: Sequence[Sample], temperature: float = 1.0) -> FilterTable:
    """Histograms of the samples; the spread is the median of the outputs without highlight."""
    high = np.concatenate([one.of_highlight for one in samples])
    none = np.concatenate([one.of_without for one in samples])
    spread = np.array([np.nanmedian(np.abs(none[:, f])) for f in range(len(FILTERS))])
    return FilterTable(spread, _histograms(none, spread), _histograms(high, spread), temperature)


def _histograms(outputs: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """(F, BINS), smoothed and, but for the difference, symmetric where the filter is odd."""
    rows = []
    for f, (kind, _) in enumerate(FILTERS):
        values = outputs[:, f][np.isfinite(outputs[:, f])]
        counts = np.bincount(bins(values, spread[f]), minlength=BINS).astype(float)
        counts = (counts + counts[::-1]) / 2 if kind == "slope" else counts
        counts = (
            ndimage.gaussian_filter1d(counts, 0.7, mode="nearest")
            + _PRIOR_COUNT / 1000 * counts.sum()
        )
        rows.append(counts / counts.sum())
    return np.stack(rows)


def calibrated(samples: Sequence[Sample]) -> tuple[FilterTable, float, float]:
    """The table of all samples with the temperature of those left out, and what it does there: bits
    a pixel gained over knowing nothing, and the area under the curve of hits against false alarms.
    """
    things = sorted({one.thing for one in samples})
    high: list[np.ndarray] = []
    none: list[np.ndarray] = []
    for fold in range(_FOLDS):
        left_out = set(things[fold::_FOLDS])
        table = fitted([one for one in samples if one.thing not in left_out])
        for one in samples:
            if one.thing in left_out:
                evidence = pooled_evidence(one.intensity, one.mask, table)
                high.append(evidence[one.highlight])
                none.append(evidence[one.without])
    yes, no = np.concatenate(high), np.concatenate(none)
    losses = [
        (np.logaddexp(0, -yes / t).mean() + np.logaddexp(0, no / t).mean()) / 2
        for t in _TEMPERATURES
    ]
    best = int(np.argmin(losses))
    return fitted(samples, float(_TEMPERATURES[best])), 1 - losses[best] / np.log(2), area(yes, no)


def area(yes: np.ndarray, no: np.ndarray) -> float:
    """The probability that one of `yes` is larger than one of `no`."""
    ordered = np.sort(no)
    below = np.searchsorted(ordered, yes, "left") + np.searchsorted(ordered, yes, "right")
    return float(below.mean() / 2 / len(no))


def judged(samples: Sequence[Sample], table: FilterTable) -> str:
    """What the table says of photos that it was not fitted to: the area over all pixels, the mean
    area within one photo, bits a pixel.
    """
    yes, no, within = [], [], []
    for one in samples:
        evidence = pooled_evidence(one.intensity, one.mask, table) / table.temperature
        yes.append(evidence[one.highlight])
        no.append(evidence[one.without])
        if min(len(yes[-1]), len(no[-1])) > _FEW:
            within.append(area(yes[-1], no[-1]))
    high, none = np.concatenate(yes), np.concatenate(no)
    bits = 1 - (np.logaddexp(0, -high).mean() + np.logaddexp(0, none).mean()) / 2 / np.log(2)
    return f"area {area(high, none):.3f}, within one photo {np.mean(within):.3f} (mean of {len(within)}), {bits:.3f} bits a pixel"


def figure(folder: Path, output: Path) -> None:
    """A picture of each filter's histograms on diffuse and on specular layers (figure 3.12)."""
    output.mkdir(parents=True, exist_ok=True)
    table = fitted([sample(path, "layers") for path in scenes(folder, ("train",))])
    top = float(max(table.without.max(), table.highlight.max()))
    for number, (kind, width) in enumerate(FILTERS):
        edges = bin_edges()
        plot = Plot(
            f"{kind}, width {width:g} of the diagonal",
            "asinh(output / spread)",
            "share",
            (edges[0], edges[-1]),
            (0, 1.05 * top),
        )
        plot.bars(edges, table.without[number], COLOURS[0], "diffuse layers")
        plot.bars(edges, table.highlight[number], COLOURS[1], "specular layers")
        plot.save(output / f"{kind}-{WIDTH_NAMES[width]}.png")


WIDTH_NAMES = {width: f"{1000 * width:03.0f}" for _, width in FILTERS}


def _main_fit(given: argparse.Namespace) -> str:
    samples = [sample(path, given.of) for path in scenes(given.scenes, ("train",))]
    table, bits, hits = calibrated(samples)
    with new_file(given.output) as path, path.open("wb") as file:
        np.savez_compressed(
            file, spread=table.spread.astype(np.float32), without=table.without.astype(np.float32),
            highlight=table.highlight.astype(np.float32), temperature=np.float32(table.temperature),
        )  # fmt: skip
    tests = judged([sample(path, "seen") for path in scenes(given.scenes, _TESTS)], table)
    left_out = f"area {hits:.3f}, {bits:.3f} bits a pixel"
    return f"{len(samples)} scenes: temperature {table.temperature:.2f}\nobjects left out: {left_out}\ntest scenes: {tests}"


@dataclass(frozen=True)
class Outcome:
    """Of one photo: its group, and for each setting the squared error over that of doing nothing,
    or, without highlights, the change in per cent of the photo's RMS.
    """

    group: str
    name: str
    figures: tuple[float, ...]


def outcomes(
    data: Path, folder: Path, settings: Sequence[Callable[[SeparationTruth], np.ndarray]]
) -> Iterator[Outcome]:
    """Each test scene of `folder` and each photo of `data` whose layers are known, under each
    setting, a function to the diffuse layer.
    """
    for path in scenes(folder, _TESTS):
        yield _outcome("rendered", load_rendered(path), settings)
    for case in cases(data, None):
        yield _outcome(case.group, case.load(), settings)


def _outcome(
    group: str, truth: SeparationTruth, settings: Sequence[Callable[[SeparationTruth], np.ndarray]]
) -> Outcome:
    image, diffuse, mask = (
        np.asarray(layer, float) for layer in (truth.image, truth.diffuse, truth.mask)
    )
    inside = mask > 0
    highlight = np.square((image - diffuse)[inside]).sum()
    matt = highlight <= 1e-8 * np.square(image[inside]).sum()
    figures = []
    for setting in settings:
        answer = setting(truth)
        off = np.square((answer - (image if matt else diffuse))[inside]).sum()
        figures.append(
            float(100 * np.sqrt(off / np.square(image[inside]).sum()) if matt else off / highlight)
        )
    return Outcome(
        f"{group} matt" if matt and group == "rendered" else group, truth.name, tuple(figures)
    )


def _setting(table: FilterTable | None) -> Callable[[SeparationTruth], np.ndarray]:
    def diffuse(truth: SeparationTruth) -> np.ndarray:
        prior = None if table is None else highlight_prior(truth.image, truth.mask, table)
        return separate("isc", truth.image, truth.mask, truth.clipped, prior=prior).diffuse

    return diffuse


def markdown(found: Sequence[Outcome], names: Sequence[str]) -> str:
    """The table: of groups with highlights the geometric mean of the error ratios, the worst, and
    how many got better or worse by 1 %; of those without, the mean and the largest change.
    """
    lines = ["| group | photos | " + " | ".join(names) + " |", "|---" * (len(names) + 2) + "|"]
    for group in dict.fromkeys(one.group for one in found):
        rows = np.array([one.figures for one in found if one.group == group])
        still = group.endswith(("clean", "matt"))
        typical = (
            rows.mean(axis=0) if still else np.exp(np.log(np.maximum(rows, 1e-3)).mean(axis=0))
        )
        unit, cells = (" %" if still else ""), []
        for column in range(rows.shape[1]):
            base = rows[:, 0]
            better, worse = (
                (rows[:, column] < 0.99 * base - 1e-9).sum(),
                (rows[:, column] > 1.01 * base + 1e-9).sum(),
            )
            moved = "" if column == 0 else f"; {better} better, {worse} worse"
            cells.append(
                f"{typical[column]:.3f}{unit} (at most {rows[:, column].max():.3f}{moved})"
            )
        lines.append(f"| {group} | {len(rows)} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _main_ablation(given: argparse.Namespace) -> str:
    tables = {Path(path).stem: read_table(path) for path in given.tables}
    settings = [_setting(None), *(_setting(table) for table in tables.values())]
    found = []
    for one in outcomes(given.data, given.scenes, settings):
        found.append(one)
        print(
            f"{one.group:14s} {one.name:45s} " + "  ".join(f"{value:.4f}" for value in one.figures),
            flush=True,
        )
    text = markdown(found, ["without", *tables])
    with new_file(given.output) as path:
        path.write_text(text, encoding="utf-8")
    return text


def _main_figure(given: argparse.Namespace) -> str:
    figure(given.scenes, given.output)
    return f"look at {given.output}"


def main(words: Sequence[str] | None = None) -> None:
    """Runs, prints and writes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(required=True)
    for name, run in (("fit", _main_fit), ("figure", _main_figure), ("ablation", _main_ablation)):
        command = commands.add_parser(name)
        command.set_defaults(run=run)
        command.add_argument("scenes", type=Path, help="a folder of isc synth")
        command.add_argument("-o", "--output", type=Path, required=True)
    commands.choices["fit"].add_argument("--of", choices=("seen", "layers"), default="seen")
    commands.choices["ablation"].add_argument("--data", type=Path, default=Path("../shared/data"))
    commands.choices["ablation"].add_argument(
        "--tables", nargs="+", type=Path, required=True, help="what `fit` wrote"
    )
    given = parser.parse_args(words)
    try:
        print(given.run(given))
    except InputError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
