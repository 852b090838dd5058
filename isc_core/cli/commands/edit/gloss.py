"""`isc edit RESULT gloss`: sharper, rougher or metallic gloss."""

import argparse

from ....editing.blinn_phong_extension import METHODS, Gloss, change_gloss
from ....errors import InputError
from ....scene.part_of_result import ResultPart
from ...interface.values import finite
from .action import ActionResult, EditAction

_LOOKS = {
    "glossier": {"sharper": 2.5, "gain": 1.5},
    "rougher": {"sharper": 0.4},
    "metallic": {"metal": 1.0},
}


def _act(stored: ResultPart, options: argparse.Namespace) -> ActionResult:
    preset: dict[str, float] = _LOOKS.get(options.look, {})
    if options.present is not None and options.exponent is None and "sharper" not in preset:
        raise InputError("--present requires a new sharpness: add --exponent or --look")
    if options.exponent is not None and "sharper" in preset:
        raise InputError(
            f"--exponent and --look {options.look} both set the sharpness: give one of them"
        )
    sharper = preset.get("sharper", 1.0)
    metal = options.metal if options.metal is not None else preset.get("metal", 0.0)
    gain = options.gain if options.gain is not None else preset.get("gain", 1.0)
    gloss = Gloss(options.exponent, sharper, options.present, gain, metal, options.method)
    return ActionResult(change_gloss(stored.result, gloss), {})


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--look",
        choices=tuple(_LOOKS),
        help="preset: a sharper and stronger lobe, a wider one, or metal",
    )
    parser.add_argument(
        "--exponent", type=finite, metavar="P", help="the new Blinn-Phong exponent, 1 to 1e5"
    )
    parser.add_argument(
        "--present", type=finite, metavar="P", help="the current exponent (default: fitted)"
    )
    parser.add_argument(
        "--gain",
        type=finite,
        metavar="G",
        help="factor of the highlights (default 1; 1.5 for --look glossier)",
    )
    parser.add_argument(
        "--metal",
        type=finite,
        metavar="M",
        help="metalness, 0 to 1 (default 0; 1 for --look metallic)",
    )
    parser.add_argument(
        "--method",
        choices=METHODS,
        default=Gloss().method,
        help="change the existing highlights (default), or render new ones on the shape",
    )


ACTION = EditAction("gloss", "make the object glossier, rougher or metallic", _act, _add_options)
