"""The shape prior of SIRFS: normals predicted from the photo, or the silhouette alone."""

import numpy as np
import pytest

from isc_core.decomposition.pipeline import KnownInputs, Settings, decompose
from isc_core.errors import InputError
from isc_core.photo import Photo, PhotoSource
from isc_core.scene.decomposition import Decomposition
from tests.core.lit_balls import ball, under_lights


def found(evidence: KnownInputs | None = None, cut: int = 0, **settings: str) -> Decomposition:
    """A coloured ball under one light, explained."""
    image, mask = (part[cut:] for part in under_lights((-0.7, 0.2, 0.6)))
    photo = Photo(
        image, mask, 1e-4, np.zeros_like(mask), PhotoSource("", mask.shape, 32, "linear", "file")
    )
    return decompose(photo, Settings(model="mdr", threads=1, **settings), known=evidence)  # type: ignore[arg-type]


def error(d: Decomposition) -> float:
    """Degrees between the normals and the ball's, in the mean."""
    normal, mask = ball()
    return float(np.degrees(np.arccos(np.clip((d.normal * normal).sum(-1)[mask], -1, 1))).mean())


@pytest.mark.slow
def test_a_ball_is_rounder_as_it_was_seen() -> None:
    seen, outline = found(), found(shape_prior="silhouette")
    assert seen.identity_errors().broken() == ()
    assert error(seen) < 0.8 * error(outline)
    assert (
        seen.provenance.settings["shape_prior"] == "predicted"
        and outline.provenance.settings["shape_prior"] == "silhouette"
    )


@pytest.mark.slow
def test_a_depth_that_is_known_is_better_than_one_that_was_seen() -> None:
    normal, _ = ball()
    evidence = KnownInputs(depth=67.5 * normal[..., 2])
    one, other = (found(evidence, shape_prior=prior) for prior in ("predicted", "silhouette"))
    np.testing.assert_array_equal(one.height, other.height)


@pytest.mark.slow
def test_a_known_shape_is_as_smooth_in_smaller_maps() -> None:
    normal, _ = ball()
    image, mask = under_lights((-0.7, 0.2, 0.6))
    cap = mask & (normal[..., 2] > 0.4)
    photo = Photo(
        image, cap, 1e-4, np.zeros_like(cap), PhotoSource("", cap.shape, 32, "linear", "file")
    )
    height = np.where(cap, 67.5 * normal[..., 2], np.nan)
    settings = Settings(model="sirfs", threads=1, max_size=80)
    d = decompose(photo, settings, known=KnownInputs(height=height))
    assert d.mask.shape != cap.shape
    # a plane through the centre in pixels of the maps
    scale, (rows, columns) = d.provenance.input["scale"], np.indices(d.mask.shape) + 0.5
    centre = [float(part[ball()[1]].mean()) + 0.5 for part in np.indices(cap.shape)]
    right, up = (columns / scale - centre[1]) / 67.5, -(rows / scale - centre[0]) / 67.5
    truth = np.dstack([right, up, np.sqrt(np.maximum(1 - right**2 - up**2, 0))])
    inner = d.mask & (truth[..., 2] > 0.5)
    off = np.degrees(np.arccos(np.clip((d.normal * truth).sum(-1)[inner], -1, 1)))
    assert np.percentile(off, 95) < 1.5


@pytest.mark.slow
@pytest.mark.parametrize(("illumination", "cut"), [("natural", 60), ("laboratory", 0)])
def test_every_photo_takes_what_was_predicted(illumination: str, cut: int) -> None:
    one, other = (
        found(cut=cut, illumination=illumination, shape_prior=prior)
        for prior in ("predicted", "silhouette")
    )
    assert not np.array_equal(one.height, other.height)


def test_an_unknown_prior_is_refused() -> None:
    with pytest.raises(InputError, match="unknown shape prior"):
        Settings(shape_prior="round").check()
