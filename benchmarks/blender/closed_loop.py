"""Compare renders of imported results with the photo, and relit renders with ground truth.

  python -m benchmarks.blender.closed_loop -o FOLDER --photos ../shared/data/photos
  python -m benchmarks.blender.closed_loop -o FOLDER
  python -m benchmarks.blender.closed_loop -o FOLDER --names gourd --size 64 --samples 16

The first form measures five photos and three rendered objects, the second the rendered objects
alone, the third one object at low quality.

Each object is decomposed, built in Blender by the add-on's own scene builder, and rendered with
Cycles from the scene's camera: linear, view transform Standard. Measured inside the mask; the peak
is the 99.9th percentile of the photo there.

Equation: relative RMS = sqrt(sum (k W - S)^2 / sum S^2), where W is the render in white, S the
shading, k the scale of the base colour; PSNR = 10 log10(peak^2 / mean squared error). Under a new
light, the render is scaled by one gain g = <x, t> / <x, x>, as the scale between reflectance and
light cannot be known from one photo; g is the same for all channels, and the peak is that of the
truth. An object with the true maps is not scaled.

Limits: renders are kept in FOLDER/renders and reused unless `--fresh` is given. Also writes
tables.md, rows.json and comparison sheets.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from PIL import Image
from scipy import ndimage

from blender_addon.files.result_arrays import ResultArrays, read_result
from isc_core.evaluation.metrics import psnr
from isc_core.result_files.contact_sheet import MapPanel, edit_sheet
from isc_core.shading.environment_map import shading_under

from .closed_loop_cases import (
    LoopCase,
    RelitTruth,
    add_case_arguments,
    chosen_cases,
    run_cases,
)
from .renders import RenderVariant, render

USUAL_FILTER = 1.5  # pixels: Blender's default
_RING = 2  # pixels of the outline that "inner" excludes
_SHEET_WIDTH, _SHEET_ROWS = 1000, 3


@dataclass(frozen=True)
class LoopRow:
    """One object in its own light.

    Attributes
    ----------
    name : str
        The object.
    shading, inner, shadowed : float
        Relative RMS of the white render: everywhere, without the outline, with own shadows.
    environment : float
        Relative RMS of the environment map's shading without geometry.
    diffuse, diffuse_inner, diffuse_shadowed : float
        PSNR of the diffuse render against the diffuse layer, dB; as above.
    diffuse_usual : float
        The same with Blender's default pixel filter.
    no_gloss, lobe, image : float
        PSNR against the photo of renders without gloss, with the lobe, with the specular image, dB.
    maps_lobe : float
        PSNR against the photo of the maps diffuse + lobe, dB.
    """

    name: str
    shading: float
    inner: float
    shadowed: float
    environment: float
    diffuse: float
    diffuse_inner: float
    diffuse_shadowed: float
    diffuse_usual: float
    no_gloss: float
    lobe: float
    image: float
    maps_lobe: float


@dataclass(frozen=True)
class RelitRow:
    """One object in a new light; PSNR in dB against the true image.

    Attributes
    ----------
    name, light : str
        The object and the light.
    photo : float
        Of the unchanged photo.
    unshadowed, shadowed : float
        Of the diffuse object without and with its own shadows.
    lobe : float
        With the lobe and own shadows.
    diffuse : float
        Of the diffuse object against the true diffuse light.
    true_maps : float
        The same of an object with the true maps: the cost of the way through Blender.
    gain : float
        Of `shadowed`.
    """

    name: str
    light: str
    photo: float
    unshadowed: float
    shadowed: float
    lobe: float
    diffuse: float
    true_maps: float
    gain: float


@dataclass(eq=False)
class Renders:
    """The renders of one result, made on demand and kept in a file.

    Attributes
    ----------
    result : ResultArrays
        The result.
    path : Path
        File of the renders.
    samples : int
        Samples per pixel.
    kept : dict of str to ndarray
        Renders by name.
    """

    result: ResultArrays
    path: Path
    samples: int
    kept: dict[str, np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.path.is_file():
            with np.load(self.path, allow_pickle=False) as stored:
                self.kept = {name: stored[name] for name in stored.files}

    def __call__(self, variant: RenderVariant) -> np.ndarray:
        """Return the render (H, W, 3), linear."""
        light = variant.relit.light if variant.relit is not None else "own"
        name = (
            f"{light} {variant.gloss} white={variant.white} shadows={variant.own_shadows} "
            f"filter={variant.filter_width} {self.samples}"
        )
        if name not in self.kept:
            self.kept[name] = render(self.result, variant, self.samples)[0].astype(np.float32)
            self.path.parent.mkdir(parents=True, exist_ok=True)
            np.savez(self.path, **self.kept)
        return self.kept[name]


def loop_row(name: str, renders: Renders) -> LoopRow:
    """Measure an object in its own light.

    Parameters
    ----------
    name : str
        The object.
    renders : Renders
        Its decomposition and Blender's renders of it.

    Returns
    -------
    LoopRow
        Relative RMS errors of the shading, and PSNR in dB of the diffuse image and the photo.
    """
    r = renders.result
    mask, inner, peak, k = r.mask, _inner(r.mask), white(r.image, r.mask), r.reflectance_scale
    environment = np.zeros_like(r.shading)
    environment[mask] = k * shading_under(
        r.environment_map.astype(float), r.normal[mask].astype(float)
    )
    own, shadowed = (
        k * renders(RenderVariant(white=True)),
        k * renders(RenderVariant(white=True, own_shadows=True)),
    )
    no_gloss = renders(RenderVariant())
    return LoopRow(
        name=name,
        shading=relative_rms(own, r.shading, mask),
        inner=relative_rms(own, r.shading, inner),
        shadowed=relative_rms(shadowed, r.shading, mask),
        environment=relative_rms(environment, r.shading, mask),
        diffuse=psnr(r.diffuse, no_gloss, mask, peak=peak),
        diffuse_inner=psnr(r.diffuse, no_gloss, inner, peak=peak),
        diffuse_shadowed=psnr(r.diffuse, renders(RenderVariant(own_shadows=True)), mask, peak=peak),
        diffuse_usual=psnr(
            r.diffuse, renders(RenderVariant(filter_width=USUAL_FILTER)), mask, peak=peak
        ),
        no_gloss=psnr(r.image, no_gloss, mask, peak=peak),
        lobe=psnr(r.image, renders(RenderVariant("lobe")), mask, peak=peak),
        image=psnr(r.image, renders(RenderVariant("image")), mask, peak=peak),
        maps_lobe=psnr(r.image, r.diffuse + r.lobe, mask, peak=peak),
    )


def relit_row(name: str, new: RelitTruth, renders: Renders, ideal: Renders) -> RelitRow:
    """Measure an object in a new light.

    Parameters
    ----------
    name : str
        The object.
    new : RelitTruth
        The new light and its ground truth.
    renders, ideal : Renders
        Of the result, and of the true maps, on the grid of the truth.

    Returns
    -------
    RelitRow
        The figures.
    """
    mask = renders.result.mask & ideal.result.mask
    shadowed = renders(RenderVariant(own_shadows=True, relit=new))
    measured = {
        "photo": renders.result.image,
        "unshadowed": renders(RenderVariant(own_shadows=False, relit=new)),
        "shadowed": shadowed,
        "lobe": renders(RenderVariant("lobe", own_shadows=True, relit=new)),
    }
    figures = {what: scaled_psnr(new.image, found, mask) for what, found in measured.items()}
    perfect = ideal(RenderVariant(own_shadows=True, relit=new)) / ideal.result.reflectance_scale
    diffuse, true_maps = (
        scaled_psnr(new.diffuse, shadowed, mask),
        psnr(new.diffuse, perfect, mask, peak=white(new.diffuse, mask)),
    )
    return RelitRow(
        name,
        new.light,
        **figures,
        diffuse=diffuse,
        true_maps=true_maps,
        gain=gain(new.image, shadowed, mask),
    )


def white(image: np.ndarray, mask: np.ndarray) -> float:
    """Return the peak of PSNR: the 99.9th percentile of an image inside the mask.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear.
    mask : (H, W) ndarray of bool
        Pixels of the object.

    Returns
    -------
    float
        In the unit of the image.
    """
    return float(np.percentile(image[mask], 99.9))


def relative_rms(found: np.ndarray, truth: np.ndarray, mask: np.ndarray) -> float:
    """Return the RMS error of an image over the RMS of the truth, inside the mask.

    Parameters
    ----------
    found, truth : (H, W, 3) ndarray
        Linear.
    mask : (H, W) ndarray of bool
        Pixels of the object.

    Returns
    -------
    float
        0 for equal images.
    """
    return float(
        np.sqrt(np.square(found[mask] - truth[mask]).mean() / np.square(truth[mask]).mean())
    )


def gain(truth: np.ndarray, found: np.ndarray, mask: np.ndarray) -> float:
    """Return the factor of `found` with the least squared error.

    Parameters
    ----------
    truth, found : (H, W, 3) ndarray
        Linear.
    mask : (H, W) ndarray of bool
        Pixels that count.

    Returns
    -------
    float
        The factor, for all channels.
    """
    inside = found[mask].astype(float)
    return float((inside * truth[mask]).sum() / max(float(np.square(inside).sum()), 1e-30))


def scaled_psnr(truth: np.ndarray, found: np.ndarray, mask: np.ndarray) -> float:
    """Return the PSNR of `found` after the best gain; the peak is the truth's.

    Parameters
    ----------
    truth, found : (H, W, 3) ndarray
        Linear.
    mask : (H, W) ndarray of bool
        Pixels that count.

    Returns
    -------
    float
        In dB.
    """
    return psnr(truth, gain(truth, found, mask) * found, mask, peak=white(truth, mask))


def _inner(mask: np.ndarray) -> np.ndarray:
    eroded: np.ndarray = ndimage.binary_erosion(mask, iterations=_RING)
    return eroded if eroded.any() else mask


def loop_table(rows: Sequence[LoopRow]) -> str:
    """Format the rows of objects in their own light as Markdown.

    Parameters
    ----------
    rows : sequence of LoopRow
        One per object.

    Returns
    -------
    str
        The table: errors of the shading in per cent, PSNR in dB.
    """
    lines = [
        "| object | (i) white render against shading | without the outline | with own shadows "
        "| environment map alone | (ii) diffuse | without the outline | with own shadows "
        "| default filter | (iii) fitted lobe | no gloss | specular image "
        "| maps: diffuse + lobe |",
        "|---" * 13 + "|",
    ]
    for r in rows:
        shares = [
            f"{100 * value:.1f} %" for value in (r.shading, r.inner, r.shadowed, r.environment)
        ]
        ratios = (
            r.diffuse,
            r.diffuse_inner,
            r.diffuse_shadowed,
            r.diffuse_usual,
            r.lobe,
            r.no_gloss,
            r.image,
            r.maps_lobe,
        )
        lines.append(
            f"| {r.name} | " + " | ".join(shares + [f"{value:.1f} dB" for value in ratios]) + " |"
        )
    return "\n".join(lines) + "\n"


def relit_table(rows: Sequence[RelitRow]) -> str:
    """Format the rows of relit objects as Markdown.

    Parameters
    ----------
    rows : sequence of RelitRow
        One per object and new light.

    Returns
    -------
    str
        The table: PSNR in dB, and the gain.
    """
    lines = [
        "| object | new light | unchanged photo | diffuse, no shadows | diffuse, own shadows "
        "| lobe, own shadows | diffuse light alone | true maps, diffuse light | gain |",
        "|---" * 9 + "|",
    ]
    for r in rows:
        ratios = (r.photo, r.unshadowed, r.shadowed, r.lobe, r.diffuse, r.true_maps)
        lines.append(
            f"| {r.name} | {r.light} | "
            + " | ".join(f"{value:.1f} dB" for value in ratios)
            + f" | {r.gain:.2f} |"
        )
    return "\n".join(lines) + "\n"


def loop_panels(name: str, renders: Renders) -> list[MapPanel]:
    """Show the photo, its maps and their renders.

    Parameters
    ----------
    name : str
        The object.
    renders : Renders
        Its decomposition and Blender's renders of it.

    Returns
    -------
    list of MapPanel
        Images are divided by the peak of the photo, shadings by that of the shading map.
    """
    r, peak = renders.result, white(renders.result.image, renders.result.mask)
    level = white(r.shading, r.mask)
    shown = (
        (r.image / peak, f"{name}: photo"),
        (renders(RenderVariant("image")) / peak, "Blender, specular image"),
        (renders(RenderVariant("lobe")) / peak, "Blender, fitted lobe"),
        (r.diffuse / peak, "Diffuse map"),
        (renders(RenderVariant()) / peak, "Blender, diffuse"),
        (r.shading / level, "Shading map"),
        (r.reflectance_scale * renders(RenderVariant(white=True)) / level, "Blender, white"),
    )
    return [MapPanel(values, r.mask, label) for values, label in shown]


def relit_panels(name: str, new: RelitTruth, renders: Renders, ideal: Renders) -> list[MapPanel]:
    """Show the photo, the truth in a new light, and the renders of recovered and true maps.

    Parameters
    ----------
    name : str
        The object.
    new : RelitTruth
        The new light and its ground truth.
    renders, ideal : Renders
        Of the result, and of the true maps.

    Returns
    -------
    list of MapPanel
        The panels.
    """
    mask, peak = ideal.result.mask, white(new.image, ideal.result.mask)
    diffuse, glossy = (
        renders(RenderVariant(own_shadows=True, relit=new)),
        renders(RenderVariant("lobe", own_shadows=True, relit=new)),
    )
    perfect = ideal(RenderVariant(own_shadows=True, relit=new)) / ideal.result.reflectance_scale
    shown = [(renders.result.image, f"{name}: photo"), (new.image, f"Truth, new {new.light}")]
    shown += [
        (gain(new.image, one, mask) * one, f"Blender, {label}")
        for one, label in ((diffuse, "diffuse"), (glossy, "lobe"))
    ]
    shown += [(new.diffuse, "Truth, diffuse"), (perfect, "Blender, true maps")]
    return [MapPanel(values / peak, mask, label) for values, label in shown]


def save_sheet(
    path: Path, title: str, subtitle: str, panels: Sequence[MapPanel], columns: int
) -> None:
    """Write a comparison sheet, reduced to page width.

    Parameters
    ----------
    path : Path
        The PNG file.
    title, subtitle : str
        Above the panels.
    panels : sequence of MapPanel
        Images.
    columns : int
        Panels per row.
    """
    sheet = edit_sheet(title, subtitle, panels, columns=columns)
    sheet = sheet.resize(
        (_SHEET_WIDTH, round(sheet.height * _SHEET_WIDTH / sheet.width)), Image.Resampling.LANCZOS
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    sheet.save(path, optimize=True)


def measure(given: argparse.Namespace) -> None:
    """Measure all objects; tables and sheets are rewritten after each.

    Parameters
    ----------
    given : argparse.Namespace
        The command's options.

    Raises
    ------
    InputError
        For an unknown name, a missing photo, or a failed run.
    """
    loops: list[LoopRow] = []
    relits: list[RelitRow] = []
    panels: dict[str, list[MapPanel]] = {"rendered": [], "photos": [], "relit": []}
    for case in chosen_cases(given, max(16, 4 * given.samples)):
        renders = _renders(given, case.name, case.result)
        loops.append(loop_row(case.name, renders))
        panels["photos" if case.truth is None else "rendered"] += loop_panels(case.name, renders)
        relits += _relit(given, case, renders, panels["relit"])
        _write(given, loops, relits, panels)
        print(loop_table(loops[-1:]).splitlines()[-1], flush=True)


def _renders(given: argparse.Namespace, name: str, result: Path) -> Renders:
    path = given.output / "renders" / f"{name}_{given.size}.npz"
    if given.fresh:
        path.unlink(missing_ok=True)
    return Renders(read_result(result), path, given.samples)


def _relit(
    given: argparse.Namespace, case: LoopCase, renders: Renders, panels: list[MapPanel]
) -> list[RelitRow]:
    rows = []
    if case.truth is not None:
        ideal = _renders(given, f"{case.name}_true", case.truth)
        for new in case.relit:
            rows.append(relit_row(case.name, new, renders, ideal))
            panels += relit_panels(case.name, new, renders, ideal)
    return rows


def _write(
    given: argparse.Namespace,
    loops: list[LoopRow],
    relits: list[RelitRow],
    panels: dict[str, list[MapPanel]],
) -> None:
    (given.output / "tables.md").write_text(
        loop_table(loops) + "\n" + relit_table(relits), encoding="utf-8"
    )
    rows = {"loop": [asdict(row) for row in loops], "relit": [asdict(row) for row in relits]}
    (given.output / "rows.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    about = f"Cycles, {given.samples} samples, {given.size} px"
    for what, shown in panels.items():
        columns = 6 if what == "relit" else 7
        for page, first in enumerate(range(0, len(shown), _SHEET_ROWS * columns), start=1):
            path = given.output / f"closed_loop_{what}_{page}.png"
            save_sheet(
                path, _TITLES[what], about, shown[first : first + _SHEET_ROWS * columns], columns
            )


_TITLES = {
    "rendered": "The closed loop: rendered objects",
    "photos": "The closed loop: photos",
    "relit": "In a new light, against the truth",
}


def main(arguments: list[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : list of str, optional
        By default those of the process.

    Returns
    -------
    int
        0, or 2 after an error message.
    """
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.blender.closed_loop",
        description="Compare renders of imported results with the photo.",
    )
    add_case_arguments(parser, size=256, samples=64)
    parser.add_argument("--fresh", action="store_true", help="render again what exists")
    return run_cases(parser, measure, arguments)


if __name__ == "__main__":
    sys.exit(main())
