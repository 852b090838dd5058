"""Recovery from a photo: blind to the photo's frame and scale, at home with cut objects, grey
photos and what is known beforehand.
"""

from dataclasses import replace

import numpy as np
import pytest

from isc_core.errors import Cancelled
from isc_core.imaging.area_resize import averaged
from isc_core.imaging.resampling import resample_inside
from isc_core.numerics.lbfgs import LbfgsOptions
from isc_core.progress import Monitor
from isc_core.scene.known_inputs import DepthObservation, SceneConstraints
from isc_core.shading.surface_stencils import normals
from isc_core.sirfs.recover import Recovered, RecoverOptions, recover
from isc_core.sirfs.solve_inputs import SolveInputs
from isc_core.sirfs.solver import SolverOptions

from .small_problems import Scene, blob, made_priors, weights

FLOOR = 1 / 131070
SOME = LbfgsOptions(iterations=60)
SOLVER = SolverOptions(threads=1, lbfgs=SOME)
OPTIONS = RecoverOptions(solve_size=0, solver=SOLVER)


def run(
    scene: Scene, options: RecoverOptions = OPTIONS, known: SceneConstraints | None = None
) -> Recovered:
    return recover(
        scene.image,
        scene.mask,
        FLOOR,
        made_priors(scene.image.shape[2]),
        weights(),
        options,
        known=known,
    )


def cropped(scene: Scene, part: tuple[slice, slice]) -> Scene:
    return Scene(scene.image[part], scene.mask[part], scene.height[part], scene.light)


def padded(scene: Scene, rows: tuple[int, int], columns: tuple[int, int]) -> Scene:
    image = np.pad(scene.image, (rows, columns, (0, 0)))
    return Scene(
        image,
        np.pad(scene.mask, (rows, columns)),
        np.pad(scene.height, (rows, columns)),
        scene.light,
    )


def box(mask: np.ndarray, margin: int) -> tuple[slice, slice]:
    rows, columns = np.nonzero(mask.any(axis=1))[0], np.nonzero(mask.any(axis=0))[0]
    return slice(rows[0] - margin, rows[-1] + 1 + margin), slice(
        columns[0] - margin, columns[-1] + 1 + margin
    )


def angles(a: np.ndarray, b: np.ndarray, where: np.ndarray) -> np.ndarray:
    return np.degrees(np.arccos(np.clip((normals(a) * normals(b)).sum(-1), -1, 1)))[where]


def inner(mask: np.ndarray, steps: int = 2) -> np.ndarray:
    for _ in range(steps):
        m = np.pad(mask, 1)
        mask = mask & m[:-2, 1:-1] & m[2:, 1:-1] & m[1:-1, :-2] & m[1:-1, 2:]
    return mask


@pytest.mark.parametrize("channels", [3, 1])
def test_recovers_shape_and_light(channels: int) -> None:
    scene = blob(channels=channels)
    result = run(scene)
    assert result.height.shape == scene.mask.shape and result.light.shape == (9, channels)
    assert np.isfinite(result.height).all() and np.isfinite(result.light).all()
    assert abs(result.height[scene.mask].mean()) < 1e-9
    where = inner(scene.mask)
    assert (
        angles(result.height, scene.height, where).mean()
        < 0.7 * angles(0 * scene.height, scene.height, where).mean()
    )


@pytest.mark.parametrize("solve_size", [0, 40])
def test_empty_space_around_changes_nothing(solve_size: int) -> None:
    scene = blob()
    options = replace(OPTIONS, solve_size=solve_size)
    plain = run(scene, options)
    wide = padded(scene, (3, 64), (31, 0))
    around = run(wide, options)
    part = (slice(3, 3 + 64), slice(31, 31 + 72))
    np.testing.assert_array_equal(around.light, plain.light)
    np.testing.assert_array_equal(around.height[part][scene.mask], plain.height[scene.mask])
    assert repr(around.terms) == repr(plain.terms)
    assert around.solved_shape == plain.solved_shape


