"""`isc export`: a result as a texture set or as a mesh for other programs."""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...batch.names import safe_name
from ...errors import InputError
from ...io.atomic import require_writable
from ...lobe_fitting.specular_level import SpecularSource
from ...progress import Monitor
from ...result_files.arrays_file import finer_by, mesh_of
from ...result_files.exports.full_texture import full_texture
from ...result_files.exports.mesh_file import SUFFIXES, check_mesh_path, write_mesh_file
from ...result_files.exports.targets import TARGETS
from ...result_files.exports.texture_set import texture_files, write_texture_set
from ...result_files.exports.usd import require_usd
from ...result_files.mesh.object_cover import object_cover, read_cover
from ...result_files.mesh.options import MeshOptions
from ...result_files.result_folder import MASK, load_part
from ...result_files.solids.back import Back
from ...scene.decomposition import Decomposition
from ...scene.part_of_result import placed_result
from ..interface.options import add_limits, add_triangles, limits_of
from ..interface.parser import describe, hints
from ..interface.result_photo import photo_of_result
from ..interface.values import MAPS_SIZE, share, texture_size

_EXAMPLES = """  isc export cup --textures unreal -o cup_textures
  isc export cup --textures generic --name mug -o mug_textures
  isc export cup --format usd -o cup.usdz
  isc export cup --format obj --triangles 20000 -o cup.obj
  isc export cup --format glb --back rounded --photo cup.jpg -o cup.glb"""


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
        "Export a result to other programs: --textures writes a texture set with the names and "
        "packings that a program expects, --format writes the mesh with its material.",
        examples=_EXAMPLES,
    )
    parser.add_argument(
        "result", type=Path, metavar="RESULT", help="a folder written by isc decompose"
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="PATH",
        help="the folder of the textures, or the file of the mesh",
    )
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument(
        "--textures", choices=tuple(TARGETS), help="write a texture set for this program"
    )
    what.add_argument(
        "--format",
        choices=tuple(SUFFIXES),
        help="write the mesh in this format; obj and usd have their textures beside them, usdz "
        "(chosen by its suffix) and glb include them",
    )
    parser.add_argument(
        "--name", metavar="NAME", help="prefix of the texture names (default: the photo's name)"
    )
    parser.add_argument(
        "--roughness",
        type=share,
        metavar="R",
        help="roughness from 0 to 1 (default: the fitted one)",
    )
    add_triangles(parser)
    parser.add_argument(
        "--back",
        choices=tuple(Back),
        default=Back.OPEN,
        help="with --format: back of the mesh, which the photo does not show; all except open are "
        "closed (default %(default)s)",
    )
    fine = parser.add_argument_group("base colour at the photo's resolution")
    fine.add_argument("--photo", type=Path, metavar="PHOTO", help="the photo that was decomposed")
    fine.add_argument(
        "--mask",
        type=Path,
        metavar="MASK",
        help="the mask that it was decomposed with (default: mask.png of the result)",
    )
    fine.add_argument(
        "--texture-size",
        type=texture_size,
        metavar="photo|maps|N",
        help="longest side: that of the photo, that of the maps, or at most N pixels "
        "(default photo)",
    )
    add_limits(fine)


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

    Raises
    ------
    InputError
        If the result cannot be read, or the output cannot be written.
    """
    output: Path = options.output
    if options.photo is None and (options.mask, options.texture_size) != (None, None):
        raise InputError("--mask and --texture-size require --photo: add it")
    if options.textures is not None and options.back != Back.OPEN:
        raise InputError("--back applies to a mesh: add --format, or leave it out")
    if options.format is not None:
        check_mesh_path(output, options.format)
        if options.format == "usd":
            require_usd(output)
    monitor.report("reading", 0.0)
    stored = load_part(options.result)
    d, part = stored.result, stored.part
    name = safe_name(options.name or _name_of(d, options.result))
    if options.textures is not None:
        inputs = (options.result / MASK, options.photo, options.mask)
        require_writable(output, texture_files(name), inputs)
    monitor.report("building the mesh", 0.2)
    seen = read_cover(options.result / MASK, stored.result.provenance.input)
    cover = object_cover(stored, seen)
    how = MeshOptions(triangles=options.triangles, back=Back(options.back))
    # Texture sets are for the plane of the photo, whose mesh has its vertices at pixels.
    fine = options.photo is not None and options.texture_size != MAPS_SIZE
    texture = _fine_texture(placed_result(d, part), options) if fine else None
    edge = None if options.format is None else cover
    built = mesh_of(stored, how, edge, finer=finer_by(texture, part.shape))
    built = built if texture is None else built.with_texture(texture)
    if options.roughness is not None:
        known = {"roughness": options.roughness, "roughness_source": SpecularSource.GIVEN}
        built = replace(built, gloss=replace(built.gloss, **known))
    monitor.report("writing", 0.4)
    if options.format is not None:
        given = [one for one in (options.photo, options.mask) if one is not None]
        files = write_mesh_file(built, output, options.format, given)
        return hints(options, f"wrote {', '.join(map(str, files))}")
    writing, near = monitor.part(0.4, 1.0), stored.at(built.place)
    write_texture_set(
        near,
        built,
        near.mask.astype(np.float32) if cover is None else built.place.cut(cover.share),
        options.textures,
        output,
        name=name,
        monitor=writing,
    )
    return hints(options, f"wrote {output}, see {output / texture_files(name)[0]}")


def _fine_texture(d: Decomposition, options: argparse.Namespace) -> np.ndarray | None:
    """The base colour at the photo's resolution; None where the maps have it."""
    photo = photo_of_result(
        d, options.result, options.photo, options.mask, None, limits_of(options)
    )
    if photo.original.sha256 != d.provenance.input.get("sha256"):
        raise InputError(f"{options.photo} is not the photo of {options.result}: give its photo")
    return full_texture(photo, d, options.texture_size or 0)


def _name_of(d: Decomposition, folder: Path) -> str:
    """The photo's name without its suffix, else the folder's."""
    return Path(str(d.provenance.input.get("name", ""))).stem or folder.resolve().name
