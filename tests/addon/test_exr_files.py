"""OpenEXR files of the add-on: the library reads back every bit."""

from pathlib import Path

import numpy as np
import pytest

from blender_addon.files.exr import encode_exr
from isc_core.io.exr import read_channels


@pytest.mark.parametrize("channels", ["Y", "RGB", "RGBA"])
@pytest.mark.parametrize("size", [(1, 1), (16, 5), (50, 33)])
def test_every_value_comes_back(tmp_path: Path, channels: str, size: tuple[int, int]) -> None:
    rng = np.random.default_rng(1)
    values = rng.normal(size=(*size, len(channels))).astype(np.float32)
    values[size[0] // 2 :] *= 1e-30
    values[0, 0] = -0.0
    path = tmp_path / "map.exr"
    path.write_bytes(encode_exr(values[..., 0] if channels == "Y" else values))
    found = read_channels(path)
    assert set(found) == set(channels)
    for k, name in enumerate(channels):
        assert found[name].tobytes() == np.ascontiguousarray(values[..., k]).tobytes()


def test_the_surroundings_of_an_object_take_no_room_and_no_map_grows() -> None:
    row, column = np.mgrid[:256, :256]
    smooth = np.hypot(row - 128, column - 128).astype(np.float32)
    assert len(encode_exr(np.zeros_like(smooth))) < 0.02 * smooth.nbytes
    assert len(encode_exr(np.where(smooth < 60, smooth, 0))) < 0.25 * smooth.nbytes
    noise = np.random.default_rng(2).integers(0, 2**30, smooth.shape).astype(np.int32)
    for values in (smooth, noise.view(np.float32)):
        assert len(encode_exr(values)) < 1.01 * smooth.nbytes
