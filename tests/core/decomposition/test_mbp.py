"""The models that separate, on a scene with known parts: identities, the order of their steps, and
nothing invented on a diffuse object.
"""

from dataclasses import replace

import numpy as np
import pytest

from isc_core.decomposition.mbp import split_reflectance
from isc_core.decomposition.pipeline import KnownInputs, Settings, decompose
from isc_core.errors import InputError
from isc_core.photo import Photo, PhotoSource
from isc_core.progress import Monitor
from isc_core.scene.decomposition import Decomposition
from isc_core.scene.diagnostics import LobeFitOutcome, LobeStatus, WarningKind
from isc_core.separation import separate
from isc_core.shading.brdf.ggx import Ggx
from isc_core.shading.radiance import directional, radiance
from tests.angles import degrees_between
from tests.core.ball_scene import ball

TO_LIGHT = np.array([-0.42, 0.5, 0.757])
TO_LIGHT /= np.linalg.norm(TO_LIGHT)


def glossy(shape: tuple[int, int] = (76, 90), radius: float = 34.0) -> Decomposition:
    """The ball with one red albedo and the gloss of one light: alpha .15, strength x light 1.5."""
    d = ball(shape, radius, (shape[0] / 2, shape[1] / 2))
    inside = d.mask[..., None]
    reflectance = np.where(inside, [0.52, 0.12, 0.07], 0).astype(np.float32)
    gloss = radiance(
        Ggx(0.15, 0.04), d.normal.astype(float), np.array([0.0, 0, 1]), directional(TO_LIGHT, 1.5)
    )
    diffuse, specular = reflectance * d.shading, np.where(inside, gloss, 0).astype(np.float32)
    return replace(
        d, image=diffuse + specular, diffuse=diffuse, specular=specular, reflectance=reflectance
    )


def photo_of(d: Decomposition, image: np.ndarray) -> Photo:
    source = PhotoSource("0" * 64, (image.shape[1], image.shape[0]), 12, "linear", "file")
    return Photo(image.astype(np.float32), d.mask, 1 / 4095, np.zeros(d.mask.shape, bool), source)


def lobe_status(d: Decomposition) -> LobeStatus:
    lobe = d.provenance.diagnostics.lobe
    assert lobe is not None
    return lobe.status


def truth_of(d: Decomposition) -> KnownInputs:
    return KnownInputs(height=d.height.astype(float), light=d.illumination)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["mdr", "mbp"])
@pytest.mark.parametrize("full_size", [False, True])
def test_the_identities_hold_and_the_layers_are_the_scene_s(model: str, full_size: bool) -> None:
    d = glossy()
    found = decompose(
        photo_of(d, d.image),
        Settings(model=model, max_size=60, full_size=full_size),
        known=truth_of(d),
    )
    assert found.identity_errors().broken() == ()
    assert found.mask.shape == (d.mask.shape if full_size else found.mask.shape)
    assert min(found.diffuse.min(), found.specular.min()) >= 0
    assert found.specular.sum() > 0
    if full_size:
        inner = d.normal[..., 2] > 0.5
        assert np.abs(found.specular - d.specular)[inner].mean() < 0.5 * d.specular[inner].mean()


@pytest.mark.slow
@pytest.mark.parametrize("model", ["mdr", "mbp"])
def test_the_lobe_of_a_known_shape_is_found(model: str) -> None:
    d = glossy()
    brdf = decompose(photo_of(d, d.image), Settings(model=model), known=truth_of(d)).brdf
    assert brdf is not None
    assert brdf.determined, brdf.outcome
    assert brdf.alpha == pytest.approx(0.15, rel=0.5)
    assert brdf.direction is not None
    assert degrees_between(brdf.direction, TO_LIGHT) < 5
    assert brdf.model.startswith("ggx" if model == "mdr" else "blinn_phong")


@pytest.mark.slow
def test_the_whole_chain_keeps_the_identities() -> None:
    """Shape and light unknown: SIRFS is really solved."""
    d = glossy((52, 60), 23.0)
    found = decompose(photo_of(d, d.image), Settings(model="mbp"))
    assert found.identity_errors().broken() == ()
    assert found.provenance.diagnostics.converged
    assert found.provenance.settings["separator"] == "isc"
    assert found.brdf is not None


def test_plain_sirfs_has_no_lobe() -> None:
    d = glossy((52, 60), 23.0)
    found = decompose(photo_of(d, d.image), Settings(model="sirfs"), known=truth_of(d))
    assert found.brdf is None
    assert not found.specular.any()


