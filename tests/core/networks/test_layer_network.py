"""The layer network: its arithmetic against other people's, what it must not depend on, and what
the shipped weights can do.
"""

import numpy as np
import pytest
from scipy import ndimage

from isc_core.errors import InputError
from isc_core.networks.layer_network import LayerNetwork, NetworkOptions, log_ratio
from isc_core.networks.layers import convolved, depth_to_space, space_to_depth
from isc_core.separation import separate
from isc_core.separation.support.light_tint import limit_tint


def small_network(rng):
    """Two levels, random weights."""
    shapes = [(16, 4), (4, 4), (4, 6), (6, 6), (10, 4), (4, 4), (4, 16)]
    weights = tuple(
        rng.normal(0, (2 / (9 * inputs)) ** 0.5, (9, inputs, outputs)).astype(np.float32)
        for inputs, outputs in shapes
    )
    return LayerNetwork(
        weights, tuple(rng.normal(0, 0.1, outputs).astype(np.float32) for _, outputs in shapes)
    )


def ball(side=160, paint=(0.5, 0.5, 0.5), gloss=1.0):
    """A ball under one lamp: image, diffuse layer, mask."""
    y, x = np.mgrid[1 : -1 : side * 1j, -1 : 1 : side * 1j] / 0.9
    mask = x**2 + y**2 < 1
    normal = np.stack([x, y, np.sqrt(np.maximum(1 - x**2 - y**2, 0))], -1)
    lamp = np.array([0.4, 0.5, 0.77]) / np.linalg.norm([0.4, 0.5, 0.77])
    half = (lamp + [0, 0, 1]) / np.linalg.norm(lamp + [0, 0, 1])
    diffuse = (0.1 + np.maximum(normal @ lamp, 0))[..., None] * np.array(paint) * mask[..., None]
    specular = gloss * np.maximum(normal @ half, 0)[..., None] ** 60 * np.ones(3) * mask[..., None]
    return (diffuse + specular).astype(np.float32), diffuse.astype(np.float32), mask


def test_convolution_is_correlation_with_zeros_around():
    rng = np.random.default_rng(0)
    layer, weight, bias = rng.normal(size=(7, 9, 3)), rng.normal(size=(9, 3, 2)), rng.normal(size=2)
    expected = [
        sum(
            ndimage.correlate(layer[..., i], weight[:, i, o].reshape(3, 3), mode="constant")
            for i in range(3)
        )
        + bias[o]
        for o in range(2)
    ]
    assert np.allclose(
        convolved(layer, weight, bias), np.stack(expected, -1), atol=5e-5
    )  # steps of 2^-20 of the largest factors


def test_blocks_of_pixels_go_there_and_back():
    layer = np.arange(4 * 6 * 3.0).reshape(4, 6, 3)
    blocks = space_to_depth(layer)
    assert np.array_equal(blocks[1, 2].reshape(3, 2, 2), layer[2:4, 4:6].transpose(2, 0, 1))
    assert np.array_equal(depth_to_space(blocks), layer)


def test_exposure_and_mirror_images_change_nothing():
    rng = np.random.default_rng(1)
    network, image, mask = (
        small_network(rng),
        rng.uniform(0.01, 1, (64, 32, 3)).astype(np.float32),
        rng.random((64, 32)) > 0.2,
    )
    y, log_error = network(image, mask)
    brighter, _ = network(8 * image, mask)
    mirrored, mirrored_error = network(image[:, ::-1], mask[:, ::-1])
    assert y.min() >= 0 and y.std() > 0.01
    assert np.allclose(y, brighter, atol=1e-5)
    assert np.allclose(y, mirrored[:, ::-1], atol=1e-5) and np.allclose(
        log_error, mirrored_error[:, ::-1], atol=1e-5
    )


def test_what_is_outside_the_mask_is_not_looked_at():
    rng = np.random.default_rng(2)
    network, image, mask = (
        small_network(rng),
        rng.uniform(0.01, 1, (70, 50, 3)).astype(np.float32),
        np.zeros((70, 50), bool),
    )
    mask[5:60, 8:41] = True
    found, error = log_ratio(image, mask, network, NetworkOptions(long_side=40))
    padded = np.pad(
        np.where(mask[..., None], image, 7), ((13, 4), (3, 21), (0, 0)), constant_values=9
    )
    again, _ = log_ratio(
        padded, np.pad(mask, ((13, 4), (3, 21))), network, NetworkOptions(long_side=40)
    )
    assert np.array_equal(found, again[13:-4, 3:-21])
    assert not found[~mask].any() and (error[mask] > 0).all()


