"""A world in one small file: what a fit on another machine needs, at most so many megabytes.

Problem: a world of some thousand views takes a gigabyte; a machine with a GPU may be far away, and
lent for minutes. Quantised and compressed, a view takes some 30 KB.

Equation: pixels follow each other row by row, and each stores its difference from the one before:
normals as octahedral coordinates of 8 bits each, depth in steps of 1/1024, thickness in steps of
1/100, visibility as its changed bits. All views' differences of one kind are one stream for LZMA.
Surroundings are kept as half floats at the size that the lighting uses.

Citation: Z. H. Cigolle et al., "A survey of efficient representations for independent unit
vectors", Journal of Computer Graphics Techniques 3(2), 2014 (octahedral coordinates).

Limits: normals are off by up to a degree.
"""

import lzma
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from isc_core.errors import InputError
from isc_core.io.atomic import new_file

from ..archives import open_archive
from .environments import Panorama, read_panoramas
from .files import Split, read_patterns, views_in
from .patterns import Atlas
from .views import DIRECTIONS, SIDE, View

FORMAT = 2
SUFFIX = ".isw"
_DEPTH, _THICKNESS = 1024.0, 100.0  # steps per unit
_SHARES = {Split.TRAIN: 0.9, Split.UNSEEN_BODY: 0.08, Split.UNSEEN_SOURCE: 0.02}
_PATTERNS, _FIRST_GUESS, _GUESSES, _NEARLY, _MOST_GROWTH = 600, 200, 8, 0.9, 20.0
_STREAMS = ("normal", "depth", "thickness", "visible")


@dataclass(frozen=True)
class PackedWorld:
    """The content of a pack.

    Attributes
    ----------
    views : dict of Split to list of View
    panoramas : list of Panorama
    atlas : Atlas
    """

    views: dict[Split, list[View]]
    panoramas: list[Panorama]
    atlas: Atlas


def write_pack(path: Path, world: PackedWorld) -> int:
    """Write a pack.

    Parameters
    ----------
    path : Path
    world : PackedWorld

    Returns
    -------
    int
        Bytes of the file.
    """
    views = [view for split in Split for view in world.views.get(split, [])]
    splits = [str(split) for split in Split for _ in world.views.get(split, [])]
    arrays: dict[str, np.ndarray] = {
        "format": np.array(FORMAT),
        "names": np.array([view.name for view in views]),
        "sources": np.array([view.source for view in views]),
        "splits": np.array(splits),
        "masks": _stream([np.packbits(view.mask) for view in views]),
        "directions": np.stack([view.directions for view in views]),
        "distances": np.array([view.distance for view in views]),
        "ups": np.stack([view.up for view in views]),
        "panorama_names": np.array([one.name for one in world.panoramas]),
        "judged": np.array([one.held_out for one in world.panoramas]),
        "radiance": np.stack([one.radiance for one in world.panoramas]).astype(np.float16),
        "patterns": _stream(
            [np.diff(one, axis=1, prepend=np.uint8(0)) for one in world.atlas.maps]
        ),
        "kinds": world.atlas.kinds,
        "tileable": world.atlas.tileable,
        "side": np.array(world.atlas.maps.shape[-1]),
    }
    for name in _STREAMS:
        arrays[name] = _stream([_differences(view)[name] for view in views])
    with new_file(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]
    return path.stat().st_size


def read_pack(path: Path) -> PackedWorld:
    """Read a pack.

    Parameters
    ----------
    path : Path

    Returns
    -------
    PackedWorld

    Raises
    ------
    InputError
        If the file is no pack of this version.
    """
    with open_archive(path, "a pack of a world", "make it again with isc world pack") as data:
        if int(data["format"]) != FORMAT:
            raise InputError(
                f"{path} is a pack of another version: make it again with isc world pack"
            )
        return _unpacked({name: data[name] for name in data.files})


