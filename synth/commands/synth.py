"""`isc synth`: render glossy objects with ground truth."""

import argparse
import math
import sys
from pathlib import Path
from typing import get_args

from isc_core.cli.interface.parser import describe, hints
from isc_core.cli.interface.values import count, names, positive
from isc_core.errors import InputError
from isc_core.io.regular_files import require_regular
from isc_core.progress import Monitor

from ..albedos import ALBEDOS
from ..capture.recipe import HEIGHT_FILE, IMAGE_FILE, MESH_FILE, PictureSettings, Sources
from ..capture.sensor import DEPTHS, Sensor
from ..dataset.generate import make_dataset
from ..dataset.settings import DatasetSettings
from ..dataset.splits import SPLITS, Choices
from ..light_rigs import FROM_FILES, RIGS
from ..light_rigs.files import PANORAMAS
from ..rendering import Renderer
from ..scene.materials import MODELS
from ..scene.variant import slower_without
from ..shapes import SHAPES
from . import glossy_mit

_EXAMPLES = """  isc synth --count 200 --size 128 -o scenes
  isc synth --count 20 --shapes lathe --materials ggx --lights area --clip --bits 8 -o photos
  isc synth --count 10 --mesh bust.obj --albedo-image marble.png -o busts

About six out of ten scenes are for training, the others have held-out objects, materials or lights.
A scene depends on its seed only: --seed 200 --count 100 renders the scenes that follow those of
--count 200. The same command continues an interrupted run; a larger --count adds scenes."""


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    """
    describe(
        parser,
        run,
        "Render a data set of glossy objects: photos with the ground truth of their decomposition. "
        "Each scene is a folder with preview.png, maps.exr and scene.json; README.md describes the "
        "set.",
        examples=_EXAMPLES,
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="DIR",
        help="output folder; an interrupted run continues",
    )
    parser.add_argument(
        "--count",
        type=count,
        default=20,
        metavar="N",
        help="number of scenes (default: %(default)s)",
    )
    parser.add_argument(
        "--seed",
        type=count,
        default=0,
        metavar="S",
        help="seed of the first scene (default: %(default)s)",
    )
    _add_choices(parser)
    _add_picture(parser)
    others = parser.add_subparsers(title="other data sets", metavar="SET")
    glossy_mit.declare(others.add_parser("glossy-mit", help=glossy_mit.SUMMARY))


def _add_choices(parser: argparse.ArgumentParser) -> None:
    what = parser.add_argument_group("content of the scenes")
    known = {"shapes": SHAPES, "materials": MODELS, "albedos": ALBEDOS, "splits": SPLITS}
    for option, all_names in known.items():
        what.add_argument(
            f"--{option}",
            type=names,
            metavar="a,b",
            help=f"{', '.join(all_names)} (default: all)",
        )
    drawn = ", ".join(name for name in RIGS if name not in FROM_FILES)
    what.add_argument(
        "--lights",
        type=names,
        metavar="a,b",
        help=f"{', '.join(RIGS)} (default: {drawn}, and those whose files are given)",
    )
    what.add_argument(
        "--mesh",
        type=Path,
        metavar="FILE",
        help="your own mesh, with its colours; replaces --shapes, or is added to them",
    )
    what.add_argument(
        "--height",
        type=Path,
        metavar="FILE",
        help="your own height map (Z.mat, .npy, .exr), likewise",
    )
    what.add_argument(
        "--albedo-image",
        type=Path,
        metavar="FILE",
        help="your own albedo texture; replaces --albedos, or is added to them",
    )
    what.add_argument("--natural-lights", type=Path, metavar="ROOT", help=FROM_FILES["natural"])
    what.add_argument("--hdr", type=Path, metavar="FILE|DIR", help=FROM_FILES["hdr"])


def _add_picture(parser: argparse.ArgumentParser) -> None:
    usual = PictureSettings()
    how = parser.add_argument_group("photography")
    how.add_argument(
        "--size",
        type=count,
        default=usual.size,
        metavar="N",
        help="side of the picture in pixels (default: %(default)s)",
    )
    how.add_argument(
        "--samples",
        type=count,
        default=usual.samples,
        metavar="N",
        help="light paths per pixel (default: %(default)s)",
    )
    how.add_argument(
        "--bounces",
        type=count,
        default=usual.bounces,
        metavar="N",
        help="interreflections on the object (default: %(default)s)",
    )
    how.add_argument(
        "--perspective", action="store_true", help="pinhole camera instead of an orthographic one"
    )
    how.add_argument(
        "--exposure",
        type=positive,
        metavar="X",
        help="99.5th percentile of the diffuse layer (default: .5 to .75, drawn per scene)",
    )
    how.add_argument("--clip", action="store_true", help="clip light above 1, as sensors do")
    how.add_argument(
        "--noise",
        type=_share,
        default=0.0,
        metavar="X",
        help="sensor noise relative to full scale (default: none)",
    )
    how.add_argument(
        "--bits",
        type=count,
        choices=DEPTHS,
        default=0,
        help="bits of the sRGB codes, implies --clip (default: none)",
    )
    how.add_argument(
        "--renderer",
        choices=get_args(Renderer),
        default=usual.renderer,
        help="renderer; auto is the fastest available (default: %(default)s)",
    )


def run(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Run the command.

    Parameters
    ----------
    options : argparse.Namespace
        The parsed options.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    list of str
        Lines for the user.

    Raises
    ------
    InputError
        For invalid input, before the work begins.
    """
    if options.output is None:
        raise InputError("the output folder is missing: isc synth -o DIR")
    sources = _sources(options)
    sensor = Sensor(clip=options.clip or options.bits > 0, noise=options.noise, bits=options.bits)
    picture = PictureSettings(
        options.size,
        options.samples,
        options.bounces,
        options.perspective,
        options.exposure,
        sensor,
        options.renderer,
    )
    wanted = DatasetSettings(
        options.count, options.seed, _choices(options, sources, sources.check()), picture, sources
    )
    if (advice := slower_without()) and not options.quiet:
        print(f"isc: {advice}", file=sys.stderr)
    outcome = make_dataset(wanted, options.output, monitor)
    kept = f", {outcome.kept} kept" if outcome.kept else ""
    return hints(
        options, f"{outcome.made} scenes rendered{kept}, see {options.output / 'README.md'}"
    )


