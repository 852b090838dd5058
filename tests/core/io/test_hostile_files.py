"""Small files that claim large sizes or are expensive: each is rejected at once, with the reason in
one line.
"""

import io
import struct
import subprocess
import sys
import time
import zipfile
import zlib
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from isc_core.errors import InputError
from isc_core.io.decoders import read_raster
from isc_core.io.limits import Limits
from isc_core.io.memory import enough_memory, free_memory, is_exhausted, require_memory
from isc_core.io.npy import read_arrays
from tests.core.command_line import ROOT


def refused_in_time(path: Path) -> str:
    """The message of the refusal, within a second of processor time."""
    start = time.process_time()
    with pytest.raises(InputError) as refusal:
        read_raster(path)
    assert time.process_time() - start < 1.0
    return str(refusal.value)


def progressive_jpeg(side: int) -> bytes:
    stream = io.BytesIO()
    Image.new("RGB", (side, side), (90, 60, 30)).save(stream, "JPEG", progressive=True)
    return stream.getvalue()


def test_a_jpeg_of_thousands_of_scans_is_refused(tmp_path: Path) -> None:
    data = progressive_jpeg(2048)
    last = data.rindex(b"\xff\xda")
    path = tmp_path / "scans.jpg"
    path.write_bytes(data[:last] + data[last:-2] * 4000 + data[-2:])
    assert "more than 100 scans" in refused_in_time(path)


def test_scans_of_a_thumbnail_do_not_count(tmp_path: Path) -> None:
    data = progressive_jpeg(64)
    thumbnail = b"\xff\xda" * 500
    path = tmp_path / "thumbnail.jpg"
    segment = b"\xff\xe2" + struct.pack(">H", 2 + len(thumbnail)) + thumbnail
    path.write_bytes(data[:2] + segment + data[2:])
    assert read_raster(path).values.shape == (64, 64, 3)


@pytest.mark.parametrize("magic", [b"P1", b"P2", b"P3", b"P4", b"P5", b"P6"])
@pytest.mark.parametrize("filling", [b" ", b"#", b"# \n", b"1"])
def test_a_pixmap_header_without_end_is_refused(
    tmp_path: Path, magic: bytes, filling: bytes
) -> None:
    path = tmp_path / "blank.ppm"
    path.write_bytes(magic + b" " + filling * (20_000_000 // len(filling)))
    assert "PPM file is damaged" in refused_in_time(path)


def test_comments_in_a_pixmap_header_are_read(tmp_path: Path) -> None:
    path = tmp_path / "comments.ppm"
    path.write_bytes(b"P5 # by a scanner\n#\n 9\t8 # size\n1000\n" + bytes(range(1, 145)))
    with pytest.raises(InputError, match="damaged"):  # codes above 1000
        read_raster(path)
    path.write_bytes(b"P5 # by a scanner\n#\n 9\t8 # size\n255\n" + bytes(range(72)))
    assert read_raster(path).values.ravel().tolist() == list(range(72))


def test_a_radiance_header_without_end_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "blank.hdr"
    path.write_bytes(b"#?RADIANCE\n" + b"A=1\n" * 5_000_000)
    assert "HDR file is damaged" in refused_in_time(path)


def chunk(kind: bytes, content: bytes) -> bytes:
    return (
        struct.pack(">I", len(content))
        + kind
        + content
        + zlib.crc32(kind + content).to_bytes(4, "big")
    )


@pytest.mark.parametrize("kind", [b"tEXt", b"IDAT"])
def test_a_png_of_a_million_chunks_is_refused(tmp_path: Path, kind: bytes) -> None:
    stream = io.BytesIO()
    Image.new("RGB", (32, 32), (90, 60, 30)).save(stream, "PNG")
    data = stream.getvalue()
    path = tmp_path / "chunks.png"
    path.write_bytes(data[:33] + chunk(kind, b"") * 1_000_000 + data[33:])
    assert "PNG file is damaged" in refused_in_time(path)


def test_a_png_of_small_chunks_is_read(tmp_path: Path) -> None:
    stream = io.BytesIO()
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (99, 99, 3), np.uint8)).save(
        stream, "PNG"
    )
    data = stream.getvalue()
    content = data[41 : 41 + struct.unpack(">I", data[33:37])[0]]
    parts = [chunk(b"IDAT", content[at : at + 64]) for at in range(0, len(content), 64)]
    path = tmp_path / "small.png"
    path.write_bytes(data[:33] + b"".join(parts) + chunk(b"IEND", b""))
    whole = tmp_path / "whole.png"
    whole.write_bytes(data)
    assert np.array_equal(read_raster(path).values, read_raster(whole).values)


