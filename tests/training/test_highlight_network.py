"""The trainable highlight network is the one that the core runs; its loss says what it should."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

import torch

from isc_core.imaging.brightness_bands import brightness_bands
from isc_core.networks.highlight_network import (
    REACHES,
    HighlightNetwork,
    channels_of,
    predict_highlights,
)
from isc_core.networks.scene_network import SIDE
from training.networks import highlight_network
from training.networks.highlight_module import (
    HighlightNetworkModule,
    bands_of,
    network_channels,
)
from training.networks.highlight_network import varied
from training.world.lit_pictures import LitPictures
from training.world.samples import Sample

DOWN, UP = (6, 8, 8, 6), (7, 6, 5)


def module(seed: int) -> HighlightNetworkModule:
    """Random weights and normalisations, as after some training."""
    torch.manual_seed(seed)
    one = HighlightNetworkModule(DOWN, UP)
    for _, norm in one.pairs:
        torch.nn.init.uniform_(norm.weight, 0.5, 1.5)
        torch.nn.init.normal_(norm.bias, 0, 0.1)
    return one.eval()


def photo() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    mask = np.zeros((SIDE, SIDE), bool)
    mask[8:-8, 20:-20] = True
    return rng.random((SIDE, SIDE, 3)).astype(np.float32) * mask[..., None], mask


def tensors(image: np.ndarray, mask: np.ndarray) -> tuple[torch.Tensor, torch.Tensor]:
    return torch.from_numpy(image).permute(2, 0, 1)[None], torch.from_numpy(mask)[None, None] * 1.0


def test_bands_and_channels_are_those_of_the_core() -> None:
    image, mask = photo()
    given = tensors(image, mask)
    bands = bands_of(*given)
    wanted = np.stack(list(brightness_bands(image.min(axis=2), mask, REACHES)))
    np.testing.assert_array_equal(bands[0].numpy(), wanted)
    channels = network_channels(*given, bands)[0].permute(1, 2, 0).numpy()
    np.testing.assert_allclose(channels, channels_of(image, mask), atol=1e-5)


def test_the_core_and_the_module_compute_the_same(tmp_path: Path) -> None:
    one, (image, mask) = module(0), photo()
    np.savez(tmp_path / "network.npz", **one.arrays())  # type: ignore[arg-type]
    other = module(1)
    other.load_arrays(one.arrays())
    given = tensors(image, mask)
    with torch.no_grad():
        odds, bands = one(*given)
        mirrored, _ = one(*(part.flip(3) for part in given))
        again, _ = other(*given)
    odds = (odds + mirrored.flip(3)) / 2
    light = (torch.sigmoid(odds) * bands).sum(1)[0].numpy()
    found = predict_highlights(image, mask, network=HighlightNetwork.read(tmp_path / "network.npz"))
    np.testing.assert_allclose(found.specular, np.minimum(light, image.min(axis=2)), atol=0.01)
    np.testing.assert_allclose(again, one(*given)[0].detach(), atol=0.02)


@pytest.mark.parametrize("gloss", [0.0, 0.5])
def test_the_loss_is_least_at_the_truth(gloss: float) -> None:
    one = module(0)
    image, mask = photo()
    image = (0.3 + 0.1 * image) * mask[..., None]
    light = image.copy()
    light[50:54, 60:64] += gloss
    seen, known = tensors(light, mask)
    diffuse, _ = tensors(image, mask)
    ratio = torch.log(seen.clamp(min=1e-6)) - torch.log(diffuse.clamp(min=1e-6))
    zeros = {name: torch.zeros(1) for name in Sample.__dataclass_fields__}
    batch = Sample(**{**zeros, "photo": seen, "mask": known, "known": known, "ratio": ratio})
    bands = bands_of(seen, known)
    share = ((bands - bands_of(diffuse, known)) / bands.clamp(min=1e-6)).clamp(1e-3, 1 - 1e-3)

    def loss(odds: torch.Tensor) -> tuple[float, dict[str, torch.Tensor]]:
        one.forward = lambda *_: (odds, bands)  # type: ignore[method-assign]
        value, terms = one.loss(batch)
        return float(value), terms

    truth, terms = loss(torch.logit(share))
    assert terms["glossy"] < 0.2 and terms["matt"] < 0.01
    assert truth < loss(torch.full_like(share, -6))[0] or not gloss
    assert truth < loss(torch.full_like(share, 6))[0]


def random_pictures(count: int) -> LitPictures:
    blank = {name: torch.zeros(count) for name in LitPictures.__dataclass_fields__}
    layers = torch.rand(count, 13, 4, 4).half()
    blank |= {"layers": layers, "cover": torch.ones(count, 1, 4, 4)}
    return LitPictures(**blank | {"strongest": torch.zeros(count, 3)})


def test_pictures_vary_in_gloss_and_in_the_order_of_channels(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(highlight_network, "_SHARP", 0.0)
    torch.manual_seed(0)
    pictures = random_pictures(64)
    layers = pictures.layers
    found = varied(pictures).layers
    before = layers.float()
    assert torch.equal(found[:, 6:], before[:, 6:]) and torch.equal(layers.float(), before)
    assert torch.equal(found[:, :3].sort(1).values, before[:, :3].sort(1).values)
    gain = found[:, 3:6].sum((1, 2, 3)) / before[:, 3:6].sum((1, 2, 3))
    assert 0.1 < (gain == 0).float().mean() < 0.5 and gain.max() > 1.5
    order = (found[:, None, :3] - before[:, :3, None]).abs().sum((3, 4)).argmin(1)
    own = (found[:, None, 3:6] - gain[:, None, None, None, None] * before[:, 3:6, None]).abs()
    glossy = gain > 0
    assert torch.equal(own.sum((3, 4)).argmin(1)[glossy], order[glossy])
    assert len(order.unique(dim=0)) == 6


def test_small_highlights_are_added_to_glossy_pictures_alone() -> None:
    torch.manual_seed(0)
    pictures = random_pictures(200)
    pictures.layers[:, 3:6] = 0
    found = varied(pictures).layers[:, 3:6].sum((1, 2, 3))
    assert 0.2 < (found > 0).float().mean() < 0.5
