"""`isc edit RESULT highlight`: a new highlight on the recovered shape."""

import argparse

import numpy as np

from ....editing.highlights import add_highlight
from ....editing.lobes import known_lobe
from ....editing.spheres import render_sphere
from ....errors import InputError
from ....lobe_fitting.light_direction import (
    explain_shading,
    explain_specular,
)
from ....scene.decomposition import Decomposition
from ....scene.part_of_result import ResultPart
from ....shading.lights import DirectionalLight, toward
from ....shading.lobe_rendering import Lobe
from ...interface.values import finite
from .action import ActionResult, EditAction
from .options import add_direction, add_lobe, lobe_of, plain
from .panels import sphere_panel

_DEFAULT_LEVEL = 0.7


def _act(stored: ResultPart, options: argparse.Namespace) -> ActionResult:
    d = stored.result
    lobe = lobe_of(options) or known_lobe(d) or Lobe()
    light = _chosen_light(d, options)
    level = options.strength if options.replace or options.strength is not None else _DEFAULT_LEVEL
    edit = add_highlight(d, light, lobe, level=level, replacing=options.replace)
    sphere = sphere_panel(
        render_sphere(light, exponent=lobe.nearest_exponent)[0], "The light", "on a white sphere"
    )
    return ActionResult(edit, {"direction": plain(light.direction)}, (sphere,))


def _chosen_light(d: Decomposition, options: argparse.Namespace) -> DirectionalLight:
    color = np.ones(3) if options.color is None else options.color
    if options.direction is not None:
        if options.like is not None:
            raise InputError("--direction and --like both set the light: give one of them")
        return DirectionalLight(toward(*options.direction), np.pi * color)
    estimate = explain_specular(d) if options.like == "specular" else explain_shading(d)
    if not estimate.light.irradiance.any():
        raise InputError(
            f"the {options.like or 'shading'} does not determine a light: give --direction X Y Z"
        )
    tint = estimate.light.irradiance / estimate.light.irradiance.max()
    return DirectionalLight(
        estimate.light.direction, np.pi * (tint if options.color is None else color)
    )


def _add_options(parser: argparse.ArgumentParser) -> None:
    add_direction(parser)
    parser.add_argument(
        "--like",
        choices=("shading", "specular"),
        help="without --direction: the light that best explains the shading (default) or the "
        "existing highlights",
    )
    add_lobe(parser)
    parser.add_argument(
        "--strength",
        type=finite,
        metavar="S",
        help="1: as bright as the photo's white (default 0.7; with --replace, the energy of the "
        "existing highlights)",
    )
    parser.add_argument("--replace", action="store_true", help="remove the existing highlights")


ACTION = EditAction("highlight", "add a highlight on the recovered shape", _act, _add_options)
