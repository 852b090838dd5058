"""`isc edit`: another light, gloss or colour for a decomposed photo."""

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...editing.blinn_phong_extension import METHODS, Gloss, change_gloss
from ...editing.clusters import Clusters, find_clusters
from ...editing.dichromatic import DichromaticEdit, LayerEdit, edit_layers
from ...editing.edit_folder import Original, Record, Sheet, require_writable_edit, save_edit
from ...editing.edited import Edited
from ...editing.highlights import add_highlight
from ...editing.lobes import known_lobe
from ...editing.recolour import Paint, recolour
from ...editing.relight import HIGHLIGHTS, NewLight, Relighting, relight
from ...editing.spheres import render_sphere, sphere_normals
from ...errors import InputError
from ...imaging.srgb import linear_to_srgb, srgb_to_linear
from ...io.limits import Limits
from ...io.npy import read_array
from ...io.printable_names import readable
from ...lobe_fitting.light_direction import (
    DirectionEstimate,
    explain_shading,
    explain_specular,
    share_explained,
)
from ...networks.light_network import predict_light
from ...photo import TRANSFERS, read_linear, read_photo, read_raster
from ...progress import Monitor
from ...result_files.contact_sheet import Panel
from ...result_files.known_inputs import read_light
from ...result_files.result_folder import load
from ...scene.decomposition import Decomposition
from ...scene.light_estimate import LightEstimate
from ...shading.lights import DirectionalLight, toward, turn, turned_light
from ...shading.lobe_rendering import USUAL_EXPONENT, Lobe
from ...shading.spherical_harmonics import real_sh
from ..interface.options import (
    Commands,
    Parser,
    add_command,
    add_limits,
    add_speech,
    count,
    hints,
    limits_of,
)

_EXAMPLES = """  isc edit cup light-direction -o light                                where the light is, and how sure that is
  isc edit cup highlight --direction -0.5 0.6 0.6 -o glint             a new highlight
  isc edit cup gloss --look metallic -o metal
  isc edit cup dichromatic --remove specular --photo cup.png -o matt   the same in the photo itself, at its size
  isc edit cup recolour --cluster 2 --color 2060c0 -o blue             clusters.png shows the parts
  isc edit cup relight --yaw 60 -o turned

every action takes --photo, --mask, --transfer and -o; `isc edit RESULT ACTION --help` shows what else."""

_LOOKS = {
    "glossier": {"sharper": 2.5, "gain": 1.5},
    "rougher": {"sharper": 0.4},
    "metallic": {"metal": 1.0},
}
_OTHER_LIGHTS = (
    ("from the left", (-0.8, 0.2, 0.5)),
    ("from the right", (0.8, 0.2, 0.5)),
    ("from above", (0.0, 0.85, 0.5)),
    ("from below", (0.0, -0.85, 0.5)),
    ("from the front", (0.0, 0.0, 1.0)),
)
_USUAL_LEVEL = 0.7
_OF_THE_COMMAND = ("run", "act", "quiet", "progress", "output", "action", "usual", "max_pixels")
_COEFFICIENTS = ("", ".json", ".npy")  # files of lights that are no pictures


@dataclass(frozen=True)
class _Done:
    """What an action hands back: the edit, what it measured (JSON-ready), panels for the sheet, the
    clusters, lines for people; whether the sheet shows the layers.
    """

    edit: Edited
    measured: Mapping[str, object]
    panels: tuple[Panel, ...] = ()
    clusters: Clusters | None = None
    lines: tuple[str, ...] = ()
    layers: bool = True


def declare(commands: Commands) -> None:
    """Adds the command to the parser."""
    parser = add_command(
        commands,
        "edit",
        run,
        "other light, gloss or colour for a decomposed photo",
        "Edits what isc decompose found: RESULT is its folder. Writes a folder with the picture (edited.png, edited.exr), "
        "before_after.png (look at this first) and edit.json. With --photo the edit is brought back into the photo, "
        "at its size and in its coding.",
        _EXAMPLES,
    )
    parser.add_argument(
        "result", type=Path, metavar="RESULT", help="a folder that isc decompose wrote"
    )
    actions = parser.add_subparsers(
        title="actions", metavar="ACTION", required=True, dest="action", parser_class=Parser
    )
    for name, summary, act, add in _ACTIONS:
        action = actions.add_parser(
            name, help=summary, description=f"{summary[0].upper()}{summary[1:]}."
        )
        action.set_defaults(act=act)
        add(action)
        _add_common(action)


