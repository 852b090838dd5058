"""The errors: zero at the truth, with the intended invariances, and equal to the reference's
numbers.
"""

import json
import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from isc_core.datasets.mit_berkeley import MitBerkeleyObject, load_object
from isc_core.evaluation.metrics import (
    Scores,
    angular_error,
    geometric_mean,
    height_error,
    light_error,
    lmse,
    mse,
    psnr,
    scaled_mse,
    score,
    truth_normal,
)
from isc_core.shading.spherical_harmonics import (
    light_from_reference,
    light_to_reference,
    normal_from_reference,
    normal_to_reference,
    real_sh,
    reference_basis,
)


def directions(count: int, seed: int = 0) -> np.ndarray:
    n = np.random.default_rng(seed).normal(size=(count, 3))
    return n / np.linalg.norm(n, axis=-1, keepdims=True)


@pytest.fixture
def truth() -> MitBerkeleyObject:
    """A dome under a coloured light, made by our own formulas, with a hole and an irregular border
    in its height.
    """
    rng = np.random.default_rng(5)
    rows, columns = np.mgrid[:61, :73].astype(float)
    inside = np.hypot(rows - 30, columns - 36) < 27
    height = np.where(inside, 20 * np.cos(np.hypot(rows - 30, columns - 36) / 20), np.nan)
    height[30, 40] = np.nan
    light = 0.3 * rng.normal(size=(9, 3))
    normal = np.where(np.isfinite(truth_normal(height)), truth_normal(height), [0.0, 0.0, 1.0])
    shading = np.exp(reference_basis(normal) @ light) * inside[..., None]
    reflectance = rng.uniform(0.1, 0.9, (*inside.shape, 3)) * inside[..., None]
    return MitBerkeleyObject(
        "dome",
        "natural",
        shading * reflectance,
        inside,
        inside,
        height,
        shading,
        reflectance,
        light,
    )


def answer(truth: MitBerkeleyObject) -> dict[str, Any]:
    """The truth itself, as the result of a method."""
    return {
        "height": np.nan_to_num(truth.height),
        "normal": np.nan_to_num(truth_normal(truth.height)),
        "shading": truth.shading,
        "reflectance": truth.reflectance,
        "light": light_from_reference(truth.light),
    }


# Frames


def test_light_round_trip() -> None:
    light = np.random.default_rng(1).normal(size=(9, 3))
    assert np.abs(light_to_reference(light_from_reference(light)) - light).max() < 1e-14
    assert np.abs(light_from_reference(light_to_reference(light)) - light).max() < 1e-14


@pytest.mark.parametrize("channels", [1, 3])
def test_both_conventions_give_the_same_shading(channels: int) -> None:
    light, normal = np.random.default_rng(2).normal(size=(9, channels)), directions(500)
    assert (
        np.abs(real_sh(normal) @ light - reference_basis(normal) @ light_to_reference(light)).max()
        < 1e-12
    )
    assert (
        np.abs(
            reference_basis(normal) @ light - real_sh(normal) @ light_from_reference(light)
        ).max()
        < 1e-12
    )


def test_normal_round_trip_and_meaning() -> None:
    normal = directions(50)
    assert np.array_equal(normal_from_reference(normal_to_reference(normal)), normal)
    up, right = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
    assert np.array_equal(normal_to_reference(up), [-1, 0, 0])
    assert np.array_equal(normal_to_reference(right), [0, 1, 0])


def test_reference_basis_is_the_printed_one() -> None:
    """The nine functions of (down, right, toward) = (.6, 0, .8) and (0, .6, .8), by hand."""
    c1, c2, c3, c4, c5 = 0.429043, 0.511664, 0.743125, 0.886227, 0.247708
    down, right = np.array([0, -0.6, 0.8]), np.array([0.6, 0, 0.8])
    tilted = c3 * 0.64 - c5
    assert reference_basis(down) == pytest.approx(
        [c4, 0, 1.6 * c2, 1.2 * c2, 0, 0, tilted, 0.96 * c1, 0.36 * c1], abs=1e-15
    )
    assert reference_basis(right) == pytest.approx(
        [c4, 1.2 * c2, 1.6 * c2, 0, 0, 0.96 * c1, tilted, 0, -0.36 * c1], abs=1e-15
    )


