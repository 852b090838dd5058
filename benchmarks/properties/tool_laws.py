"""Laws of what works on images and results besides: thresholds, filling, edits, lobes, metrics,
photos.
"""

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st

from isc_core.brdf.blinn_phong import BlinnPhong
from isc_core.brdf.energy import reciprocity_error
from isc_core.brdf.fitting import LobeFitOptions, fit_lobe
from isc_core.brdf.ggx import Ggx
from isc_core.brdf.lambert import Lambert
from isc_core.brdf.oren_nayar import OrenNayar
from isc_core.decomposition import Decomposition, Provenance
from isc_core.editing.blinn_phong_extension import Gloss, change_gloss
from isc_core.editing.clusters import find_clusters
from isc_core.editing.dichromatic import DichromaticEdit, LayerEdit, edit_layers
from isc_core.editing.edited import Edited, edited
from isc_core.editing.highlights import add_highlight
from isc_core.editing.light_direction import explain_shading, explain_specular, share_explained
from isc_core.editing.lights import DirectionalLight, toward, turn, turned_light
from isc_core.editing.recolour import Paint, recolour
from isc_core.editing.relight import NewLight, Relighting, relight
from isc_core.illuminant import estimate_illuminant
from isc_core.image_metrics import rank_correlation, sparsification, ssim, ssim_volume
from isc_core.inpainting.patch_fill import fill_patches
from isc_core.inpainting.pull_push import fill
from isc_core.metrics import lmse, mse, psnr, scaled_mse
from isc_core.photo import averaged, linear_to_srgb, srgb_to_linear, tidy_mask
from isc_core.sirfs.frames import real_sh
from isc_core.thresholding import OPTIMISERS, OtsuObjective, exact, maximise, quantise

from .law import Law, Notes, between, finite
from .pictures import Picture, pictures

_EDITS = (
    "nothing",
    "gloss",
    "metal",
    "render",
    "layers",
    "recolour",
    "relight",
    "sun",
    "highlight",
)


@dataclass(frozen=True)
class Numbers:
    """A picture and three numbers in [0, 1] that choose options."""

    picture: Picture
    a: float
    b: float
    c: float


def _numbers(drawn: st.SearchStrategy[Picture]) -> st.SearchStrategy[Numbers]:
    unit = st.integers(0, 100).map(lambda n: n / 100)
    return st.builds(Numbers, drawn, unit, unit, unit)


def _result(p: Picture) -> Decomposition:
    """A decomposition whose identities hold by construction: half of the smallest channel is
    specular, the object a bump.
    """
    image, mask = p.light(), p.inside()
    y, x = np.mgrid[-1 : 1 : p.rows * 1j, -1 : 1 : p.columns * 1j]
    z = np.sqrt(np.maximum(1.2 - x**2 - y**2, 0.05))
    normal = np.stack([x, -y, z], -1) / np.linalg.norm([x, y, z], axis=0)[..., None]
    normal = np.where(mask[..., None], normal, [0.0, 0.0, 1.0]).astype(np.float32)
    light = np.random.default_rng(p.seed).normal(0, 0.3, (9, 3))
    inside = mask[..., None]
    shading = np.where(inside, np.exp(real_sh(normal.astype(float)) @ light), 0).astype(np.float32)
    specular = np.where(inside, 0.5 * image.min(axis=2, keepdims=True) * np.ones(3), 0).astype(
        np.float32
    )
    image = np.where(inside, image, 0).astype(np.float32)
    diffuse = image - specular
    reflectance = np.where(inside, diffuse / np.where(inside, shading, 1), 0).astype(np.float32)
    height = np.where(mask, p.columns * z / 2, 0).astype(np.float32)
    confidence = mask.astype(np.float32)
    residual = np.zeros_like(image)
    return Decomposition(
        image,
        diffuse,
        specular,
        residual,
        reflectance,
        shading,
        normal,
        height,
        mask,
        confidence,
        light,
        Provenance(),
    )


def _edit(d: Decomposition, case: Numbers, kind: str) -> Edited:
    a, b, c = case.a, case.b, case.c
    sun = DirectionalLight(toward(2 * a - 1, 2 * b - 1, 0.2 + c), np.pi * np.array([1.0, a, b]))
    edits = {
        "nothing": lambda: edited(d),
        "gloss": lambda: change_gloss(d, Gloss(exponent=1 + 500 * a, gain=2 * b)),
        "metal": lambda: change_gloss(d, Gloss(metal=a)),
        "render": lambda: change_gloss(d, Gloss(exponent=1 + 500 * a, method="render")),
        "layers": lambda: edit_layers(
            d,
            DichromaticEdit(
                LayerEdit(2 * a, 0.3 + 3 * b, 2 * c - 1), LayerEdit(a, 1, b, 0.5 + 3 * c)
            ),
        ),
        "recolour": lambda: recolour(
            d, Paint(360 * a, 2 * b, 2 * c), find_clusters(d, 1 + int(5 * a), 3).weight(1)
        ),
        "relight": lambda: relight(
            d,
            NewLight(turned_light(d.illumination, turn(360 * a, 90 * b, 90 * c))),
            Relighting(exposure=0.2 + b),
        ),
        "sun": lambda: relight(d, NewLight(sun=sun)),
        "highlight": lambda: add_highlight(d, sun, level=a, replacing=b > 0.5),
    }
    return edits[kind]()