def all_views(path: Path) -> list[View]:
    """Read the views of a pack, whatever their split.

    Parameters
    ----------
    path : Path

    Returns
    -------
    list of View

    Raises
    ------
    InputError
        If the file is no pack of this version.
    """
    return [view for views in read_pack(path).views.values() for view in views]


def pack_worlds(
    folders: Sequence[Path],
    panoramas: Path,
    path: Path,
    most: int,
    seed: int,
    packed: Sequence[View] = (),
) -> list[str]:
    """Pack as many views of worlds as fit into a file.

    Parameters
    ----------
    folders : sequence of Path
        Worlds.
    panoramas : Path
        Their folder.
    path : Path
        The file to write.
    most : int
        Bytes that it may have.
    seed : int
        Chooses views.
    packed : sequence of View
        Left out; their bodies come last.

    Returns
    -------
    list of str
        A line that describes the pack.

    Raises
    ------
    InputError
        If a folder is no world, no view is left, or not even a few fit.
    """
    known = {_identity(view) for view in packed}
    views = {
        split: [v for one in folders for v in views_in(one, split) if _identity(v) not in known]
        for split in Split
    }
    if not any(views.values()):
        raise InputError(f"{folders[0]} has no views that other packs do not hold")
    atlas = read_patterns(folders[0])
    few = slice(_PATTERNS)
    atlas = Atlas(atlas.maps[few], atlas.kinds[few], atlas.tileable[few])
    found, count, size, whole = read_panoramas(panoramas), _FIRST_GUESS, 0, 0
    everything = sum(map(len, views.values()))
    for _ in range(_GUESSES):
        chosen = {
            split: chosen_views(
                views[split], round(count * share), np.random.default_rng(seed), packed
            )
            for split, share in _SHARES.items()
        }
        size = write_pack(path, PackedWorld(chosen, found, atlas))
        whole = sum(map(len, chosen.values()))
        if size <= most and (size > _NEARLY * most or whole == everything):
            break
        count = max(1, int(count * min(_MOST_GROWTH, 0.97 * most / size)))
    if size > most:
        path.unlink()
        raise InputError(f"{most} bytes are too few for a pack: allow more")
    return [f"{path}: {whole} views, {len(found)} panoramas, {size / 1e6:.1f} MB"]


def _identity(view: View) -> tuple[str, bytes]:
    """Two views of a body have different outlines."""
    return view.name, np.packbits(view.mask).tobytes()


def chosen_views(
    views: Sequence[View], count: int, rng: np.random.Generator, packed: Sequence[View] = ()
) -> list[View]:
    """Choose views so that as many bodies as possible are among them.

    Parameters
    ----------
    views : sequence of View
    count : int
    rng : numpy.random.Generator
    packed : sequence of View
        Chosen before.

    Returns
    -------
    list of View
        At most `count`; every body once before any body twice, those chosen before counted.
    """
    order = rng.permutation(len(views))
    seen = Counter(view.name for view in packed)
    rank = []
    for k in order:
        rank.append(seen[views[k].name])
        seen[views[k].name] += 1
    first = np.argsort(rank, kind="stable")[:count]
    return [views[order[k]] for k in first]


def _stream(parts: list[np.ndarray]) -> np.ndarray:
    data = b"".join(np.ascontiguousarray(part).tobytes() for part in parts)
    return np.frombuffer(lzma.compress(data, preset=4), np.uint8)


def _bytes(stream: np.ndarray) -> np.ndarray:
    return np.frombuffer(lzma.decompress(stream.tobytes()), np.uint8)


