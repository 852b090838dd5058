"""Fit, draw and measure filter statistics as a prior of the separation (thesis, 3.6.5.1).

  python -m benchmarks.separation.filter_statistics fit SCENES -o FILE [--of photo|layers]
  python -m benchmarks.separation.filter_statistics figure SCENES -o DIR
  python -m benchmarks.separation.filter_statistics ablation SCENES --data DATA --tables NPZ...
      -o MD

SCENES is a run of `isc synth`. `fit` writes histograms and a temperature from SCENES/train;
`figure` draws diffuse against specular layers, one image per filter (figure 3.12); `ablation` runs
the method `isc` with and without the prior and writes a Markdown table.

With `--of layers`, the statistics are those of true diffuse and true specular layers, as in the
thesis; with `--of photo`, those of the photo where at least a quarter of the light is specular, and
where at most a twentieth is. The temperature maximises the likelihood over five groups of objects,
each left out in turn, with both kinds of pixel at equal weight.
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

from ..plots import COLOURS, AxesOptions, png_axes
from .specular_removal import photo_cases

_HIGHLIGHT, _NONE = 0.25, 0.05  # specular share of the light
_FOLDS = 5
_FEW = 30  # pixels of either kind that a photo needs for an area of its own
_TEMPERATURES = np.geomspace(0.1, 30, 51)
_PRIOR_COUNT = 2.0  # pixels added to every bin, per thousand
_TESTS = ("test_objects", "test_materials", "test_lights", "test")


@dataclass(frozen=True, eq=False)
class Sample:
    """Filter outputs of a scene.

    Attributes
    ----------
    subject : str
        Name of the object.
    intensity : (H, W) ndarray
        Mean of the channels.
    mask, highlight, without : (H, W) ndarray of bool
        Pixels of the object, with a highlight, without one.
    of_highlight, of_without : (N, F, 2) ndarray
        Filter outputs of either kind.
    """

    subject: str
    intensity: np.ndarray
    mask: np.ndarray
    highlight: np.ndarray
    without: np.ndarray
    of_highlight: np.ndarray
    of_without: np.ndarray


def scenes(folder: Path, splits: Sequence[str]) -> list[Path]:
    """List the folders of scenes.

    Parameters
    ----------
    folder : Path
        A run of `isc synth`.
    splits : sequence of str
        Names of its splits.

    Returns
    -------
    list of Path
        Ordered by split and name.

    Raises
    ------
    InputError
        If there are none.
    """
    found = [path for split in splits for path in sorted((folder / split).glob("*/"))]
    if not found:
        raise InputError(
            f"no scenes in {', '.join(splits)} of `{folder}`; make some with isc synth"
        )
    return found


def sample(folder: Path, of: str) -> Sample:
    """Compute the filter outputs of a rendered scene.

    Parameters
    ----------
    folder : Path
        The scene.
    of : {"photo", "layers"}
        What to filter.

    Returns
    -------
    Sample
        Outputs at the pixels whose kind is clear.
    """
    return sample_of(load_rendered(folder), of)


def sample_of(truth: SeparationTruth, of: str) -> Sample:
    """Compute the filter outputs of a photo with known layers.

    Parameters
    ----------
    truth : SeparationTruth
        The photo and its layers.
    of : {"photo", "layers"}
        What to filter.

    Returns
    -------
    Sample
        Outputs at the pixels whose kind is clear.
    """
    image, specular = truth.image.mean(axis=2), truth.specular.mean(axis=2)
    share = specular / np.maximum(image, 1e-9)
    highlight, without = truth.mask & (share >= _HIGHLIGHT), truth.mask & (share <= _NONE)
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
    """Build the histograms of samples.

    Parameters
    ----------
    samples : sequence of Sample
        Not empty.
    temperature : float, optional
        To store.

    Returns
    -------
    FilterTable
        Its spread is the median absolute output without highlights.
    """
    high = np.concatenate([one.of_highlight for one in samples])
    none = np.concatenate([one.of_without for one in samples])
    spread = np.array([np.nanmedian(np.abs(none[:, f])) for f in range(len(FILTERS))])
    return FilterTable(spread, _histograms(none, spread), _histograms(high, spread), temperature)


def _histograms(outputs: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """(F, BINS), smoothed; symmetric where the filter is odd, apart from the difference."""
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
    """Fit a table and its temperature.

    Parameters
    ----------
    samples : sequence of Sample
        Of at least five objects.

    Returns
    -------
    table : FilterTable
        Of all samples, with the temperature fitted to left-out objects.
    bits : float
        Information per pixel on left-out objects.
    area : float
        Area under the ROC curve on left-out objects.
    """
    subjects = sorted({one.subject for one in samples})
    high: list[np.ndarray] = []
    none: list[np.ndarray] = []
    for fold in range(_FOLDS):
        left_out = set(subjects[fold::_FOLDS])
        table = fitted([one for one in samples if one.subject not in left_out])
        for one in samples:
            if one.subject in left_out:
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
    """Return the area under the ROC curve: how likely a `yes` exceeds a `no`.

    Parameters
    ----------
    yes, no : (N,), (M,) ndarray
        Values of the two classes.

    Returns
    -------
    float
        Between 0 and 1; ties count half.
    """
    ordered = np.sort(no)
    below = np.searchsorted(ordered, yes, "left") + np.searchsorted(ordered, yes, "right")
    return float(below.mean() / 2 / len(no))


def evaluated(samples: Sequence[Sample], table: FilterTable) -> str:
    """Measure a table on photos that it was not fitted to.

    Parameters
    ----------
    samples : sequence of Sample
        The photos.
    table : FilterTable
        The table.

    Returns
    -------
    str
        Area over all pixels, mean area within one photo, bits per pixel.
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
    return (
        f"area {area(high, none):.3f}, within one photo {np.mean(within):.3f} "
        f"(mean of {len(within)}), {bits:.3f} bits per pixel"
    )


