"""`isc edit RESULT relight`: the recovered light rotated, or another light."""

import argparse
from pathlib import Path

import numpy as np

from ....editing.relight import HIGHLIGHTS, NewLight, Relighting, relight
from ....errors import InputError
from ....io.npy import read_array
from ....photo import read_linear
from ....result_files.known_inputs import read_light
from ....scene.decomposition import Decomposition
from ....scene.part_of_result import ResultPart
from ....shading.lights import DirectionalLight, toward, turn, turned_light
from ....shading.sphere import sphere_normals
from ...interface.options import limits_of
from ...interface.values import finite
from .action import ActionResult, EditAction
from .options import add_direction, add_lobe, lobe_of, plain
from .panels import recovered_light_panel, sphere_panel

_COEFFICIENTS = ("", ".json", ".npy")  # suffixes of lights that are not images


def _act(stored: ResultPart, options: argparse.Namespace) -> ActionResult:
    d = stored.result
    rotation = turn(options.yaw, options.pitch, options.roll)
    light, fixed = _new_light(d, options, rotation)
    lobe = lobe_of(options)
    if lobe is not None and options.highlights not in ("auto", "render"):
        raise InputError(
            "--exponent and --alpha apply to rendered highlights, not to --highlights "
            f"{options.highlights}: give one of them"
        )
    choice = Relighting(options.highlights, lobe, options.exposure, not fixed)
    edit = relight(d, light, choice)
    sphere = sphere_panel(
        light.shading(sphere_normals(320)[0].reshape(-1, 3)).reshape(320, 320, 3),
        "New light",
        "on a white sphere",
    )
    measured = {} if light.coefficients is None else {"coefficients": plain(light.coefficients)}
    return ActionResult(edit, measured, (recovered_light_panel(d), sphere))


def _new_light(
    d: Decomposition, options: argparse.Namespace, rotation: np.ndarray
) -> tuple[NewLight, bool]:
    """The light, and whether to keep its brightness."""
    rotated = not np.array_equal(rotation, np.eye(3))
    if options.light is not None and options.direction is not None:
        raise InputError("--light and --direction both set the light: give one of them")
    if options.direction is None and (options.color is not None or options.ambient is not None):
        raise InputError("--colour and --ambient require --direction: add it")
    if options.direction is not None:
        color = np.ones(3) if options.color is None else options.color
        ambient = 0.15 if options.ambient is None else options.ambient
        return NewLight(
            directional=DirectionalLight(
                rotation @ toward(*options.direction), np.pi * color, ambient * color
            )
        ), False
    if (
        options.light is not None
        and not options.light.is_dir()
        and options.light.suffix.lower() not in _COEFFICIENTS
    ):
        if rotated:
            raise InputError(
                "an environment map cannot be rotated here: rotate the image itself, or give a "
                "direction"
            )
        return NewLight(
            environment=read_linear(options.light, limits=limits_of(options), finite=True)
        ), False
    if options.light is None:
        return NewLight(
            coefficients=turned_light(d.illumination, rotation), rotation=rotation
        ), True
    return NewLight(coefficients=turned_light(_read_coefficients(options.light), rotation)), True


def _read_coefficients(path: Path) -> np.ndarray:
    if path.suffix.lower() != ".npy":
        return read_light(path)
    light = read_array(path)
    if light.shape != (9, 3) or light.dtype.kind not in "fiu" or not np.isfinite(light).all():
        raise InputError(f"{path} is not a light: expected an array of 9 x 3 numbers")
    return light.astype(float)


def _add_options(parser: argparse.ArgumentParser) -> None:
    for name, text in (
        ("yaw", "front to the right"),
        ("pitch", "top to the front"),
        ("roll", "right side up"),
    ):
        parser.add_argument(
            f"--{name}",
            type=finite,
            default=0.0,
            metavar="DEGREES",
            help=f"rotation of the light: {text}",
        )
    parser.add_argument(
        "--light",
        type=Path,
        metavar="FILE",
        help="another light: a result folder, a JSON file or .npy of 9 x 3 coefficients, or an "
        "environment map (twice as wide as high)",
    )
    add_direction(parser)
    parser.add_argument(
        "--ambient",
        type=finite,
        metavar="A",
        help="ambient light relative to that of --direction (default 0.15)",
    )
    parser.add_argument(
        "--exposure",
        type=finite,
        default=1.0,
        metavar="F",
        help="factor of the new light (default %(default)s)",
    )
    parser.add_argument(
        "--highlights",
        choices=HIGHLIGHTS,
        default="auto",
        help="treatment of highlights (auto: rendered if a lobe is fitted or given, else scaled "
        "with the shading)",
    )
    add_lobe(parser)


ACTION = EditAction(
    "relight", "rotate the recovered light, or use another light", _act, _add_options
)