def _choices(options: argparse.Namespace, sources: Sources, coloured: bool) -> Choices:
    """The chosen families. Given files are added, and replace the defaults where nothing was named.

    `coloured`: whether the mesh has colours, which are its albedo unless another one is named.
    """
    usual = Choices()
    own = [
        name for name, path in ((MESH_FILE, sources.mesh), (HEIGHT_FILE, sources.height)) if path
    ]
    shapes = _together(options.shapes, tuple(own), () if own else usual.shapes)
    own_albedos = (
        [IMAGE_FILE]
        if sources.albedo_image
        else [MESH_FILE]
        if coloured and shapes == (MESH_FILE,) and not options.albedos
        else []
    )
    albedos = _together(options.albedos, tuple(own_albedos), () if own_albedos else usual.albedos)
    if MESH_FILE in albedos and not coloured:
        raise InputError("the mesh has no colours of its own: choose other --albedos")
    from_files = tuple(
        name for name, given in (("natural", sources.natural_lights), ("hdr", sources.hdr)) if given
    )
    lights = _together(options.lights, () if options.lights else from_files, usual.lights)
    return Choices(
        shapes, options.materials or usual.materials, albedos, lights, options.splits or ()
    )


def _together(
    named: tuple[str, ...] | None, own: tuple[str, ...], usual: tuple[str, ...]
) -> tuple[str, ...]:
    listed = usual if named is None else named
    return (*listed, *(name for name in own if name not in listed))


def _sources(options: argparse.Namespace) -> Sources:
    files = (options.mesh, options.height, options.albedo_image)
    for path in filter(None, files):
        if not path.exists():
            raise InputError(f"{path} does not exist")
        require_regular(path)
    return Sources(
        *files, options.natural_lights, () if options.hdr is None else _panoramas(options.hdr)
    )


def _panoramas(path: Path) -> tuple[Path, ...]:
    """The file, or those of the folder."""
    if path.is_file():
        return (path,)
    found = tuple(
        sorted(
            entry
            for entry in path.glob("*")
            if entry.suffix.lower() in PANORAMAS and entry.is_file()
        )
    )
    if not found:
        raise InputError(
            f"{path} has no {' or '.join(PANORAMAS)} file: give a latitude-longitude image, or a "
            "folder of them"
        )
    return found


def _share(text: str) -> float:
    """A number from 0 to below 1."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 <= value < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number from 0 to below 1")
    return value
