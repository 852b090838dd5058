"""EXR files: the same bytes on one thread and on several."""

from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from isc_core.io.exr import read_channels, write_channels


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