def test_real_sh_is_orthonormal_and_ordered() -> None:
    # Gauss-Legendre in z times a uniform circle integrates products of two quadratics exactly.
    z, weight = np.polynomial.legendre.leggauss(6)
    phi = np.arange(12) * np.pi / 6
    ring = np.sqrt(1 - z * z)[:, None]
    points = np.stack(
        [ring * np.cos(phi), ring * np.sin(phi), np.broadcast_to(z[:, None], (6, 12))], axis=-1
    )
    basis = real_sh(points).reshape(-1, 9)
    gram = basis.T @ (basis * np.repeat(weight * np.pi / 6, 12)[:, None])
    assert np.abs(gram - np.eye(9)).max() < 1e-14
    x, y, z_axis = real_sh(np.eye(3))
    assert y[1] > 0.4 and z_axis[2] > 0.4 and x[3] > 0.4 and x[8] > 0.4 and z_axis[6] > 0.4
    assert real_sh(np.sqrt(0.5) * np.array([1.0, 1.0, 0.0]))[4] > 0.4


def test_real_sh_keeps_single_precision() -> None:
    assert real_sh(directions(4).astype(np.float32)).dtype == np.float32


# Normals of the truth


def test_normal_of_a_plane_in_our_frame() -> None:
    rows, columns = np.mgrid[:9, :9].astype(float)
    expected = np.array([-0.5, 0.25, 1]) / np.linalg.norm([-0.5, 0.25, 1])
    # It rises 0.5 a pixel to the right and 0.25 a pixel downward: it leans left and up.
    normal = truth_normal(0.5 * columns + 0.25 * rows)
    assert np.abs(normal[1:-1, 1:-1] - expected).max() < 1e-14
    assert np.isfinite(normal).all()


def test_normal_is_missing_around_a_hole() -> None:
    height = np.zeros((7, 8))
    height[3, 4] = np.nan
    missing = np.isnan(truth_normal(height)).all(axis=-1)
    assert missing.sum() == 9 and missing[2:5, 3:6].all()


# Single errors


def test_height_error_forgives_only_the_offset() -> None:
    truth = np.random.default_rng(3).normal(size=(20, 20))
    truth[:4] = np.nan
    known = truth[4:]
    assert height_error(truth, np.nan_to_num(truth) + 7) == pytest.approx(0, abs=1e-14)
    expected = np.abs(known - np.median(known)).mean()
    assert height_error(truth, np.nan_to_num(2 * truth)) == pytest.approx(expected)


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2, math.pi])
def test_angular_error_of_a_rotation(angle: float) -> None:
    phi = np.linspace(0, 6, 40)
    a = np.stack([np.cos(phi), np.sin(phi), 0 * phi], axis=-1)
    b = np.stack([np.cos(phi + angle), np.sin(phi + angle), 0 * phi], axis=-1)
    assert angular_error(a, b) == pytest.approx(angle, abs=1e-7)


@pytest.mark.slow
@given(st.floats(1e-3, 1e3))
def test_scale_is_free(scale: float) -> None:
    rng = np.random.default_rng(4)
    truth, estimate, mask = (
        rng.random((47, 53, 3)),
        rng.random((47, 53, 3)),
        rng.random((47, 53)) > 0.2,
    )
    assert scaled_mse(truth, scale * estimate) == pytest.approx(
        scaled_mse(truth, estimate), rel=1e-10
    )
    assert lmse(truth, scale * estimate, mask) == pytest.approx(
        lmse(truth, estimate, mask), rel=1e-10
    )
    assert lmse(truth, scale * truth, mask) == pytest.approx(0, abs=1e-13)


def test_scaled_mse_counts_white_balance() -> None:
    """Two channels of one and two against one of ones: the best scale is .6, the mean square (.4^2
    + .2^2) / 2.
    """
    assert scaled_mse(np.ones((5, 2)), np.broadcast_to([1.0, 2.0], (5, 2))) == pytest.approx(0.1)


