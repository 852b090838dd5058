"""Figures 4.49 to 4.51: light direction from highlights, dichromatic editing, reflectance editing.

The sphere is a coloured ball under one distant light with little ambient light and a Blinn-Phong
lobe of known exponent. The light is estimated in five ways: from the shading and from the highlight
with the true shape and layers, from the highlight with layers separated by `isc`, and from both
with everything estimated from the picture (model MDR). Errors are angles between directions.

The edits are those of `isc edit`, on photos where data are given, else on rendered objects.

Citation: J. F. Blinn (1977), doi:10.1145/563858.563893; S. A. Shafer (1985),
doi:10.1002/col.5080100409; H. Akbar, thesis (2016).

Limits: a convex ball without shadows is the easiest object. The quality of an edit is not
measured, only that it changes what it should and nothing else.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from isc_core.editing.clusters import Clusters, find_clusters
from isc_core.editing.dichromatic import DichromaticEdit, LayerEdit, edit_layers
from isc_core.editing.edited import Edited
from isc_core.editing.recolour import ColourEdit, recolour
from isc_core.editing.spheres import render_sphere
from isc_core.imaging.luminance import luminance
from isc_core.lobe_fitting.light_direction import explain_shading, explain_specular, lobe_light
from isc_core.scene.decomposition import Decomposition, Provenance, Separation
from isc_core.separation import separate
from isc_core.shading.lights import DirectionalLight, toward
from isc_core.shading.sphere import sphere_normals
from synth.capture.truth import fit_light

from ..drawing.panels import Panel, panel_figure
from ..drawing.style import exposure
from ..images.subject import Subject
from ..measuring.context import Context, JsonRow
from ..measuring.decompositions import decompose_subject, subject_as_photo
from ..report.item import ItemContent, ItemTable, ThesisItem

ALBEDO = np.array([0.62, 0.18, 0.10])
EXPONENT, _STRENGTH, _AMBIENT = 60.0, 0.06, 0.08
DIRECTIONS = (
    (-0.6, 0.6, 1.0),
    (0.7, 0.5, 1.0),
    (0.0, 0.9, 0.8),
    (-0.9, 0.1, 0.7),
    (0.9, -0.4, 0.8),
    (0.2, 0.2, 1.0),
)


def render_ball(direction: np.ndarray, size: int) -> Decomposition:
    """Render a glossy ball under a directional light, with the ground truth of every layer.

    Parameters
    ----------
    direction : (3,) ndarray
        Unit vector toward the light, camera frame.
    size : int
        Side of the picture, pixels.

    Returns
    -------
    Decomposition
        The truth. `illumination` is the smooth light nearest to the directional light; `shading` is
        that of the directional light itself.
    """
    normal, coverage = sphere_normals(size)
    mask = coverage > 0.5
    light = DirectionalLight(direction, ambient=np.full(3, _AMBIENT))
    shading = light.shading(normal)
    specular = _STRENGTH * lobe_light(normal, direction, EXPONENT)[..., None] * light.irradiance
    illumination, _ = fit_light(normal[mask], shading[mask])

    def inside(values: np.ndarray) -> np.ndarray:
        return np.where(mask[..., None], values, 0).astype(np.float32)

    diffuse, specular_layer, albedo = (
        inside(ALBEDO * shading),
        inside(specular),
        inside(np.broadcast_to(ALBEDO, shading.shape)),
    )
    facing = np.where(mask[..., None], normal, [0.0, 0, 1]).astype(np.float32)
    height, sure = (
        np.where(mask, 0.45 * size * normal[..., 2], 0).astype(np.float32),
        mask.astype(np.float32),
    )
    layers = (
        diffuse + specular_layer,
        diffuse,
        specular_layer,
        np.zeros_like(diffuse),
        albedo,
        inside(shading),
    )
    return Decomposition(*layers, facing, height, mask, sure, illumination, Provenance())


def with_separated_layers(d: Decomposition) -> Decomposition:
    """Replace the layers of a decomposition by those that `isc` separates from its image.

    Parameters
    ----------
    d : Decomposition
        Remains unchanged.

    Returns
    -------
    Decomposition
        With new diffuse, specular and residual layers.
    """
    split: Separation = separate("isc", d.image, d.mask)
    return replace(d, diffuse=split.diffuse, specular=split.specular, residual=split.residual)


def degrees_between(one: np.ndarray, other: np.ndarray) -> float:
    """Compute the angle between two directions.

    Parameters
    ----------
    one, other : (3,) ndarray
        Unit vectors.

    Returns
    -------
    float
        In degrees.
    """
    return float(np.rad2deg(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other)))


def estimate_directions(
    ball: Decomposition, picture_only: Decomposition | None = None
) -> dict[str, np.ndarray]:
    """Estimate the direction of the light in several ways.

    Parameters
    ----------
    ball : Decomposition
        True layers and shape.
    picture_only : Decomposition, optional
        A model's result for the image of the ball.

    Returns
    -------
    dict of str to (3,) ndarray
        Unit directions by method.
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
        "Degrees between the true and the estimated direction; x right, y up, z toward the viewer.",
    )
    text = (
        "Each row: the ball under one directional light, its highlight as separated by "
        "`isc`, and balls lit from the directions estimated from the separated "
        "highlight, from the true shading, and from the shading by MDR. With the true "
        "shape, shading and highlight both determine the light; from the picture "
        "alone, the error follows that of the recovered shape."
    )
    if context.quick:
        text += " In a quick run, MDR decomposes the first ball only."
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
            DirectionalLight(found[name], ambient=np.full(3, _AMBIENT)), size, EXPONENT, _STRENGTH
        )
        shown.append(Panel(f"{title}: {off[name]:.2f}° off", lit, coverage > 0.5, gain=0.6))
    return shown