def figure(folder: Path, output: Path) -> None:
    """Draw each filter's histograms on diffuse and specular layers (figure 3.12 of the thesis).

    Parameters
    ----------
    folder : Path
        A run of `isc synth`.
    output : Path
        Folder of the PNG files.
    """
    output.mkdir(parents=True, exist_ok=True)
    table = fitted([sample(path, "layers") for path in scenes(folder, ("train",))])
    top = float(max(table.without.max(), table.highlight.max()))
    for number, (kind, width) in enumerate(FILTERS):
        edges = bin_edges()
        options = AxesOptions(
            f"{kind}, width {width:g} of the diagonal",
            "asinh(output / spread)",
            "share",
            (edges[0], edges[-1]),
            (0, 1.05 * top),
        )
        with png_axes(output / f"{kind}-{WIDTH_NAMES[width]}.png", options) as axes:
            axes.stairs(table.without[number], edges, color=COLOURS[0], label="diffuse layers")
            axes.stairs(table.highlight[number], edges, color=COLOURS[1], label="specular layers")


WIDTH_NAMES = {width: f"{1000 * width:03.0f}" for _, width in FILTERS}


def _main_fit(given: argparse.Namespace) -> str:
    samples = [sample(path, given.of) for path in scenes(given.scenes, ("train",))]
    table, bits, hits = calibrated(samples)
    with new_file(given.output) as path, path.open("wb") as file:
        np.savez_compressed(
            file, spread=table.spread.astype(np.float32), without=table.without.astype(np.float32),
            highlight=table.highlight.astype(np.float32), temperature=np.float32(table.temperature),
        )  # fmt: skip
    tests = evaluated([sample(path, "photo") for path in scenes(given.scenes, _TESTS)], table)
    left_out = f"area {hits:.3f}, {bits:.3f} bits per pixel"
    return (
        f"{len(samples)} scenes: temperature {table.temperature:.2f}\n"
        f"objects left out: {left_out}\ntest scenes: {tests}"
    )


