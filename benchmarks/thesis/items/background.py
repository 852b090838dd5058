"""Figures 2.1 to 2.5: reflectance lobes, Phong's components, shading models, intrinsic images,
specular-free images.

Lobes are drawn in the plane of incidence as f_r(view) cos(view), for light from 0, 30 and 60
degrees. The sphere is lit as by Phong: ambient + diffuse + strength cos^n of the mirrored view.

Citation: B. T. Phong (1975), doi:10.1145/360825.360839; J. F. Blinn (1977),
doi:10.1145/563858.563893; M. Oren and S. K. Nayar (1994), doi:10.1145/192161.192213; B. Walter et
al. (2007), doi:10.2312/EGWR/EGSR07/195-206; H. G. Barrow and J. M. Tenenbaum, "Recovering intrinsic
scene characteristics from images", Computer Vision Systems (1978), which has no DOI (intrinsic
images).

Limits: it is not known what exactly the thesis draws under each number; the choice within the
titles is this project's.
"""

from functools import partial

import numpy as np
from matplotlib.axes import Axes

from isc_core.evaluation.metrics import scaled_mse, truth_normal
from isc_core.shading.brdf.blinn_phong import BlinnPhong
from isc_core.shading.brdf.dichromatic import Dichromatic
from isc_core.shading.brdf.energy import directional_albedo
from isc_core.shading.brdf.ggx import Ggx
from isc_core.shading.brdf.lambert import Lambert
from isc_core.shading.brdf.model import Model
from isc_core.shading.brdf.oren_nayar import OrenNayar
from isc_core.shading.brdf.phong import Phong
from isc_core.shading.lights import VIEW, DirectionalLight, toward
from isc_core.shading.radiance import directional, radiance
from isc_core.shading.sphere import sphere_normals
from isc_core.shading.spherical_harmonics import real_sh
from synth.capture.truth import fit_light

from ..drawing.panels import Panel, normals_panel, panel_figure
from ..drawing.style import LETTERS, OKABE_ITO, exposure, figure, image_sheet
from ..images.subject import Subject
from ..measuring.context import Context
from ..measuring.decompositions import decompose_subject, illumination_of
from ..measuring.specular_free_images import (
    DARK,
    KINDS,
    PHOTO,
    residual_highlight,
    subject_title,
    subjects_with_highlights,
)
from ..report.item import ItemContent, ItemTable, ThesisItem

INCIDENT = (0, 30, 60)  # degrees
_NORMAL = np.array([0.0, 0.0, 1.0])
LOBES: tuple[tuple[str, Model], ...] = (
    ("Lambert", Lambert()),
    ("Oren-Nayar, sigma .5", OrenNayar(sigma=0.5)),
    ("Phong, exponent 20", Phong(exponent=20.0)),
    ("Blinn-Phong, exponent 80", BlinnPhong(exponent=80.0)),
    ("GGX, alpha .25, f0 .04", Ggx(0.25)),
    (
        "Dichromatic: albedo .5, specular .2",
        Dichromatic(np.full(3, 0.5), Lambert(), BlinnPhong(0.2, 80.0)),
    ),
)


def lobe(model: Model, incident: float, views: np.ndarray) -> np.ndarray:
    """Evaluate a reflectance model in the plane of incidence.

    Parameters
    ----------
    model : Model
        The reflectance model.
    incident : float
        Angle of the light from the normal, degrees.
    views : (n,) ndarray
        Angles of the view, degrees; positive on the side of the mirror direction.

    Returns
    -------
    (n,) ndarray
        f_r cos(view), 1/sr.
    """
    light = np.array([-np.sin(np.deg2rad(incident)), 0, np.cos(np.deg2rad(incident))])
    angle = np.deg2rad(views)
    value = model.value(
        _NORMAL, np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], -1), light
    )
    return np.cos(angle) * (value if value.ndim == 1 else value[:, 0])


