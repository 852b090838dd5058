"""Inputs and trials that the fault tests share."""

import hashlib
from collections.abc import Callable, Iterator
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from isc_core.networks.mask_network import MaskNetwork, MaskPrediction, predict_mask
from tests.faults.commands import Command, Trial, digests, make_inputs, run

Trials = Callable[[Command], Trial]


@pytest.fixture(scope="session", autouse=True)
def _one_prediction() -> Iterator[None]:
    """The trials find the mask of one photo again and again: the network predicts it once."""
    known: dict[bytes, MaskPrediction] = {}

    def predict(
        light: np.ndarray, frame: np.ndarray, hints: np.ndarray, network: MaskNetwork | None
    ) -> MaskPrediction:
        arrays = b"".join(array.tobytes() for array in (light, frame, hints))
        key = hashlib.sha256(arrays).digest()
        if key not in known:
            known[key] = predict_mask(light, frame, hints, network)
            known[key].cover.setflags(write=False)
        return known[key]

    with mock.patch("isc_core.masking.crops.predict_mask", predict):
        yield


@pytest.fixture(scope="session")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a photo, its mask, another photo and a result."""
    return make_inputs(tmp_path_factory.mktemp("inputs"))


@pytest.fixture(scope="session")
def complete(inputs: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., dict]:
    """The digests of a command's complete output; each command runs once."""
    known: dict[str, dict[str, str]] = {}

    def of(command: Command) -> dict[str, str]:
        if command.name not in known:
            output = tmp_path_factory.mktemp("complete") / command.output
            code, text = run(command.words(inputs, output))
            assert code == 0, text
            known[command.name] = digests(output)
        return known[command.name]

    return of


@pytest.fixture
def trial(inputs: Path, complete: Callable[..., dict], tmp_path: Path) -> Trials:
    """Makes a trial of a command in an empty folder."""

    def make(command: Command) -> Trial:
        made = Trial(command, inputs, tmp_path / "place", complete(command))
        made.reset()
        return made

    return make
