"""`isc decompose`: decomposes photos into a folder each."""

import argparse
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from functools import partial
from pathlib import Path

from ...decomposition.models import load
from ...decomposition.pipeline import KnownInputs, Settings, decompose
from ...errors import InputError
from ...imaging.bounding_box import mask_box
from ...io.checkpoint import Checkpoint
from ...io.stage_cache import KeptStages, StageCache
from ...masking.finder import MaskSearch, read_each_object
from ...photo import Photo, read_photo
from ...progress import Monitor
from ...result_files.diagnostics_text import CROPPED, note_lines
from ...result_files.mesh.options import MeshOptions
from ...result_files.object_folders import holds_result, object_folders
from ...result_files.reading_notes_text import reading_note_lines
from ...result_files.result_folder import require_room, require_writable_result, save
from ...scene.decomposition import Decomposition
from ...sirfs.priors.prior_file import load_prior_set
from ...sirfs.priors.prior_set import PriorSet
from ..interface.highlight_options import add_highlight_marks, mark_notes, marks_of, with_marks
from ..interface.mask_options import add_each, add_hints, hints_of, mask_notes
from ..interface.options import (
    add_engine,
    add_limits,
    add_main_settings,
    add_mask,
    add_model_settings,
    add_open,
    add_output,
    add_photo,
    add_transfer,
    add_triangles,
    limits_of,
    names_table,
)
from ..interface.parser import describe, hints
from ..interface.several import do_all
from ..interface.standard_input import STDIN, photo_file
from ..interface.values import MAPS_SIZE, memory_size, number, positive, texture_size
from ..interface.viewer import show

