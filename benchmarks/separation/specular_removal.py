"""Measure every separation method in every variant on every photo with known layers.

  python -m benchmarks.separation.specular_removal --data ../shared/data -o DIR
  python -m benchmarks.separation.specular_removal --data ../shared/data -o DIR --photos
  python -m benchmarks.separation.specular_removal --data ../shared/data -o DIR --speed
  python -m benchmarks.separation.specular_removal --data ../shared/data -o DIR --rendered SCENES

The first form writes tables and comparison sheets. `--photos` runs `isc separate` on every photo
and writes sheets; `--speed` measures warm seconds and memory at one megapixel; `--rendered` adds
the rendered scenes of a folder.

Photos: Shen & Zheng's (values as stored, whole frame), the laboratory objects of MIT-Berkeley
(linear, inside the mask), rendered scenes; and the diffuse images of MIT-Berkeley, which have no
highlights and must not change. `none` (diffuse = input) is always included. Writes rows.csv,
tables.md and sheets/*.png. A row is kept until the source of its method changes: an interrupted run
continues; `--fresh` measures everything again.
"""

import argparse
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from isc_core.cli.main import main as isc
from isc_core.datasets.highlight_set import (
    SeparationTruth,
    list_shen_zheng,
    load_laboratory,
    load_rendered,
    load_shen_zheng,
)
from isc_core.datasets.mit_berkeley import list_objects
from isc_core.errors import InputError
from isc_core.imaging.srgb import srgb_to_linear
from isc_core.io.exr import read_channels
from isc_core.photo import WholeFrame, read_linear, read_photo
from isc_core.result_files.contact_sheet import LabelledSeparation, comparison_sheet
from isc_core.scene.decomposition import Separation
from isc_core.separation import IMPROVED, METHODS, variants

from .scores import SeparationRow, measure, read_rows, source_code, write_rows
from .speed import speed_table
from .tables import tables

_PHOTO_SUFFIXES = {".bmp", ".ppm", ".png", ".jpg", ".tif"}


@dataclass(frozen=True)
class PhotoCase:
    """A photo to measure.

    Attributes
    ----------
    group, name : str
        Group of photos, and the photo.
    load : callable
        Reads the photo and its layers.
    """

    group: str
    name: str
    load: Callable[[], SeparationTruth]


def photo_cases(data: Path, rendered: Path | None) -> Iterator[PhotoCase]:
    """List all photos.

    Parameters
    ----------
    data : Path
        Folder with highlight/ and mit_berkeley_train/.
    rendered : Path or None
        Folder of rendered scenes.

    Yields
    ------
    PhotoCase
        The photos, by group.
    """
    highlight, objects = data / "highlight", data / "mit_berkeley_train"
    for name in list_shen_zheng(highlight):
        yield PhotoCase("shen_zheng", name, partial(load_shen_zheng, highlight, name))
    for name in list_objects(objects, "laboratory"):
        yield PhotoCase("laboratory", name, partial(load_laboratory, objects, name))
    for folder in (
        sorted(path for path in rendered.iterdir() if path.is_dir()) if rendered is not None else ()
    ):
        yield PhotoCase("rendered", folder.name, partial(load_rendered, folder))
    for light in ("laboratory", "natural"):
        for name in list_objects(objects, light):
            load = partial(_without_highlights, objects, light, name)
            yield PhotoCase("clean", f"{light} {name}", load)


def _without_highlights(objects: Path, light: str, name: str) -> SeparationTruth:
    folder = objects / light / name
    image, mask = (
        read_linear(folder / "diffuse.png", "linear"),
        read_linear(folder / "mask.png", "linear")[..., 0] > 0,
    )
    return SeparationTruth(
        f"{light} {name}", image, mask, image, np.zeros_like(image), np.zeros_like(mask)
    )


def measure_all(given: argparse.Namespace) -> list[SeparationRow]:
    """Measure what is missing; write the table after each row and the sheets that changed.

    Parameters
    ----------
    given : argparse.Namespace
        The command's options.

    Returns
    -------
    list of SeparationRow
        All rows, old and new.
    """
    table = given.output / "rows.csv"
    rows = {} if given.fresh else read_rows(table)
    for case in photo_cases(given.data, given.rendered):
        if given.images and case.name not in given.images:
            continue
        wanted = [
            (method, variant)
            for method in given.methods
            for variant in variants(method)
            if variant in given.variants
        ]
        new = [pair for pair in wanted if _stale(rows.get((case.group, case.name, *pair)), pair[0])]
        if not new:
            continue
        truth = case.load()
        for method, variant in new:
            row, split = measure(case.group, truth, method, variant)
            rows[row.key] = row
            write_rows(table, rows.values())
            print(_line(row), flush=True)
            if split is not None and variant == IMPROVED and case.group != "clean":
                _keep(given.output, case, method, split)
        if case.group != "clean":
            _sheet(given.output, case, truth, rows)
    return list(rows.values())


def _stale(row: SeparationRow | None, method: str) -> bool:
    return row is None or row.code != source_code(method)


def _line(row: SeparationRow) -> str:
    figures = [
        f"{name} {value:.4g}"
        for name in ("psnr", "mse_ratio", "change", "seconds")
        if (value := getattr(row, name)) is not None
    ]
    return f"{row.group:10s} {row.image:20s} {row.method:20s} {row.variant:8s} " + (
        "  ".join(figures) or f"refused: {row.refused}"
    )


