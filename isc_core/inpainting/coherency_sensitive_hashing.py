# mypy: disable-error-code="no-untyped-def"
"""Nearest patches by hashing and coherence (Korman & Avidan 2011).

Problem: find for each target patch the source patch with the smallest Euclidean distance. Comparing
all pairs is exact and takes minutes to hours; hashing alone misses many neighbours; images are
coherent, so that the neighbour of a good match is often a good match.

Equation: each table hashes a patch v by the bins floor((a_j . v + b_j) / r) of its strongest
Walsh-Hadamard coefficients a_j . v, with random offsets b_j. Candidates of a target patch are (1)
source patches in its bin, (2) the matches of target patches in its bin, (3) the matches of its two
neighbours visited before, moved by one pixel, and (4) source patches in the bin of those. A
candidate is dropped as soon as the distance of its projections, a lower bound, exceeds the best
distance; the others are compared in full. Each table has a new offset, another width r and the
opposite scan direction to the one before.

Citation: S. Korman and S. Avidan, "Coherency sensitive hashing", ICCV 2011, 1607-1614,
doi:10.1109/ICCV.2011.6126421; IEEE TPAMI 38(6), 1099-1112 (2016), doi:10.1109/TPAMI.2015.2477814.
Changes: widths from the data, and exact final distances.

Limits: approximate; patches are 8 x 8 pixels, neither rotated nor scaled. A patch without a similar
one is matched to an arbitrary one, with a large distance.
"""

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..numerics.jit import jit
from ..numerics.thread_pool import ThreadPool
from ..progress import Monitor
from .walsh_hadamard import PATCH, opponent, project, strongest


@dataclass(frozen=True)
class CshOptions:
    """Options of the search.

    Attributes
    ----------
    tables : int
        Number of hash tables, at least 1; more find better matches.
    projections : int
        Walsh-Hadamard coefficients kept per patch, 1 to 64 C (8 pixels squared, C channels).
    hashed : int
        Number of the strongest of them that are hashed, 1 to `projections`.
    candidates : int
        Patches tried per bin, at least 1.
    occupancy : float
        Median number of source patches in a patch's bin for the narrowest bins, greater than 0.
    seed : int
        Of the random offsets, not negative; the same seed gives the same matches.
    threads : int
        At least 1; the matches do not depend on it.
    """

    tables: int = 8
    projections: int = 23
    hashed: int = 8
    candidates: int = 4
    occupancy: float = 8.0
    seed: int = 0
    threads: int = 2


@dataclass(frozen=True, eq=False)
class Patches:
    """Patches of one image, by their upper left corners in raster order.

    Attributes
    ----------
    image : (H, W, C) float32 ndarray
        Contiguous.
    rows, columns : (n,) intp ndarray
    index : (H, W) int32 ndarray
        A corner's position in the list, else -1.
    """

    image: np.ndarray
    rows: np.ndarray
    columns: np.ndarray
    index: np.ndarray

    def __len__(self) -> int:
        return len(self.rows)


@dataclass(frozen=True, eq=False)
class Matches:
    """The matches of target patches.

    Attributes
    ----------
    source : (n,) int32 ndarray
        Position in the list of source patches.
    distance : (n,) float32 ndarray
        Sum of squared differences of all values of the two patches.
    """

    source: np.ndarray
    distance: np.ndarray


def patches_within(image: np.ndarray, usable: np.ndarray) -> Patches:
    """Return the patches of an image whose pixels are all usable.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    usable : (H, W) bool ndarray

    Returns
    -------
    Patches
    """
    return _listed(image, _windows(usable) == PATCH * PATCH)


def patches_touching(image: np.ndarray, wanted: np.ndarray) -> Patches:
    """Return the patches of an image that contain a wanted pixel.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    wanted : (H, W) bool ndarray

    Returns
    -------
    Patches
    """
    return _listed(image, _windows(wanted) > 0)


def _listed(image: np.ndarray, corners: np.ndarray) -> Patches:
    rows, columns = np.nonzero(corners)
    index = np.full(image.shape[:2], -1, np.int32)
    index[rows, columns] = np.arange(len(rows), dtype=np.int32)
    return Patches(opponent(image), rows, columns, index)