def _edits(case: tuple[Numbers, str], notes: Notes) -> None:
    del notes
    numbers, kind = case
    d = _result(numbers.picture)
    assert not d.identity_errors().broken(), d.identity_errors().broken()
    edit = _edit(d, numbers, kind)
    finite(image=edit.image, diffuse=edit.diffuse, specular=edit.specular)
    for name in ("image", "diffuse", "specular"):
        layer = getattr(edit, name)
        assert (layer >= 0).all() and not layer[~d.mask].any(), name
    if kind == "nothing":
        assert np.array_equal(edit.image, d.image), "an edit of nothing changes the image"


def _light_direction(p: Picture, notes: Notes) -> None:
    del notes
    d = _result(p)
    for found in (explain_shading(d), explain_specular(d)):
        finite(
            direction=found.light.direction,
            irradiance=found.light.irradiance,
            ambient=found.light.ambient,
        )
        between(0, 1 + 1e-9, explained=found.explained)
        between(0, 180, cone=found.cone)
        between(1 - 1e-6, 1 + 1e-6, length=float(np.linalg.norm(found.light.direction)))
        assert (found.light.irradiance >= 0).all()
    light, share = share_explained(d, toward(0.1, 0.2, 1))
    between(0, 1 + 1e-9, share=share)
    finite(irradiance=light.irradiance)
    colour = estimate_illuminant(d.image, d.mask).colour
    finite(colour=colour)
    assert (colour > 0).all()


def _lobe_fit(case: Numbers, notes: Notes) -> None:
    del notes
    d = _result(case.picture)
    options = LobeFitOptions(
        most_pixels=200, most_lights=1, recovered=case.a > 0.5, normal_error=15 * case.b
    )
    fit = fit_lobe(
        d.specular, d.normal.astype(float), d.mask, d.confidence, options=options, shading=d.shading
    )
    finite(predicted=fit.predicted)
    assert (fit.predicted >= 0).all() and not fit.predicted[~d.mask].any()
    between(0, 1, explained=fit.explained)
    assert fit.determined or fit.reason, "undetermined without a reason"
    if fit.alpha is not None:
        between(1e-4, 1, alpha=fit.alpha)
    for light in fit.lights:
        finite(direction=light.direction, strength=light.strength_light)


def _thresholds(case: tuple[Picture, int, str, int], notes: Notes) -> None:
    del notes
    picture, count, optimiser, seed = case
    brightness = picture.light().mean(axis=2)
    levels = quantise(brightness, float(brightness.max()))
    objective = OtsuObjective(np.bincount(levels[picture.inside()], minlength=256))
    best, fewer = exact(objective, count), exact(objective, max(count - 1, 1))
    found = maximise(optimiser, objective, count, evaluations=1500, seed=seed)
    for optimum in (best, found):
        between(0, 255, thresholds=optimum.thresholds)
        assert (np.diff(optimum.thresholds) >= 0).all() and len(optimum.thresholds) == count
        assert np.isfinite(optimum.value) and optimum.value >= -1e-9
        assert (np.diff(optimum.history[:, 1]) >= 0).all(), "the best value so far falls"
    close = 1e-9 * max(1.0, best.value)
    assert found.value <= best.value + close, "an optimiser beats the exact maximum"
    assert best.value >= fewer.value - close, "one threshold more loses"
    again = maximise(optimiser, objective, count, evaluations=1500, seed=seed)
    assert np.array_equal(found.thresholds, again.thresholds), "the same seed, other thresholds"


def _filling(p: Picture, notes: Notes) -> None:
    del notes
    image, known = p.light(), p.inside()
    filled = fill(image, known)
    finite(filled=filled)
    low, high = image[known].min(axis=0), image[known].max(axis=0)
    room = 1e-5 * float(high.max())
    assert (filled >= low - room).all() and (filled <= high + room).all(), (
        "filled beyond what is known"
    )
    assert np.array_equal(filled[known], image[known]), "known pixels changed"
    patched = fill_patches(image, known, ~known)
    finite(patched=patched)
    assert np.array_equal(patched[known], image[known]), "known pixels changed"
    room = 1e-4 * float(high.max())
    assert (patched >= low - room).all() and (patched <= high + room).all(), (
        "patches beyond what is known"
    )