@dataclass(frozen=True)
class AblationRow:
    """Result of one photo.

    Attributes
    ----------
    group, name : str
        Group of photos, and the photo.
    figures : tuple of float
        Per setting: squared error over that of the unchanged photo; without highlights, the
        change in per cent of the photo's RMS.
    """

    group: str
    name: str
    figures: tuple[float, ...]


def ablation_rows(
    data: Path, folder: Path, settings: Sequence[Callable[[SeparationTruth], np.ndarray]]
) -> Iterator[AblationRow]:
    """Separate all test photos under each setting.

    Parameters
    ----------
    data : Path
        Root of the data sets.
    folder : Path
        A run of `isc synth`.
    settings : sequence of callable
        Functions from a photo to its diffuse layer.

    Yields
    ------
    AblationRow
        One per photo.
    """
    for path in scenes(folder, _TESTS):
        yield _ablation_row("rendered", load_rendered(path), settings)
    for case in photo_cases(data, None):
        yield _ablation_row(case.group, case.load(), settings)


def _ablation_row(
    group: str, truth: SeparationTruth, settings: Sequence[Callable[[SeparationTruth], np.ndarray]]
) -> AblationRow:
    image, diffuse, mask = (
        np.asarray(layer, float) for layer in (truth.image, truth.diffuse, truth.mask)
    )
    inside = mask > 0
    highlight = np.square((image - diffuse)[inside]).sum()
    diffuse_only = highlight <= 1e-8 * np.square(image[inside]).sum()
    figures = []
    for setting in settings:
        answer = setting(truth)
        off = np.square((answer - (image if diffuse_only else diffuse))[inside]).sum()
        figures.append(
            float(
                100 * np.sqrt(off / np.square(image[inside]).sum())
                if diffuse_only
                else off / highlight
            )
        )
    return AblationRow(
        f"{group} diffuse" if diffuse_only and group == "rendered" else group,
        truth.name,
        tuple(figures),
    )


def _setting(table: FilterTable | None) -> Callable[[SeparationTruth], np.ndarray]:
    def diffuse(truth: SeparationTruth) -> np.ndarray:
        prior = None if table is None else highlight_prior(truth.image, truth.mask, table)
        return separate("isc", truth.image, truth.mask, truth.clipped, prior=prior).diffuse

    return diffuse


def markdown(found: Sequence[AblationRow], names: Sequence[str]) -> str:
    """Format the ablation.

    Parameters
    ----------
    found : sequence of AblationRow
        All photos.
    names : sequence of str
        Of the settings.

    Returns
    -------
    str
        Markdown: with highlights, the geometric mean of the error ratios, the maximum, and how many
        photos changed by more than 1 %; without highlights, the mean and the maximum change.
    """
    lines = ["| group | photos | " + " | ".join(names) + " |", "|---" * (len(names) + 2) + "|"]
    for group in dict.fromkeys(one.group for one in found):
        rows = np.array([one.figures for one in found if one.group == group])
        still = group.endswith(("clean", "diffuse"))
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
    for one in ablation_rows(given.data, given.scenes, settings):
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
    return f"wrote figures to `{given.output}`"


def main(words: Sequence[str] | None = None) -> None:
    """Run the command line.

    Parameters
    ----------
    words : sequence of str, optional
        Arguments; by default those of the process.
    """
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(required=True)
    for name, run in (("fit", _main_fit), ("figure", _main_figure), ("ablation", _main_ablation)):
        command = commands.add_parser(name)
        command.set_defaults(run=run)
        command.add_argument("scenes", type=Path, help="a run of isc synth")
        command.add_argument(
            "-o", "--output", type=Path, required=True, help="file or folder to write"
        )
    commands.choices["fit"].add_argument(
        "--of", choices=("photo", "layers"), default="photo", help="what to filter"
    )
    commands.choices["ablation"].add_argument(
        "--data", type=Path, default=Path("../shared/data"), help="root of the data sets"
    )
    commands.choices["ablation"].add_argument(
        "--tables", nargs="+", type=Path, required=True, help="tables written by `fit`"
    )
    given = parser.parse_args(words)
    try:
        print(given.run(given))
    except InputError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
