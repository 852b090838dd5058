"""The trainable mask network is the one that the core runs."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

import torch

from isc_core.networks.mask_network import INPUTS, SIDE, MaskNetwork
from training.masks.mask_module import MaskNetworkModule

DOWN, UP = (6, 8, 8, 6), (7, 6, 5)


def module(seed: int) -> MaskNetworkModule:
    """Random weights and normalisations, as after some training."""
    torch.manual_seed(seed)
    one = MaskNetworkModule(DOWN, UP)
    for block in [*one.down, *one.up]:
        for _, norm in block.pairs:
            torch.nn.init.uniform_(norm.weight, 0.5, 1.5)
            torch.nn.init.normal_(norm.bias, 0, 0.1)
            torch.nn.init.normal_(norm.running_mean, 0, 0.2)
            torch.nn.init.uniform_(norm.running_var, 0.5, 2)
    return one.eval()


def test_the_core_and_the_module_compute_the_same(tmp_path: Path) -> None:
    one = module(0)
    path = tmp_path / "network.npz"
    np.savez(path, **one.arrays())  # type: ignore[arg-type]
    inputs = np.random.default_rng(0).normal(0, 1, (SIDE, SIDE, INPUTS)).astype(np.float32)
    with torch.no_grad():
        odds, counts = one(torch.from_numpy(inputs).permute(2, 0, 1)[None])
    found = MaskNetwork.read(path)(inputs[None])
    np.testing.assert_allclose(found[0], odds[:, 0].numpy(), atol=0.02)
    np.testing.assert_allclose(found[1][0], counts[0].numpy(), atol=0.02)


def test_weights_are_restored_from_an_archive() -> None:
    one, other = module(0), module(1)
    arrays = one.arrays()
    other.load_arrays(arrays)
    inputs = torch.randn(1, INPUTS, 32, 32)
    with torch.no_grad():
        for found, wanted in zip(other(inputs), one(inputs), strict=True):
            np.testing.assert_allclose(found.numpy(), wanted.numpy(), atol=0.02)


def test_the_scene_network_is_a_start_where_channels_agree() -> None:
    from isc_core.io.npy import read_arrays
    from isc_core.networks import scene_network

    folder = Path(scene_network.__file__).parent / "data"
    arrays = read_arrays(folder / scene_network.SceneNetwork.file)
    one = MaskNetworkModule()
    one.start_from_scene(arrays)
    gain = one.down[0].n2.weight / torch.sqrt(one.down[0].n2.running_var + 1e-5)
    folded = (one.down[0].c2.weight * gain[:, None, None, None]).detach().numpy()
    wanted = arrays["weight01"].astype(np.float32).reshape(3, 3, *arrays["weight01"].shape[1:])
    np.testing.assert_allclose(folded, wanted.transpose(3, 2, 0, 1), atol=1e-3)