def test_a_highlight_on_grey_paint_is_found_where_colour_tells_nothing():
    image, diffuse, mask = ball()
    split = separate("network", image, mask)
    left = np.abs(split.diffuse - diffuse)[mask].mean()
    assert left < 0.5 * np.abs(image - diffuse)[mask].mean()
    assert np.abs(separate("isc", image, mask).diffuse - image)[mask].max() < 1e-3
    assert np.allclose(
        (split.diffuse + split.specular + split.residual)[mask], image[mask], atol=1e-6
    )


@pytest.mark.slow
@pytest.mark.parametrize("side", [60, 160, 420])
def test_matt_balls_keep_their_light(side):
    image, _, mask = ball(side, (0.6, 0.5, 0.3), gloss=0)
    split = separate("network", image, mask)
    assert split.specular[mask].mean() < 0.02 * image[mask].mean()


def test_confidence_sorts_pixels_by_their_error():
    image, diffuse, mask = ball()
    split = separate("network", image, mask)
    error = np.abs(split.diffuse - diffuse).mean(-1)[mask]
    order = np.argsort(split.confidence[mask])
    fifth = len(order) // 5
    assert error[order[:fifth]].sum() > 2 * error[order[-fifth:]].sum()


@pytest.mark.parametrize("tint", [1.0, 1.5])
def test_what_is_taken_off_is_not_more_coloured_than_light(tint):
    rng = np.random.default_rng(4)
    seen = rng.uniform(0.01, 1, (40, 50, 3)).astype(np.float32)
    diffuse = limit_tint(seen, seen * rng.uniform(0.05, 1, seen.shape).astype(np.float32), tint)
    light = seen - diffuse
    assert (diffuse >= 0).all() and light.min() > -1e-6
    assert (light.max(-1) <= tint * light.min(-1) + 1e-6).all()


def test_light_that_is_white_stays_and_green_light_on_green_paint_goes_back():
    paint = np.array([0.3, 0.5, 0.05], np.float32) * np.ones((4, 5, 1), np.float32)
    assert np.allclose(limit_tint(paint + 0.2, paint, 1.5), paint, atol=1e-6)
    assert np.allclose(limit_tint(paint, paint, 1.5), paint)
    green = np.array([0.1, 0.18, 0.01], np.float32)
    kept = limit_tint(paint + green, paint, 1.0)
    level = (paint + green - kept)[0, 0]
    costs = [np.square((level[0] + d - green) / paint[0, 0]).sum() for d in (-0.001, 0, 0.001)]
    assert np.ptp(level) < 1e-6 and costs[1] == min(costs), (
        "the white light whose diffuse layer differs least in its logarithm"
    )


def test_the_mirror_image_is_asked_only_where_that_is_wanted():
    rng = np.random.default_rng(5)
    network, image, mask = (
        small_network(rng),
        rng.uniform(0.01, 1, (32, 32, 3)).astype(np.float32),
        np.ones((32, 32), bool),
    )
    one, _ = network(image, mask, mirrored=False)
    other, _ = network(image[:, ::-1], mask, mirrored=False)
    assert np.allclose(network(image, mask)[0], 0.5 * (one + other[:, ::-1]), atol=1e-6)
    assert not np.allclose(one, other[:, ::-1], atol=1e-3)
    alone, _ = log_ratio(image, mask, network, NetworkOptions(mirrored=False))
    assert not np.allclose(alone, log_ratio(image, mask, network, NetworkOptions())[0], atol=1e-3)


def test_options_and_files_that_mean_nothing_are_refused(tmp_path):
    image, _, mask = ball(40)
    with pytest.raises(InputError, match="long_side"):
        separate("network", image, mask, changes={"long_side": 8})
    with pytest.raises(InputError, match="doubt"):
        separate("network", image, mask, changes={"doubt": -1.0})
    for wrong in (0.9, float("nan")):
        with pytest.raises(InputError, match="tint"):
            separate("network", image, mask, changes={"tint": wrong})
    bad = tmp_path / "bad.npz"
    bad.write_bytes(b"no archive")
    with pytest.raises(InputError, match=r"bad\.npz is not a layer network"):
        LayerNetwork.read(bad)
    np.savez(bad, weight00=np.zeros((9, 2, 2)), bias00=np.zeros(2))
    with pytest.raises(InputError, match="not the weights"):
        LayerNetwork.read(bad)


def test_the_shipped_network_is_small_and_finite():
    network = LayerNetwork.shipped()
    assert all(np.isfinite(w).all() for w in (*network.weights, *network.biases))
    assert sum(w.size for w in network.weights) < 2_000_000
