"""`isc edit RESULT dichromatic`: the diffuse and the specular layer, edited separately."""

import argparse

from ....editing.dichromatic import DichromaticEdit, LayerEdit, edit_layers
from ....errors import InputError
from ....scene.part_of_result import ResultPart
from ...interface.values import finite
from .action import ActionResult, EditAction


def _act(stored: ResultPart, options: argparse.Namespace) -> ActionResult:
    layers = []
    for layer in ("diffuse", "specular"):
        values = {
            name: getattr(options, f"{layer}_{name}")
            for name in ("gain", "gamma", "sharpen", "radius")
        }
        if options.remove == layer:
            if LayerEdit(**values) != LayerEdit():
                raise InputError(
                    f"--remove {layer} and --{layer}-... exclude each other: give one of them"
                )
            values["gain"] = 0.0
        layers.append(LayerEdit(**values))
    return ActionResult(edit_layers(stored.result, DichromaticEdit(*layers)), {})


def _add_options(parser: argparse.ArgumentParser) -> None:
    defaults = LayerEdit()
    parser.add_argument(
        "--remove",
        choices=("diffuse", "specular"),
        help="remove this layer, and keep the other unchanged",
    )
    for layer in ("diffuse", "specular"):
        group = parser.add_argument_group(f"the {layer} layer")
        for name, text in (
            ("gain", "factor of its light, at least 0"),
            ("gamma", "above 1: more contrast"),
            ("sharpen", "amount of detail added; -1 removes it"),
            ("radius", "size of detail, in pixels of the maps"),
        ):
            group.add_argument(
                f"--{layer}-{name}",
                type=finite,
                default=getattr(defaults, name),
                metavar="N",
                help=f"{text} (default %(default)s)",
            )


ACTION = EditAction(
    "dichromatic", "edit the diffuse and the specular layer separately", _act, _add_options
)
