"""`isc edit RESULT light-direction`: the best single light for the shading and the highlights."""

import argparse

from ....editing.relight import NewLight, Relighting, relight
from ....lobe_fitting.light_direction import (
    DirectionEstimate,
    explain_shading,
    explain_specular,
    share_explained,
)
from ....networks.scene_network import predict_scene
from ....result_files.panels import Panel
from ....scene.decomposition import Decomposition
from ....scene.light_estimate import LightEstimate
from ....scene.part_of_result import ResultPart
from ....shading.lights import DirectionalLight, toward
from .action import ActionResult, EditAction
from .options import plain
from .panels import directional_sphere, empty_panel, recovered_light_panel, sphere_panel

_OTHER_LIGHTS = (
    ("from the left", (-0.8, 0.2, 0.5)),
    ("from the right", (0.8, 0.2, 0.5)),
    ("from above", (0.0, 0.85, 0.5)),
    ("from below", (0.0, -0.85, 0.5)),
    ("from the front", (0.0, 0.0, 1.0)),
)


def _act(stored: ResultPart, options: argparse.Namespace) -> ActionResult:
    del options
    d = stored.result
    shading, specular = explain_shading(d), explain_specular(d)
    edit = relight(d, NewLight(directional=shading.light), Relighting(highlights="keep"))
    panels = [recovered_light_panel(d)]
    for label, estimate in (
        ("Best for the shading", shading),
        ("Best for the highlights", specular),
    ):
        remark = _remark(estimate)
        panels.append(
            sphere_panel(directional_sphere(estimate.light, estimate.exponent), label, remark)
            if estimate.determined
            else empty_panel(label, remark)
        )
    light_estimate = predict_scene(d.image, d.mask).lamps
    panels.append(_predicted_panel(d, light_estimate))
    for label, direction in _OTHER_LIGHTS:
        _, share = share_explained(d, toward(*direction))
        panels.append(
            sphere_panel(
                directional_sphere(DirectionalLight(toward(*direction))),
                f"Light {label}",
                f"explains {100 * share:.0f} %",
            )
        )
    measured = {
        "shading": _record(shading),
        "specular": _record(specular),
        "light_estimate": _predicted_record(light_estimate),
    }
    lines = [
        f"{label}: {_line(estimate)}"
        for label, estimate in (("shading", shading), ("highlights", specular))
    ]
    lines.append(f"predicted: {_predicted_line(light_estimate)}")
    return ActionResult(edit, measured, tuple(panels), None, tuple(lines), layers=False)


def _remark(estimate: DirectionEstimate) -> str:
    return (
        f"explains {100 * estimate.explained:.0f} %, ± {estimate.cone:.0f}°"
        if estimate.determined
        else "undetermined"
    )


def _line(estimate: DirectionEstimate) -> str:
    if not estimate.determined:
        return (
            f"undetermined: no single light explains it ({100 * estimate.explained:.0f} % at best)"
        )
    x, y, z = estimate.light.direction
    lobe = "" if estimate.exponent is None else f", exponent {estimate.exponent:.0f}"
    share = f"explains {100 * estimate.explained:.0f} %"
    return (
        f"from {x:.3f} {y:.3f} {z:.3f} (right, up, toward the viewer) "
        f"± {estimate.cone:.1f} degrees on this shape, {share}{lobe}"
    )


def _record(estimate: DirectionEstimate) -> dict[str, object]:
    light = estimate.light
    return {
        "determined": estimate.determined,
        "direction": plain(light.direction),
        "irradiance": plain(light.irradiance),
        "ambient": plain(light.ambient),
        "explained": estimate.explained,
        "cone_degrees": estimate.cone,
        "exponent": estimate.exponent,
    }


def _predicted_panel(d: Decomposition, light_estimate: LightEstimate) -> Panel:
    label, remark = "Predicted", _most_likely(light_estimate)
    if not light_estimate.determined:
        return empty_panel(label, remark)
    light, share = share_explained(d, light_estimate.direction)
    return sphere_panel(
        directional_sphere(light),
        label,
        f"explains {100 * share:.0f} %, ± {light_estimate.cone:.0f}°, {remark}",
    )


def _most_likely(light_estimate: LightEstimate) -> str:
    shares = {
        "smooth light": light_estimate.none,
        "one source": light_estimate.one,
        "several sources": light_estimate.several,
    }
    likely = max(shares, key=lambda name: shares[name])
    return f"{likely} ({100 * shares[likely]:.0f} %)"


def _predicted_line(light_estimate: LightEstimate) -> str:
    if not light_estimate.determined:
        return f"{_most_likely(light_estimate)}, direction undetermined"
    x, y, z = light_estimate.direction
    return (
        f"{_most_likely(light_estimate)}, the strongest from {x:.3f} {y:.3f} {z:.3f} "
        f"± {light_estimate.cone:.1f} degrees, independent of the shape"
    )


def _predicted_record(light_estimate: LightEstimate) -> dict[str, object]:
    return {
        "determined": light_estimate.determined,
        "direction": plain(light_estimate.direction),
        "cone_degrees": light_estimate.cone,
        "lamps": {
            "none": light_estimate.none,
            "one": light_estimate.one,
            "several": light_estimate.several,
        },
    }


def _add_nothing(parser: argparse.ArgumentParser) -> None:
    del parser


ACTION = EditAction(
    "light-direction",
    "estimate the single light that best explains the shading, and the highlights",
    _act,
    _add_nothing,
)
