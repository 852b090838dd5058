"""Runs on the same photo with other settings: what does not depend on them is kept, and changes no
bit of the result.
"""

from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from isc_core.decomposition import light_colour
from isc_core.decomposition.pipeline import Settings, decompose
from isc_core.io.stage_cache import StageCache
from isc_core.networks import scene_network
from isc_core.scene.decomposition import Decomposition
from tests.core.decomposition.test_light_colour import photo_of
from tests.core.illuminant.test_illuminant import ALBEDOS, LIGHT
from tests.core.small_solves import small_solves


def bytes_of(result: Decomposition) -> dict[str, bytes]:
    """All maps, and the text of all else but the run time."""
    values = {field.name: getattr(result, field.name) for field in fields(result)}
    values["provenance"] = replace(result.provenance, timings={}, versions={})
    return {
        name: value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode()
        for name, value in values.items()
    }


@pytest.fixture(autouse=True)
def few_steps() -> Iterator[None]:
    with small_solves():
        yield


@pytest.mark.slow
def test_kept_stages_change_no_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    photo, kept = photo_of(ALBEDOS, LIGHT, size=64), StageCache(tmp_path)
    first, second = (
        Settings(model="joint", separator=separator, engine="numpy", light_colour="estimate")
        for separator in ("isc", "shen_2009")
    )
    wanted = [bytes_of(decompose(photo, settings)) for settings in (first, second)]
    assert wanted[0] != wanted[1]
    assert bytes_of(decompose(photo, first, kept=kept)) == wanted[0]

    def refuse(*arguments: object) -> None:
        raise AssertionError("this stage does not depend on the separator")

    with monkeypatch.context() as patch:
        patch.setattr(scene_network, "_computed", refuse)
        patch.setattr(light_colour, "estimate_illuminant", refuse)
        assert bytes_of(decompose(photo, second, kept=kept)) == wanted[1]
        with pytest.raises(AssertionError):
            decompose(replace(photo, image=2 * photo.image), second, kept=kept)
    for file in tmp_path.iterdir():
        file.write_bytes(file.read_bytes()[:-9])
    assert bytes_of(decompose(photo, second, kept=kept)) == wanted[1]
