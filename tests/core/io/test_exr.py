"""EXR files: the same bytes on one thread and on several; parts of frames."""

from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from isc_core.io.exr import read_channels, read_windowed, write_channels


@pytest.mark.skipif(
    not hasattr(OpenEXR, "set_global_thread_count"), reason="this OpenEXR has one thread"
)
def test_a_large_file_has_the_same_bytes_on_several_threads(tmp_path: Path) -> None:
    values = np.hypot(*np.mgrid[-1:1:1030j, -1:1:1030j]).astype(np.float32)
    channels = {"a.R": values, "a.G": values * values}
    before = OpenEXR.global_thread_count()
    try:
        OpenEXR.set_global_thread_count(3)
        write_channels(tmp_path / "three.exr", channels)
        OpenEXR.set_global_thread_count(0)
        write_channels(tmp_path / "chosen.exr", channels)
        assert OpenEXR.global_thread_count() > 0
    finally:
        OpenEXR.set_global_thread_count(before)
    # With no thread of its own the library compresses on the caller's.
    with OpenEXR.File(
        {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, dict(channels)
    ) as file:
        file.write(str(tmp_path / "one.exr"))
    one = (tmp_path / "one.exr").read_bytes()
    assert (tmp_path / "three.exr").read_bytes() == one
    assert (tmp_path / "chosen.exr").read_bytes() == one
    found = read_channels(tmp_path / "three.exr")
    assert all((found[name] == channels[name]).all() for name in channels)


def test_a_part_of_a_frame_is_read_in_its_place(tmp_path: Path) -> None:
    values = np.arange(1, 13, dtype=np.float32).reshape(3, 4)
    write_channels(tmp_path / "part.exr", {"a.Y": values}, (5, 2), (8, 11))
    stored = read_windowed(tmp_path / "part.exr")
    assert (stored.corner, stored.frame) == ((5, 2), (8, 11))
    assert (stored.channels["a.Y"] == values).all()
    frame = np.zeros((8, 11), np.float32)
    frame[2:5, 5:9] = values
    assert (read_channels(tmp_path / "part.exr")["a.Y"] == frame).all()


@pytest.mark.parametrize("corner", [(-2, 1), (9, 6), (-7, 0), (3, 20)])
def test_what_lies_outside_the_frame_is_left_out(tmp_path: Path, corner: tuple[int, int]) -> None:
    values = np.arange(1, 13, dtype=np.float32).reshape(3, 4)
    write_channels(tmp_path / "over.exr", {"Y": values}, corner, (8, 11))
    found = read_channels(tmp_path / "over.exr")["Y"]
    wide = np.zeros((8 + 40, 11 + 40), np.float32)
    wide[20 + corner[1] : 23 + corner[1], 20 + corner[0] : 24 + corner[0]] = values
    assert (found == wide[20:28, 20:31]).all()


def test_a_whole_frame_has_the_same_bytes_with_and_without_its_windows(tmp_path: Path) -> None:
    values = {"Y": np.ones((3, 4), np.float32)}
    write_channels(tmp_path / "plain.exr", values)
    write_channels(tmp_path / "windows.exr", values, (0, 0), (3, 4))
    assert (tmp_path / "plain.exr").read_bytes() == (tmp_path / "windows.exr").read_bytes()