def _differences(view: View) -> dict[str, np.ndarray]:
    """What is stored of each pixel; wraps around at 8 and 16 bits."""
    normal = _octahedral(view.normal.astype(np.float32))
    depth = np.rint(view.depth.astype(np.float32) * _DEPTH).astype(np.int16).view(np.uint16)
    step = np.diff(depth, prepend=np.uint16(0))
    thickness = np.clip(view.thickness.astype(np.float32) * _THICKNESS, 0, 255).astype(np.uint8)
    before = np.vstack([np.zeros_like(view.visible[:1]), view.visible[:-1]])
    return {
        "normal": np.diff(normal, axis=0, prepend=np.uint8(0)).T,
        # high bytes first: they hardly ever change
        "depth": np.stack([step >> 8, step & 255]).astype(np.uint8),
        "thickness": np.diff(thickness, prepend=np.uint8(0)),
        "visible": (view.visible ^ before).T,
    }


def _unpacked(data: dict[str, np.ndarray]) -> PackedWorld:
    count, side = len(data["names"]), int(data["side"])
    masks = np.unpackbits(_bytes(data["masks"]).reshape(count, -1), axis=1).astype(bool)
    masks = masks[:, : SIDE * SIDE].reshape(count, SIDE, SIDE)
    streams = {name: _bytes(data[name]) for name in _STREAMS}
    sizes = np.concatenate([[0], np.cumsum(masks.sum((1, 2)))])
    if any(len(streams[n]) != sizes[-1] * w for n, w in zip(_STREAMS, (2, 2, 1, 8), strict=True)):
        raise ValueError("its parts do not fit each other")
    views: dict[Split, list[View]] = {split: [] for split in Split}
    for k in range(count):
        start, end = int(sizes[k]), int(sizes[k + 1])
        views[Split(str(data["splits"][k]))].append(
            View(
                str(data["names"][k]),
                str(data["sources"][k]),
                masks[k],
                *_pixels(streams, start, end),
                data["directions"][k],
                float(data["distances"][k]),
                data["ups"][k],
            )
        )
    steps = _bytes(data["patterns"]).reshape(-1, side, side)
    atlas = Atlas(np.cumsum(steps, axis=2, dtype=np.uint8), data["kinds"], data["tileable"])
    panoramas = [
        Panorama(str(name), radiance.astype(np.float32), bool(held_out))
        for name, radiance, held_out in zip(
            data["panorama_names"], data["radiance"], data["judged"], strict=True
        )
    ]
    return PackedWorld(views, panoramas, atlas)


def _pixels(
    streams: dict[str, np.ndarray], start: int, end: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Normal, depth, thickness and visibility of the pixels `start` to `end` of all views."""
    normal = streams["normal"][2 * start : 2 * end].reshape(2, -1).T
    high, low = streams["depth"][2 * start : 2 * end].reshape(2, -1).astype(np.uint16)
    depth = np.cumsum((high << 8) | low, dtype=np.uint16).view(np.int16) / _DEPTH
    thickness = np.cumsum(streams["thickness"][start:end], dtype=np.uint8) / _THICKNESS
    width = DIRECTIONS // 8
    changed = streams["visible"][width * start : width * end].reshape(width, -1).T
    return (
        _from_octahedral(np.cumsum(normal, axis=0, dtype=np.uint8)).astype(np.float16),
        depth.astype(np.float16),
        thickness.astype(np.float16),
        np.bitwise_xor.accumulate(changed, axis=0),
    )


def _octahedral(normal: np.ndarray) -> np.ndarray:
    """Unit vectors (N, 3) as two numbers of 8 bits (N, 2)."""
    flat = normal[:, :2] / np.abs(normal).sum(1, keepdims=True)
    folded = (1 - np.abs(flat[:, ::-1])) * np.where(flat >= 0, 1, -1)
    flat = np.where(normal[:, 2:] < 0, folded, flat)
    return np.rint((flat + 1) * 127.5).astype(np.uint8)


def _from_octahedral(coded: np.ndarray) -> np.ndarray:
    flat = coded / 127.5 - 1
    up = 1 - np.abs(flat).sum(1, keepdims=True)
    folded = (1 - np.abs(flat[:, ::-1])) * np.where(flat >= 0, 1, -1)
    normal = np.hstack([np.where(up < 0, folded, flat), up])
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))