def _windows(flags: np.ndarray) -> np.ndarray:
    """Number of set pixels of each patch, by its corner.

    (H - 7, W - 7); empty if the image is smaller than a patch.
    """
    if min(flags.shape) < PATCH:
        return np.zeros((0, 0), np.int32)
    sums = np.pad(
        np.cumsum(np.cumsum(flags, axis=0, dtype=np.int32), axis=1, dtype=np.int32),
        ((1, 0), (1, 0)),
    )
    return (
        sums[PATCH:, PATCH:]
        - sums[:-PATCH, PATCH:]
        - sums[PATCH:, :-PATCH]
        + sums[:-PATCH, :-PATCH]
    )


class CshSearch:
    """Matches between target patches and a fixed set of source patches.

    The sources' projections are computed once.
    """

    def __init__(self, source: Patches, options: CshOptions | None = None) -> None:
        """Raise `InputError` without a source patch, or for options out of range."""
        self.options = options or CshOptions()
        _check(self.options, source)
        self.source = source
        self._chosen = strongest(
            source.image, source.rows, source.columns, self.options.projections
        )
        self._workers = ThreadPool(self.options.threads)
        self._projected = project(
            source.image, source.rows, source.columns, self._chosen, self._workers
        )
        self._width = _bin_width(self._projected, self.options)

    def match(
        self, target: Patches, start: np.ndarray | None = None, monitor: Monitor | None = None
    ) -> Matches:
        """Find the nearest source patch of each target patch.

        Parameters
        ----------
        target : Patches
            Patches of an image with as many channels as the sources'.
        start : (n,) int ndarray, optional
            Initial matches; no match gets worse. Random by default.
        monitor : Monitor, optional

        Returns
        -------
        Matches

        Raises
        ------
        Cancelled
            If the user cancels.
        """
        rng = np.random.default_rng(self.options.seed)
        projected = project(target.image, target.rows, target.columns, self._chosen, self._workers)
        best = rng.integers(len(self.source), size=len(target)) if start is None else start
        matches = Matches(best.astype(np.int32), np.full(len(target), np.inf, np.float32))
        for table in range(self.options.tables):
            if monitor is not None:
                monitor.report("matching patches", table / self.options.tables)
            self._try_table(target, projected, matches, table, rng)
        return matches

    def _try_table(
        self,
        target: Patches,
        projected: np.ndarray,
        matches: Matches,
        table: int,
        rng: np.random.Generator,
    ) -> None:
        """Improve `matches` in place with the candidates of one hash table."""
        width = self._width * np.float32(_WIDTHS[table % len(_WIDTHS)])
        offset = rng.random(self.options.hashed, np.float32) * width
        factors = rng.integers(1 << 40, size=self.options.hashed)
        bits = len(self.source).bit_length()
        hashed = [
            _Hashed(
                patches.image,
                patches.rows,
                patches.columns,
                patches.index,
                values,
                *_buckets(values, width, offset, factors, bits),
            )
            for patches, values in ((self.source, self._projected), (target, projected))
        ]
        salt, forward = int(rng.integers(1 << 30)), table % 2 == 0
        common = (
            hashed[0],
            hashed[1],
            matches.source,
            matches.distance,
            matches.source.copy(),
            self.options.candidates,
            salt,
            forward,
        )
        ends = np.linspace(0, len(target), _PARTS + 1).astype(int)
        self._workers.run(
            [
                partial(_sweep, *common, int(a), int(b))
                for a, b in zip(ends[:-1], ends[1:], strict=True)
            ]
        )


class _Hashed(NamedTuple):
    """One image's patches (see `Patches`; `places` is its `index`) with their projections (n, k)
    and one hash table: `bins` (n,), and the members of bin h, `members[starts[h]:starts[h + 1]]`.
    """

    image: np.ndarray
    rows: np.ndarray
    columns: np.ndarray
    places: np.ndarray
    projected: np.ndarray
    bins: np.ndarray
    starts: np.ndarray
    members: np.ndarray


# Types, see `numerics.kernel_types`.
_HASHED = "_Hashed(f4[3] i8[1:] i8[1:] i4[2] f4[2] i4[1] i4[1] i4[1])"
# Number of parts in which target patches are swept; independent of the number of threads, so that
# the result is, too.
_PARTS = 16
# Factors of the bin width: wide bins give candidates to rare patches, narrow ones the best to
# common patches.
_WIDTHS = (8.0, 4.0, 2.0, 16.0, 1.0)