@pytest.mark.slow
@pytest.mark.parametrize("model", ["mdr", "mbp"])
def test_no_highlight_is_invented_on_a_matt_object(model: str) -> None:
    d = glossy()
    found = decompose(photo_of(d, d.diffuse), Settings(model=model), known=truth_of(d))
    assert found.specular.sum() < 3e-3 * found.image.sum()
    assert found.brdf is not None
    assert not found.brdf.determined
    assert found.brdf.alpha is None
    assert found.brdf.outcome == LobeFitOutcome.NO_SPECULAR
    assert lobe_status(found) == LobeStatus.NO_HIGHLIGHTS


@pytest.mark.slow
@pytest.mark.parametrize("model", ["mdr", "mbp"])
def test_where_nobody_looked_for_highlights_the_object_is_not_called_matt(model: str) -> None:
    d = glossy((52, 60), 23.0)
    found = decompose(
        photo_of(d, d.image), Settings(model=model, separator="none"), known=truth_of(d)
    )
    assert found.brdf is None and lobe_status(found) == LobeStatus.NOT_FITTED


def test_an_overexposed_object_is_not_called_matt() -> None:
    d = glossy((52, 60), 23.0)
    photo = photo_of(
        d, np.where(d.mask[..., None], np.minimum(40 * d.image, 1 - 1e-3 * d.normal[..., :1]), 0)
    )
    found = decompose(
        replace(photo, clipped=d.mask & (photo.image.min(-1) > 0.9)),
        Settings(model="mdr"),
        known=truth_of(d),
    )
    assert lobe_status(found) == LobeStatus.HIDDEN
    kinds = {warning.kind for warning in found.provenance.diagnostics.warnings}
    assert WarningKind.CLIPPED in kinds


@pytest.mark.slow
def test_the_exposure_of_a_float_file_does_not_matter() -> None:
    d = glossy((52, 60), 23.0)
    found = []
    for factor in (2.0**-10, 1.0, 2.0**10):  # scaled without rounding
        photo = replace(photo_of(d, 4 * factor * d.image), code_value=factor / 4095, exposed=False)
        found.append(decompose(photo, Settings(model="mdr")))
    dim, usual, bright = found
    for other, factor in ((dim, 2.0**-10), (bright, 2.0**10)):
        assert lobe_status(other) == lobe_status(usual)
        cosine = (other.normal * usual.normal).sum(-1)[d.mask]
        assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean() < 1
        assert other.identity_errors().broken() == ()
        assert other.diffuse.sum() == pytest.approx(factor * usual.diffuse.sum(), rel=1e-3)
        assert other.reflectance[d.mask] == pytest.approx(usual.reflectance[d.mask], rel=1e-3)


def test_a_mask_without_an_inside_is_refused_before_the_work() -> None:
    d = glossy((52, 60), 23.0)
    speckled = d.mask & (np.indices(d.mask.shape).sum(0) % 2 == 0)
    stages: list[str] = []
    with pytest.raises(InputError, match="2 x 2"):
        decompose(
            replace(photo_of(d, d.image), mask=speckled),
            Settings(),
            monitor=Monitor(lambda event: stages.append(event.stage)),
        )
    assert stages == []


def test_it_is_the_reflectance_that_is_separated() -> None:
    """With the true shading, without its hue: the layers are those of image / shading, times the
    shading.
    """
    d = glossy()
    split = split_reflectance(d.image, d.shading, d.mask, None, "isc")
    inside = d.mask[..., None]
    grey = np.exp(np.log(np.where(inside, d.shading, 1)).mean(-1, keepdims=True))
    expected = separate("isc", np.where(inside, d.image / grey, 0).astype(np.float32), d.mask)
    for name in ("diffuse", "specular"):
        layer = getattr(split, name)
        assert np.abs(layer - getattr(expected, name) * grey).max() < 1e-4 * d.image.max(), name
        assert not layer[~d.mask].any()
    assert np.abs(d.image - split.diffuse - split.specular - split.residual)[d.mask].max() < 1e-6


def test_how_sirfs_shares_out_brightness_does_not_matter() -> None:
    d = glossy()
    usual, brighter = (
        split_reflectance(d.image, factor * d.shading, d.mask, None, "isc") for factor in (1, 8)
    )
    assert np.allclose(usual.diffuse, brighter.diffuse, atol=1e-6)
    assert usual.specular.any()


def test_a_light_of_the_wrong_hue_gives_no_highlights_of_that_hue() -> None:
    """SIRFS may explain yellow albedo as orange albedo under blue light; highlights stay white."""
    d = glossy()
    blue = d.shading * np.array([0.5, 0.8, 2.5], np.float32)
    usual, wrong = (
        split_reflectance(d.image, shading, d.mask, None, "isc") for shading in (d.shading, blue)
    )
    assert usual.specular.any()
    assert np.allclose(usual.specular, wrong.specular, atol=1e-5)
    assert np.ptp(wrong.specular, axis=-1).max() < 1e-6