def _keep(output: Path, case: PhotoCase, method: str, split: Separation) -> None:
    folder = output / "layers" / case.group / case.name
    folder.mkdir(parents=True, exist_ok=True)
    layers = {
        name: getattr(split, name).astype(np.float16)
        for name in ("diffuse", "specular", "confidence")
    }
    np.savez_compressed(folder / f"{method}.npz", **layers)


def _sheet(
    output: Path,
    case: PhotoCase,
    truth: SeparationTruth,
    rows: dict[tuple[str, str, str, str], SeparationRow],
) -> None:
    decode = srgb_to_linear if truth.coded else np.asarray
    answers = []
    for method in METHODS:
        path, row = (
            output / "layers" / case.group / case.name / f"{method}.npz",
            rows.get((case.group, case.name, method, IMPROVED)),
        )
        if (
            path.is_file()
            and row is not None
            and row.psnr is not None
            and row.mse_ratio is not None
        ):
            with np.load(path) as layers:
                diffuse, specular, confidence = (
                    layers[name].astype(np.float32)
                    for name in ("diffuse", "specular", "confidence")
                )
            split = Separation(
                decode(diffuse), decode(specular), np.zeros_like(diffuse), confidence
            )
            answers.append(
                LabelledSeparation(method, f"{row.psnr:.1f} dB, MSE x {row.mse_ratio:.2g}", split)
            )
    sheet = comparison_sheet(
        f"{case.group}: {case.name}",
        decode(truth.image),
        truth.mask,
        answers,
        (decode(truth.diffuse), decode(truth.specular)),
    )
    _save(output / "sheets" / f"{case.group}-{case.name}.png", sheet)


def _save(path: Path, sheet: object) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    sheet.save(path)  # type: ignore[attr-defined]


def photos(given: argparse.Namespace) -> str:
    """Run `isc separate` with every method on every file of highlight/ and photos/.

    Parameters
    ----------
    given : argparse.Namespace
        The command's options.

    Returns
    -------
    str
        Markdown: how each run ended. Sheets are written.
    """
    lines = [
        "| photo | " + " | ".join(given.methods) + " |",
        "|---" * (len(given.methods) + 1) + "|",
    ]
    for path in sorted(
        p
        for folder in ("highlight", "photos")
        for p in (given.data / folder).iterdir()
        if p.suffix in _PHOTO_SUFFIXES
    ):
        if path.stem.endswith("_gt") or (given.images and path.stem not in given.images):
            continue
        transfer = "linear" if path.parent.name == "highlight" else "auto"
        answers, ends = [], []
        for method in given.methods:
            folder = given.output / "photos" / f"{path.stem}-{method}"
            code = isc(
                [
                    "separate",
                    str(path),
                    "--transfer",
                    transfer,
                    "--method",
                    method,
                    "--quiet",
                    "-o",
                    str(folder),
                ]
            )
            ends.append({0: "done", 2: "refused"}.get(code, f"exit code {code}"))
            if code == 0:
                answers.append(_answer(folder, method, coded=transfer == "linear"))
                shutil.rmtree(folder)
        photo = read_photo(path, None, transfer, whole_frame=WholeFrame.WITHOUT_MASK)
        shown = srgb_to_linear(photo.image) if transfer == "linear" else photo.image
        _save(
            given.output / "sheets" / f"photo-{path.stem}.png",
            comparison_sheet(path.name, shown, photo.mask, answers),
        )
        lines.append(f"| {path.stem} | " + " | ".join(ends) + " |")
        print(lines[-1], flush=True)
    return "\n".join(lines) + "\n"


def _answer(folder: Path, method: str, coded: bool) -> LabelledSeparation:
    channels = read_channels(folder / "separation.exr")
    diffuse, specular = (
        np.stack([channels[f"{layer}.{c}"] for c in "RGB"], -1) for layer in ("diffuse", "specular")
    )
    if coded:
        diffuse, specular = srgb_to_linear(diffuse), srgb_to_linear(specular)
    return LabelledSeparation(
        method, "", Separation(diffuse, specular, np.zeros_like(diffuse), channels["confidence.Y"])
    )


def parser() -> argparse.ArgumentParser:
    """Build the command's parser."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument(
        "--data",
        type=Path,
        default=Path("../shared/data"),
        help="folder with highlight/, photos/ and mit_berkeley_train/",
    )
    options.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        help="folder to write to",
    )
    options.add_argument("--rendered", type=Path, help="folder of rendered scenes")
    options.add_argument(
        "--methods",
        type=lambda text: text.split(","),
        default=list(METHODS),
        help="comma-separated names (default: all)",
    )
    options.add_argument(
        "--variants",
        type=lambda text: text.split(","),
        default=["improved", "paper", "sihr"],
        help="comma-separated names",
    )
    options.add_argument(
        "--images",
        type=lambda text: text.split(","),
        default=[],
        help="comma-separated names (default: all)",
    )
    options.add_argument("--fresh", action="store_true", help="measure all rows again")
    options.add_argument(
        "--photos",
        action="store_true",
        help="run isc separate on all photos",
    )
    options.add_argument(
        "--speed", action="store_true", help="measure time and memory at one megapixel"
    )
    return options


def main() -> None:
    """Run the command line."""
    options = parser()
    given = options.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    try:
        if "none" not in given.methods:
            given.methods.insert(0, "none")
        if given.speed:
            name, text = "speed.md", speed_table(given.data / "highlight", given.methods)
        elif given.photos:
            name, text = "photos.md", photos(given)
        else:
            name, text = "tables.md", tables(measure_all(given))
    except InputError as error:
        options.error(str(error))
    (given.output / name).write_text(text, encoding="utf-8")
    print("\n" + text)


if __name__ == "__main__":
    main()
