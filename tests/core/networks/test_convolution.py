"""Convolution against SciPy's correlation, compiled and as matrix products."""

import numpy as np
import pytest
from scipy import ndimage
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from isc_core.networks import convolution
from isc_core.networks.convolution import convolved, single
from isc_core.numerics.jit import compiled_available

WAYS = [
    pytest.param(
        True,
        marks=pytest.mark.skipif(not compiled_available(), reason="needs compiled kernels"),
        id="compiled",
    ),
    pytest.param(False, id="products"),
]


@pytest.fixture(params=WAYS)
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Convolve with or without compiled kernels."""
    monkeypatch.setattr(convolution, "compiled_available", lambda: request.param)


@pytest.mark.usefixtures("way")
@pytest.mark.parametrize("size", [(7, 9), (1, 1), (1, 12), (5, 1), (2, 2)])
@pytest.mark.parametrize("channels", [(3, 2), (8, 16), (21, 5), (1, 1), (16, 67)])
def test_it_is_correlation_with_zeros_around(
    size: tuple[int, int], channels: tuple[int, int]
) -> None:
    rng, (inputs, outputs) = np.random.default_rng(0), channels
    layers = rng.normal(size=(2, *size, inputs)).astype(np.float32)
    weight = rng.normal(size=(9, inputs, outputs)).astype(np.float32)
    bias = rng.normal(size=outputs).astype(np.float32)
    expected = np.zeros((2, *size, outputs)) + bias
    for k, i, o in np.ndindex(2, inputs, outputs):
        kernel = weight[:, i, o].reshape(3, 3).astype(float)
        expected[k, ..., o] += ndimage.correlate(
            layers[k, ..., i].astype(float), kernel, mode="constant"
        )
    found = convolved(layers, weight, bias)
    assert found.dtype == np.float32
    # single precision, or steps of 2^-20 of the largest factors
    np.testing.assert_allclose(found, expected, atol=1e-4)


@pytest.mark.usefixtures("way")
def test_a_photo_does_not_depend_on_those_beside_it() -> None:
    rng = np.random.default_rng(3)
    layers = rng.normal(size=(2, 7, 9, 3)) * np.array([1.0, 30.0])[:, None, None, None]
    weight, bias = rng.normal(size=(9, 3, 2)), rng.normal(size=2)
    both = convolved(layers, weight, bias)
    for k in range(2):
        np.testing.assert_array_equal(convolved(layers[k : k + 1], weight, bias)[0], both[k])


def test_weights_of_16_bits_are_converted_exactly() -> None:
    every = np.arange(1 << 16, dtype=np.uint16).view(np.float16)
    finite = every[np.isfinite(every)].reshape(2, -1)
    np.testing.assert_array_equal(
        single(finite.T).view(np.int32), finite.T.astype(np.float32).view(np.int32)
    )


@pytest.mark.usefixtures("way")
def test_the_same_bytes_on_any_number_of_threads() -> None:
    rng = np.random.default_rng(1)
    layers = rng.normal(size=(1, 32, 32, 96)).astype(np.float32)
    weight = rng.normal(size=(9, 96, 64)).astype(np.float32)
    found = []
    for threads in (1, 4):
        with threadpool_limits(threads):
            found.append(convolved(layers, weight, np.zeros(64, np.float32)).tobytes())
    assert found[0] == found[1]


@pytest.mark.usefixtures("way")
def test_arguments_are_left_alone() -> None:
    rng = np.random.default_rng(2)
    given = [rng.normal(size=shape).astype(np.float32) for shape in ((1, 4, 5, 8), (9, 8, 3), (3,))]
    copies = [values.copy() for values in given]
    for values in given:
        values.flags.writeable = False
    convolved(*given)
    for values, copy in zip(given, copies, strict=True):
        np.testing.assert_array_equal(values, copy)
