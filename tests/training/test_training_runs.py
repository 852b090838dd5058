"""A training runs, resumes, and exports weights that the core reads."""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch")

import torch

from isc_core.errors import InputError
from isc_core.networks.scene_network import SceneNetwork
from training.devices import available_device
from training.loop import RunOptions, fit
from training.networks.scene_module import SceneNetworkModule
from training.networks.scene_network import SCHEDULE, main
from training.world.samples import Sample

from .test_scene_network import WIDTHS, batch


def options(output: Path, **others: Any) -> RunOptions:
    return RunOptions(output, **({"steps": 2, "batch": 2, "workers": 0} | others))


def draw(rng: np.random.Generator) -> Sample:
    return batch(int(rng.integers(1, 3)))


def network() -> SceneNetworkModule:
    torch.manual_seed(0)
    return SceneNetworkModule(WIDTHS)


def test_weights_are_written_in_the_layout_of_the_core(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "folder" / "out.npz"
    fit(network(), draw, SCHEDULE, options(path), draw)
    SceneNetwork.read(path)
    with np.load(path, allow_pickle=False) as data:
        assert all(np.isfinite(data[name]).all() for name in data)
    printed = capsys.readouterr().out
    assert "step 2: loss" in printed and "held out: loss" in printed


def test_every_parameter_is_fitted(tmp_path: Path) -> None:
    one = network()
    before = {name: values.clone() for name, values in one.named_parameters()}
    fit(one, draw, SCHEDULE, options(tmp_path / "out.npz"))
    for name, values in one.named_parameters():
        assert not torch.equal(values, before[name]), name


def test_a_run_resumes_where_it_stopped(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = tmp_path / "first.npz", tmp_path / "second.npz"
    fit(network(), draw, SCHEDULE, options(first))
    resumed = options(second, steps=3, resume=first.with_suffix(".pt"))
    fit(network(), draw, SCHEDULE, resumed)
    kept = [torch.load(path.with_suffix(".pt"), weights_only=True) for path in (first, second)]
    assert [one["step"] for one in kept] == [2, 3]
    assert "step 3:" in capsys.readouterr().out
    again = tmp_path / "again.npz"
    fit(network(), draw, SCHEDULE, options(again, resume=first.with_suffix(".pt")))
    assert not again.exists()


def test_another_networks_checkpoint_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "first.npz"
    fit(network(), draw, SCHEDULE, options(path))
    other = SceneNetworkModule((4, 8, 8, 10))
    with pytest.raises(InputError, match=r"another network, [^\n]*size mismatch[^\n]*\Z"):
        fit(other, draw, SCHEDULE, options(path, resume=path.with_suffix(".pt")))
    torch.save({"weights": torch.zeros(1)}, tmp_path / "other.pt")
    (tmp_path / "text.pt").write_text("no checkpoint")
    for name, match in (
        ("other.pt", "not a training checkpoint"),
        ("first.npz", "not a training checkpoint"),
        ("text.pt", "not a training checkpoint"),
        ("none.pt", "cannot be read"),
    ):
        with pytest.raises(InputError, match=match):
            fit(other, draw, SCHEDULE, options(path, resume=tmp_path / name))


def test_options_that_no_run_can_use_are_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ["scene_network", str(tmp_path), "-o", str(tmp_path / "out.npz")]
    for more, match in (
        (["--side", "50"], "50 is not a multiple of 32 pixels"),
        (["--steps", "0"], "1 or more"),
        (["--batch", "0"], "1 or more"),
        (["--rate", "0"], "not a number"),
        (["-o", str(tmp_path)], "is a folder"),
        ([], "is no world"),
    ):
        monkeypatch.setattr("sys.argv", [*words, *more])
        with pytest.raises(SystemExit) as found:
            main()
        assert found.value.code == 2 and match in capsys.readouterr().err.splitlines()[-1]


def test_arrays_that_are_no_weights_are_refused() -> None:
    for arrays in ({}, {"maps": np.zeros(3)}, {"weight00": np.zeros(3), "weight01": np.zeros(3)}):
        with pytest.raises(InputError, match="weights of another network"):
            SceneNetworkModule.of(arrays)


def test_a_device_that_is_not_there_is_refused_in_one_line() -> None:
    assert available_device("cpu") == "cpu"
    with pytest.raises(argparse.ArgumentTypeError, match="unknown device"):
        available_device("tpu")
    if not torch.cuda.is_available():
        with pytest.raises(argparse.ArgumentTypeError, match="leave out --device"):
            available_device("cuda")
