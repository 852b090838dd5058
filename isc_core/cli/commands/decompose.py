"""`isc decompose`: one photo in, the folder of its decomposition out."""

import argparse
from dataclasses import fields
from pathlib import Path

from ...decomposition.pipeline import KnownInputs, Settings, decompose
from ...photo import Photo, read_photo
from ...progress import Monitor
from ...result_files.diagnostics_text import note_lines
from ...result_files.known_inputs import read_height, read_light
from ...result_files.result_folder import require_room, require_writable_result, save
from ...sirfs.priors.prior_file import load_prior_set
from ..interface.options import (
    Commands,
    add_command,
    add_engine,
    add_photo,
    add_settings,
    hints,
    limits_of,
    number,
    positive,
)

_EXAMPLES = """  isc decompose cup.png -o cup
  isc decompose photo.jpg --mask mask.png --model sirfs -o result
  isc decompose scan.tif --transfer linear --depth sensor.exr --depth-sigma 3 -o result

Height maps (--shape, --depth) have the photo's size, in photo pixels toward the viewer: EXR with
a channel Y, Z or height.Z; NumPy .npy; PNG or TIFF of 16 bits, where one code is 1/64 pixel and 0
is a hole; or the folder of an earlier result. NaN is a hole. --height-scale changes the unit: -0.2
for distances from the camera whose unit is 0.2 pixels."""


def declare(commands: Commands) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : object
        Returned by `add_subparsers`.
    """
    parser = add_command(
        commands,
        "decompose",
        run,
        "everything: layers, shape, light, shading, reflectance, mesh",
        "Decomposes a photo of one glossy object into diffuse and specular light, shape, "
        "illumination, shading, reflectance. Writes a folder "
        "with preview.png (start here), maps.exr, mesh.glb and decomposition.json.",
        _EXAMPLES,
    )
    add_photo(parser)
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="DIR",
        help="the folder to write; an earlier result is replaced",
    )
    add_settings(parser)
    _add_known_inputs(parser)
    add_engine(parser)


def _add_known_inputs(parser: argparse.ArgumentParser) -> None:
    defaults = KnownInputs()
    group = parser.add_argument_group("known inputs")
    group.add_argument(
        "--shape",
        type=Path,
        metavar="FILE",
        help="the exact shape, a height map without holes inside the mask",
    )
    group.add_argument(
        "--light",
        type=Path,
        metavar="FILE",
        help="the exact light, a decomposition.json or a JSON file with 9 x 3 coefficients",
    )
    group.add_argument(
        "--depth", type=Path, metavar="FILE", help="a measured height map, with holes and errors"
    )
    group.add_argument(
        "--depth-sigma",
        type=positive,
        default=defaults.depth_sigma,
        metavar="S",
        help="its standard deviation in photo pixels (default %(default)s)",
    )
    group.add_argument(
        "--depth-weight",
        type=positive,
        default=defaults.depth_weight,
        metavar="W",
        help="its weight (default %(default)s)",
    )
    group.add_argument(
        "--height-scale",
        type=number,
        metavar="F",
        help="photo pixels per unit of --shape and --depth (default 1; 1/64 for 16 bits)",
    )


def run(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Run the command; inputs are checked before the work begins.

    Parameters
    ----------
    options : argparse.Namespace
    monitor : Monitor

    Returns
    -------
    list of str
        Lines to print.
    """
    settings = Settings(**{f.name: getattr(options, f.name) for f in fields(Settings)})
    settings.check()
    require_writable_result(options.output, inputs=(options.photo, options.mask))
    prior_set = None if options.priors is None else load_prior_set(options.priors)
    photo = read_photo(options.photo, options.mask, options.transfer, limits=limits_of(options))
    known = _known_inputs(options, photo)
    require_room(options.output, _pixels(photo, settings), arrays=options.arrays)
    result = decompose(
        photo,
        settings,
        known=known,
        prior_set=prior_set,
        name=options.photo.name,
        monitor=monitor.part(0.0, 0.8),
    )
    save(result, options.output, arrays=options.arrays, monitor=monitor.part(0.8, 1.0))
    return hints(
        options,
        *note_lines(result.provenance.diagnostics),
        f"see {options.output / 'preview.png'}",
    )


def _known_inputs(options: argparse.Namespace, photo: Photo) -> KnownInputs:
    size, scale, limits = photo.mask.shape, options.height_scale, limits_of(options)
    return KnownInputs(
        height=None if options.shape is None else read_height(options.shape, size, scale, limits),
        light=None if options.light is None else read_light(options.light),
        depth=None if options.depth is None else read_height(options.depth, size, scale, limits),
        depth_sigma=options.depth_sigma,
        depth_weight=options.depth_weight,
    )


def _pixels(photo: Photo, settings: Settings) -> int:
    """Number of the object's pixels in the maps."""
    longest = max(photo.box[2:])
    keep = settings.full_size or settings.max_size == 0 or longest <= settings.max_size
    return round(int(photo.mask.sum()) * (1.0 if keep else (settings.max_size / longest) ** 2))