def _word(direction: np.ndarray) -> str:
    return " ".join(f"{value:.2f}" for value in direction)


def _photographed(
    context: Context, rank: Callable[[Subject], float]
) -> tuple[Subject, Decomposition]:
    """Decompose the photo with the largest score, with a silhouette if possible."""
    photos = context.photos()
    chosen = max([one for one in photos if not one.mask.all()] or photos, key=rank)
    return chosen, decompose_subject(context, chosen)


def _specular_share(subject: Subject) -> float:
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
    subject, d = _photographed(context, _specular_share)
    gain = exposure(d.image, d.mask)
    shown = [Panel("photo", d.image, d.mask, gain=gain)]
    rows = [_change("no edit", d, edit_layers(d, DichromaticEdit()))]
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
    caption = (
        f"{subject.name}: RMS of the change relative to the RMS of the layer or image. "
        "An unedited layer changes by 0."
    )
    text = (
        f"{subject.name}: each layer edited separately, then summed; one exposure for "
        "all. Removing one layer shows the other."
    )
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
    """Create a soft disc on the middle of the object, a quarter of its size.

    Parameters
    ----------
    d : Decomposition
        The object.

    Returns
    -------
    (H, W) ndarray
        Weights in [0, 1].
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
    edits: list[tuple[str, ColourEdit, np.ndarray | None]] = [
        ("hue turned by 120°, everywhere", ColourEdit(hue=120), None),
        ("less saturation, everywhere", ColourEdit(saturation=0.3), None),
        ("blue inside a mask", ColourEdit(target=target), soft_disc_mask(d)),
    ]
    edits += [
        (f"blue in cluster {number}", ColourEdit(target=target), clusters.weight(number))
        for number in numbers
    ]
    shown = [
        Panel("photo", d.image, d.mask, gain=gain),
        Panel("clusters of reflectance", _cluster_picture(clusters), d.mask),
    ]
    shown.append(Panel("mask", soft_disc_mask(d), d.mask, (0, 1)))
    rows: list[tuple[str | float, ...]] = []
    for name, edit, region in edits:
        after = recolour(d, edit, region)
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
    caption = (
        f"{subject.name}: RMS of the change of the diffuse layer relative to its own "
        "RMS; luminance of the diffuse layer, inside."
    )
    text = (
        f"{subject.name}: another reflectance under the same light and specular lobe. "
        "Clusters are numbered by size and drawn in their mean colour. Luminance is "
        "kept, unless a colour cannot be that bright and becomes paler."
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
    _figure("4.49", "Highlights on a sphere and the estimated light directions", _spheres),
    _figure("4.50", "Dichromatic editing", _dichromatic),
    _figure("4.51", "Reflectance editing", _recolouring),
)