def test_lmse_by_the_letter() -> None:
    """Against the definition, window by window in plain loops."""
    rng = np.random.default_rng(6)
    t, u, m = rng.random((50, 33)), rng.random((50, 33)), rng.random((50, 33)) > 0.3
    error = total = 0.0
    for i0 in (0, 9):
        for j0 in (0, 9):
            for i in range(i0, 50, 20):
                for j in range(j0, 33, 20):
                    tb, ub, mb = (
                        t[i : i + 20, j : j + 20],
                        u[i : i + 20, j : j + 20],
                        m[i : i + 20, j : j + 20],
                    )
                    a = (mb * tb * ub).sum() / max(np.finfo(float).eps, (mb * ub * ub).sum())
                    error += (mb * (tb - a * ub) ** 2).sum()
                    total += (mb * tb**2).sum()
    assert lmse(t, u, m) == pytest.approx(error / total, rel=1e-12)


def test_lmse_is_local_and_blind_outside() -> None:
    rng = np.random.default_rng(7)
    truth, mask = rng.random((64, 64, 3)), np.zeros((64, 64), bool)
    mask[10:50, 12:44] = True
    outside = np.where(mask[..., None], truth, np.nan)
    assert lmse(truth, outside, mask) == pytest.approx(0, abs=1e-14)
    assert lmse(truth, np.zeros_like(truth), mask) == pytest.approx(1)
    drift = truth * np.linspace(0.2, 2, 64)[:, None, None]
    assert (
        lmse(truth, drift, mask)
        < 0.3 * scaled_mse(truth[mask], drift[mask]) / np.square(truth[mask]).mean()
    )
    small = lmse(rng.random((6, 5)), rng.random((6, 5)), np.ones((6, 5), bool))
    assert 0 < small < 1


def test_light_error_forgives_exposure_but_not_colour() -> None:
    light = np.random.default_rng(8).normal(size=(9, 3)) * 0.3
    brighter = light.copy()
    brighter[0] += 1.7
    assert light_error(light, brighter) == pytest.approx(0, abs=1e-25)
    tinted = light.copy()
    tinted[0, 0] += 0.5
    assert light_error(light, tinted) > 1e-3


def test_light_error_matches_the_definition() -> None:
    """One constant light of value 1 against exp(b3 of the reference's basis), on the probe grid
    written out.
    """
    linear = np.zeros((9, 1))
    linear[1] = 1
    values = []
    for k in range(1, 257):
        for j in range(1, 257):
            down, right = (k - 128) / 128, (j - 128) / 128
            if 1 - down**2 - right**2 > 0:
                values.append(math.exp(2 * 0.511664 * right))
    estimate = np.array(values)
    scale = estimate.sum() / np.square(estimate).sum()
    expected = np.square(scale * estimate - 1).mean()
    assert light_error(np.zeros((9, 1)), light_from_reference(linear)) == pytest.approx(
        expected, rel=1e-12
    )


def test_mse_and_psnr() -> None:
    truth = np.zeros((4, 5, 3))
    estimate = np.full((4, 5, 3), 0.1)
    assert mse(truth, estimate) == pytest.approx(0.01)
    assert psnr(truth, estimate) == pytest.approx(20)
    assert psnr(truth, 255 * estimate, peak=255) == pytest.approx(20)
    mask = np.zeros((4, 5), bool)
    mask[1, 2] = True
    estimate[1, 2] = 1
    assert mse(truth, estimate, mask) == 1 and psnr(truth, truth) == math.inf


def test_image_errors_refuse_invalid_pairs() -> None:
    image = np.ones((4, 5, 3))
    with pytest.raises(ValueError, match="shapes"):
        mse(image, image[:3])
    with pytest.raises(ValueError, match="shapes"):
        lmse(image, image, np.ones((5, 4), bool))
    with pytest.raises(ValueError, match="empty"):
        mse(image, image, np.zeros((4, 5), bool))
    with pytest.raises(ValueError, match="zero everywhere"):
        lmse(0 * image, image, np.ones((4, 5), bool))


def test_geometric_mean() -> None:
    assert geometric_mean([2, 8]) == pytest.approx(4)
    assert geometric_mean([0, 8]) == 0
    for bad in ([], [1, -1]):
        with pytest.raises(ValueError, match="geometric mean"):
            geometric_mean(bad)


