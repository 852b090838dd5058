"""Archives of arrays: other programs read them, arrays are aligned, and damage is found."""

import io
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from isc_core.errors import InputError
from isc_core.io.npy import parse_arrays, read_arrays, write_archive

ARRAYS = {
    "faces": np.arange(30).reshape(10, 3),
    "name of odd length": np.array("text"),
    "image": np.linspace(0, 1, 7 * 5 * 3, dtype=np.float32).reshape(7, 5, 3),
    "turned": np.asfortranarray(np.arange(12.0).reshape(3, 4)),
    "mask": np.eye(5, dtype=bool),
    "nothing": np.zeros((0, 3)),
    "é": np.array(2.5),
}


def archive(*, compressed: bool = False) -> bytes:
    file = io.BytesIO()
    write_archive(file, ARRAYS, compressed=compressed)
    return file.getvalue()


@pytest.mark.parametrize("compressed", [False, True])
def test_arrays_come_back_here_and_in_numpy(tmp_path: Path, compressed: bool) -> None:
    path = tmp_path / "arrays.npz"
    path.write_bytes(archive(compressed=compressed))
    with np.load(path) as loaded:
        for found in (read_arrays(path), dict(loaded)):
            assert list(found) == list(ARRAYS)
            for name, array in ARRAYS.items():
                np.testing.assert_array_equal(found[name], array)
                assert found[name].dtype == array.dtype
    assert zipfile.ZipFile(path).testzip() is None


def test_equal_arrays_give_equal_bytes() -> None:
    assert archive() == archive()
    assert archive(compressed=True) == archive(compressed=True)


def test_stored_arrays_are_aligned_views_of_the_file() -> None:
    data = archive()
    whole = np.frombuffer(data, np.uint8)
    for array in parse_arrays(data, "a.npz").values():
        assert array.flags.aligned
        if array.size:
            assert not array.flags.writeable
            assert np.shares_memory(array, whole)
            assert (array.ctypes.data - whole.ctypes.data) % 64 == 0


def test_unaligned_arrays_are_copied() -> None:
    """NumPy's own archives do not align their members."""
    for length in range(8):
        file = io.BytesIO()
        np.savez(file, **{"a" * (length + 1): np.arange(9.0)})
        (array,) = parse_arrays(file.getvalue(), "a.npz").values()
        np.testing.assert_array_equal(array, np.arange(9.0))
        assert array.flags.aligned and not array.flags.writeable


def test_a_changed_byte_of_any_array_is_found() -> None:
    data = archive()
    with zipfile.ZipFile(io.BytesIO(data)) as members:
        places = [m.header_offset for m in members.infolist()]
    for place in places:
        name, extra = struct.unpack_from("<HH", data, place + 26)
        damaged = bytearray(data)
        damaged[place + 30 + name + extra + 127] ^= 1  # the last byte of the array's header
        with pytest.raises(InputError, match="damaged"):
            parse_arrays(bytes(damaged), "a.npz")


@pytest.mark.parametrize("at", [0, 26, 28])
def test_a_damaged_local_header_is_found(at: int) -> None:
    damaged = bytearray(archive())
    damaged[at] ^= 0x40
    with pytest.raises(InputError, match="damaged"):
        parse_arrays(bytes(damaged), "a.npz")