def _lobes(context: Context) -> ItemContent:
    del context
    made, axes = figure(2, 3, height=4.0)
    rows = []
    views = np.linspace(-89.5, 89.5, 359)
    for place, (name, model) in zip(axes.flat, LOBES, strict=True):
        curves = [lobe(model, incident, views) for incident in INCIDENT]
        _polar(place, views, curves, name)
        for incident, curve in zip(INCIDENT, curves, strict=True):
            kept = float(np.max(directional_albedo(model, float(np.cos(np.deg2rad(incident))))))
            rows.append((name, incident, float(views[np.argmax(curve)]), float(curve.max()), kept))
    names = [f"light from {incident}°" for incident in INCIDENT]
    made.legend(
        axes[0, 0].get_lines()[-len(names) :],
        names,
        loc="outside lower center",
        ncols=3,
        fontsize=LETTERS,
        frameon=False,
    )
    header = (
        "model",
        "light from (degrees)",
        "largest at (degrees)",
        "largest f_r cos (1/sr)",
        "share of the light reflected",
    )
    text = (
        "f_r cos, the intensity that a small patch reflects in each direction, in the "
        "plane of incidence. Each half circle has its own scale (the number at its "
        "rim, 1/sr); dashed: the direction of the light. A Lambertian patch reflects "
        "most along its normal for every light; Oren-Nayar reflects more back toward "
        "the light. GGX increases toward grazing light, as measured surfaces do; Phong "
        "and Blinn-Phong do not."
    )
    return ItemContent((ItemTable(header, tuple(rows)),), (made,), text)


def _polar(place: Axes, views: np.ndarray, curves: list[np.ndarray], title: str) -> None:
    """Half a polar plot of `curves`, each (n,) over `views` (n,) in degrees."""
    reach = max(float(curve.max()) for curve in curves)
    around = np.deg2rad(np.linspace(-90, 90, 91))
    for share in (0.5, 1.0):
        place.plot(share * np.sin(around), share * np.cos(around), color="0.8", linewidth=0.6)
    for degrees in (-60, -30, 0, 30, 60):
        x, y = np.sin(np.deg2rad(degrees)), np.cos(np.deg2rad(degrees))
        place.plot([0, x], [0, y], color="0.9", linewidth=0.6)
        place.text(
            1.08 * x,
            1.08 * y,
            f"{abs(degrees)}°",
            ha="center",
            va="center",
            fontsize=LETTERS - 2,
            color="0.4",
        )
    place.text(1.02, -0.04, f"{reach:.2g}", ha="center", va="top", fontsize=LETTERS - 1)
    place.plot([-1, 1], [0, 0], color="0.4", linewidth=0.8)
    for incident, colour in zip(INCIDENT, OKABE_ITO, strict=False):
        x, y = -np.sin(np.deg2rad(incident)), np.cos(np.deg2rad(incident))
        place.plot([0, x], [0, y], color=colour, linewidth=0.8, linestyle="--")
    angle = np.deg2rad(views)
    for curve, colour in zip(curves, OKABE_ITO, strict=False):
        place.plot(
            curve / reach * np.sin(angle),
            curve / reach * np.cos(angle),
            color=colour,
            linewidth=1.2,
        )
    place.set(xlim=(-1.2, 1.2), ylim=(-0.16, 1.18), aspect="equal")
    place.set_axis_off()
    place.set_title(title, fontsize=LETTERS)