def _check(options: CshOptions, source: Patches) -> None:
    if not len(source):
        raise InputError(
            f"no source patch: the image needs {PATCH} x {PATCH} known pixels without a gap"
        )
    most = PATCH * PATCH * source.image.shape[2]
    if not 1 <= options.hashed <= options.projections <= most:
        raise InputError(
            f"hashed and projections must satisfy 1 <= hashed <= projections <= {most}"
        )
    if (
        min(options.tables, options.candidates, options.threads) < 1
        or not options.occupancy > 0
        or options.seed < 0
    ):
        raise InputError(
            "tables, candidates and threads must be at least 1, occupancy above 0, seed at least 0"
        )


def _bin_width(values: np.ndarray, options: CshOptions) -> np.float32:
    """The width at which half of the patches, with projections `values` (n, k), share their bins
    with more than `occupancy` patches, within about a tenth.
    """
    spread = max(_largest_range(values), 1e-30)
    low, high = float(np.log(1e-4 * spread)), float(np.log(2 * spread))
    factors = np.random.default_rng(options.seed).integers(1 << 40, size=options.hashed)
    offset = np.zeros(options.hashed, np.float32)
    bins, bits = np.empty(len(values), np.int32), len(values).bit_length()
    while high - low > 0.2:
        middle = (low + high) / 2
        _hash(values, np.float32(np.exp(middle)), offset, factors, bits, bins)
        sizes = np.bincount(bins)
        crowded = 2 * sizes[sizes > options.occupancy].sum() > len(values)
        low, high = (low, middle) if crowded else (middle, high)
    return np.float32(np.exp(low))


def _buckets(
    values: np.ndarray, width: np.float32, offset: np.ndarray, factors: np.ndarray, bits: int
) -> tuple[np.ndarray, ...]:
    """The table of patches with projections `values` (n, >= hashed): bins below 2^bits (n,), starts
    (2^bits + 1,), members (n,).
    """
    bins, members = np.empty(len(values), np.int32), np.empty(len(values), np.int32)
    starts = np.zeros((1 << bits) + 1, np.int32)
    _hash(values, width, offset, factors, bits, bins)
    _sort_into(bins, starts, members)
    return bins, starts, members


@jit(types="f4[2] -> f8")
def _largest_range(values):
    """The largest range of a column of `values` (n, k); NumPy's `ptp` takes ten times as long."""
    low, high = values[0].copy(), values[0].copy()
    for i in range(1, values.shape[0]):
        for k in range(values.shape[1]):
            low[k], high[k] = min(low[k], values[i, k]), max(high[k], values[i, k])
    return np.float64((high - low).max())


@jit(types="f4[2] f4 f4[1] i8[1] i8 i4[1]")
def _hash(values, width, offset, factors, bits, bins):
    """bins[i]: `bits` middle bits of sum_j factor_j floor((v_ij + b_j) / r), which depend on all 40
    bits of the factors; nothing overflows.
    """
    inverse = np.float32(1) / width
    for i in range(values.shape[0]):
        key = np.int64(0)
        for j in range(offset.shape[0]):
            key = (key + np.int64(np.floor((values[i, j] + offset[j]) * inverse)) * factors[j]) & (
                (1 << 60) - 1
            )
        bins[i] = (key >> 16) & ((1 << bits) - 1)


@jit(types="i4[1] i4[1] i4[1]")
def _sort_into(bins, starts, members):
    """Counting sort: the patches of bin h become members[starts[h]:starts[h + 1]], in rising order.

    `starts` begins as zeros.
    """
    for i in range(bins.shape[0]):
        starts[bins[i] + 1] += 1
    for h in range(starts.shape[0] - 1):
        starts[h + 1] += starts[h]
    free = starts.copy()
    for i in range(bins.shape[0]):
        members[free[bins[i]]] = i
        free[bins[i]] += 1


