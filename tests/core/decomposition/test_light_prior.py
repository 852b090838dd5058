"""The light prior of SIRFS: the network's prediction for a photo, or the lights of all photos."""

import numpy as np
import pytest

from isc_core.decomposition.pipeline import Settings, decompose
from isc_core.errors import InputError
from isc_core.networks.scene_network import predict_scene
from isc_core.photo import Photo, PhotoSource
from isc_core.scene.decomposition import Decomposition
from isc_core.shading.spherical_harmonics import real_sh
from tests.core.lit_balls import ball, under_lights


def found(toward: tuple[float, float, float], grey: bool = False, **settings: str) -> Decomposition:
    """A coloured ball under one light, explained."""
    image, mask = under_lights(toward)
    image = image.mean(axis=2, keepdims=True).repeat(3, axis=2) if grey else image
    photo = Photo(
        image, mask, 1e-4, np.zeros_like(mask), PhotoSource("", mask.shape, 32, "linear", "file")
    )
    return decompose(photo, Settings(model="mdr", threads=1, **settings))  # type: ignore[arg-type]


def off_the_network(d: Decomposition) -> float:
    """How far the light's contrast is from what the network sees: log shading of the ball."""
    normal, mask = ball()
    seen = predict_scene(d.image, d.mask).light.mean
    return float((real_sh(normal[mask]) @ (d.illumination - seen)).std(axis=0).mean())


@pytest.mark.slow
@pytest.mark.parametrize("grey", [False, True])
def test_the_light_is_nearer_to_what_was_seen(grey: bool) -> None:
    """One ball does not measure accuracy: docs/methods/scene_network.md has the measurements."""
    seen, usual = (
        found((-0.7, 0.2, 0.6), grey, shape_prior="silhouette", light_prior=prior)
        for prior in ("predicted", "dataset")
    )
    assert seen.identity_errors().broken() == ()
    assert off_the_network(seen) < 0.95 * off_the_network(usual)
    assert (
        seen.provenance.settings["light_prior"] == "predicted"
        and usual.provenance.settings["light_prior"] == "dataset"
    )
    assert seen.provenance.diagnostics.light_counts == usual.provenance.diagnostics.light_counts


@pytest.mark.slow
def test_predictions_count_in_the_laboratory_as_well() -> None:
    one, other = (
        found((0.5, 0.5, 0.7), illumination="laboratory", light_prior=prior)
        for prior in ("predicted", "dataset")
    )
    assert not np.array_equal(one.illumination, other.illumination)


def test_an_unknown_prior_is_refused() -> None:
    with pytest.raises(InputError, match="unknown light prior"):
        Settings(light_prior="bright").check()