def exr_in_frame(path: Path, side: int, frame: int) -> None:
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "displayWindow": (np.zeros(2, np.int32), np.full(2, frame - 1, np.int32)),
        "dataWindow": (np.zeros(2, np.int32), np.full(2, side - 1, np.int32)),
    }
    pixels = {"RGB": np.zeros((side, side, 3), np.float32)}
    with OpenEXR.File(header, pixels) as file:
        file.write(str(path))


def test_a_huge_frame_around_little_data_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "frame.exr"
    exr_in_frame(path, 8, 9999)
    assert "display window of 100 megapixels" in refused_in_time(path)


def test_a_crop_of_a_frame_is_read(tmp_path: Path) -> None:
    path = tmp_path / "crop.exr"
    exr_in_frame(path, 40, 100)
    assert read_raster(path).values.shape == (100, 100, 3)


# --- memory ---------------------------------------------------------------------------------------

_WITH_LITTLE_MEMORY = """
import resource, sys
from pathlib import Path
from isc_core.errors import InputError
from isc_core.io.decoders import read_raster
pages = int(Path("/proc/self/statm").read_text().split()[0])
resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + (64 << 20),) * 2)
try:
    read_raster(sys.argv[1])
except InputError as error:
    print(error)
"""


def test_an_array_that_does_not_fit_is_no_damage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "arrays.npz"
    np.savez_compressed(path, a=np.zeros(1_000_000))  # stored members are not unpacked

    def fail(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr("zipfile.ZipFile.read", fail)
    with pytest.raises(InputError, match=r"its arrays need about 8.0 MB of memory"):
        read_arrays(path)


def test_an_archive_may_unpack_to_the_limit(tmp_path: Path) -> None:
    path = tmp_path / "arrays.npz"
    np.savez(path, a=np.zeros(1_000_000))
    with zipfile.ZipFile(path) as archive:
        size = sum(member.file_size for member in archive.infolist())
    assert read_arrays(path, Limits(max_bytes=size, max_ratio=0))["a"].size == 1_000_000
    with pytest.raises(InputError, match="unpacks to"):
        read_arrays(path, Limits(max_bytes=size - 1, max_ratio=0))


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs Linux's /proc")
@pytest.mark.parametrize("kind", ["progressive.jpg", "plain.jpg", "p.png", "deep.png", "f.exr"])
def test_exhausted_memory_is_distinguished_from_damage_and_states_the_amount(
    tmp_path: Path, kind: str
) -> None:
    path, side = tmp_path / kind, 3000
    if kind.startswith("deep"):
        import cv2

        cv2.imwrite(str(path), np.zeros((side, side, 3), np.uint16))
    elif kind.endswith("exr"):
        exr_in_frame(path, side, side)
    else:
        image = Image.new("RGB", (side, side), (90, 60, 30))
        image.save(path, progressive=kind.startswith("progressive"))
    done = subprocess.run(
        [sys.executable, "-c", _WITH_LITTLE_MEMORY, str(path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "3000 x 3000 pixels need about 0.3 GB of memory, more than is available" in done.stdout


def test_exhausted_memory_has_many_names() -> None:
    outer = OSError("decoder")
    outer.__cause__ = MemoryError()
    assert is_exhausted(outer)
    assert is_exhausted(RuntimeError("std::bad_alloc"))
    assert is_exhausted(OSError("out of memory error when reading image file"))
    assert not is_exhausted(OSError("broken data stream when reading image file"))


def test_work_without_memory_states_the_amount() -> None:
    with (
        pytest.raises(InputError, match="4 pixels need about 2.0 GB of memory, more than is avail"),
        enough_memory("4 pixels", 2_000_000_000, "use fewer"),
    ):
        raise MemoryError
    with pytest.raises(KeyError), enough_memory("4 pixels", 1, "use fewer"):
        raise KeyError


@pytest.mark.parametrize(
    ("group", "free"),
    [({}, 2_048_000), ({"max": "max"}, 2_048_000), ({"max": "1500", "current": "400"}, 1100)],
)
def test_free_memory_is_that_of_the_machine_or_of_the_container(
    tmp_path: Path, group: dict[str, str], free: int
) -> None:
    system = tmp_path / "meminfo"
    system.write_text("MemTotal:  9000 kB\nMemAvailable:  2000 kB\n")
    for name, text in group.items():
        (tmp_path / f"memory.{name}").write_text(f"{text}\n")
    assert free_memory(system, tmp_path) == free
    assert free_memory(tmp_path / "nowhere", tmp_path) is None


def test_work_that_needs_more_memory_than_allowed_is_refused() -> None:
    require_memory("4 pixels", 2_000_000_000, 2_000_000_000, "use fewer")
    expected = r"4 pixels need about 2.0 GB of memory, more than the 50.0 MB of --memory"
    with pytest.raises(InputError, match=expected):
        require_memory("4 pixels", 2_000_000_000, 50_000_000, "use fewer")
    with pytest.raises(InputError, match="more than is available: use fewer"):
        require_memory("4 pixels", 1 << 60, None, "use fewer")