# All six


def test_truth_scores_zero(truth: MitBerkeleyObject) -> None:
    scores = score(truth, **answer(truth))
    assert max(asdict(scores).values()) < 1e-7
    assert scores.average < 1e-7


def test_average_is_the_geometric_mean_of_the_six() -> None:
    assert Scores(1, 2, 4, 8, 16, 32).average == pytest.approx(2**2.5)


@pytest.mark.parametrize("changed", ["height", "normal", "shading", "reflectance", "light"])
def test_each_error_depends_only_on_its_own_map(truth: MitBerkeleyObject, changed: str) -> None:
    rng, wrong = np.random.default_rng(9), answer(truth)
    wrong[changed] = wrong[changed] + rng.uniform(0.1, 0.5, wrong[changed].shape)
    if changed == "normal":
        wrong[changed] /= np.linalg.norm(wrong[changed], axis=-1, keepdims=True)
    high = {name for name, value in asdict(score(truth, **wrong)).items() if value > 1e-5}
    assert high == {changed} | ({"rs_mse"} if changed in ("shading", "reflectance") else set())


def test_unknown_pixels_are_not_compared(truth: MitBerkeleyObject) -> None:
    """Values outside the valid input, NaN included, change neither shading nor reflectance."""
    holed = replace(truth, valid=truth.valid.copy())
    holed.valid[20:30, 20:30] = False
    wild = answer(holed)
    for name in ("shading", "reflectance"):
        wild[name] = np.where(holed.valid[..., None], wild[name], np.nan)
    assert max(asdict(score(holed, **wild)).values()) < 1e-7


@pytest.mark.parametrize("edge", [np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1]])
def test_the_frame_of_the_crop_is_not_compared(truth: MitBerkeleyObject, edge: Any) -> None:
    """On a crop that the object fills, wrong values on the outermost pixels cost nothing; one pixel
    further in they do.
    """
    maps = ("image", "valid", "mask", "height", "shading", "reflectance")
    filled = replace(truth, **{name: getattr(truth, name)[15:29, 20:45] for name in maps})
    wrong = answer(filled) | {"shading": filled.shading.copy()}
    wrong["shading"][edge] *= 5
    assert filled.valid[edge].all() and score(filled, **wrong).shading < 1e-20
    wrong["shading"][1:-1, 1:-1][edge] *= 5
    assert score(filled, **wrong).shading > 1e-3


def test_refuses_a_misshapen_or_unfinished_answer(truth: MitBerkeleyObject) -> None:
    good = answer(truth)
    with pytest.raises(ValueError, match="height has shape"):
        score(truth, **(good | {"height": good["height"][1:]}))
    with pytest.raises(ValueError, match="light must be"):
        score(truth, **(good | {"light": good["light"][:4]}))
    with pytest.raises(ValueError, match="reflectance is not finite"):
        score(truth, **(good | {"reflectance": good["reflectance"] * np.nan}))
    with pytest.raises(ValueError, match="no pixel"):
        score(replace(truth, valid=np.zeros_like(truth.valid)), **good)


def test_flat_and_unlit_equals_the_reference_that_stalled_there(shared: Path) -> None:
    """The reference program stops at its start on teabag2 (laboratory): flat, no light.

    Its six errors are ours.
    """
    anchors = json.loads((shared / "anchors" / "sirfs_reference.json").read_text())
    expected = anchors["results"]["laboratory/diffuse"]["teabag2"]
    truth = load_object(shared / "data" / "mit_berkeley_train", "teabag2", "laboratory")
    flat = np.broadcast_to([0.0, 0.0, 1.0], truth.image.shape)
    nothing = score(
        truth,
        height=np.zeros(truth.height.shape),
        normal=flat,
        shading=np.ones(truth.image.shape),
        reflectance=truth.image,
        light=np.zeros((9, 3)),
    )
    for name, value in asdict(nothing).items():
        assert value == pytest.approx(expected[name], rel=3e-4), name
    assert nothing.average == pytest.approx(expected["avg"], rel=1e-4)
