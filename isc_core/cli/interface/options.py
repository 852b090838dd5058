"""Options that commands share: the photo, its limits, the settings, the engine."""

import argparse
from pathlib import Path

from ...decomposition.settings import (
    ILLUMINATIONS,
    LIGHT_PRIORS,
    MODEL_SUMMARIES,
    SHAPE_PRIORS,
    Settings,
)
from ...io.limits import DEFAULT_LIMITS, Limits
from ...photo import TRANSFERS
from ...result_files.mesh.options import MeshOptions
from ...separation import SUMMARIES
from .parser import table
from .values import count, current_name, not_negative, pixel, whole

Group = argparse._ArgumentGroup


def add_photo(parser: argparse.ArgumentParser, *, several: bool = False) -> None:
    """Add PHOTO.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    several : bool
        Accept more than one.
    """
    parser.add_argument(
        "photo",
        metavar="PHOTO",
        type=Path,
        nargs="+" if several else None,
        help="PNG, JPEG, TIFF, HEIC, AVIF, camera raw, EXR, HDR, BMP, PPM, PGM or NumPy .npy; - "
        "reads standard input",
    )


def add_mask(group: Group) -> None:
    """Add --mask.

    Parameters
    ----------
    group : argparse._ArgumentGroup
        Changed in place.
    """
    group.add_argument(
        "--mask",
        type=Path,
        metavar="MASK",
        help="image of the photo's size with the object white on black (default: the photo's "
        "alpha channel, else the pixels that are not black, else the object that is found)",
    )


def add_pixels(group: argparse.ArgumentParser | Group, option: str, name: str, of: str) -> None:
    """Add an option that takes a pixel and can be repeated.

    Parameters
    ----------
    group : argparse.ArgumentParser or argparse._ArgumentGroup
        Changed in place.
    option : str
        Such as --point.
    name : str
        Name of the list of (x, y) in the parsed options.
    of : str
        What the pixels mark, for the help.
    """
    group.add_argument(
        option,
        type=pixel,
        action="append",
        default=[],
        dest=name,
        metavar="x,y",
        help=f"a pixel of {of}, counted from the top left; can be repeated",
    )


def add_output(
    group: Group, what: str = "the folder to write; an earlier result is replaced"
) -> None:
    """Add -o DIR.

    Parameters
    ----------
    group : argparse._ArgumentGroup
        Changed in place.
    what : str
        Help text of the option.
    """
    group.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help=what)


def add_open(group: Group) -> None:
    """Add --open.

    Parameters
    ----------
    group : argparse._ArgumentGroup
        Changed in place.
    """
    group.add_argument(
        "--open", action="store_true", help="show the preview in the system's viewer when done"
    )


def add_transfer(parser: argparse.ArgumentParser | Group) -> None:
    """Add --transfer.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    """
    parser.add_argument(
        "--transfer",
        choices=TRANSFERS,
        default="auto",
        help="transfer curve of the photo (auto: that of the file, else sRGB; floats are linear)",
    )


def add_limits(parser: argparse.ArgumentParser | Group) -> None:
    """Add --max-pixels.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    """
    parser.add_argument(
        "--max-pixels",
        type=whole,
        default=DEFAULT_LIMITS.max_pixels,
        metavar="N",
        help="refuse images with more pixels (width x height) before decoding them "
        "(default %(default)s)",
    )


def limits_of(options: argparse.Namespace) -> Limits:
    """Return the limits of files that a command reads.

    Parameters
    ----------
    options : argparse.Namespace

    Returns
    -------
    Limits
    """
    return Limits(max_pixels=options.max_pixels)


def add_main_settings(group: Group) -> None:
    """Add the settings that users change most: --model, --max-size, --full-size, --detail,
    --arrays.

    Parameters
    ----------
    group : argparse._ArgumentGroup
        Changed in place.
    """
    defaults = Settings()
    group.add_argument(
        "--model",
        default=defaults.model,
        metavar="NAME",
        help=f"decomposition model, see below (default {defaults.model})",
    )
    group.add_argument(
        "--max-size",
        type=count,
        default=defaults.max_size,
        metavar="N",
        help="long side of the object in the maps, in pixels (default %(default)s; 0: the photo's)",
    )
    group.add_argument(
        "--full-size", action="store_true", help="maps of the photo's size, like --max-size 0"
    )
    group.add_argument(
        "--detail",
        type=count,
        default=defaults.detail,
        metavar="N",
        help="long side of the object at which the finest relief is recovered, in pixels, with "
        "--illumination photo (default %(default)s; 0: only the overall shape)",
    )
    group.add_argument(
        "--arrays",
        action="store_true",
        help="also write arrays.npz: everything as plain NumPy arrays, for other programs",
    )


