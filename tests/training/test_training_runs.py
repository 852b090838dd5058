"""Every training runs, resumes, and exports weights that the core reads."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mitsuba")
pytest.importorskip("torch")

import torch

from isc_core.networks.layer_network import LayerNetwork
from isc_core.networks.layers import inputs_of
from isc_core.networks.light_network import LightNetwork
from isc_core.networks.normal_network import NormalNetwork
from isc_core.networks.scene_classifier import SceneClassifier
from training.data import labelled_photos, layered_objects
from training.data.labelled_photos import LabelledObject
from training.data.layered_objects import LayeredObject
from training.data.traced_objects import make_object
from training.loop import RunOptions, fit, split
from training.networks import layer_network, light_network, normal_network, scene_classifier
from training.networks.torch_layers import network_input


@pytest.fixture(scope="module")
def objects(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("objects")
    for number in (0, 1):
        np.savez_compressed(folder / f"{number:06d}.npz", **make_object(number))  # type: ignore[arg-type]
    return folder


def disc(side: int) -> np.ndarray:
    y, x = np.mgrid[:side, :side] - side / 2
    return np.hypot(x, y) < 0.4 * side


def layered(name: str, seed: int) -> LayeredObject:
    mask = disc(layered_objects.SIZE)
    layers = np.random.default_rng(seed).uniform(0.1, 1, (13, *mask.shape)) * mask
    layers[12] = mask
    return LayeredObject(torch.from_numpy(layers.astype(np.float16)), name, name or str(seed))


def labelled(group: str, label: str, count: int) -> LabelledObject:
    mask = disc(labelled_photos.SIDE)
    layers = np.random.default_rng(count).uniform(0.1, 1, (count, 3, *mask.shape)) * mask
    cover = torch.from_numpy(mask.astype(np.float32))
    return LabelledObject(torch.from_numpy(layers.astype(np.float16)), cover, label, group, group)


def options(output: Path, **others: Any) -> RunOptions:
    return RunOptions(output, **({"steps": 2, "batch": 2, "workers": 0} | others))


def accepted(path: Path, read: Callable[[Path], object]) -> None:
    read(path)
    with np.load(path, allow_pickle=False) as data:
        assert all(np.isfinite(data[name]).all() for name in data)


def test_the_scene_classifier(tmp_path: Path) -> None:
    rows = [labelled("rig", "", 3), labelled("mirror", "mirror", 1), labelled("synth", "either", 1)]
    path, network = (
        tmp_path / "out.npz",
        scene_classifier.SceneClassifierModule(LayerNetwork.shipped()),
    )
    fit(network, scene_classifier.SceneBatches(rows, 4), scene_classifier.SCHEDULE, options(path))
    accepted(path, SceneClassifier.read)


def test_the_layer_network(tmp_path: Path) -> None:
    rows, path = [layered("", 0), layered("cup", 1)], tmp_path / "out.npz"
    draw = layer_network.LayerBatches(rows, 2)
    fit(layer_network.LayerNetworkModule(), draw, layer_network.SCHEDULE, options(path))
    accepted(path, LayerNetwork.read)


@pytest.mark.parametrize(
    ("program", "read"),
    [(light_network, LightNetwork.read), (normal_network, NormalNetwork.read)],
    ids=["light", "normals"],
)
def test_the_programs_for_relit_objects(
    program: Any,
    read: Callable[[Path], object],
    objects: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = tmp_path / "folder" / "out.npz"
    given = ["--steps", "2", "--batch", "3", "--workers", "0", "--validation", ".5"]
    monkeypatch.setattr(sys, "argv", ["training", str(objects), "-o", str(path), *given])
    program.main()
    accepted(path, read)
    printed = capsys.readouterr().out
    assert "step 2: loss" in printed and "held out: loss" in printed


def test_a_run_resumes_where_it_stopped(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    draw, schedule = layer_network.LayerBatches([layered("", 0)], 2), layer_network.SCHEDULE
    first, second = tmp_path / "first.npz", tmp_path / "second.npz"
    fit(layer_network.LayerNetworkModule(), draw, schedule, options(first))
    fit(
        layer_network.LayerNetworkModule(),
        draw,
        schedule,
        options(second, steps=3, resume=first.with_suffix(".pt")),
    )
    kept = [torch.load(path.with_suffix(".pt"), weights_only=True) for path in (first, second)]
    assert [one["step"] for one in kept] == [2, 3]
    assert "step 3:" in capsys.readouterr().out
    again = tmp_path / "again.npz"
    fit(
        layer_network.LayerNetworkModule(),
        draw,
        schedule,
        options(again, steps=2, resume=first.with_suffix(".pt")),
    )
    assert not again.exists()


def test_another_networks_checkpoint_is_refused(tmp_path: Path) -> None:
    draw, path = layer_network.LayerBatches([layered("", 0)], 2), tmp_path / "first.npz"
    fit(layer_network.LayerNetworkModule(), draw, layer_network.SCHEDULE, options(path))
    other, resumed = (
        normal_network.NormalNetworkModule(),
        options(path, resume=path.with_suffix(".pt")),
    )
    with pytest.raises(ValueError, match="another network"):
        fit(other, draw, normal_network.SCHEDULE, resumed)
    torch.save({"weights": torch.zeros(1)}, tmp_path / "other.pt")
    with pytest.raises(ValueError, match="not a training checkpoint"):
        fit(other, draw, normal_network.SCHEDULE, options(path, start=tmp_path / "other.pt"))


@pytest.mark.parametrize("share", [0.0, 0.2, 0.5, 0.99])
def test_the_split_keeps_names_together(share: float) -> None:
    members = [(name, k) for name in "abcde" for k in range(3)]
    kept, held_out = split(members, lambda one: one[0], options(Path(), validation=share))
    assert sorted(kept + held_out) == members and kept
    assert not {name for name, _ in kept} & {name for name, _ in held_out}
    assert bool(held_out) == bool(share)


def test_the_input_is_the_cores() -> None:
    mask = disc(32)
    image = np.random.default_rng(0).uniform(0, 2, (32, 32, 3)).astype(np.float32) * mask[..., None]
    picture = torch.from_numpy(image.transpose(2, 0, 1))[None]
    found = network_input(picture, torch.from_numpy(mask.astype(np.float32))[None, None])
    np.testing.assert_allclose(
        found[0].numpy().transpose(1, 2, 0), inputs_of(image, mask), 1e-4, 1e-4
    )