def phong_sphere(size: int, exponent: float) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Render Phong's components on a ball.

    Parameters
    ----------
    size : int
        Side of the picture, pixels.
    exponent : float
        Phong exponent.

    Returns
    -------
    layers : dict of str to (size, size, 3) ndarray
        Ambient, diffuse and specular light and their sum.
    mask : (size, size) ndarray
        Pixels of the ball.
    """
    normal, coverage = sphere_normals(size)
    mask = coverage > 0.5
    light = DirectionalLight(toward(-0.5, 0.6, 0.8), ambient=np.full(3, 0.12))
    albedo = np.array([0.65, 0.16, 0.10])
    source = directional(light.direction, light.irradiance)
    ambient = np.broadcast_to(albedo * light.ambient, normal.shape)
    diffuse = radiance(Dichromatic(albedo, Lambert(), Lambert(0.0)), normal, VIEW, source)
    specular = radiance(Phong(0.6 / np.pi, exponent, normalised=False), normal, VIEW, source)
    layers = {
        "ambient": ambient,
        "diffuse": diffuse,
        "specular": specular,
        "sum": ambient + diffuse + specular,
    }
    return {name: np.where(mask[..., None], layer, 1) for name, layer in layers.items()}, mask


def _phong(context: Context) -> ItemContent:
    rows, cells = [], []
    for exponent in (5.0, 20.0, 100.0):
        layers, mask = phong_sphere(96 if context.quick else 240, exponent)
        rows.append((f"exponent {exponent:g}", list(layers.values())))
        level = layers["specular"][mask].max(axis=1)
        cells.append((exponent, float(level.max()), 100 * float((level > level.max() / 2).mean())))
    header = ("exponent", "brightest specular light", "share of the ball above half of it (%)")
    text = (
        "Ambient, diffuse and specular light of one distant light on a ball, and their "
        "sum. The higher the exponent, the smaller the highlight."
    )
    return ItemContent(
        (ItemTable(header, tuple(cells)),),
        (image_sheet(("ambient", "diffuse", "specular", "sum"), rows, expose=False),),
        text,
    )


def shading_models(subject: Subject) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
    """Fit models of the shading to a subject's true normals.

    The models: exp of nine spherical harmonics, one distant light with ambient light, and a
    constant.

    Parameters
    ----------
    subject : Subject
        A subject with ground truth.

    Returns
    -------
    shading : (H, W, 3) ndarray
        True shading; 0 where unknown.
    models : dict of str to (H, W, 3) ndarray
        Fitted shadings.
    normal : (H, W, 3) ndarray
        True normals.
    """
    truth = subject.truth
    assert truth is not None
    normal = truth_normal(np.where(subject.mask, truth.height, np.nan))
    known = subject.mask & np.isfinite(normal[..., 2]) & np.isfinite(truth.shading).all(-1)
    shading = np.where(known[..., None], truth.shading, 0)
    found, inside = normal[known], shading[known]
    light, _ = fit_light(found, inside)
    fits = {
        "exp(SH), nine coefficients": np.exp(real_sh(found) @ light),
        "one distant light + ambient": _one_light(found, inside),
    }
    fits["constant"] = np.broadcast_to(inside.mean(axis=0), inside.shape)
    models = {}
    for name, values in fits.items():
        models[name] = np.zeros(shading.shape)
        models[name][known] = values
    return shading, models, np.where(known[..., None], normal, [0.0, 0.0, 1.0])


def _one_light(normal: np.ndarray, shading: np.ndarray) -> np.ndarray:
    """Fit S = E max(0, n . l) + A over a grid of directions l to normals and shadings (N, 3)."""
    best, least = shading, np.inf
    for azimuth in np.deg2rad(np.arange(0, 360, 15)):
        for tilt in np.deg2rad(np.arange(0, 100, 10)):
            light = np.array(
                [np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)]
            )
            design = np.stack([np.maximum(normal @ light, 0), np.ones(len(normal))], axis=1)
            fit = design @ np.linalg.lstsq(design, shading, rcond=None)[0]
            if (error := float(np.square(fit - shading).sum())) < least:
                best, least = fit, error
    return best


def _shading(context: Context) -> ItemContent:
    shown, cells = [], []
    for kind in ("synthetic", "diffuse"):
        subject = next((one for one in context.subjects(kind) if one.truth is not None), None)
        if subject is None:
            continue
        true, models, normal = shading_models(subject)
        inside = true.any(axis=2)
        gain = exposure(true, inside)
        size = float(np.sqrt(np.square(true[inside]).mean()))
        shown += [
            normals_panel(f"{subject.name}: true normals", normal, inside),
            Panel("true shading", true, inside, gain=gain),
        ]
        for name, model in models.items():
            left = float(np.sqrt(np.square((model - true)[inside]).mean())) / size
            cells.append((subject_title(subject), name, 100 * left))
            if name != "constant":
                error = np.abs(model - true).mean(axis=2) / size
                shown += [
                    Panel(name, model, inside, gain=gain),
                    Panel("its error, of the RMS", error, inside, (0, 0.5)),
                ]
    header = ("subject", "model of the shading", "RMS error (% of the shading's RMS)")
    text = (
        "Shading is the image of a white object. The models depend on the true normals "
        "only: cast shadows and interreflections are no function of the normal. "
        "Normals are differences of the true height and wrong at its steps."
    )
    return ItemContent((ItemTable(header, tuple(cells)),), (panel_figure(shown, 6),), text)


_LAYERS = ("image", "diffuse", "specular", "reflectance", "shading")


def _intrinsic(context: Context) -> ItemContent:
    subject = next(one for one in context.subjects("synthetic") if one.truth is not None)
    assert subject.truth is not None
    assert subject.diffuse is not None
    assert subject.specular is not None
    d = decompose_subject(context, subject)
    true = dict(
        zip(
            _LAYERS,
            (
                subject.image,
                subject.diffuse,
                subject.specular,
                subject.truth.reflectance,
                subject.truth.shading,
            ),
            strict=True,
        )
    )
    found = {name: getattr(d, name) for name in _LAYERS}
    gain = exposure(subject.image, subject.mask)
    shown = []
    for title, mask, layers in (("true", subject.mask, true), ("found", d.mask, found)):
        for name, layer in layers.items():
            own = name in ("reflectance", "shading")
            shown.append(
                Panel(
                    name if name == "image" else f"{title} {name}",
                    layer,
                    mask,
                    gain=None if own else gain,
                )
            )
    both = d.mask & subject.mask & np.isfinite(subject.truth.shading).all(-1)
    cells = tuple((name, 100 * _error(true[name][both], found[name][both])) for name in _LAYERS[1:])
    table = ItemTable(
        ("intrinsic image", "RMS error after the best scale (% of its RMS)"),
        cells,
        f"{subject.name}: estimated by `--model mdr --illumination {illumination_of(subject)}`.",
    )
    text = (
        "image = reflectance × shading + specular. Top: ground truth; bottom: "
        "estimate. Reflectance and shading have their own exposures, since one photo "
        "leaves their scale undetermined."
    )
    return ItemContent((table,), (panel_figure(shown, 5),), text)


def _error(true: np.ndarray, found: np.ndarray) -> float:
    size = float(np.square(true, dtype=float).mean())
    return float(np.sqrt(scaled_mse(true.astype(float), found.astype(float)) / max(size, 1e-12)))


def _specular_free(context: Context) -> ItemContent:
    subjects = subjects_with_highlights(
        (*context.subjects("specular"), *context.subjects("synthetic"))
    )
    kinds = (PHOTO, *KINDS, DARK)
    cells: list[tuple[str | int | float, ...]] = [
        (subject_title(one), *(100 * residual_highlight(kind, one) for kind in kinds))
        for one in subjects
    ]
    table = ItemTable(("subject", *(kind.name for kind in kinds)), tuple(cells), _LEFT)
    chosen = subjects[0]
    assert chosen.diffuse is not None
    shown = []
    gains: list[float] = []
    for name, layer in (("", chosen.image), (", of diffuse", chosen.diffuse)):
        image = np.where(chosen.mask[..., None], layer, 0).astype(float)
        made = [kind.make(image, chosen.mask) for kind in kinds]
        gains = gains or [exposure(one, chosen.mask) for one in made]
        names = ["diffuse layer" if name and kind is PHOTO else kind.name + name for kind in kinds]
        shown += [
            Panel(title, one, chosen.mask, gain=gain)
            for title, one, gain in zip(names, made, gains, strict=True)
        ]
    text = (
        f"{chosen.name}: each image made of the photo (top) and of its diffuse layer "
        "(bottom), one exposure per column. Where both rows agree, the image contains "
        "no specular light. The dark channel is the opposite: mostly highlight, and "
        "the rest of pale surfaces. SF1 and SF2 assume white highlights: the residue "
        "is noise, clipping, and the tint of the light."
    )
    return ItemContent((table,), (panel_figure(shown, len(kinds)),), text)


_LEFT = (
    "Share of the specular light that remains in each image (%), offsets common to "
    "the whole object excluded."
)
_figure = partial(ThesisItem, "figure")
ITEMS: tuple[ThesisItem, ...] = (
    _figure("2.1", "Lobes of the reflectance models", _lobes),
    _figure("2.2", "Phong's components on a sphere", _phong),
    _figure("2.3", "Shading and its model", _shading),
    _figure("2.4", "The intrinsic images of a subject", _intrinsic),
    _figure("2.5", "Specular-free images and the dark channel", _specular_free),
)