def add_triangles(group: Group | argparse.ArgumentParser) -> None:
    """Add --triangles.

    Parameters
    ----------
    group : argparse._ArgumentGroup or argparse.ArgumentParser
        Changed in place.
    """
    group.add_argument(
        "--triangles",
        type=count,
        default=MeshOptions().triangles,
        metavar="N",
        help="maximum number of triangles of the mesh, unless its outline alone needs more; finer "
        "detail is in the normal map (default %(default)s; 0: a vertex at each pixel)",
    )


def add_model_settings(parser: argparse.ArgumentParser) -> None:
    """Add the other options of `Settings` except --engine and --threads; and --priors.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    """
    defaults = Settings()
    group = parser.add_argument_group("model")
    group.add_argument(
        "--separator",
        default=defaults.separator,
        metavar="NAME",
        help=f"for joint, mdr and mbp: separation method, see below (default {defaults.separator})",
    )
    _add_scene_settings(group, defaults)
    group.add_argument(
        "--highlight-odds",
        type=not_negative,
        default=defaults.highlight_odds,
        metavar="N",
        help="for joint: odds of a highlight against print that removed light must exceed; 1: "
        "remove what is more likely a highlight, 0: remove all that colour and shape find "
        "(default %(default)s)",
    )
    group.add_argument(
        "--shading-only",
        action="store_true",
        help="assume that the object has one colour (shape from shading)",
    )
    group.add_argument(
        "--confidence-weights",
        action="store_true",
        help="for joint and mdr: weight pixels by the confidence of their separation",
    )
    group.add_argument(
        "--priors",
        type=Path,
        metavar="FILE",
        help="priors written by isc fit-priors (default: those of the package)",
    )
    group.add_argument(
        "--seed",
        type=count,
        default=defaults.seed,
        metavar="N",
        help="random seed, recorded in the result (default %(default)s)",
    )


def _add_scene_settings(group: argparse._ArgumentGroup, defaults: Settings) -> None:
    """What is assumed of light, shape and camera."""
    group.add_argument(
        "--illumination",
        choices=ILLUMINATIONS,
        default=defaults.illumination,
        help="kind of photo: any of balanced colours, or an object of MIT-Berkeley in natural or "
        "laboratory light (default %(default)s)",
    )
    group.add_argument(
        "--light-colour",
        type=current_name("light_colour"),
        default=defaults.light_colour,
        metavar="NAME|r,g,b",
        help="colour of the light: balanced (nearly white, after the camera's white balance), "
        "estimate (from the highlights if they determine it), free, toned (a grey photo with a "
        "tone, such as sepia), or three linear numbers (default %(default)s)",
    )
    group.add_argument(
        "--light-prior",
        type=current_name("light_prior"),
        choices=LIGHT_PRIORS,
        default=defaults.light_prior,
        help="prior of the light: predicted from the photo, or that of the data set "
        "(default %(default)s)",
    )
    group.add_argument(
        "--shape-prior",
        type=current_name("shape_prior"),
        choices=SHAPE_PRIORS,
        default=defaults.shape_prior,
        help="prior of the shape: predicted from the photo, or from its silhouette only "
        "(default %(default)s)",
    )
    group.add_argument(
        "--camera",
        default=defaults.camera,
        metavar="NAME|MM",
        help="auto (the focal length in the photo's EXIF, orthographic without it), orthographic, "
        "or a 35 mm equivalent focal length in mm, based on the diagonal (default %(default)s)",
    )


def names_table() -> str:
    """Return the models and the separation methods with a line each, for the help.

    Returns
    -------
    str
    """
    return f"{table('models', MODEL_SUMMARIES)}\n\n{methods_table()}"


def methods_table() -> str:
    """Return the separation methods with a line each, for the help.

    Returns
    -------
    str
    """
    return table("separation methods", SUMMARIES)


def add_engine(
    parser: argparse.ArgumentParser | Group, threads: str = "number of threads (0: one per core)"
) -> None:
    """Add --engine and --threads.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    threads : str
        Help text of --threads.
    """
    parser.add_argument(
        "--engine",
        choices=("auto", "numba", "numpy"),
        default="auto",
        help="compiled kernels, or plain NumPy (auto: compiled if possible)",
    )
    parser.add_argument("--threads", type=count, default=0, metavar="N", help=threads)