@jit(types=f"{_HASHED} {_HASHED} i4[1] f4[1] i4[1] i8 i8 b1 i8 i8")
def _sweep(source, target, match, distance, before, candidates, salt, forward, low, high):
    """One pass over the target patches [low, high).

    Matches outside that range are read from `before`, a copy of the state at the start, because
    other threads change them.
    """
    step = 1 if forward else -1
    tried = np.empty(4 * candidates + 4, np.int32)
    image_s, image_t = source.image, target.image
    projected_s, projected_t = source.projected, target.projected
    for n in range(high - low):
        i = low + n if forward else high - 1 - n
        filled, found = 0, -1
        if distance[i] == np.inf:
            tried[0] = match[i]
            filled = 1
        for axis in range(2):
            other = found
            found = _propagated(
                source, target, match, before, low, high, i, step * (1 - axis), step * axis
            )
            if found >= 0 and found != other:
                tried[filled] = found
                filled = _draw(
                    source.starts,
                    source.members,
                    source.bins[found],
                    candidates,
                    i + salt,
                    tried,
                    filled + 1,
                )
        filled = _draw(
            source.starts, source.members, target.bins[i], candidates, i + salt, tried, filled
        )
        own_bins = filled
        filled = _draw(
            target.starts, target.members, target.bins[i], candidates, i + salt, tried, filled
        )
        for k in range(own_bins, filled):
            tried[k] = before[tried[k]]
        for k in range(filled):
            if tried[k] == match[i] and distance[i] < np.inf:
                continue
            bound = _projected_distance(projected_s, tried[k], projected_t, i, distance[i])
            if bound < distance[i]:
                row_s, column_s, row_t, column_t = (
                    source.rows[tried[k]],
                    source.columns[tried[k]],
                    target.rows[i],
                    target.columns[i],
                )
                total = _distance(image_s, row_s, column_s, image_t, row_t, column_t, distance[i])
                if total < distance[i]:
                    distance[i], match[i] = total, tried[k]


@jit
def _propagated(source, target, match, before, low, high, i, down, right):
    """The source patch propagated from the match of target patch i's neighbour at -(down, right);
    -1 without one.
    """
    row, column = target.rows[i] - down, target.columns[i] - right
    if row < 0 or column < 0 or row >= target.places.shape[0] or column >= target.places.shape[1]:
        return -1
    neighbour = target.places[row, column]
    if neighbour < 0:
        return -1
    matched = match[neighbour] if low <= neighbour < high else before[neighbour]
    row, column = source.rows[matched] + down, source.columns[matched] + right
    if row < 0 or column < 0 or row >= source.places.shape[0] or column >= source.places.shape[1]:
        return -1
    return source.places[row, column]


@jit
def _draw(starts, members, bin_, most, turn, drawn, filled):
    """Append up to `most` members of a bin to `drawn`, starting at a position that varies with
    `turn`; return the new count.
    """
    first, size = starts[bin_], starts[bin_ + 1] - starts[bin_]
    for k in range(min(size, most)):
        drawn[filled] = members[first + (turn + k) % size]
        filled += 1
    return filled


@jit
def _projected_distance(source, candidate, target, i, bound):
    """Squared distance of the projections of two patches, rows of `source` and `target`, or a
    value above `bound`.
    """
    total = np.float32(0)
    for first in range(0, source.shape[1], 8):
        for k in range(first, min(first + 8, source.shape[1])):
            difference = source[candidate, k] - target[i, k]
            total += difference * difference
        if total >= bound:
            break
    return total


@jit
def _distance(source, row_s, column_s, target, row_t, column_t, bound):
    """Squared distance of two patches by all their values, or a value above `bound`.

    Four rows at once: independent sums are several times faster than one.
    """
    t0, t1, t2, t3 = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
    for r in range(0, 8, 4):
        s, t = row_s + r, row_t + r
        for b in range(8):
            for c in range(source.shape[2]):
                d0 = source[s, column_s + b, c] - target[t, column_t + b, c]
                d1 = source[s + 1, column_s + b, c] - target[t + 1, column_t + b, c]
                d2 = source[s + 2, column_s + b, c] - target[t + 2, column_t + b, c]
                d3 = source[s + 3, column_s + b, c] - target[t + 3, column_t + b, c]
                t0 += d0 * d0
                t1 += d1 * d1
                t2 += d2 * d2
                t3 += d3 * d3
        if t0 + t1 + t2 + t3 >= bound:
            break
    return t0 + t1 + t2 + t3