def test_a_closer_crop_changes_nothing() -> None:
    scene = blob()
    part = box(scene.mask, 1)
    close = run(cropped(scene, part))
    np.testing.assert_array_equal(close.height[scene.mask[part]], run(scene).height[scene.mask])


def test_a_crop_to_the_last_pixel_changes_nothing() -> None:
    """A round outline that touches the frame is trimmed, not cut."""
    scene = blob()
    part = box(scene.mask, 0)
    tight = run(cropped(scene, part))
    np.testing.assert_array_equal(tight.height[scene.mask[part]], run(scene).height[scene.mask])


def test_a_cut_object_works_and_bends_over_nowhere_along_the_cut() -> None:
    scene = blob()
    cut = cropped(scene, (slice(0, 64), slice(0, 36)))
    assert cut.mask[:, -1].sum() > 30
    result = run(cut)
    assert np.isfinite(result.height).all()
    where = inner(cut.mask, 1)
    error = angles(result.height, cut.height, where)
    assert error.mean() < 0.8 * angles(0 * cut.height, cut.height, where).mean()
    along = np.zeros_like(cut.mask)
    along[20:44, -4:-1] = True
    assert angles(result.height, cut.height, along & cut.mask).mean() < 20


@pytest.mark.parametrize("factor", [2, 3])
def test_a_larger_photo_gives_the_same_shape_larger(factor: int) -> None:
    scene = blob()
    image, mask, height = (
        np.kron(a, np.ones((factor, factor, 1)[: a.ndim])).astype(a.dtype)
        for a in (scene.image, scene.mask, scene.height)
    )
    large = Scene(image, mask, height, scene.light)
    side = max(part.stop - part.start for part in box(scene.mask, 0))
    options = replace(OPTIONS, solve_size=side)
    small, big = run(scene, options), run(large, options)
    assert big.solved_shape == small.solved_shape
    np.testing.assert_allclose(big.light, small.light, atol=1e-4)
    assert big.height.shape == large.mask.shape
    coarse = big.height.reshape(64, factor, 72, factor).mean(axis=(1, 3)) / factor
    away = (coarse - small.height)[inner(scene.mask)]
    assert np.abs(away - away.mean()).max() < 0.02 * np.ptp(small.height[scene.mask])


def test_a_smaller_photo_is_solved_as_sharp_as_a_larger_one() -> None:
    """From three quarters of the size; interpolated linearly, it is half as far again from it."""
    scene = blob((144, 160))
    paint = np.kron(np.random.default_rng(0).uniform(0.5, 1, (36, 40)), np.ones((4, 4)))
    large, small = (
        averaged(scene.image * paint[..., None], scene.mask, f)[:2] for f in (0.5, 0.375)
    )
    inputs = SolveInputs(*small, small[1], np.ones_like(small[1]))
    linear, _ = resample_inside(*small, 4 / 3)
    where = inner(large[1], 2)
    errors = [
        np.std(np.log(image[where]) - np.log(large[0][where]))
        for image in (inputs.scaled(4 / 3).image, linear)
    ]
    assert errors[0] < 0.8 * errors[1]


def test_solving_at_another_size_keeps_the_shape() -> None:
    scene = blob((96, 104))
    plain, small = run(scene), run(scene, replace(OPTIONS, solve_size=50))
    assert max(small.solved_shape) < max(plain.solved_shape)
    where = inner(scene.mask, 3)
    assert np.ptp(small.height[scene.mask]) == pytest.approx(
        np.ptp(plain.height[scene.mask]), rel=0.25
    )
    assert np.median(angles(small.height, plain.height, where)) < 12


