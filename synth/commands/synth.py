"""`isc synth`: renders glossy objects whose ground truth is known."""

import argparse
import math
import sys
from pathlib import Path
from typing import get_args

from isc_core.cli.interface.options import Commands, add_command, count, hints, names, positive
from isc_core.errors import InputError
from isc_core.progress import Monitor

from ..albedos import ALBEDOS
from ..capture.recipe import HEIGHT_FILE, IMAGE_FILE, MESH_FILE, PictureSettings, Sources
from ..capture.sensor import DEPTHS, Sensor
from ..dataset.generate import DatasetSettings, make_dataset
from ..dataset.splits import SPLITS, Choices
from ..light_rigs import FROM_FILES, RIGS
from ..light_rigs.files import PANORAMAS
from ..rendering import Renderer
from ..scene.materials import MODELS
from ..scene.variant import slower_without
from ..shapes import SHAPES
from . import glossy_mit

_EXAMPLES = """  isc synth --count 200 --size 128 -o scenes              about six of ten scenes to train on, the others held out
  isc synth --count 20 --shapes lathe --materials ggx --lights area --clip --bits 8 --noise 0.01 -o photos
  isc synth --count 10 --mesh bust.obj --albedo-image marble.png -o busts

A scene's seed decides what is in it: --seed 200 --count 100 makes the scenes that follow those of --count 200. The same command goes on
where it was interrupted; a larger --count adds scenes."""


def declare(commands: Commands) -> None:
    """Adds the command, and those below it, to the parser."""
    parser = add_command(
        commands,
        "synth",
        run,
        "render glossy objects with ground truth",
        "Renders a data set of glossy objects: photos, and what a decomposition should find in them. Each scene is a folder with "
        "preview.png (look at this first), maps.exr and scene.json; README.md describes the set.",
        _EXAMPLES,
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="DIR",
        help="the folder to write; an interrupted run in it goes on",
    )
    parser.add_argument(
        "--count", type=count, default=20, metavar="N", help="how many scenes (default %(default)s)"
    )
    parser.add_argument(
        "--seed",
        type=count,
        default=0,
        metavar="S",
        help="of the first scene (default %(default)s)",
    )
    _add_choices(parser)
    _add_picture(parser)
    glossy_mit.declare(parser.add_subparsers(title="another data set", metavar="SET"))


def _add_choices(parser: argparse.ArgumentParser) -> None:
    what = parser.add_argument_group("what is in the scenes")
    known = {"shapes": SHAPES, "materials": MODELS, "albedos": ALBEDOS, "splits": SPLITS}
    for option, all_names in known.items():
        what.add_argument(
            f"--{option}",
            type=names,
            metavar="a,b",
            help=f"of {', '.join(all_names)} (default: all)",
        )
    drawn = ", ".join(name for name in RIGS if name not in FROM_FILES)
    what.add_argument(
        "--lights",
        type=names,
        metavar="a,b",
        help=f"of {', '.join(RIGS)} (default: {drawn}, and those whose files are given)",
    )
    what.add_argument(
        "--mesh",
        type=Path,
        metavar="FILE",
        help="a mesh of your own, in its own colours, instead of --shapes or beside them",
    )
    what.add_argument(
        "--height",
        type=Path,
        metavar="FILE",
        help="a height map of your own (Z.mat, .npy, .exr), likewise",
    )
    what.add_argument(
        "--albedo-image",
        type=Path,
        metavar="FILE",
        help="an image to paint objects with, instead of --albedos or beside them",
    )
    what.add_argument("--natural-lights", type=Path, metavar="ROOT", help=FROM_FILES["natural"])
    what.add_argument("--hdr", type=Path, metavar="FILE|DIR", help=FROM_FILES["hdr"])


def _add_picture(parser: argparse.ArgumentParser) -> None:
    usual = PictureSettings()
    how = parser.add_argument_group("how they are taken")
    how.add_argument(
        "--size",
        type=count,
        default=usual.size,
        metavar="N",
        help="side of the picture, pixels (default %(default)s)",
    )
    how.add_argument(
        "--samples",
        type=count,
        default=usual.samples,
        metavar="N",
        help="light paths a pixel (default %(default)s)",
    )
    how.add_argument(
        "--bounces",
        type=count,
        default=usual.bounces,
        metavar="N",
        help="of light within the object (default %(default)s)",
    )
    how.add_argument(
        "--perspective", action="store_true", help="a pinhole camera instead of an orthographic one"
    )
    how.add_argument(
        "--exposure",
        type=positive,
        metavar="X",
        help="what 99.5 %% of the matt light stays below (default: .5 to .75 by the scene, less for mirrors)",
    )
    how.add_argument(
        "--clip", action="store_true", help="lose what is brighter than 1, as sensors do"
    )
    how.add_argument(
        "--noise",
        type=_share,
        default=0.0,
        metavar="X",
        help="the sensor's noise, of full scale (default: none)",
    )
    how.add_argument(
        "--bits",
        type=count,
        choices=DEPTHS,
        default=0,
        help="of the image's sRGB codes, implies --clip (default: none)",
    )
    how.add_argument(
        "--renderer",
        choices=get_args(Renderer),
        default=usual.renderer,
        help="default: %(default)s, the fastest that runs",
    )


def run(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Does the work; what can be wrong is found before it begins."""
    if options.output is None:
        raise InputError("give the folder to write: isc synth -o DIR (see `isc synth --help`)")
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
    kept = f", {outcome.kept} were there already" if outcome.kept else ""
    return hints(
        options, f"{outcome.made} scenes made{kept}: {options.output / 'README.md'} describes them"
    )


def _choices(options: argparse.Namespace, sources: Sources, painted: bool) -> Choices:
    """The families asked for; files that are given take part, and where nothing was named beside
    them, alone. `painted`: whether the mesh has colours, which are its paint unless another is
    named.
    """
    usual = Choices()
    own = [
        name for name, path in ((MESH_FILE, sources.mesh), (HEIGHT_FILE, sources.height)) if path
    ]
    shapes = _together(options.shapes, tuple(own), () if own else usual.shapes)
    paints = (
        [IMAGE_FILE]
        if sources.albedo_image
        else [MESH_FILE]
        if painted and shapes == (MESH_FILE,) and not options.albedos
        else []
    )
    albedos = _together(options.albedos, tuple(paints), () if paints else usual.albedos)
    if MESH_FILE in albedos and not painted:
        raise InputError("the mesh has no colours of its own: name other --albedos")
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
    for path in files:
        if path is not None and not path.is_file():
            raise InputError(f"{path} does not exist")
    return Sources(
        *files, options.natural_lights, () if options.hdr is None else _panoramas(options.hdr)
    )


def _panoramas(path: Path) -> tuple[Path, ...]:
    """The file, or those of the folder. Raises `InputError` where there is none."""
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
            f"{path} holds no {' or '.join(PANORAMAS)} file: name a latitude-longitude picture, or a folder of them"
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
