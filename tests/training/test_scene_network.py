"""The trainable scene network is the one that the core runs, and it learns."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

import torch

from isc_core.errors import InputError
from isc_core.networks.scene_network import (
    CHANNELS,
    FACTORS,
    GLOBAL,
    INPUTS,
    LIGHT,
    PLACE_COUNT,
    SIDE,
    SceneNetwork,
    channels_of,
)
from training.networks.highlight_module import HighlightNetworkModule
from training.networks.scene_module import SceneNetworkModule, light_nll, network_channels
from training.networks.scene_network import with_small_highlights
from training.world.lit_pictures import LitPictures
from training.world.recipes import Kind
from training.world.samples import OBJECT, OUTPUT, Sample

WIDTHS = (6, 8, 8, 10)


pytestmark = pytest.mark.usefixtures("one_torch_thread")


def module(seed: int, widths: tuple[int, ...] = WIDTHS) -> SceneNetworkModule:
    """Random weights and normalisations, as after some training."""
    torch.manual_seed(seed)
    one = SceneNetworkModule(widths)
    for block in [*one.down, *one.up]:
        for _, norm in block.pairs:
            torch.nn.init.uniform_(norm.weight, 0.5, 1.5)
            torch.nn.init.normal_(norm.bias, 0, 0.1)
            torch.nn.init.normal_(norm.running_mean, 0, 0.2)
            torch.nn.init.uniform_(norm.running_var, 0.5, 2)
    return one.eval()


def written(one: SceneNetworkModule, folder: Path) -> SceneNetwork:
    path = folder / "network.npz"
    np.savez(path, **one.arrays())  # type: ignore[arg-type]
    return SceneNetwork.read(path)


def photos(count: int, side: int = SIDE) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    y, x = np.mgrid[:side, :side] / side - 0.5
    mask = np.stack([(x**2 + (1 + 0.5 * k) * y**2) < 0.17 for k in range(count)])
    mask &= rng.random(mask.shape) < 0.97
    return rng.uniform(0.01, 1, (*mask.shape, 3)).astype(np.float32) * mask[..., None], mask


def batch(count: int = 3, side: int = 32) -> Sample:
    """Balls lit along an axis each, with what is seen as the truth."""
    photo, mask = photos(count, side)
    generator = torch.Generator().manual_seed(1)
    known = torch.from_numpy(mask[:, None]).float()
    y, x = np.mgrid[:side, :side] / side - 0.5
    across = torch.from_numpy(np.stack([2 * x, -2 * y])).float().expand(count, 2, side, side)
    up = torch.sqrt((1 - across.square().sum(1, keepdim=True)).clamp(min=0.01))
    normal = torch.nn.functional.normalize(torch.cat([across, up], 1), dim=1)
    shading = torch.log(0.3 + normal[:, :1].clamp(min=0)).repeat(1, 3, 1, 1)
    return Sample(
        torch.from_numpy(photo).permute(0, 3, 1, 2) * torch.exp(shading),
        known,
        known,
        normal,
        0.1 * torch.ones_like(shading),
        shading,
        torch.zeros_like(known),
        torch.randn(count, LIGHT, generator=generator),
        torch.arange(count) % 3,
        torch.arange(count) % PLACE_COUNT - 1,
        torch.arange(count) % 3,
    )


def test_the_frames_of_both_agree() -> None:
    assert OUTPUT == SIDE and OBJECT == 112


def test_the_channels_of_both_agree() -> None:
    photo, mask = photos(2)
    mine = network_channels(
        torch.from_numpy(photo).permute(0, 3, 1, 2), torch.from_numpy(mask[:, None]).float()
    )
    assert mine.shape == (2, INPUTS, SIDE, SIDE)
    for k in range(2):
        wanted = channels_of(photo[k], mask[k])
        np.testing.assert_allclose(mine[k].permute(1, 2, 0).numpy(), wanted, atol=1e-5)


def test_the_core_and_the_module_compute_the_same(tmp_path: Path) -> None:
    """With weights of 16 bits in both; and without, but for their rounding."""
    one = module(0)
    network = written(one, tmp_path)
    rounded = module(1)
    rounded.load_arrays(one.arrays())
    photo, mask = photos(2)
    inputs = network_channels(
        torch.from_numpy(photo).permute(0, 3, 1, 2), torch.from_numpy(mask[:, None]).float()
    )
    with torch.no_grad():
        (maps, vector), (exact_maps, exact_vector) = rounded(inputs), one(inputs)
    assert maps.shape == (2, CHANNELS, SIDE, SIDE) and vector.shape == (2, GLOBAL)
    for k in range(2):
        (raw,) = network((photo[k], mask[k]))
        # The biases of the file are rounded, those of the module follow from its normalisation.
        for found, both, tolerance in (
            (raw.maps, (maps, vector), 3e-3),
            (raw.maps, (exact_maps, exact_vector), 1e-2),
        ):
            theirs = both[0][k].permute(1, 2, 0).numpy()
            assert np.abs(found - theirs).max() < tolerance * np.abs(theirs).max()
            light = both[1][k].numpy()
            assert np.abs(raw.vector - light).max() < tolerance * np.abs(light).max()


def test_weights_read_back_are_those_written() -> None:
    one, other = module(2), module(3)
    arrays = one.arrays()
    other.load_arrays(arrays)
    for name, values in one.state_dict().items():
        if "num_batches" in name:
            continue
        found = other.state_dict()[name]
        is_norm = any(part in name for part in (".n1.", ".n2."))
        torch.testing.assert_close(found, values, rtol=0 if is_norm else 2e-3, atol=1e-4)
    again = other.arrays()
    assert again.keys() == arrays.keys()
    for name, values in arrays.items():
        assert again[name].dtype == values.dtype and again[name].shape == values.shape
        np.testing.assert_allclose(
            again[name].astype(float), values.astype(float), rtol=2e-3, atol=1e-6
        )


def test_the_shipped_widths_are_within_their_budget() -> None:
    assert sum(part.numel() for part in SceneNetworkModule().parameters()) < 8e6


@pytest.mark.parametrize("training", [True, False])
def test_the_loss_is_finite_without_a_known_pixel(training: bool) -> None:
    one, sample = module(4).train(training), batch()
    sample.known[1] = 0
    sample.mask[1] = 0
    sample.photo[1] = 0
    loss, terms = one.loss(sample)
    loss.backward()
    assert loss.isfinite() and all(term.isfinite() for term in terms.values())
    assert all(part.grad is None or part.grad.isfinite().all() for part in one.parameters())
    sample.known[:] = 0
    assert one.loss(sample)[0].isfinite()


def test_the_brightness_of_the_true_shading_changes_the_level_alone() -> None:
    one, sample = module(5), batch()
    with torch.no_grad():
        before = one.loss(sample)[1]
        sample.log_shading[:] += 0.7
        after = one.loss(sample)[1]
    for name in ("shading", "gradient", "normal", "ratio"):
        torch.testing.assert_close(after[name], before[name], rtol=1e-4, atol=1e-5)
    assert not torch.isclose(after["level"], before["level"])


def test_the_truth_itself_has_no_error() -> None:
    """Maps and light put in place of a prediction leave only the terms of the scales."""
    sample = batch()

    class Knowing(SceneNetworkModule):
        def forward(self, inputs: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
            ratio = torch.log(torch.expm1(sample.ratio)) + 2  # the inverse of softplus
            least = torch.full_like(sample.mask, -20)
            maps = [sample.normal, least, ratio, least, sample.log_shading + 0.3, least, least]
            vector = torch.zeros(len(inputs), GLOBAL)
            vector[:, :LIGHT] = sample.light
            return torch.cat(maps, 1), vector

    terms = Knowing(WIDTHS).loss(sample)[1]
    for name in ("normal", "ratio_error", "shading_error", "light_error", "edge"):
        assert terms[name].item() < 2e-3, name
    assert terms["degrees"].item() < 1


@pytest.mark.slow
def test_the_loss_falls() -> None:
    torch.manual_seed(0)
    one, sample = SceneNetworkModule(WIDTHS).train(), batch(2, 32)
    steps = torch.optim.AdamW(one.parameters(), 3e-3)
    losses = []
    for _ in range(30):
        loss, terms = one.loss(sample)
        steps.zero_grad()
        loss.backward()
        steps.step()
        losses.append((loss.item(), terms["degrees"].item()))
    assert np.mean([loss for loss, _ in losses[-5:]]) < 0.7 * losses[0][0]
    assert losses[-1][1] < losses[0][1] - 10


def test_the_likelihood_of_light_is_that_of_a_gaussian_of_low_rank() -> None:
    torch.manual_seed(0)
    error, log_scale = torch.randn(4, LIGHT), 0.3 * torch.randn(4, LIGHT)
    factors = torch.randn(4, LIGHT, FACTORS)
    gauss = torch.distributions.LowRankMultivariateNormal(
        torch.zeros_like(error), factors, torch.exp(2 * log_scale)
    )
    expected = -gauss.log_prob(error) / LIGHT
    torch.testing.assert_close(light_nll(error, log_scale, factors), expected)


def test_weights_of_another_network_are_refused_in_one_line() -> None:
    arrays = module(4).arrays()
    del arrays["normalisation"]
    for wrong in (arrays, HighlightNetworkModule().arrays()):
        with pytest.raises(InputError, match="weights of another network"):
            SceneNetworkModule.of(wrong)


def test_small_highlights_are_added_to_opaque_bodies_alone() -> None:
    torch.manual_seed(0)
    count = 200
    kinds = torch.arange(count) % 2 * Kind.GLASS
    layers = torch.rand(count, 13, 4, 4).half()
    blank = {name: torch.zeros(count) for name in LitPictures.__dataclass_fields__}
    blank |= {"layers": layers, "cover": torch.ones(count, 1, 4, 4), "kind": kinds}
    found = with_small_highlights(
        LitPictures(**blank | {"strongest": torch.zeros(count, 3)})
    ).layers
    added = found - layers.float()
    assert torch.equal(added[:, :3], torch.zeros_like(added[:, :3]))
    assert torch.equal(added[:, 6:], torch.zeros_like(added[:, 6:]))
    brighter = added[:, 3:6].sum((1, 2, 3)) > 0
    assert not brighter[kinds == Kind.GLASS].any()
    assert 0.2 < brighter[kinds == Kind.OPAQUE].float().mean() < 0.5