@pytest.mark.parametrize("size", [50, 90])
def test_only_a_larger_object_is_kept_at_its_size(size: int) -> None:
    """To 50 pixels, it would be reduced; to 90, it is enlarged in either case."""
    scene = blob((96, 104))
    length = max(np.ptp(np.nonzero(scene.mask), axis=1)) + 1
    assert 50 < length < 90
    options = replace(OPTIONS, solve_size=size, reduce_larger=False)
    found = run(scene, options)
    same = run(scene, replace(OPTIONS, solve_size=max(size, int(length))))
    assert found.solved_shape == same.solved_shape
    np.testing.assert_array_equal(found.height, same.height)
    known = run(scene, options, SceneConstraints(found.height))
    np.testing.assert_array_equal(known.height, found.height)


@pytest.mark.parametrize("solve_size", [0, 41])
def test_what_is_known_comes_back_as_it_was_given(solve_size: int) -> None:
    scene = blob()
    options = replace(OPTIONS, solve_size=solve_size)
    shaped = run(scene, options, SceneConstraints(height=scene.height + 11))
    np.testing.assert_array_equal(shaped.height[scene.mask], (scene.height + 11)[scene.mask])
    lit = run(scene, options, SceneConstraints(light=scene.light))
    np.testing.assert_array_equal(lit.light, scene.light)
    both = run(scene, options, SceneConstraints(height=scene.height, light=scene.light))
    np.testing.assert_array_equal(both.height[scene.mask], scene.height[scene.mask])


@pytest.mark.slow
@pytest.mark.parametrize("offset", [0.0, 1e6])
@pytest.mark.parametrize("solve_size", [0, 41])
def test_depth_with_holes_pulls_the_height(solve_size: int, offset: float) -> None:
    scene = blob()
    target = scene.height + 5 * np.sin(np.arange(72) / 12)
    seen = np.where(
        np.random.default_rng(0).random(scene.mask.shape) < 0.3, np.nan, target + offset
    )
    seen[:, 36:][~scene.mask[:, 36:]] = -300.0  # what a sensor sees behind the object
    options = replace(
        OPTIONS, solve_size=solve_size, solver=replace(SOLVER, lbfgs=LbfgsOptions(iterations=200))
    )
    plain = run(scene, options)
    pulled = run(
        scene, options, SceneConstraints(depth=DepthObservation(seen, sigma=1.0, weight=300.0))
    )
    assert np.isfinite(pulled.height).all()
    away = [(r.height - target)[scene.mask] for r in (plain, pulled)]
    errors = [np.abs(a - np.median(a)).mean() for a in away]
    assert errors[1] < 0.3 * errors[0]
    assert np.median(away[1]) == pytest.approx(offset, abs=1.0)


def test_zero_channels_are_floored_and_stay_valid() -> None:
    scene = blob()
    image = scene.image.copy()
    image[30:33, 30:33, 2] = 0
    result = run(replace(scene, image=image))
    assert np.isfinite(result.height).all() and np.isfinite(result.terms.total)


@pytest.mark.parametrize("solve_size", [0, 20, 64])
def test_a_line_one_pixel_wide(solve_size: int) -> None:
    mask = np.zeros((120, 9), bool)
    mask[5:115, 4] = True
    image = np.where(mask[..., None], np.linspace(0.2, 0.6, 120)[:, None, None], 0) * np.ones(3)
    result = run(
        Scene(image, mask, 0.0 * mask, blob().light), replace(OPTIONS, solve_size=solve_size)
    )
    assert np.isfinite(result.height).all() and np.isfinite(result.terms.total)


def test_shape_from_shading_mode() -> None:
    scene = blob(one_color=True)
    result = run(scene, replace(OPTIONS, shading_only=True), SceneConstraints(light=scene.light))
    assert result.terms.shading_only > 0 and result.terms.smoothness == 0
    where = inner(scene.mask)
    assert (
        angles(result.height, scene.height, where).mean()
        < 0.6 * angles(0 * scene.height, scene.height, where).mean()
    )


def test_cancel() -> None:
    scene = blob()
    with pytest.raises(Cancelled):
        recover(
            scene.image,
            scene.mask,
            FLOOR,
            made_priors(),
            weights(),
            OPTIONS,
            monitor=Monitor(cancelled=lambda: True),
        )
