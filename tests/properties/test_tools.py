"""Properties of edits, light estimates, lobes, thresholds, filling, metrics and photo helpers."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import strategies as st

from isc_core.editing.blinn_phong_extension import Gloss, change_gloss
from isc_core.editing.clusters import find_clusters
from isc_core.editing.dichromatic import DichromaticEdit, LayerEdit, edit_layers
from isc_core.editing.edited import Edited, edited
from isc_core.editing.highlights import add_highlight
from isc_core.editing.recolour import ColourEdit, recolour
from isc_core.editing.relight import NewLight, Relighting, relight
from isc_core.evaluation.image_metrics import rank_correlation, sparsification, ssim, ssim_volume
from isc_core.evaluation.metrics import lmse, mse, psnr, scaled_mse
from isc_core.illuminant.illuminant import estimate_illuminant
from isc_core.imaging.area_resize import averaged
from isc_core.imaging.srgb import linear_to_srgb, srgb_to_linear
from isc_core.inpainting.patch_fill import fill_patches
from isc_core.inpainting.pull_push import fill, fill_at
from isc_core.lobe_fitting import PixelData, RecoveredScene, fit_lobe
from isc_core.lobe_fitting.light_direction import explain_shading, explain_specular, share_explained
from isc_core.photo import tidy_mask
from isc_core.scene.decomposition import Decomposition, Provenance
from isc_core.scene.lobe_fit import LobeFitOptions
from isc_core.shading.brdf.blinn_phong import BlinnPhong
from isc_core.shading.brdf.energy import reciprocity_error
from isc_core.shading.brdf.ggx import Ggx
from isc_core.shading.brdf.lambert import Lambert
from isc_core.shading.brdf.oren_nayar import OrenNayar
from isc_core.shading.lights import DirectionalLight, toward, turn, turned_light
from isc_core.shading.spherical_harmonics import real_sh
from isc_core.thresholding import OPTIMISERS, OtsuObjective, exact, maximise, quantise
from tests.properties.laws import at_most, between, finite, law
from tests.properties.photos import MadePhoto, photos

UNIT = st.integers(0, 100).map(lambda n: n / 100)


@dataclass(frozen=True)
class OptionsCase:
    """A photo and three numbers in [0, 1] that choose options."""

    made: MadePhoto
    a: float
    b: float
    c: float


def with_options(drawn: st.SearchStrategy[MadePhoto]) -> st.SearchStrategy[OptionsCase]:
    """Photos with three numbers."""
    return st.builds(OptionsCase, drawn, UNIT, UNIT, UNIT)


def bump(made: MadePhoto) -> Decomposition:
    """A decomposition whose identities hold by construction: half of the smallest channel is
    specular, the object a bump.
    """
    image, mask = made.light(), made.inside()
    inside = mask[..., None]
    y, x = np.mgrid[-1 : 1 : made.rows * 1j, -1 : 1 : made.columns * 1j]
    z = np.sqrt(np.maximum(1.2 - x**2 - y**2, 0.05))
    normal = np.stack([x, -y, z], -1) / np.linalg.norm([x, y, z], axis=0)[..., None]
    normal = np.where(inside, normal, [0.0, 0.0, 1.0]).astype(np.float32)
    light = np.random.default_rng(made.seed).normal(0, 0.3, (9, 3))
    shading = np.where(inside, np.exp(real_sh(normal.astype(float)) @ light), 0).astype(np.float32)
    white = 0.5 * image.min(axis=2, keepdims=True) * np.ones(3)
    specular = np.where(inside, white, 0).astype(np.float32)
    image = np.where(inside, image, 0).astype(np.float32)
    diffuse = image - specular
    reflectance = np.where(inside, diffuse / np.where(inside, shading, 1), 0).astype(np.float32)
    height = np.where(mask, made.columns * z / 2, 0).astype(np.float32)
    return Decomposition(
        image=image,
        diffuse=diffuse,
        specular=specular,
        residual=np.zeros_like(image),
        reflectance=reflectance,
        shading=shading,
        normal=normal,
        height=height,
        mask=mask,
        confidence=mask.astype(np.float32),
        illumination=light,
        provenance=Provenance(),
    )


def sun_of(case: OptionsCase) -> DirectionalLight:
    direction = toward(2 * case.a - 1, 2 * case.b - 1, 0.2 + case.c)
    return DirectionalLight(direction, np.pi * np.array([1.0, case.a, case.b]))


def layers_edit(n: OptionsCase) -> DichromaticEdit:
    diffuse = LayerEdit(2 * n.a, 0.3 + 3 * n.b, 2 * n.c - 1)
    return DichromaticEdit(diffuse, LayerEdit(n.a, 1, n.b, 0.5 + 3 * n.c))


def recoloured(d: Decomposition, n: OptionsCase) -> Edited:
    weight = find_clusters(d, 1 + int(5 * n.a), 3).weight(1)
    return recolour(d, ColourEdit(360 * n.a, 2 * n.b, 2 * n.c), weight)


def turned(d: Decomposition, n: OptionsCase) -> Edited:
    light = turned_light(d.illumination, turn(360 * n.a, 90 * n.b, 90 * n.c))
    return relight(d, NewLight(light), Relighting(exposure=0.2 + n.b))


EDITS: dict[str, Callable[[Decomposition, OptionsCase], Edited]] = {
    "nothing": lambda d, n: edited(d),
    "gloss": lambda d, n: change_gloss(d, Gloss(exponent=1 + 500 * n.a, gain=2 * n.b)),
    "metal": lambda d, n: change_gloss(d, Gloss(metal=n.a)),
    "render": lambda d, n: change_gloss(d, Gloss(exponent=1 + 500 * n.a, method="render")),
    "layers": lambda d, n: edit_layers(d, layers_edit(n)),
    "recolour": recoloured,
    "relight": turned,
    "sun": lambda d, n: relight(d, NewLight(directional=sun_of(n))),
    "highlight": lambda d, n: add_highlight(d, sun_of(n), level=n.a, replacing=n.b > 0.5),
}


def apply_edit(d: Decomposition, case: OptionsCase, kind: str) -> Edited:
    return EDITS[kind](d, case)


@pytest.mark.slow
@law(st.tuples(with_options(photos(3, 28)), st.sampled_from(tuple(EDITS))), seconds=0.05)
def test_edits(case: tuple[OptionsCase, str]) -> None:
    options, kind = case
    d = bump(options.made)
    assert not d.identity_errors().broken(), d.identity_errors().broken()
    edit = apply_edit(d, options, kind)
    finite(image=edit.image, diffuse=edit.diffuse, specular=edit.specular)
    for name in ("image", "diffuse", "specular"):
        layer = getattr(edit, name)
        assert (layer >= 0).all() and not layer[~d.mask].any(), name
    if kind == "nothing":
        assert np.array_equal(edit.image, d.image), "an edit of nothing changes the image"


@pytest.mark.slow
@law(photos(6, 28), seconds=0.1)
def test_light_directions_and_colour(made: MadePhoto) -> None:
    d = bump(made)
    for found in (explain_shading(d), explain_specular(d)):
        light = found.light
        finite(direction=light.direction, irradiance=light.irradiance, ambient=light.ambient)
        between(0, 1 + 1e-9, explained=found.explained)
        between(0, 180, cone=found.cone)
        between(1 - 1e-6, 1 + 1e-6, length=float(np.linalg.norm(light.direction)))
        assert (light.irradiance >= 0).all()
    ambient, share = share_explained(d, toward(0.1, 0.2, 1))
    between(0, 1 + 1e-9, share=share)
    finite(irradiance=ambient.irradiance)
    colour = estimate_illuminant(d.image, d.mask).colour
    finite(colour=colour)
    assert (colour > 0).all()


@law(with_options(photos(8, 20)), seconds=0.5)
def test_lobe_is_finite_or_has_a_reason(case: OptionsCase) -> None:
    d = bump(case.made)
    options = LobeFitOptions(most_pixels=200, most_lights=1, normal_error=15 * case.b)
    normal = d.normal.astype(float)
    fit = fit_lobe(
        d.specular,
        normal,
        d.mask,
        options=options,
        pixels=PixelData(confidence=d.confidence),
        recovered=RecoveredScene(d.shading) if case.a > 0.5 else None,
    )
    finite(predicted=fit.predicted)
    assert (fit.predicted >= 0).all() and not fit.predicted[~d.mask].any()
    between(0, 1, explained=fit.explained)
    assert fit.determined or fit.alpha is None or fit.outcome.bounded, "undetermined alpha"
    if fit.alpha is not None:
        between(1e-4, 1, alpha=fit.alpha)
    for light in fit.lights:
        finite(direction=light.direction, strength=light.strength_light)


@law(
    st.tuples(photos(2, 24), st.integers(1, 5), st.sampled_from(OPTIMISERS), st.integers(0, 99)),
    seconds=0.05,
)
def test_thresholds(case: tuple[MadePhoto, int, str, int]) -> None:
    made, count, optimiser, seed = case
    brightness = made.light().mean(axis=2)
    levels = quantise(brightness, float(brightness.max()))
    objective = OtsuObjective(np.bincount(levels[made.inside()], minlength=256))
    best, fewer = exact(objective, count), exact(objective, max(count - 1, 1))
    found, again = (
        maximise(optimiser, objective, count, evaluations=1500, seed=seed) for _ in range(2)
    )
    for optimum in (best, found):
        between(0, 255, thresholds=optimum.thresholds)
        assert (np.diff(optimum.thresholds) >= 0).all() and len(optimum.thresholds) == count
        assert np.isfinite(optimum.value) and optimum.value >= -1e-9
        assert (np.diff(optimum.history[:, 1]) >= 0).all(), "the best value so far falls"
    close = 1e-9 * max(1.0, best.value)
    assert found.value <= best.value + close, "an optimiser exceeds the exact maximum"
    assert best.value >= fewer.value - close, "one more threshold is worse"
    assert np.array_equal(found.thresholds, again.thresholds), "not deterministic"


@law(photos(3, 28), seconds=0.1)
def test_filling_some_pixels_is_filling_all(made: MadePhoto) -> None:
    image, known = made.light().astype(np.float32), made.inside()
    np.testing.assert_array_equal(fill_at(image, known, ~known), fill(image, known)[~known])


@law(photos(3, 28), seconds=0.1)
def test_filling_stays_between_the_known_values(made: MadePhoto) -> None:
    image, known = made.light(), made.inside()
    low, high = image[known].min(axis=0), image[known].max(axis=0)
    results = ((fill(image, known), 1e-5), (fill_patches(image, known, ~known), 1e-4))
    for filled, tolerance in results:
        room = tolerance * float(high.max())
        finite(filled=filled)
        assert np.array_equal(filled[known], image[known]), "known pixels changed"
        assert (filled >= low - room).all() and (filled <= high + room).all()


@law(st.tuples(photos(4, 24), photos(4, 24)))
def test_metrics_stay_in_range(case: tuple[MadePhoto, MadePhoto]) -> None:
    one, other = case
    a, mask = one.light().astype(float), one.inside()
    shuffled = np.random.default_rng(other.seed).permutation(a.reshape(-1, 3))
    b = shuffled.reshape(a.shape) * other.gain
    scaled = scaled_mse(a[mask], b[mask])
    between(0, np.inf, mse=mse(a, b, mask), scaled=scaled)
    assert scaled <= float(np.square(a[mask]).mean()) * (1 + 1e-9), "a scale of 0 is better"
    assert mse(a, a) == 0 and psnr(a, a) == np.inf
    peak = max(float(a.max()), 1e-30)
    for similarity in (ssim, ssim_volume):
        between(-1 - 1e-9, 1 + 1e-9, ssim=similarity(a, b, mask, peak=peak))
        between(1 - 1e-6, 1 + 1e-6, same=similarity(a, a, mask, peak=peak))
    if all(a[mask][:, c].any() for c in range(3)):
        try:
            error = lmse(a, b, mask)
        except ValueError:
            error = 0.0  # a channel is zero except for pixels too dark to be squared
        between(0, 1 + 1e-9, lmse=error)
    curve = sparsification(np.abs(a - b)[mask].mean(axis=1), b[mask].mean(axis=1))
    between(0, 1, left=curve.left, dropped=curve.dropped)
    assert (np.diff(curve.left) <= 1e-12).all()
    between(-1 - 1e-9, 1 + 1e-9, rank=rank_correlation(a[mask][:, 0], b[mask][:, 1]))


@law(with_options(photos(3, 40)))
def test_photo_helpers(case: OptionsCase) -> None:
    image, mask = case.made.light(), case.made.inside()
    round_trip = srgb_to_linear(linear_to_srgb(image.astype(float)))
    error = float(np.abs(round_trip - image).max()) / max(float(image.max()), 1e-30)
    at_most(1e-6, error, "sRGB round trip")
    tidy = tidy_mask(mask)
    assert np.array_equal(tidy_mask(tidy), tidy), "tidying twice changes a mask"
    small, inside, factor = averaged(image, mask, 0.2 + 0.8 * case.a)
    finite(small=small)
    assert inside.any() and 0 < factor <= 1 and not small[~inside].any()
    # Means of denormal values have hardly any correct digit.
    room = 1e-5 * float(image.max()) + float(np.finfo(np.float32).tiny)
    assert (small[inside] >= image[mask].min(axis=0) - room).all()
    assert (small[inside] <= image[mask].max(axis=0) + room).all()


@law(st.tuples(UNIT, UNIT, UNIT))
def test_reflectance_models(case: tuple[float, float, float]) -> None:
    rough, strong, seed = case
    models = (
        Lambert(strong),
        OrenNayar(strong, rough),
        BlinnPhong(1 + 2000 * rough),
        Ggx(0.02 + 0.9 * rough),
    )
    vectors = np.random.default_rng(int(1000 * seed)).normal(size=(3, 200, 3))
    normal, view, light = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    below = ((normal * light).sum(-1) <= 0) | ((normal * view).sum(-1) <= 0)
    for model in models:
        name, value = type(model).__name__, model.value(normal, view, light)
        finite(value=value)
        assert (value >= 0).all(), f"{name} is negative"
        assert not value[below].any(), f"{name}: light from below the horizon"
        finite(reciprocity=np.asarray(reciprocity_error(model, 100)))


def test_no_error_remains_when_every_pixel_is_dropped() -> None:
    """A cumulative sum over its own total may exceed 1 by rounding."""
    for seed in range(40):
        error = np.random.default_rng(seed).random(15)
        left = sparsification(error, np.arange(15.0)).left
        assert left.min() >= 0 and left[-1] == pytest.approx(0, abs=1e-12)
