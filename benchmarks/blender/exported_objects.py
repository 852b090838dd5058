"""Measure exported objects read back, and highlights of a new lamp.

  python -m benchmarks.blender.exported_objects -o FOLDER --photos ../shared/data/photos

Objects are those of `closed_loop_cases`: photos, and rendered scenes with known truth. Each is
decomposed, built in Blender, and rendered by Cycles from the photo's camera.

Exports: the object, as recovered and after edits of hue, value, level and gloss, is written by
Blender's own exporters for glTF and USD, as File > Export calls them, imported in place of the
original, and rendered again. PSNR inside the mask; the peak is the 99.9th percentile of the
original.

Highlights: a sun from each of `LAMPS` lights the object alone. The centre of the highlight is the
mean place of the pixels with at least half of the largest glossy light, weighted by it. Measured is
the angle between the true normals at the centre of the recovered object's highlight and at that of
the object with the true maps: how far the highlight has been displaced on the object. An object
without fitted gloss gets the level 1 and the roughness .3, as would both.

Limits: rendered objects alone have true normals; a highlight outside of the mask is not counted.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import bpy
import numpy as np

from blender_addon.files.result_arrays import ResultArrays, read_result
from blender_addon.materials.edit_nodes import dichromatic_node
from blender_addon.scene.build import build_object
from blender_addon.scene.built_object import BuiltObject
from blender_addon.scene.preparation import BuildOptions
from blender_addon.scene.sun import ensure_sun
from blender_addon.scene.world import set_sun_mix
from isc_core.evaluation.metrics import psnr
from synth.light_rigs.placing import toward

from .closed_loop import white
from .closed_loop_cases import (
    LoopCase,
    add_case_arguments,
    chosen_cases,
    run_cases,
)
from .read_back import read_back, shown
from .renders import render_scene

EDITS = {"Hue": 0.7, "Value": 0.8, "Specular Level": 1.0, "Roughness": 0.4, "Gloss Gain": 1.5}
LAMPS = ((30.0, 20.0), (35.0, 110.0), (40.0, 200.0), (25.0, 290.0))  # degrees: off the view, around
_GLOSSY = {"Specular Level": 1.0, "Roughness": 0.3, "Diffuse Gain": 0.0}


@dataclass(frozen=True)
class ExportRow:
    """One object, exported and read back: PSNR in dB.

    Attributes
    ----------
    name : str
        The object.
    glb, usd : float
        As recovered.
    glb_edited, usd_edited : float
        After the edits.
    """

    name: str
    glb: float
    usd: float
    glb_edited: float
    usd_edited: float


@dataclass(frozen=True)
class HighlightRow:
    """The highlight of one lamp.

    Attributes
    ----------
    name : str
        The object.
    lamp : int
        Index into `LAMPS`.
    angle : float
        Degrees between the true normals at both centres.
    """

    name: str
    lamp: int
    angle: float


def export_row(name: str, result: ResultArrays, samples: int) -> ExportRow:
    """Export an object in each way and compare it with the original.

    Parameters
    ----------
    name : str
        The object.
    result : ResultArrays
        Its decomposition.
    samples : int
        Samples per pixel.

    Returns
    -------
    ExportRow
        The figures.
    """
    figures = {}
    for label, edits in (("", {}), ("_edited", EDITS)):
        for kind in ("glb", "usd"):
            built = _built(result, edits)
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / f"object.{'glb' if kind == 'glb' else 'usdc'}"
                _standard_export(path)
                wanted, mask = shown(built, samples)
                found, _ = read_back(built, path, samples)
            figures[kind + label] = psnr(wanted, found, mask, peak=white(wanted, mask))
    return ExportRow(name, **figures)


def highlight_rows(name: str, result: ResultArrays, truth: ResultArrays) -> Iterator[HighlightRow]:
    """Measure the places of the highlights of new lamps.

    Parameters
    ----------
    name : str
        The object.
    result : ResultArrays
        Its decomposition.
    truth : ResultArrays
        Its true maps, on the same grid.

    Yields
    ------
    HighlightRow
        One per lamp.
    """
    mask = result.mask & truth.mask
    for number, lamp in enumerate(LAMPS):
        places = [highlight_centre(_lit_by(one, lamp), mask) for one in (result, truth)]
        found, wanted = (truth.normal[place].astype(float) for place in places)
        cosine = np.clip((found * wanted).sum(), -1, 1)
        yield HighlightRow(name, number, float(np.degrees(np.arccos(cosine))))


def highlight_centre(image: np.ndarray, mask: np.ndarray) -> tuple[int, int]:
    """Return the pixel at the centre of a highlight.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Glossy light alone.
    mask : (H, W) ndarray of bool
        Pixels that count.

    Returns
    -------
    tuple of int
        Row and column of the pixel of the mask that is nearest to the weighted mean.
    """
    light = np.where(mask, image.mean(-1), 0)
    weight = np.where(light >= 0.5 * light.max(), light, 0)
    rows, columns = np.indices(light.shape)
    centre = [float((one * weight).sum() / weight.sum()) for one in (rows, columns)]
    places = np.argwhere(mask)
    row, column = places[np.square(places - centre).sum(1).argmin()]
    return int(row), int(column)


def _built(result: ResultArrays, values: dict[str, float]) -> BuiltObject:
    """The object in an empty file, selected, with these values on its node."""
    import addon_utils  # type: ignore[import-not-found]  # a module of Blender's

    bpy.ops.wm.read_factory_settings(use_empty=True)
    addon_utils.enable("blender_addon", default_set=True)
    built = build_object(result, BuildOptions())
    bpy.context.window.scene = built.scene
    built.object.select_set(True)
    built.scene.view_layers[0].objects.active = built.object
    node = dichromatic_node(built.material)
    for name, value in values.items():
        node.inputs[name].default_value = value  # type: ignore[union-attr]
    bpy.context.view_layer.update()
    return built


def _standard_export(path: Path) -> None:
    if path.suffix == ".glb":
        bpy.ops.export_scene.gltf(filepath=str(path), use_selection=True, use_active_scene=True)
    else:
        bpy.ops.wm.usd_export(filepath=str(path), selected_objects_only=True)


def _lit_by(result: ResultArrays, lamp: tuple[float, float]) -> np.ndarray:
    built = _built(result, _GLOSSY)
    set_sun_mix(built.world, np.zeros(3), True)
    sun = ensure_sun(built.object["isc_key"], built.collection, toward(*lamp), np.ones(3))
    sun.data.angle = 0.0
    return render_scene(built.scene, 16)[0]


def _write(folder: Path, exports: list[ExportRow], highlights: list[HighlightRow]) -> None:
    lines = ["| object | GLB | USD | GLB, edited | USD, edited |", "|---|---|---|---|---|"]
    for row in exports:
        figures = (row.glb, row.usd, row.glb_edited, row.usd_edited)
        lines.append(f"| {row.name} | " + " | ".join(f"{one:.1f} dB" for one in figures) + " |")
    lines += ["", "| object | angles | median |", "|---|---|---|"]
    for name in dict.fromkeys(row.name for row in highlights):
        angles = [row.angle for row in highlights if row.name == name]
        shown_angles = ", ".join(f"{angle:.1f}" for angle in angles)
        lines.append(f"| {name} | {shown_angles} | {np.median(angles):.1f} |")
    if highlights:
        every = np.median([row.angle for row in highlights])
        lines.append(f"| all | | {every:.1f} |")
    (folder / "exported.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    rows = {"exports": [asdict(row) for row in exports]}
    rows |= {"highlights": [asdict(row) for row in highlights]}
    (folder / "exported.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


def measure(given: argparse.Namespace) -> None:
    """Measure all objects; the tables are rewritten after each.

    Parameters
    ----------
    given : argparse.Namespace
        The command's options.

    Raises
    ------
    InputError
        For an unknown name, a missing photo, or a failed run.
    """
    exports: list[ExportRow] = []
    highlights: list[HighlightRow] = []
    for case in chosen_cases(given, 64):
        _measure_case(case, given.samples, exports, highlights)
        _write(given.output, exports, highlights)
        print(exports[-1], flush=True)


def _measure_case(
    case: LoopCase, samples: int, exports: list[ExportRow], highlights: list[HighlightRow]
) -> None:
    result = read_result(case.result)
    exports.append(export_row(case.name, result, samples))
    if case.truth is not None:
        highlights += highlight_rows(case.name, result, read_result(case.truth))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        By default those of the process.

    Returns
    -------
    int
        0, or 2 after an error message.
    """
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.blender.exported_objects",
        description="Measure exported objects read back, and highlights of a new lamp.",
    )
    add_case_arguments(parser, size=128, samples=32)
    return run_cases(parser, measure, arguments)


if __name__ == "__main__":
    sys.exit(main())
