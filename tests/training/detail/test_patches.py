"""The detail network's patches and module: equal to the core's, and physically right."""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs PyTorch: pip install isc-intrinsic[training]")

from isc_core.networks import detail_network as core  # noqa: E402
from isc_core.networks.layers import weights_in  # noqa: E402
from training.detail.detail_module import (  # noqa: E402
    DetailNetworkModule,
    network_channels,
)
from training.detail.patches import Patch, Patches, band_of  # noqa: E402
from training.detail.reliefs import draw_reliefs  # noqa: E402

SIDE = 32


@pytest.fixture(scope="module")
def patches() -> Patch:
    return Patches(0, 16, SIDE, 12)(np.random.default_rng(0))


def _arrays(patch: Patch, k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    photo, slope, gain = (
        part[k].permute(1, 2, 0).numpy() for part in (patch.photo, patch.slope, patch.gain)
    )
    return photo, patch.mask[k, 0].numpy() > 0.5, slope, gain, float(patch.belief[k])


def test_patches_are_finite_and_the_truth_is_a_band(patches: Patch) -> None:
    for part in (patches.photo, patches.slope, patches.gain, patches.belief, patches.height):
        assert torch.isfinite(part).all()
    assert patches.photo.shape == (16, 3, SIDE, SIDE)
    assert 0 < int((patches.height.abs().amax((1, 2, 3)) > 0).sum()) < 16
    coarse = torch.nn.functional.avg_pool2d(patches.height, 4)
    assert coarse.abs().mean() < 0.4 * patches.height.abs().mean() and patches.photo.min() >= 0
    assert patches.belief.min() >= -1 and patches.belief.max() <= 1


def test_channels_and_bands_are_the_cores(patches: Patch) -> None:
    channels = network_channels(patches)
    for k in range(3):
        expected = core.channels_of(*_arrays(patches, k))
        assert np.abs(channels[k].permute(1, 2, 0).numpy() - expected).max() < 1e-4
    height = torch.randn(1, 1, SIDE, SIDE)
    assert np.allclose(band_of(height)[0, 0].numpy(), core.band(height[0, 0].numpy()), atol=1e-6)


def test_the_module_and_the_core_agree(patches: Patch) -> None:
    torch.manual_seed(0)
    module = DetailNetworkModule().eval()
    arrays = module.arrays()
    weights = {name: part for name, part in arrays.items() if name[-2:].isdigit()}
    network = core.DetailNetwork(*weights_in(weights))
    with torch.no_grad():
        expected = module(network_channels(patches))[0, 0].numpy()
    found = network(core.channels_of(*_arrays(patches, 0)))
    assert np.abs(found - expected).max() < 2e-3


def test_the_loss_is_zero_for_the_truth_and_has_a_gradient(patches: Patch) -> None:
    module = DetailNetworkModule()
    loss, terms = module.loss(patches)
    loss.backward()
    assert all(p.grad is not None for p in module.parameters()) and terms["left"] > 0
    module.forward = lambda inputs: patches.height  # type: ignore[method-assign]
    assert float(module.loss(patches)[0]) < 0.2


def test_reliefs_have_slopes_of_one() -> None:
    maps = draw_reliefs(0, 10, 64)
    for one in maps:
        down, right = np.gradient(one)
        assert np.sqrt(np.mean(down**2 + right**2)) == pytest.approx(1, rel=1e-4)
    assert np.array_equal(maps, draw_reliefs(0, 10, 64))