_EXAMPLES = """  isc decompose cup.png -o cup
  isc decompose cup.png jug.png vase.png -o results      one folder each, results/cup and so on
  isc decompose photo.jpg --mask mask.png --model sirfs -o result
  isc decompose phone.jpg --point 900,1200 -o result     the object at that pixel
  isc decompose toy.jpg --highlight 480,215 -o toy       the bright spot there is a highlight
  isc decompose shelf.jpg --each -o results              each object: results/1, results/2, ...
  isc decompose scan.tif --transfer linear --depth sensor.exr --depth-sigma 3 -o result
  curl -s https://example.org/cup.png | isc decompose - -o cup

Height maps (--shape, --depth) have the photo's size, in photo pixels toward the viewer: EXR with
a channel Y, Z or height.Z; NumPy .npy; PNG or TIFF of 16 bits, where one code is 1/64 pixel and 0
is a hole; or the folder of an earlier result. NaN is a hole. --height-scale changes the unit: -0.2
for distances from the camera whose unit is 0.2 pixels.

isc.toml in the current folder sets defaults: a line max-size = 384 below [decompose]."""


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
        "Decompose a photo of one glossy object into diffuse and specular light, shape, "
        "illumination, shading and reflectance. Writes a folder "
        "with preview.png (start here), maps.exr, mesh.glb and decomposition.json.",
        examples=_EXAMPLES,
        more=names_table(),
    )
    add_photo(parser, several=True)
    main = parser.add_argument_group("main options")
    add_output(main)
    add_mask(main)
    add_hints(main)
    add_each(main, "DIR/1, DIR/2 and so on, from left to right")
    add_highlight_marks(main)
    add_main_settings(main)
    main.add_argument(
        "--refine",
        action="store_true",
        help="fit lamps and gloss to the highlights, as isc refine does; kept only if the fit "
        "explains the photo better; after an interruption, the same command continues the fit",
    )
    main.add_argument(
        "--png", action="store_true", help="also write the layers as 8-bit PNG, beside maps/*.exr"
    )
    add_triangles(main)
    main.add_argument(
        "--texture-size",
        type=texture_size,
        metavar="photo|maps|N",
        help="with --arrays: longest side of its base colour: that of the photo, that of the maps, "
        "or at most N pixels (default maps)",
    )
    add_open(main)
    reading = parser.add_argument_group("reading the photo")
    add_transfer(reading)
    add_limits(reading)
    add_model_settings(parser)
    _add_known_inputs(parser)
    computing = parser.add_argument_group("computing")
    add_engine(computing)
    computing.add_argument(
        "--memory",
        type=memory_size,
        metavar="SIZE",
        help="memory limit, such as 2GB; a photo that needs more is refused with the amount that "
        "it needs (default: the free memory)",
    )
    computing.add_argument(
        "--cache",
        type=Path,
        metavar="DIR",
        help="keep in DIR what does not depend on model and separator, and the fits of --refine, 1 "
        "to 2 MB per photo: the next run on the photo takes less time, and gives the same result",
    )


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
        help="standard deviation of --depth in photo pixels (default %(default)s)",
    )
    group.add_argument(
        "--depth-weight",
        type=positive,
        default=defaults.depth_weight,
        metavar="W",
        help="weight of --depth (default %(default)s)",
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

    Raises
    ------
    Rejected
        If some of several photos, or of several objects, failed.
    """
    settings = Settings(**{f.name: getattr(options, f.name) for f in fields(Settings)})
    settings.check()
    if options.texture_size is not None and not options.arrays:
        raise InputError("--texture-size applies to the arrays: add --arrays, or leave it out")
    if options.cache is not None and options.cache.exists() and not options.cache.is_dir():
        raise InputError(f"--cache {options.cache} is a file: name a folder")
    prior_set = None if options.priors is None else load_prior_set(options.priors)
    if options.light is not None:
        from ...result_files.known_inputs import read_light

        read_light(options.light)  # an unusable file is not a failure of each photo
    marked = bool(marks_of(options))
    if marked and (options.each or len(options.photo) > 1):
        raise InputError(
            "--highlight and --not-highlight apply to one object: give one photo without --each"
        )
    if options.each:
        return _decompose_each(options, settings, prior_set, monitor)
    if len(options.photo) == 1:
        return _decompose_one(
            options.photo[0], options.output, options, settings, prior_set, monitor
        )
    return _decompose_several(options, settings, prior_set, monitor)


def _decompose_one(
    path: Path,
    output: Path,
    options: argparse.Namespace,
    settings: Settings,
    prior_set: PriorSet | None,
    monitor: Monitor,
) -> list[str]:
    """Decompose a photo, and return the lines to print."""
    finder = MaskSearch(hints_of(options))
    require_writable_result(output, inputs=(path, options.mask))
    aside = ThreadPoolExecutor(1)
    aside.submit(load, settings, prior_set)
    aside.shutdown(wait=False)
    with photo_file(path, options) as file:
        photo = read_photo(
            file, options.mask, options.transfer, limits=limits_of(options), finder=finder
        )
    lines = hints(options, *(f"note: {note}" for note in mask_notes(photo)))
    return lines + _decompose_photo(photo, path, output, options, settings, prior_set, monitor)


def _decompose_photo(
    photo: Photo,
    path: Path,
    output: Path,
    options: argparse.Namespace,
    settings: Settings,
    prior_set: PriorSet | None,
    monitor: Monitor,
) -> list[str]:
    photo = with_marks(photo, options)
    known = _known_inputs(options, photo)
    require_room(output, _pixels(photo, settings), arrays=options.arrays)
    cache, refined = None if options.cache is None else StageCache(options.cache), list[str]()
    with Checkpoint(output) as checkpoint:
        result = decompose(
            photo,
            settings,
            known=known,
            prior_set=prior_set,
            name="standard input" if path == STDIN else path.name,
            memory=options.memory,
            kept=cache,
            monitor=monitor.part(0.0, 0.7 if options.refine else 0.8),
        )
        if options.refine:
            refining = monitor.part(0.7, 0.8)
            result, line = _refined(result, settings.seed, cache or checkpoint, refining)
            refined = [line]
        _write(result, photo, output, options, monitor.part(0.8, 1.0))
        checkpoint.remove()
    preview = output / "preview.png"
    return hints(
        options,
        *reading_note_lines(photo.original.notes),
        *refined,
        *checkpoint.notes(),
        *note_lines(result.provenance.diagnostics),
        *(f"note: {note}" for note in mark_notes(photo, result)),
        *_detail_notes(settings, max(mask_box(result.mask)[2:]), max(photo.box[2:])),
        *((f"note: {CROPPED}",) if photo.original.cropped and settings.camera == "auto" else ()),
        *(show(preview) if options.open else ()),
        f"see {preview}",
    )


def _refined(
    result: Decomposition, seed: int, kept: KeptStages, monitor: Monitor
) -> tuple[Decomposition, str]:
    """The result, with refined gloss if that explains the photo better, and a line about it."""
    from ...refinement import GlossOptions, refine_gloss
    from ...refinement.gloss_note import gloss_line

    done = refine_gloss(result, GlossOptions(seed=seed), monitor, kept)
    return done.result, gloss_line(done.result.provenance.settings)


def _write(
    result: Decomposition, photo: Photo, output: Path, options: argparse.Namespace, monitor: Monitor
) -> None:
    texture = None
    if options.texture_size is not None and options.texture_size != MAPS_SIZE:
        from ...result_files.exports.full_texture import full_texture

        monitor.report("refining the texture", 0.0)
        texture = full_texture(photo, result, options.texture_size)
    save(
        result,
        output,
        mesh=MeshOptions(triangles=options.triangles),
        arrays=options.arrays,
        texture=texture,
        png=options.png,
        cover=photo.cover,
        monitor=monitor,
    )


def _decompose_each(
    options: argparse.Namespace, settings: Settings, prior_set: PriorSet | None, monitor: Monitor
) -> list[str]:
    """Decompose each of several objects of a photo into its own folder; one that fails does not
    stop the others.
    """
    hints_of(options)
    for option in ("shape", "depth"):
        if getattr(options, option) is not None:
            raise InputError(f"--{option} applies to one object: leave out --each")
    if len(options.photo) > 1:
        raise InputError("--each applies to one photo: give one photo")
    path: Path = options.photo[0]
    monitor.report("finding the objects", 0.0)
    with photo_file(path, options) as file:
        photos = read_each_object(file, options.mask, options.transfer, limits_of(options))
    _require_no_result(options.output)
    _require_no_other_objects(options.output, len(photos))
    works = {
        f"object {number} of {len(photos)}": partial(
            _decompose_object,
            photo,
            path,
            options.output / str(number),
            options,
            settings,
            prior_set,
        )
        for number, photo in enumerate(photos, 1)
    }
    return do_all("objects", works, monitor)


def _require_no_result(output: Path) -> None:
    """Raise `InputError` for the folder of one result, which several results would mix with."""
    if holds_result(output):
        raise InputError(
            f"{output} is the result of one object: choose another folder for several results"
        )


def _require_no_other_objects(output: Path, count: int) -> None:
    """Raise `InputError` for a folder with more objects, which readers would attribute to this
    photo.
    """
    for result in object_folders(output):
        if int(result.name) > count:
            raise InputError(
                f"{result} is the result of another run, and this photo has {count} "
                f"{'object' if count == 1 else 'objects'}: remove it, or choose another folder"
            )


def _decompose_object(
    photo: Photo,
    path: Path,
    output: Path,
    options: argparse.Namespace,
    settings: Settings,
    prior_set: PriorSet | None,
    monitor: Monitor,
) -> list[str]:
    require_writable_result(output, inputs=(path, options.mask))
    return _decompose_photo(photo, path, output, options, settings, prior_set, monitor)


def _decompose_several(
    options: argparse.Namespace, settings: Settings, prior_set: PriorSet | None, monitor: Monitor
) -> list[str]:
    """Decompose each photo into a separate folder; one that fails does not stop the others."""
    for option in ("mask", "shape", "depth"):
        if getattr(options, option) is not None:
            raise InputError(
                f"--{option} applies to one photo: give one photo, or list photos and masks in a "
                "manifest (see `isc batch --help`)"
            )
    if hints_of(options):
        raise InputError("--box, --point and --not apply to one photo: give one photo")
    _require_no_result(options.output)
    works = {
        path.name: partial(_decompose_one, path, output, options, settings, prior_set)
        for path, output in _outputs(options.photo, options.output)
    }
    return do_all("photos", works, monitor)


def _outputs(photos: list[Path], folder: Path) -> Iterator[tuple[Path, Path]]:
    """Each photo and the folder of its result."""
    from ...batch.names import safe_name

    seen: dict[str, Path] = {}
    for path in photos:
        if path == STDIN:
            raise InputError("- reads one photo from standard input: give no other photo")
        name = safe_name(path.stem)
        other = seen.setdefault(name.casefold(), path)
        if other is not path:
            raise InputError(
                f"{other} and {path} would both be written to {folder / name}: decompose them "
                "into different folders"
            )
        yield path, folder / name


def _known_inputs(options: argparse.Namespace, photo: Photo) -> KnownInputs:
    if options.shape is options.light is options.depth is None:
        return KnownInputs()
    from ...result_files.known_inputs import read_height, read_light

    size, scale, limits = photo.mask.shape, options.height_scale, limits_of(options)
    return KnownInputs(
        height=None if options.shape is None else read_height(options.shape, size, scale, limits),
        light=None if options.light is None else read_light(options.light),
        depth=None if options.depth is None else read_height(options.depth, size, scale, limits),
        depth_sigma=options.depth_sigma,
        depth_weight=options.depth_weight,
    )


def _detail_notes(settings: Settings, length: int, longest: int) -> tuple[str, ...]:
    """Notes if finer relief was requested than the resolution of the maps, in which the object is
    `length` pixels long; it is `longest` in the photo.
    """
    if settings.detail <= max(length, Settings.detail):
        return ()
    remedy = "as in the photo" if length >= longest else "use --max-size 0 for more"
    return (
        f"note: the object is {length} pixels long in the maps, not {settings.detail}: {remedy}",
    )


def _pixels(photo: Photo, settings: Settings) -> int:
    """Number of the object's pixels in the maps."""
    longest = max(photo.box[2:])
    length = min(settings.maps_size or longest, longest)
    return round(int(photo.mask.sum()) * (length / longest) ** 2)