def run(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Does the work; what can be wrong is found before anything is written."""
    read = (getattr(options, name, None) for name in ("photo", "mask", "region", "light"))
    require_writable_edit(options.output, read)
    if options.photo is None and (options.mask is not None or options.transfer is not None):
        raise InputError("--mask and --transfer say how --photo is read: give it too")
    monitor.report("reading", 0.0)
    d = load(options.result)
    if not d.mask.any():
        raise InputError(
            f"{options.result} has an empty mask: it is damaged; decompose the photo again"
        )
    _require_sound(d, options.result)
    monitor.report("editing", 0.2)
    done = options.act(d, options)
    original = None if options.photo is None else _original(d, options)
    notes = [*done.edit.notes, *_notes(d, done, original)]
    monitor.report("writing", 0.7)
    parameters = {
        name: _plain(value) for name, value in vars(options).items() if name not in _OF_THE_COMMAND
    }
    name = Path(str(d.provenance.input.get("name", ""))).name or options.result.name
    sheet = Sheet(f"{name}: {options.action}", _said(options), done.panels, done.layers)
    record = Record(options.action, parameters, done.measured)
    edit = replace(done.edit, notes=tuple(notes))
    save_edit(d, edit, options.output, record, sheet, original=original, clusters=done.clusters)
    monitor.report("writing", 1.0)
    return [
        *done.lines,
        *hints(
            options,
            *(f"note: {note}" for note in notes),
            f"look at {options.output / 'before_after.png'}",
        ),
    ]


def _require_sound(d: Decomposition, folder: Path) -> None:
    """Raises `InputError` for a result that no decomposition gives: an edit would divide by its
    zeros.
    """
    broken = list(d.identity_errors().broken())
    broken += [
        f"{name} >= 0"
        for name in ("image", "diffuse", "specular", "reflectance", "shading")
        if getattr(d, name)[d.mask].min() < 0
    ]
    if broken:
        raise InputError(
            f"{folder} does not keep to {broken[0]}: it is damaged; decompose the photo again"
        )


def _notes(d: Decomposition, done: _Done, original: Original | None) -> list[str]:
    """What is to be said beside what the edit itself says."""
    notes = []
    if original is not None and d.provenance.input.get("sha256") != original.photo.original.sha256:
        notes.append(
            "the photo's file is not the one that was decomposed; the edit is brought into it all the same"
        )
    if done.layers and np.array_equal(done.edit.image, d.image):
        notes.append("the picture stays as it was: nothing of what was asked for changes it")
    return notes


# --- the actions ----------------------------------------------------------------------------------


def _light_direction(d: Decomposition, options: argparse.Namespace) -> _Done:
    del options
    shading, specular = explain_shading(d), explain_specular(d)
    edit = relight(d, NewLight(sun=shading.light), Relighting(highlights="keep"))
    panels = [_recovered_ball(d)]
    for label, found in (("Best for the shading", shading), ("Best for the highlights", specular)):
        remark = _short(found)
        panels.append(
            _ball(_directed(found.light, found.exponent), label, remark)
            if found.determined
            else _no_ball(label, remark)
        )
    light_estimate = predict_light(d.image, d.mask)
    panels.append(_ball_of_glance(d, light_estimate))
    for label, direction in _OTHER_LIGHTS:
        _, share = share_explained(d, toward(*direction))
        panels.append(
            _ball(
                _directed(DirectionalLight(toward(*direction))),
                f"Light {label}",
                f"explains {100 * share:.0f} %",
            )
        )
    measured = {
        "shading": _measured(shading),
        "specular": _measured(specular),
        "light_estimate": _measured_glance(light_estimate),
    }
    lines = [
        f"{label}: {_long(found)}"
        for label, found in (("shading", shading), ("highlights", specular))
    ]
    lines.append(f"at first sight: {_long_glance(light_estimate)}")
    return _Done(edit, measured, tuple(panels), None, tuple(lines), layers=False)


def _highlight(d: Decomposition, options: argparse.Namespace) -> _Done:
    lobe = _lobe(options) or known_lobe(d) or Lobe()
    light = _chosen_light(d, options)
    level = options.strength if options.replace or options.strength is not None else _USUAL_LEVEL
    edit = add_highlight(d, light, lobe, level=level, replacing=options.replace)
    ball = _ball(
        render_sphere(light, exponent=lobe.nearest_exponent)[0], "The light", "on a white ball"
    )
    return _Done(edit, {"direction": _plain(light.direction)}, (ball,))


def _gloss(d: Decomposition, options: argparse.Namespace) -> _Done:
    usual: dict[str, float] = _LOOKS.get(options.look, {})
    if options.present is not None and options.exponent is None and "sharper" not in usual:
        raise InputError(
            "--present says how sharp the gloss is now: say how sharp it shall be, with --exponent or --look"
        )
    if options.exponent is not None and "sharper" in usual:
        raise InputError(
            f"--exponent says how sharp, and so does --look {options.look}: give one of them"
        )
    sharper = usual.get("sharper", 1.0)
    metal = options.metal if options.metal is not None else usual.get("metal", 0.0)
    gain = options.gain if options.gain is not None else usual.get("gain", 1.0)
    gloss = Gloss(options.exponent, sharper, options.present, gain, metal, options.method)
    return _Done(change_gloss(d, gloss), {})


def _dichromatic(d: Decomposition, options: argparse.Namespace) -> _Done:
    layers = []
    for layer in ("diffuse", "specular"):
        values = {
            name: getattr(options, f"{layer}_{name}")
            for name in ("gain", "gamma", "sharpen", "radius")
        }
        if options.remove == layer:
            if LayerEdit(**values) != LayerEdit():
                raise InputError(
                    f"--remove {layer} leaves nothing that --{layer}-... could change: give one of them"
                )
            values["gain"] = 0.0
        layers.append(LayerEdit(**values))
    return _Done(edit_layers(d, DichromaticEdit(*layers)), {})


def _recolour(d: Decomposition, options: argparse.Namespace) -> _Done:
    paint = Paint(
        options.hue, options.saturation, options.value, options.color, options.match_brightness
    )
    if options.cluster is not None and options.region is not None:
        raise InputError("--cluster and --region both say where: give one of them")
    clusters = find_clusters(d, options.clusters, options.seed)
    region = None
    if options.cluster is not None:
        region = clusters.weight(options.cluster)
    elif options.region is not None:
        region = _read_region(options.region, d, limits_of(options))
    measured = {
        "clusters": [
            {"color": _plain(c), "share": float(s)}
            for c, s in zip(clusters.colors, clusters.shares, strict=True)
        ]
    }
    return _Done(recolour(d, paint, region), measured, (), clusters)


def _relight(d: Decomposition, options: argparse.Namespace) -> _Done:
    rotation = turn(options.yaw, options.pitch, options.roll)
    light, fixed = _new_light(d, options, rotation)
    lobe = _lobe(options)
    if lobe is not None and options.highlights not in ("auto", "render"):
        raise InputError(
            f"--exponent and --alpha are of rendered highlights, not of --highlights {options.highlights}: give one of them"
        )
    choice = Relighting(options.highlights, lobe, options.exposure, not fixed)
    edit = relight(d, light, choice)
    ball = _ball(
        light.shading(sphere_normals(320)[0].reshape(-1, 3)).reshape(320, 320, 3),
        "New light",
        "on a white ball",
    )
    measured = {} if light.coefficients is None else {"coefficients": _plain(light.coefficients)}
    return _Done(edit, measured, (_recovered_ball(d), ball))


# --- lights, lobes, regions, photos ---------------------------------------------------------------


def _chosen_light(d: Decomposition, options: argparse.Namespace) -> DirectionalLight:
    color = np.ones(3) if options.color is None else options.color
    if options.direction is not None:
        if options.like is not None:
            raise InputError("--direction and --like both say where the light is: give one of them")
        return DirectionalLight(toward(*options.direction), np.pi * color)
    found = explain_specular(d) if options.like == "specular" else explain_shading(d)
    if not found.light.irradiance.any():
        raise InputError(
            f"the {options.like or 'shading'} tells no light here: give --direction X Y Z"
        )
    own = found.light.irradiance / found.light.irradiance.max()
    return DirectionalLight(
        found.light.direction, np.pi * (own if options.color is None else color)
    )


def _new_light(
    d: Decomposition, options: argparse.Namespace, rotation: np.ndarray
) -> tuple[NewLight, bool]:
    """The light, and whether its brightness is meant as it is."""
    turned = not np.array_equal(rotation, np.eye(3))
    if options.light is not None and options.direction is not None:
        raise InputError("--light and --direction both name a light: give one of them")
    if options.direction is None and (options.color is not None or options.ambient is not None):
        raise InputError("--color and --ambient belong to the light of --direction: give that too")
    if options.direction is not None:
        color = np.ones(3) if options.color is None else options.color
        ambient = 0.15 if options.ambient is None else options.ambient
        return NewLight(
            sun=DirectionalLight(
                rotation @ toward(*options.direction), np.pi * color, ambient * color
            )
        ), False
    if (
        options.light is not None
        and not options.light.is_dir()
        and options.light.suffix.lower() not in _COEFFICIENTS
    ):
        if turned:
            raise InputError(
                "an environment picture is not turned here: turn the picture itself, or give a direction"
            )
        return NewLight(
            sky=read_linear(options.light, limits=limits_of(options), finite=True)
        ), False
    if options.light is None:
        return NewLight(coefficients=turned_light(d.illumination, rotation), turned=rotation), True
    return NewLight(coefficients=turned_light(_read_coefficients(options.light), rotation)), True


def _read_coefficients(path: Path) -> np.ndarray:
    if path.suffix.lower() != ".npy":
        return read_light(path)
    light = read_array(path)
    if light.shape != (9, 3) or light.dtype.kind not in "fiu" or not np.isfinite(light).all():
        raise InputError(f"{path} holds no light: an array of 9 x 3 numbers is needed")
    return light.astype(float)


def _lobe(options: argparse.Namespace) -> Lobe | None:
    if options.exponent is not None and options.alpha is not None:
        raise InputError("--exponent and --alpha both say how rough the lobe is: give one of them")
    if options.exponent is None and options.alpha is None:
        return None
    return Lobe(USUAL_EXPONENT if options.exponent is None else options.exponent, options.alpha)


def _read_region(path: Path, d: Decomposition, limits: Limits) -> np.ndarray:
    """(H, W) in [0, 1] of the maps' size, from a picture of that size or the photo's: its alpha
    where that is not opaque; else its codes, of which 1 is white where none is larger.
    """
    raster = read_raster(path, limits)
    region = raster.transparency
    if region is None:
        codes = np.nan_to_num(raster.values.astype(float), nan=0.0, posinf=1.0, neginf=0.0)
        white = 1.0 if raster.peak is None or codes.max() <= 1 else float(raster.peak)
        region = np.clip(codes.mean(axis=2) / white, 0, 1)
    if region.shape == d.mask.shape:
        return region
    scale, size = d.provenance.input.get("scale"), d.provenance.input.get("size")
    if not isinstance(scale, int | float) or [*region.shape[::-1]] != size:
        raise InputError(
            f"{path}: the region is {region.shape[1]} x {region.shape[0]} pixels: give one of the photo's size"
        )
    rows, columns = (
        np.clip(((np.arange(n) + 0.5) / scale).astype(int), 0, m - 1)
        for n, m in zip(d.mask.shape, region.shape, strict=True)
    )
    return region[np.ix_(rows, columns)]


def _original(d: Decomposition, options: argparse.Namespace) -> Original:
    given = d.provenance.input
    transfer = options.transfer or str(given.get("transfer", "auto"))
    if given.get("mask_from") == "file" and options.mask is None:
        raise InputError(
            "the result was made with a mask of its own: give the same one with --mask"
        )
    limits = limits_of(options)
    photo = read_photo(options.photo, options.mask, transfer, limits=limits)
    raster = read_raster(options.photo, limits)
    if raster.sha256 != photo.original.sha256:
        raise InputError(f"{options.photo} changed while it was read: run the command again")
    return Original(photo, raster, options.photo)


# --- words ----------------------------------------------------------------------------------------


def _ball(color: np.ndarray, label: str, remark: str) -> Panel:
    coverage = sphere_normals(len(color))[1]
    return Panel(
        color * 0.95 / max(float(np.percentile(color[coverage > 0.5].max(-1), 99.5)), 1e-9),
        coverage,
        label,
        remark,
    )


def _recovered_ball(d: Decomposition) -> Panel:
    return _ball(
        np.exp(real_sh(sphere_normals(320)[0]) @ d.illumination),
        "Recovered light",
        "on a white ball",
    )


def _directed(light: DirectionalLight, exponent: float | None = None) -> np.ndarray:
    """A ball in the directed part of the light alone: an ambient rest hides where it comes from."""
    return render_sphere(replace(light, ambient=np.zeros(3)), exponent=exponent)[0]


def _no_ball(label: str, remark: str) -> Panel:
    return Panel(np.full((320, 320, 3), 0.03), sphere_normals(320)[1], label, remark)


def _short(found: DirectionEstimate) -> str:
    return (
        f"explains {100 * found.explained:.0f} %, ± {found.cone:.0f}°"
        if found.determined
        else "undetermined"
    )


def _long(found: DirectionEstimate) -> str:
    if not found.determined:
        return f"undetermined: no single light explains it ({100 * found.explained:.0f} % at best)"
    x, y, z = found.light.direction
    lobe = "" if found.exponent is None else f", exponent {found.exponent:.0f}"
    share = f"explains {100 * found.explained:.0f} %"
    return f"from {x:.3f} {y:.3f} {z:.3f} (right, up, toward the viewer) ± {found.cone:.1f} degrees on this shape, {share}{lobe}"


def _measured(found: DirectionEstimate) -> dict[str, object]:
    light = found.light
    return {
        "determined": found.determined,
        "direction": _plain(light.direction),
        "irradiance": _plain(light.irradiance),
        "ambient": _plain(light.ambient),
        "explained": found.explained,
        "cone_degrees": found.cone,
        "exponent": found.exponent,
    }


def _ball_of_glance(d: Decomposition, light_estimate: LightEstimate) -> Panel:
    label, remark = "At first sight", _lamps_of_glance(light_estimate)
    if not light_estimate.determined:
        return _no_ball(label, remark)
    light, share = share_explained(d, light_estimate.direction)
    return _ball(
        _directed(light),
        label,
        f"explains {100 * share:.0f} %, ± {light_estimate.cone:.0f}°, {remark}",
    )


def _lamps_of_glance(light_estimate: LightEstimate) -> str:
    shares = {
        "smooth light": light_estimate.none,
        "one lamp": light_estimate.one,
        "several lamps": light_estimate.several,
    }
    likely = max(shares, key=lambda name: shares[name])
    return f"{likely} ({100 * shares[likely]:.0f} %)"


def _long_glance(light_estimate: LightEstimate) -> str:
    if not light_estimate.determined:
        return f"{_lamps_of_glance(light_estimate)}, no direction that could be told"
    x, y, z = light_estimate.direction
    return f"{_lamps_of_glance(light_estimate)}, the strongest from {x:.3f} {y:.3f} {z:.3f} ± {light_estimate.cone:.1f} degrees, whatever the shape"


def _measured_glance(light_estimate: LightEstimate) -> dict[str, object]:
    return {
        "determined": light_estimate.determined,
        "direction": _plain(light_estimate.direction),
        "cone_degrees": light_estimate.cone,
        "lamps": {
            "none": light_estimate.none,
            "one": light_estimate.one,
            "several": light_estimate.several,
        },
    }


def _said(options: argparse.Namespace) -> str:
    """What differs from the usual, for the sheet."""
    skip = (*_OF_THE_COMMAND, "result", "photo", "mask", "transfer")
    words = []
    for name, value in vars(options).items():
        if (
            name in skip
            or value is None
            or value is False
            or np.array_equal(value, options.usual.get(name))
        ):
            continue
        shown = value
        if isinstance(value, np.ndarray):
            shown = "".join(
                f"{code:02x}" for code in np.rint(255 * linear_to_srgb(value)).astype(int)
            )
        elif isinstance(value, list):
            shown = " ".join(f"{n:g}" for n in value)
        words.append(
            name.replace("_", "-") if value is True else f"{name.replace('_', '-')} {shown}"
        )
    return "   ·   ".join(map(str, words))


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return readable(str(value)) if isinstance(value, Path) else value


# --- options --------------------------------------------------------------------------------------


def _add_common(parser: argparse.ArgumentParser) -> None:
    picture = parser.add_argument_group("the photo")
    picture.add_argument(
        "--photo",
        type=Path,
        metavar="PHOTO",
        help="the photo that RESULT was made of: the edit is brought back into it",
    )
    picture.add_argument(
        "--mask", type=Path, metavar="MASK", help="its mask, where the result was made with one"
    )
    picture.add_argument(
        "--transfer", choices=TRANSFERS, help="how it is coded (default: as isc decompose read it)"
    )
    add_limits(parser)
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="DIR",
        help="the folder to write; an earlier edit is replaced",
    )
    add_speech(parser, again=True)
    parser.set_defaults(usual=vars(parser.parse_args(["-o", "."])))


def _add_nothing(parser: argparse.ArgumentParser) -> None:
    del parser


def _add_lobe(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--exponent", type=_number, metavar="P", help="Blinn-Phong's, 1 to 1e5, larger is sharper"
    )
    parser.add_argument(
        "--alpha",
        type=_number,
        metavar="A",
        help="of GGX facets instead, 0.01 to 1, smaller is sharper",
    )


def _add_direction(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--direction",
        type=_number,
        nargs=3,
        metavar=("X", "Y", "Z"),
        help="toward the light: right, up, toward the viewer; of any length",
    )
    parser.add_argument(
        "--color",
        type=_color,
        metavar="RRGGBB",
        help="of that light, as in web pages (default ffffff, the photo's own white)",
    )


def _add_highlight(parser: argparse.ArgumentParser) -> None:
    _add_direction(parser)
    parser.add_argument(
        "--like",
        choices=("shading", "specular"),
        help="without --direction: the one light that best explains the shading (default) or the present highlights",
    )
    _add_lobe(parser)
    parser.add_argument(
        "--strength",
        type=_number,
        metavar="S",
        help="1: as bright as the photo's white (default 0.7; with --replace, as much light as was there)",
    )
    parser.add_argument("--replace", action="store_true", help="take the present highlights away")


def _add_gloss(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--look",
        choices=tuple(_LOOKS),
        help="a good start: a sharper and stronger lobe, a wider one, or metal",
    )
    parser.add_argument(
        "--exponent", type=_number, metavar="P", help="the new Blinn-Phong exponent, 1 to 1e5"
    )
    parser.add_argument(
        "--present", type=_number, metavar="P", help="the present one (default: fitted)"
    )
    parser.add_argument(
        "--gain",
        type=_number,
        metavar="G",
        help="factor of the highlights (default 1; 1.5 for --look glossier)",
    )
    parser.add_argument(
        "--metal",
        type=_number,
        metavar="M",
        help="how much of a metal, 0 to 1 (default 0; 1 for --look metallic)",
    )
    parser.add_argument(
        "--method",
        choices=METHODS,
        default=Gloss().method,
        help="change the present highlights (default), or render new ones on the shape",
    )


def _add_dichromatic(parser: argparse.ArgumentParser) -> None:
    usual = LayerEdit()
    parser.add_argument(
        "--remove", choices=("diffuse", "specular"), help="leave the other layer alone"
    )
    for layer in ("diffuse", "specular"):
        group = parser.add_argument_group(f"the {layer} layer")
        for name, text in (
            ("gain", "factor of its light, from 0 on"),
            ("gamma", "above 1: more contrast"),
            ("sharpen", "how much detail is added; -1 takes it away"),
            ("radius", "what counts as detail, in pixels of the maps"),
        ):
            group.add_argument(
                f"--{layer}-{name}",
                type=_number,
                default=getattr(usual, name),
                metavar="N",
                help=f"{text} (default %(default)s)",
            )


def _add_recolour(parser: argparse.ArgumentParser) -> None:
    usual = Paint()
    parser.add_argument(
        "--hue", type=_number, default=usual.hue, metavar="DEGREES", help="turns the hue"
    )
    parser.add_argument(
        "--saturation",
        type=_number,
        default=usual.saturation,
        metavar="F",
        help="factor (default %(default)s)",
    )
    parser.add_argument(
        "--value",
        type=_number,
        default=usual.value,
        metavar="F",
        help="factor of the brightness (default %(default)s)",
    )
    parser.add_argument(
        "--color",
        type=_color,
        metavar="RRGGBB",
        help="the paint, as in web pages; its brightness stays the object's",
    )
    parser.add_argument(
        "--match-brightness", action="store_true", help="takes the brightness of --color too"
    )
    parser.add_argument(
        "--region",
        type=Path,
        metavar="FILE",
        help="where: an image, white on black, of the photo's size",
    )
    parser.add_argument(
        "--cluster",
        type=count,
        metavar="N",
        help="where: the cluster N of the object's paints, see clusters.png",
    )
    parser.add_argument(
        "--clusters",
        type=count,
        default=4,
        metavar="K",
        help="how many there are at most (default %(default)s)",
    )
    parser.add_argument(
        "--seed",
        type=count,
        default=0,
        metavar="N",
        help="of the clusters' random numbers (default %(default)s)",
    )


def _add_relight(parser: argparse.ArgumentParser) -> None:
    for name, text in (
        ("yaw", "front to the right"),
        ("pitch", "top to the front"),
        ("roll", "right side up"),
    ):
        parser.add_argument(
            f"--{name}",
            type=_number,
            default=0.0,
            metavar="DEGREES",
            help=f"turns the light: {text}",
        )
    parser.add_argument(
        "--light",
        type=Path,
        metavar="FILE",
        help="another light: a result folder, a JSON file or .npy of 9 x 3 coefficients, or a panorama, twice as wide as high",
    )
    _add_direction(parser)
    parser.add_argument(
        "--ambient",
        type=_number,
        metavar="A",
        help="of what --direction does not reach, to its light (default 0.15)",
    )
    parser.add_argument(
        "--exposure",
        type=_number,
        default=1.0,
        metavar="F",
        help="factor of the new light (default %(default)s)",
    )
    parser.add_argument(
        "--highlights",
        choices=HIGHLIGHTS,
        default="auto",
        help="what becomes of them (auto: rendered if the lobe is known, fitted or given, else scaled as the shading)",
    )
    _add_lobe(parser)


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number")
    return value


def _color(text: str) -> np.ndarray:
    digits = text.removeprefix("#")
    try:
        codes = np.array([int(digits[k : k + 2], 16) for k in (0, 2, 4)])
    except ValueError:
        codes = np.zeros(0)
    if len(digits) != 6 or len(codes) != 3 or not (digits.isascii() and digits.isalnum()):
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a colour: write red, green and blue as rrggbb, like 2060c0"
        )
    return srgb_to_linear(codes / 255)


_Action = tuple[
    str,
    str,
    Callable[[Decomposition, argparse.Namespace], _Done],
    Callable[[argparse.ArgumentParser], None],
]
_ACTIONS: tuple[_Action, ...] = (
    (
        "light-direction",
        "the one light that best explains the shading, and the highlights",
        _light_direction,
        _add_nothing,
    ),
    ("highlight", "a new highlight on the recovered shape", _highlight, _add_highlight),
    ("gloss", "glossier, rougher, or like metal", _gloss, _add_gloss),
    (
        "dichromatic",
        "the diffuse and the specular layer, each on its own",
        _dichromatic,
        _add_dichromatic,
    ),
    ("recolour", "another paint under the same gloss", _recolour, _add_recolour),
    ("relight", "the recovered light turned, or another light", _relight, _add_relight),
)
