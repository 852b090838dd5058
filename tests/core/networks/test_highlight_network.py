"""What the highlight network's answer must not depend on, with random weights, and what it says."""

from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from isc_core.errors import InputError
from isc_core.networks.encoder_decoder import BLOCK
from isc_core.networks.highlight_network import (
    INPUTS,
    REACHES,
    HighlightNetwork,
    predict_highlights,
)
from tests.core.networks.random_convolutions import random_convolutions

DOWN, UP = (4, 6, 8, 6), (7, 5, 4)


def network(folder: Path, *left_out: str) -> HighlightNetwork:
    """Random weights, by way of a file."""
    rng = np.random.default_rng(0)
    arrays = random_convolutions(rng, (BLOCK**2 * INPUTS, BLOCK**2 * len(REACHES)), DOWN, UP)
    path = folder / "network.npz"
    np.savez(path, **{name: part for name, part in arrays.items() if name not in left_out})
    return HighlightNetwork.read(path)


def photo(side: int = 100) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    mask = np.zeros((side + 20, side + 10), bool)
    mask[10 : 10 + side, 5 : 5 + side] = True
    return rng.random((*mask.shape, 3)).astype(np.float32) * mask[..., None], mask


def test_no_more_is_taken_than_bright_details_hold(tmp_path: Path) -> None:
    for side in (60, 150):
        image, mask = photo(side)
        found = predict_highlights(image, mask, network=network(tmp_path))
        assert (found.specular >= 0).all() and not found.specular[~mask].any()
        assert (found.specular <= image.min(axis=2)).all()
        assert found.specular.any() and found.deviation.any()
        assert (found.share >= 0).all() and (found.share <= 1 + 1e-6).all()


def test_the_mirrored_photo_has_the_mirrored_highlights(tmp_path: Path) -> None:
    image, mask = photo()
    one = network(tmp_path)
    seen, mirrored = (predict_highlights(image[:, ::k], mask[:, ::k], network=one) for k in (1, -1))
    np.testing.assert_allclose(mirrored.specular[:, ::-1], seen.specular, atol=1e-6)


def test_the_exposure_does_not_matter(tmp_path: Path) -> None:
    image, mask = photo()
    one = network(tmp_path)
    seen, brighter = (predict_highlights(k * image, mask, network=one).specular for k in (1, 4))
    np.testing.assert_allclose(brighter, 4 * seen, atol=1e-4)


def test_bytes_are_the_same_on_any_number_of_threads(tmp_path: Path) -> None:
    one, given = network(tmp_path), photo()
    found = []
    for threads in (1, 4):
        with threadpool_limits(threads):
            found.append(predict_highlights(*given, network=one).specular.tobytes())
    assert found[0] == found[1]


@pytest.mark.parametrize("missing", ["weight03", "bias14"])
def test_weights_that_do_not_fit_are_refused(tmp_path: Path, missing: str) -> None:
    with pytest.raises(InputError, match="highlight network"):
        network(tmp_path, missing)


def test_a_flat_body_has_no_highlights(tmp_path: Path) -> None:
    image, mask = photo()
    flat = np.where(mask[..., None], np.float32(0.4), np.zeros_like(image))
    assert predict_highlights(flat, mask, network=network(tmp_path)).specular.max() < 1e-6
