"""Figures of the applications: highlights on a sphere and where their light is, dichromatic
editing, reflectance editing.

The sphere is a painted ball under one lamp with a little ambient light and a Blinn-Phong gloss of a
known exponent. Its light is looked for five times: by the shading and by the highlight when shape
and layers are the true ones, by the highlight when the layers are separated by `isc` from the
picture, and by both when nothing but the picture is known (model MDR). Errors are angles between
directions.

The edits are those of `isc edit`, on photos where data are given, else on rendered things.

Citation: J. F. Blinn (1977), doi:10.1145/563858.563893; S. A. Shafer (1985),
doi:10.1002/col.5080100409; H. Akbar, thesis (2016).

Limits: a convex ball without shadows is the easiest object there is. How good an edit looks is not
measured, only that it does what was asked for and nothing else.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from isc_core.editing.clusters import Clusters, find_clusters
from isc_core.editing.dichromatic import DichromaticEdit, LayerEdit, edit_layers
from isc_core.editing.edited import Edited
from isc_core.editing.recolour import Paint, recolour
from isc_core.editing.spheres import render_sphere, sphere_normals
from isc_core.imaging.luminance import luminance
from isc_core.lobe_fitting.light_direction import explain_shading, explain_specular, lobe_light
from isc_core.scene.decomposition import Decomposition, Provenance, Separation
from isc_core.separation import separate
from isc_core.shading.lights import DirectionalLight, toward
from synth.capture.truth import fit_light

from ..drawing.panels import Panel, panel_figure
from ..drawing.style import exposure
from ..images.subject import Subject
from ..measuring.context import Context, JsonRow
from ..measuring.decompositions import decompose_subject, subject_as_photo
from ..report.item import ItemContent, ItemTable, ThesisItem

PAINT = np.array([0.62, 0.18, 0.10])
EXPONENT, _GLOSS, _AMBIENT = 60.0, 0.06, 0.08
DIRECTIONS = (
    (-0.6, 0.6, 1.0),
    (0.7, 0.5, 1.0),
    (0.0, 0.9, 0.8),
    (-0.9, 0.1, 0.7),
    (0.9, -0.4, 0.8),
    (0.2, 0.2, 1.0),
)


def render_ball(direction: np.ndarray, size: int) -> Decomposition:
    """A glossy ball under a light from the unit vector `direction` (3,): the truth of every layer,
    in a picture of `size` pixels a side.

    Its `illumination` is the smooth light that is nearest to the lamp; `shading` is the lamp's own.
    """
    normal, coverage = sphere_normals(size)
    mask = coverage > 0.5
    light = DirectionalLight(direction, ambient=np.full(3, _AMBIENT))
    shading = light.shading(normal)
    specular = _GLOSS * lobe_light(normal, direction, EXPONENT)[..., None] * light.irradiance
    illumination, _ = fit_light(normal[mask], shading[mask])

    def inside(values: np.ndarray) -> np.ndarray:
        return np.where(mask[..., None], values, 0).astype(np.float32)

    diffuse, gloss, paint = (
        inside(PAINT * shading),
        inside(specular),
        inside(np.broadcast_to(PAINT, shading.shape)),
    )
    facing = np.where(mask[..., None], normal, [0.0, 0, 1]).astype(np.float32)
    height, sure = (
        np.where(mask, 0.45 * size * normal[..., 2], 0).astype(np.float32),
        mask.astype(np.float32),
    )
    layers = (diffuse + gloss, diffuse, gloss, np.zeros_like(diffuse), paint, inside(shading))
    return Decomposition(*layers, facing, height, mask, sure, illumination, Provenance())


def with_separated_layers(d: Decomposition) -> Decomposition:
    """The same scene with the layers that `isc` finds in its image."""
    split: Separation = separate("isc", d.image, d.mask)
    return replace(d, diffuse=split.diffuse, specular=split.specular, residual=split.residual)


def degrees_between(one: np.ndarray, other: np.ndarray) -> float:
    """Of unit vectors (3,)."""
    return float(np.rad2deg(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other)))


def estimate_directions(
    ball: Decomposition, picture_only: Decomposition | None = None
) -> dict[str, np.ndarray]:
    """Directions (3,) of the light by each way of finding it;

    `picture_only`: what a model makes of the ball's image, or None.
    """
    ways = {
        "shading, true shape": explain_shading(ball),
        "highlight, true layers": explain_specular(ball),
        "highlight, layers by isc": explain_specular(with_separated_layers(ball)),
    }
    if picture_only is not None:
        ways |= {
            "shading, all by MDR": explain_shading(picture_only),
            "highlight, all by MDR": explain_specular(picture_only),
        }
    return {name: way.light.direction for name, way in ways.items()}


_WAYS = (
    "shading, true shape",
    "highlight, true layers",
    "highlight, layers by isc",
    "shading, all by MDR",
    "highlight, all by MDR",
)


def _spheres(context: Context) -> ItemContent:
    size = 64 if context.quick else 128
    shown, rows, errors = [], [], []
    for number, direction in enumerate(
        [toward(*one) for one in (DIRECTIONS[:3] if context.quick else DIRECTIONS)]
    ):
        ball = render_ball(direction, size)
        kept = context.rows(f"light on ball {number}", partial(_found_rows, context, ball, number))
        found = {
            str(row["way"]): np.array([float(row[axis] or 0) for axis in "xyz"]) for row in kept
        }
        off = {name: round(degrees_between(way, direction), 4) for name, way in found.items()}
        errors.append(off)
        rows.append((_word(direction), *(off.get(name, "") for name in _WAYS)))
        shown += _ball_panels(ball, found, off, size, context.quick)
    means = [[off[name] for off in errors if name in off] for name in _WAYS]
    rows.append(("mean", *(float(np.mean(values)) for values in means)))
    header = ("light (x, y, z)", *_WAYS)
    table = ItemTable(
        header,
        tuple(rows),
        "Degrees between the true direction and the one found; x right, y up, z toward the viewer.",
    )
    text = (
        "Each row: the ball under one lamp, its highlight as `isc` finds it, and balls lit from the directions that the separated "
        "highlight, the true shading and the shading by MDR tell. With the true shape both tell the light; from the picture alone they are "
        "as good as the recovered shape is."
    )
    if context.quick:
        text += " In a quick run the model sees the first ball only."
    return ItemContent((table,), (panel_figure(shown, 4 if context.quick else 5),), text)


def _found_rows(context: Context, ball: Decomposition, number: int) -> list[JsonRow]:
    picture_only = None
    if number == 0 or not context.quick:
        picture_only = decompose_subject(
            context,
            Subject(f"ball{number}", "sphere", ball.image, ball.mask),
            illumination="laboratory",
        )
    found = estimate_directions(ball, picture_only)
    return [
        {"way": name, **dict(zip("xyz", map(float, direction), strict=True))}
        for name, direction in found.items()
    ]


def _ball_panels(
    ball: Decomposition, found: dict[str, np.ndarray], off: dict[str, float], size: int, quick: bool
) -> list[Panel]:
    gain = exposure(ball.image, ball.mask)
    parted = with_separated_layers(ball)
    shown = [
        Panel("image", ball.image, ball.mask, gain=gain),
        Panel("specular, by isc", parted.specular, ball.mask, gain=gain),
    ]
    ways = (
        ("lit as the highlight tells", _WAYS[2]),
        ("as the shading tells", _WAYS[0]),
        ("by MDR", _WAYS[3]),
    )
    for title, name in ways if _WAYS[3] in found and not quick else ways[:2]:
        lit, coverage = render_sphere(
            DirectionalLight(found[name], ambient=np.full(3, _AMBIENT)), size, EXPONENT, _GLOSS
        )
        shown.append(Panel(f"{title}: {off[name]:.2f}° off", lit, coverage > 0.5, gain=0.6))
    return shown


def _word(direction: np.ndarray) -> str:
    return " ".join(f"{value:.2f}" for value in direction)


def _photographed(
    context: Context, best: Callable[[Subject], float]
) -> tuple[Subject, Decomposition]:
    """The masked photo with the most of what an edit needs; SIRFS needs an outline."""
    photos = context.photos()
    chosen = max([one for one in photos if not one.mask.all()] or photos, key=best)
    return chosen, decompose_subject(context, chosen)


def _glossy(subject: Subject) -> float:
    """The share of its light that `isc` takes for specular."""
    split = separate("isc", subject.image, subject.mask, subject_as_photo(subject).clipped)
    return float(
        split.specular[subject.mask].sum(dtype=float) / subject.image[subject.mask].sum(dtype=float)
    )


def _colourful(subject: Subject) -> float:
    """The variance of its chromaticity, weighted by brightness."""
    light = subject.image[subject.mask].astype(float)
    bright = light.sum(axis=1, keepdims=True)
    chromaticity = light / np.maximum(bright, 1e-12)
    mean = np.average(chromaticity, axis=0, weights=bright[:, 0])
    return float(np.average(np.square(chromaticity - mean).sum(axis=1), weights=bright[:, 0]))


EDITS: tuple[tuple[str, DichromaticEdit], ...] = (
    ("specular × 2.5", DichromaticEdit(specular=LayerEdit(gain=2.5))),
    ("specular gamma 2", DichromaticEdit(specular=LayerEdit(gamma=2.0))),
    ("specular gamma ½", DichromaticEdit(specular=LayerEdit(gamma=0.5))),
    ("diffuse gamma 1.6", DichromaticEdit(diffuse=LayerEdit(gamma=1.6))),
    ("diffuse sharpened", DichromaticEdit(diffuse=LayerEdit(sharpen=1.0))),
    ("specular removed", DichromaticEdit(specular=LayerEdit(gain=0.0))),
    ("diffuse removed", DichromaticEdit(diffuse=LayerEdit(gain=0.0))),
)


def _dichromatic(context: Context) -> ItemContent:
    subject, d = _photographed(context, _glossy)
    gain = exposure(d.image, d.mask)
    shown = [Panel("photo", d.image, d.mask, gain=gain)]
    rows = [_change("nothing asked for", d, edit_layers(d, DichromaticEdit()))]
    for name, edit in EDITS:
        after = edit_layers(d, edit)
        shown.append(Panel(name, after.image, d.mask, gain=gain))
        rows.append(_change(name, d, after))
    header = (
        "edit",
        "change of the image (%)",
        "of the diffuse layer (%)",
        "of the specular layer (%)",
    )
    caption = f"{subject.name}: RMS of the change, of the layer's or the image's own RMS. A layer that an edit leaves alone changes by nothing."
    text = f"{subject.name}: each layer edited by itself, then added up again; one exposure for all. A layer's removal shows the other one."
    return ItemContent((ItemTable(header, tuple(rows), caption),), (panel_figure(shown, 4),), text)


def _change(name: str, d: Decomposition, after: Edited) -> tuple[str, float, float, float]:
    def moved(before: np.ndarray, now: np.ndarray) -> float:
        return 100 * _moved(before[d.mask], now[d.mask])

    return (
        name,
        moved(d.image, after.image),
        moved(d.diffuse, after.diffuse),
        moved(d.specular, after.specular),
    )


def _moved(before: np.ndarray, after: np.ndarray) -> float:
    size = float(np.square(before, dtype=float).sum())
    return float(np.sqrt(np.square(after.astype(float) - before).sum() / max(size, 1e-30)))


def soft_disc_mask(d: Decomposition) -> np.ndarray:
    """A mask (H, W) in [0, 1] as a person might paint it: a soft disc on the object's middle, a
    quarter of its size.
    """
    rows, columns = np.nonzero(d.mask)
    y, x = np.mgrid[: d.mask.shape[0], : d.mask.shape[1]]
    radius = 0.5 * np.sqrt(d.mask.sum() / np.pi)
    distance = np.hypot(y - np.median(rows), x - np.median(columns))
    return np.where(d.mask, np.clip((radius - distance) / 2 + 0.5, 0, 1), 0)


def _recolouring(context: Context) -> ItemContent:
    subject, d = _photographed(context, _colourful)
    gain = exposure(d.image, d.mask)
    clusters = find_clusters(d, 4, context.seed)
    numbers = range(1, min(len(clusters.shares), 3) + 1)
    target = np.array([0.05, 0.18, 0.55])
    asked: list[tuple[str, Paint, np.ndarray | None]] = [
        ("hue turned by 120°, everywhere", Paint(hue=120), None),
        ("less saturation, everywhere", Paint(saturation=0.3), None),
        ("blue in a painted mask", Paint(target=target), soft_disc_mask(d)),
    ]
    asked += [
        (f"blue in cluster {number}", Paint(target=target), clusters.weight(number))
        for number in numbers
    ]
    shown = [
        Panel("photo", d.image, d.mask, gain=gain),
        Panel("clusters of paint", _cluster_picture(clusters), d.mask),
    ]
    shown.append(Panel("painted mask", soft_disc_mask(d), d.mask, (0, 1)))
    rows: list[tuple[str | float, ...]] = []
    for name, paint, region in asked:
        after = recolour(d, paint, region)
        shown.append(Panel(name, after.image, d.mask, gain=gain))
        rows.append((name, *_recoloured(d, after, region)))
    header = (
        "edit",
        "area (% of the object)",
        "change inside (%)",
        "change outside (%)",
        "change of luminance (%)",
        "of the highlights (%)",
    )
    caption = f"{subject.name}: RMS of the change of the diffuse layer, of its own RMS; luminance of the diffuse layer, inside."
    text = (
        f"{subject.name}: another paint under the same light and gloss. Clusters are numbered by size; their picture shows each in its "
        "mean colour. Luminance stays, unless a colour cannot be that bright and becomes paler."
    )
    return ItemContent((ItemTable(header, tuple(rows), caption),), (panel_figure(shown, 3),), text)


def _cluster_picture(clusters: Clusters) -> np.ndarray:
    labels, colors = clusters.labels, clusters.colors
    return np.where(labels[..., None] >= 0, colors[np.maximum(labels, 0)], 0)


def _recoloured(d: Decomposition, after: Edited, region: np.ndarray | None) -> tuple[float, ...]:
    weight = np.where(d.mask, 1.0 if region is None else region, 0)
    inside, outside = weight > 0.99, d.mask & (weight == 0)
    rest = _moved(d.diffuse[outside], after.diffuse[outside]) if outside.any() else 0.0
    return (
        100 * float(weight.sum() / d.mask.sum()),
        100 * _moved(d.diffuse[inside], after.diffuse[inside]),
        100 * rest,
        100 * _moved(luminance(d.diffuse[inside]), luminance(after.diffuse[inside])),
        100 * _moved(d.specular[d.mask], after.specular[d.mask]),
    )


_figure: Callable[..., ThesisItem] = partial(ThesisItem, "figure")
ITEMS: tuple[ThesisItem, ...] = (
    _figure("4.49", "Highlights on a sphere, and the light directions found from them", _spheres),
    _figure("4.50", "Dichromatic editing", _dichromatic),
    _figure("4.51", "Reflectance editing", _recolouring),
)