def _metrics(case: tuple[Picture, Picture], notes: Notes) -> None:
    del notes
    one, other = case
    a, mask = one.light().astype(float), one.inside()
    b = (
        np.random.default_rng(other.seed).permutation(a.reshape(-1, 3)).reshape(a.shape)
        * other.gain
    )
    between(0, np.inf, mse=mse(a, b, mask), scaled=scaled_mse(a[mask], b[mask]))
    assert scaled_mse(a[mask], b[mask]) <= float(np.square(a[mask]).mean()) * (1 + 1e-9), (
        "a scale of 0 would be better"
    )
    assert mse(a, a) == 0 and psnr(a, a) == np.inf
    peak = max(float(a.max()), 1e-30)
    for similarity in (ssim, ssim_volume):
        between(-1 - 1e-9, 1 + 1e-9, ssim=similarity(a, b, mask, peak=peak))
        between(1 - 1e-6, 1 + 1e-6, same=similarity(a, a, mask, peak=peak))
    if all(a[mask][:, c].any() for c in range(3)):
        try:
            error = lmse(a, b, mask)
        except ValueError:
            error = 0.0  # a channel is zero but for pixels too dark to be squared
        between(0, 1 + 1e-9, lmse=error)
    curve = sparsification(np.abs(a - b)[mask].mean(axis=1), b[mask].mean(axis=1))
    between(0, 1, left=curve.left, dropped=curve.dropped)
    assert (np.diff(curve.left) <= 1e-12).all()
    between(-1 - 1e-9, 1 + 1e-9, rank=rank_correlation(a[mask][:, 0], b[mask][:, 1]))


def _photos(case: Numbers, notes: Notes) -> None:
    p = case.picture
    image, mask = p.light(), p.inside()
    round_trip = srgb_to_linear(linear_to_srgb(image.astype(float)))
    error = float(np.abs(round_trip - image).max()) / max(float(image.max()), 1e-30)
    assert notes.measure("sRGB there and back, of the peak", error) <= 1e-6
    tidy = tidy_mask(mask)
    assert np.array_equal(tidy_mask(tidy), tidy), "tidying twice changes a mask"
    small, inside, factor = averaged(image, mask, 0.2 + 0.8 * case.a)
    finite(small=small)
    assert inside.any() and 0 < factor <= 1 and not small[~inside].any()
    room = 1e-5 * float(image.max()) + float(
        np.finfo(np.float32).tiny
    )  # below it a mean has hardly any digits
    assert (small[inside] >= image[mask].min(axis=0) - room).all() and (
        small[inside] <= image[mask].max(axis=0) + room
    ).all()


def _models(case: tuple[float, float, float], notes: Notes) -> None:
    rough, strong, seed = case
    models = (
        Lambert(strong),
        OrenNayar(strong, rough),
        BlinnPhong(1 + 2000 * rough),
        Ggx(0.02 + 0.9 * rough),
    )
    rng = np.random.default_rng(int(1000 * seed))
    vectors = rng.normal(size=(3, 200, 3))
    normal, view, light = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    for model in models:
        value = model.value(normal, view, light)
        finite(value=value)
        assert (value >= 0).all(), f"{type(model).__name__} is negative"
        below = ((normal * light).sum(-1) <= 0) | ((normal * view).sum(-1) <= 0)
        assert not value[below].any(), "light from below the horizon"
        notes.measure(f"reciprocity of {type(model).__name__}", reciprocity_error(model, 100))


_UNIT = st.integers(0, 100).map(lambda n: n / 100)
_THRESHOLD_CASES = st.tuples(
    pictures(2, 24), st.integers(1, 5), st.sampled_from(OPTIMISERS), st.integers(0, 99)
)
LAWS = (
    Law(
        "edits",
        "every edit of any result: finite, >= 0, 0 outside; an edit of nothing is the image",
        st.tuples(_numbers(pictures(3, 28)), st.sampled_from(_EDITS)),
        _edits,
        0.05,
    ),
    Law(
        "light",
        "light directions and the light's colour: finite, unit, shares in [0, 1]",
        pictures(6, 28),
        _light_direction,
        0.1,
    ),
    Law(
        "lobe fit",
        "any specular layer: a finite lobe, or a reason why there is none",
        _numbers(pictures(8, 20)),
        _lobe_fit,
        0.5,
    ),
    Law(
        "thresholds",
        "nothing beats the exact maximum; one threshold more never loses; the same seed, the same answer",
        _THRESHOLD_CASES,
        _thresholds,
        0.05,
    ),
    Law(
        "filling",
        "known pixels stay, filled ones lie between the known",
        pictures(3, 28),
        _filling,
        0.1,
    ),
    Law(
        "metrics",
        "in their ranges, best for equal images",
        st.tuples(pictures(4, 24), pictures(4, 24)),
        _metrics,
    ),
    Law(
        "photos",
        "curves there and back, masks tidied once, means between their values",
        _numbers(pictures(3, 40)),
        _photos,
    ),
    Law(
        "reflectance models",
        "finite, >= 0, dark below the horizon",
        st.tuples(_UNIT, _UNIT, _UNIT),
        _models,
    ),
)
