"""ICC profiles made by hand, of colorants and curves, or of a table."""

import struct
from collections.abc import Sequence

import numpy as np

from isc_core.imaging.srgb import linear_to_srgb

D50 = np.array([0.9642, 1.0, 0.8249])
D65 = np.array([0.9504559, 1.0, 1.0890578])
BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)
P3 = ((0.680, 0.320), (0.265, 0.690), (0.150, 0.060))
ADOBE = ((0.64, 0.33), (0.21, 0.71), (0.15, 0.06))
REC709 = ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06))
PROPHOTO_XYZ = np.array(
    [[0.7976749, 0.1351917, 0.0313534], [0.2880402, 0.7118741, 0.0000857], [0.0, 0.0, 0.8252100]]
)
SRGB_CURVE = (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)


def to_xyz(primaries: Sequence[tuple[float, float]], white: np.ndarray = D65) -> np.ndarray:
    """(3, 3) from linear light of the primaries to XYZ under their own white."""
    xyz = np.array([[x / y, 1.0, (1 - x - y) / y] for x, y in primaries]).T
    return xyz * np.linalg.solve(xyz, white)


def to_d50(primaries: Sequence[tuple[float, float]]) -> np.ndarray:
    """(3, 3) of the colorants of D65 primaries, adapted to D50 as profiles have them."""
    adapt = np.linalg.inv(BRADFORD) @ np.diag((BRADFORD @ D50) / (BRADFORD @ D65)) @ BRADFORD
    return adapt @ to_xyz(primaries)


def gamma_curve(gamma: float) -> bytes:
    """A curve of type `curv` with one number of 8.8 bits."""
    return b"curv" + bytes(4) + struct.pack(">IH", 1, round(256 * gamma))


def parametric_curve(*numbers: float) -> bytes:
    """A curve of type `para`; its form follows from the count of its numbers."""
    form = {1: 0, 3: 1, 4: 2, 5: 3, 7: 4}[len(numbers)]
    stored = [round(65536 * n) for n in numbers]
    return b"para" + bytes(4) + struct.pack(f">HH{len(numbers)}i", form, 0, *stored)


def sampled_curve(samples: np.ndarray) -> bytes:
    """A curve of type `curv` through equally spaced samples in [0, 1]."""
    codes = np.rint(65535 * samples).astype(">u2")
    return b"curv" + bytes(4) + struct.pack(">I", len(codes)) + codes.tobytes()


def rgb_profile(colorants: np.ndarray, curve: bytes, name: str = "Test", version: int = 2) -> bytes:
    """A display profile of (3, 3) colorants and one curve."""
    tags = {b"desc": _description(name, version), b"wtpt": _xyz(D50)}
    for k, letter in enumerate(b"rgb"):
        tags[b"%cXYZ" % letter], tags[b"%cTRC" % letter] = _xyz(colorants[:, k]), curve
    return _profile(b"RGB ", b"XYZ ", b"mntr", version, tags)


def grey_profile(curve: bytes, name: str = "Grey") -> bytes:
    """A display profile of one curve."""
    tags = {b"desc": _description(name, 2), b"wtpt": _xyz(D50), b"kTRC": curve}
    return _profile(b"GRAY", b"XYZ ", b"mntr", 2, tags)


def table_profile(name: str = "Table") -> bytes:
    """A scanner profile whose table of 17^3 colours swaps red and blue of sRGB.

    Its values are those of XYZ, as `mft2` has them.
    """
    steps = np.arange(17) / 16
    grid = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1)[..., ::-1]
    xyz = grid**2.2 @ to_d50(REC709).T
    table = np.rint(np.clip(xyz / (1 + 32767 / 32768), 0, 1) * 65535).astype(">u2")
    line = np.array([0, 65535], ">u2").tobytes()
    identity = struct.pack(">9i", *np.rint(65536 * np.eye(3)).astype(int).ravel())
    content = (
        b"mft2" + bytes(4) + bytes([3, 3, 17, 0]) + identity + struct.pack(">HH", 2, 2)
        + line * 3 + table.tobytes() + line * 3
    )  # fmt: skip
    tags = {b"desc": _description(name, 2), b"wtpt": _xyz(D50), b"A2B0": content}
    return _profile(b"RGB ", b"XYZ ", b"scnr", 2, tags)


def encoded(
    linear: np.ndarray, colorants: np.ndarray, gamma: float | None, peak: int
) -> np.ndarray:
    """Codes of linear Rec.709 light in a space of D50 colorants; sRGB's curve without a gamma."""
    light = np.clip(linear @ np.linalg.solve(colorants, to_d50(REC709)).T, 0, 1)
    codes = linear_to_srgb(light) if gamma is None else light ** (1 / gamma)
    return np.rint(peak * codes).astype(np.uint8 if peak == 255 else np.uint16)


def _xyz(values: np.ndarray) -> bytes:
    return b"XYZ " + bytes(4) + struct.pack(">3i", *(round(65536 * v) for v in values))


def _description(name: str, version: int) -> bytes:
    if version == 4:
        text = name.encode("utf-16-be")
        return b"mluc" + bytes(4) + struct.pack(">II4sII", 1, 12, b"enUS", len(text), 28) + text
    text = name.encode("latin-1") + b"\0"
    return b"desc" + bytes(4) + struct.pack(">I", len(text)) + text + bytes(78)


def _profile(
    model: bytes, connection: bytes, kind: bytes, version: int, tags: dict[bytes, bytes]
) -> bytes:
    start = 132 + 12 * len(tags)
    table, content = struct.pack(">I", len(tags)), b""
    for name, value in tags.items():
        table += name + struct.pack(">II", start + len(content), len(value))
        content += value + bytes(-len(value) % 4)
    header = struct.pack(">I4sI", start + len(content), bytes(4), version << 24)
    header += kind + model + connection + bytes(12) + b"acsp" + bytes(28)
    header += struct.pack(">3i", *(round(65536 * v) for v in D50)) + bytes(48)
    assert len(header) == 128
    return header + table + content
