"""Relief finer than the solve resolves, level by level of the photo.

Problem: SIRFS is solved with the object 256 pixels long. Finer relief stays in the reflectance.

Equation: the levels are the photo, then half its size, and so on until the object is at most
`_SOLVED` pixels long. With I the log of the photo's mean channel, log R/G and log B/G, and S the
same of the shading by SIRFS' light on the smooth slopes s, the fine changes on a level are

    d = I - S(s) - U L,

L being the low frequencies of I - S on the coarsest level (periods above `_PERIOD` of the object's
length), and U linear interpolation. Edges of paint (`shading.paint_edges`) stay in L, which is a
bilateral average (`imaging.cross_bilateral`), and d has little weight relative to them: a Gaussian
average would leave lines along each edge in d, and these are no relief.

From the coarsest level on, the relief R of a level is that which explains d
(`shading.relief_from_shading`), found from 2 U R of the level before. The height is that of the
solve plus b R of the finest level; b, which is 0 for paint, is estimated for each paint of the
object (`shading.relief_evidence`), block by block, and interpolated linearly. On the coarsest level
R loses its low frequencies too, so that no level moves the overall shape; the light is not changed.

Citation: see `shading.relief_from_shading`; pyramid: P. J. Burt, E. H. Adelson, IEEE Trans. Comm.
31, 1983, doi:10.1109/TCOM.1983.1095851; smooth light apart from edges: F. Durand, J. Dorsey, "Fast
bilateral filtering for the display of high-dynamic-range images", SIGGRAPH 2002,
doi:10.1145/566654.566574.

Tiles: a value depends on pixels near it alone, so relief is the same, bit for bit, for tiles of any
size.

Limits: the sign of relief is that of the light from SIRFS; where that light is from the wrong side,
dents become bumps.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import takewhile

import numpy as np

from ..filters.distance import nearest_pixels
from ..imaging.blocks import block_means, means_inside
from ..imaging.bounding_box import mask_slices
from ..imaging.channels import mean_channel
from ..imaging.cross_bilateral import CrossBilateral
from ..imaging.doubling import doubled_at
from ..imaging.row_blocks import row_blocks
from ..imaging.smoothing import low_pass, masked_gaussian, masked_low_pass
from ..imaging.tiles import Place, tiles_of
from ..imaging.upsampling import enlarged
from ..imaging.window import Window
from ..progress import Monitor
from ..shading.paint_edges import ONE_PAINT, paint_features, paint_guide, uniformity
from ..shading.relief_evidence import (
    BLOCK,
    RULE,
    Evidence,
    ReliefRule,
    added_share,
    block_moments,
    paint_evidence,
)
from ..shading.relief_from_shading import (
    REACH,
    log_shading,
    relief_from_shading,
    shading_gain,
    slopes,
)
from .settings import Illumination
from .task import DecompositionTask, SceneEstimate

MULTIPLE = 8  # sides of the frame on the coarsest level, and of tiles
TILE = 384  # pixels of a tile's side: its maps stay in the cache
_SOLVED = 300  # pixels: the coarsest level's object is not longer
_MOST_EVIDENCE = 1200  # pixels: no evidence is taken from levels with a longer object
_MARGIN = 16
_PERIOD = 0.026  # of the object's length: 6.7 pixels of the solve
_SIGMA = 0.2829  # of the low pass over the period of which it keeps half
_DARK = 0.01  # of the object's mean light


@dataclass(frozen=True, eq=False)
class Level:
    """One level of a photo.

    Attributes
    ----------
    image : (h, w, 3) float32 ndarray
        Linear diffuse light.
    mask : (h, w) bool ndarray
    """

    image: np.ndarray
    mask: np.ndarray

    @cached_property
    def mean(self) -> np.float32:
        """The object's mean light."""
        return np.float32(max(float(self.image[self.mask].mean(dtype=float)), 1e-9))

    def halved(self) -> "Level":
        """Return the next coarser level; sides are even."""
        rows, columns = (n // 2 for n in self.mask.shape)
        image, mask = np.empty((rows, columns, 3), np.float32), np.empty((rows, columns), bool)
        for block in row_blocks((rows, 4 * columns)):
            here = slice(2 * block.rows.start, 2 * block.rows.stop)
            image[block.rows], share = means_inside(self.image[here], self.mask[here], 2)
            mask[block.rows] = share >= 0.5
        return Level(image, mask)


@dataclass(frozen=True, eq=False)
class _Smooth:
    """Smooth maps of a level, interpolated on demand.

    Attributes
    ----------
    maps : (h, w, C) float32 ndarray
        Of the level, or of the next coarser one.
    coarser : bool
    """

    maps: np.ndarray
    coarser: bool

    def at(self, place: Place) -> np.ndarray:
        """Return maps (C, n, m) at rows and columns of even numbers."""
        part = doubled_at(self.maps, place) if self.coarser else self.maps[place]
        return np.ascontiguousarray(part.transpose(2, 0, 1))

    def finer(self, shape: tuple[int, ...]) -> "_Smooth":
        """Return the same for the next finer level; `shape` is that of this one."""
        place = (slice(0, shape[0]), slice(0, shape[1]))
        return _Smooth(doubled_at(self.maps, place) if self.coarser else self.maps, True)


def with_fine_relief(task: DecompositionTask, estimate: SceneEstimate) -> SceneEstimate:
    """Add the relief that the photo of the maps shows to an estimate's height.

    Parameters
    ----------
    task : DecompositionTask
        The photo and the settings. The height is not changed where it is known or was measured, and
        in the illuminations of MIT-Berkeley.
    estimate : SceneEstimate
        What a model recovered.

    Returns
    -------
    SceneEstimate

    Raises
    ------
    Cancelled
        If the monitor cancels.
    """
    known, settings = task.known, task.settings
    # The rule that distinguishes relief from paint was fitted to photos.
    is_photo = settings.illumination == Illumination.PHOTO
    if not (settings.detail and is_photo) or known.height is not None or known.depth is not None:
        return estimate
    with task.clock.stage("fine relief"):
        relief = fine_relief(
            estimate.split.diffuse,
            task.maps.mask,
            estimate.height,
            estimate.light,
            task.settings.detail,
            task.monitor.part(0.96, 0.98),
        )
    return replace(estimate, height=estimate.height + relief)


def fine_relief(
    diffuse: np.ndarray,
    mask: np.ndarray,
    height: np.ndarray,
    light: np.ndarray,
    finest: int,
    monitor: Monitor | None = None,
    rule: ReliefRule | None = None,
    *,
    tile: int = TILE,
) -> np.ndarray:
    """Find the relief that a smooth height lacks.

    Parameters
    ----------
    diffuse : (H, W, 3) ndarray
        Linear diffuse light.
    mask : (H, W) bool ndarray
    height : (H, W) ndarray
        Pixels toward the viewer.
    light : (9, 3) ndarray
        Log-shading SH coefficients, reference convention.
    finest : int
        Length of the object, pixels, at the finest level that is used.
    monitor : Monitor, optional
    rule : ReliefRule, optional
        By default the shipped one.
    tile : int
        Side of the tiles, pixels, a multiple of 8: only memory and time depend on it.

    Returns
    -------
    (H, W) float32 ndarray
        Pixels toward the viewer, 0 outside of the mask.

    Raises
    ------
    InputError
        If the tiles are smaller than their overlap.
    Cancelled
        If the monitor cancels.
    """
    rule = rule or RULE
    pyramid = Pyramid.of(diffuse, mask, height, light)
    added = pyramid.share(rule)
    if not added.any():
        return np.zeros(mask.shape, np.float32)
    return pyramid.relief(finest, monitor, tile, added)


@dataclass(frozen=True, eq=False)
class Pyramid:
    """The levels of a photo with what is known of its smooth surface.

    Attributes
    ----------
    mask : (H, W) bool ndarray
        Of the photo.
    frame : _Frame
        The part of the photo that is used.
    levels : list of Level
        The finest first.
    slope : tuple of (h, w) float32 ndarray
        Slopes of the smooth surface at the coarsest level.
    light : (9, 3) ndarray
        SH coefficients of the features of log shading, reference convention.
    """

    mask: np.ndarray
    frame: "_Frame"
    levels: list[Level]
    slope: tuple[np.ndarray, np.ndarray]
    light: np.ndarray

    @classmethod
    def of(
        cls, diffuse: np.ndarray, mask: np.ndarray, height: np.ndarray, light: np.ndarray
    ) -> "Pyramid":
        """Build the levels of an object.

        Parameters
        ----------
        diffuse, mask, height, light
            As for `fine_relief`.

        Returns
        -------
        Pyramid
        """
        frame = _Frame.around(mask)
        inside = frame.window.cut(mask, False)
        image = frame.window.cut(diffuse, 0).astype(np.float32, copy=False)
        np.copyto(image, 0, where=~inside[..., None])
        levels = [Level(image, inside)]
        for _ in range(frame.halvings):
            levels.append(levels[-1].halved())
        slope = slopes(frame.coarsest(height).astype(np.float32))
        red, green, blue = light.T
        features = np.stack([light.mean(axis=1), red - green, blue - green], axis=1)
        return cls(mask, frame, levels, slope, features)

    def evidence(self) -> Evidence | None:
        """Return the evidence for relief, by blocks of the coarsest level; None where too small."""
        coarsest, blocks, moments = self.levels[-1], 1, []
        left, _, uniform = self._without_shading
        levels = self._from_coarsest(np.stack([*self.slope, uniform], axis=2))
        for level, _, smooth in takewhile(lambda one: one[1] <= _MOST_EVIDENCE, levels):
            rows, columns = (slice(0, n) for n in level.mask.shape)
            right, down, alike = smooth.at((rows, columns))
            gain = shading_gain((right, down), self.light[:, 0])
            image = level.image / level.mean
            moments.append(block_moments(image, level.mask, gain, alike, blocks))
            blocks *= 2
        return paint_evidence(moments, paint_features(left, coarsest.mask), coarsest.mask)

    def share(self, rule: ReliefRule) -> np.ndarray:
        """Find which share of the relief is added.

        Parameters
        ----------
        rule : ReliefRule

        Returns
        -------
        (rows, columns) float32 ndarray
            For blocks of the coarsest level; 0 where the object is too small for evidence.
        """
        mask, evidence = self.levels[-1].mask, self.evidence()
        if evidence is None:
            return np.zeros(tuple(n // BLOCK for n in mask.shape), np.float32)
        nearest = nearest_pixels(block_means(mask.astype(np.float32), BLOCK) > 0)
        found = added_share(rule.probability(evidence)).astype(np.float32)
        return np.asarray(found[nearest])

    def relief(
        self,
        finest: int,
        monitor: Monitor | None = None,
        tile: int = TILE,
        added: np.ndarray | None = None,
    ) -> np.ndarray:
        """Find the relief, R of the module.

        Parameters
        ----------
        finest, monitor, tile
            As for `fine_relief`.
        added : (rows, columns) ndarray, optional
            Of `share`, b of the module: the relief is multiplied by it.

        Returns
        -------
        (H, W) float32 ndarray
            Pixels toward the viewer, 0 outside of the mask.

        Raises
        ------
        InputError
            If the tiles are smaller than their overlap.
        Cancelled
            If the monitor cancels.
        """
        monitor = monitor or Monitor()
        coarsest, done = self.levels[-1], 0.0
        relief: np.ndarray = np.zeros(tuple(n // 2 for n in coarsest.mask.shape), np.float32)
        for level, length, smooth in self._from_coarsest(self._smooth_maps()):
            relief = _enlarged(relief)
            share = 0.75 * level.mask.size / self.levels[0].mask.size
            if length <= finest:
                part = monitor.part(done, done + share)
                relief = _refined(relief, level, smooth, self.light, tile, part)
            if level is coarsest:
                relief -= _low_frequencies(relief, level.mask, length) * level.mask
            done += share
        if added is not None:
            self._multiply(relief, added)
        whole = self.frame.window.put(relief, self.mask.shape)
        whole[~self.mask] = 0
        return whole

    def _multiply(self, relief: np.ndarray, added: np.ndarray) -> None:
        """Multiply the finest relief by the shares of blocks, interpolated linearly."""
        side = BLOCK << self.frame.halvings
        for block in row_blocks(relief.shape):
            part = relief[block.rows]
            part *= enlarged(added, part.shape, side, (block.rows.start, 0))

    def _from_coarsest(self, maps: np.ndarray) -> Iterator[tuple[Level, float, _Smooth]]:
        """Each level with the object's length and maps of the coarsest, which comes first."""
        smooth = _Smooth(maps, False)
        for k in range(len(self.levels) - 1, -1, -1):
            level = self.levels[k]
            yield level, self.frame.length / 2**k, smooth
            if k:
                smooth = smooth.finer(level.mask.shape)

    @cached_property
    def _without_shading(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Features of log light less log shading (3, h, w) on the coarsest level, the guide
        (h, w, 3), and how far there is one paint (h, w).
        """
        level = self.levels[-1]
        shading = np.stack([log_shading(self.slope, one) for one in self.light.T])
        left = (_features(level.image, level.mean) - shading) * level.mask
        guide = paint_guide(level.image / level.mean, level.mask, left[0])
        return left, guide, uniformity(guide, level.mask)

    def _smooth_maps(self) -> np.ndarray:
        """What relief needs (h, w, 6) of the coarsest level.

        Slopes dz/dx and dz/dy, low frequencies of the features of log light less log shading, and
        how far there is one paint.
        """
        level = self.levels[-1]
        left, guide, uniform = self._without_shading
        sigma = _SIGMA * _PERIOD * self.frame.length / 2**self.frame.halvings
        smoother = CrossBilateral.of(guide, level.mask, sigma, ONE_PAINT)
        low = [_continued(low_pass(one, smoother), level.mask) for one in left]
        return np.stack([*self.slope, *low, uniform], axis=2)


@dataclass(frozen=True)
class _Frame:
    """The object's box with a margin, of a size that can be halved.

    `box` are the rows and columns of the mask, `length` the longer side of the box in pixels,
    `halvings` the number of levels less one, and `window` the frame.
    """

    box: tuple[slice, slice]
    length: int
    halvings: int
    window: Window

    @classmethod
    def around(cls, mask: np.ndarray) -> "_Frame":
        box = mask_slices(mask)
        sizes = [one.stop - one.start for one in box]
        halvings = max(0, int(np.ceil(np.log2(max(sizes) / _SOLVED))))
        multiple = MULTIPLE << halvings
        height, width = (-(-(size + 2 * _MARGIN) // multiple) * multiple for size in sizes)
        window = Window(box[0].start - _MARGIN, box[1].start - _MARGIN, height, width)
        return cls(box, max(sizes), halvings, window)

    def coarsest(self, height: np.ndarray) -> np.ndarray:
        """A height at the coarsest level, in its pixels; the box's border is replicated."""
        of_box = Window(-_MARGIN, -_MARGIN, self.window.height, self.window.width)
        coarse = of_box.cut_replicated(height[self.box])
        for _ in range(self.halvings):
            coarse = block_means(coarse, 2) / 2
        return coarse


def _features(image: np.ndarray, mean: np.float32) -> np.ndarray:
    """Features (3, H, W) of log light over the object's mean, I of the module."""
    over = image / mean + np.float32(_DARK)
    red, green, blue = np.log(over).transpose(2, 0, 1)
    return np.stack([np.log(mean_channel(over)), red - green, blue - green])


def _low_frequencies(values: np.ndarray, mask: np.ndarray, length: float) -> np.ndarray:
    """Low frequencies (H, W) of a level's map inside the mask, continued a little beyond it."""
    return _continued(masked_low_pass(values, mask, _SIGMA * _PERIOD * length), mask)


def _continued(values: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """A map (H, W) inside the mask, continued a little beyond it."""
    inside = np.where(mask, values, 0)
    return np.where(mask, inside, masked_gaussian(inside, mask, 1.0))


def _enlarged(relief: np.ndarray) -> np.ndarray:
    """A relief on the next finer level, in its pixels."""
    rows, columns = (2 * n for n in relief.shape)
    fine = np.empty((rows, columns), np.float32)
    for block in row_blocks((rows // 2, 2 * columns)):
        here = slice(2 * block.rows.start, 2 * block.rows.stop)
        fine[here] = 2 * doubled_at(relief, (here, slice(0, columns)))
    return fine


def _refined(
    relief: np.ndarray,
    level: Level,
    smooth: _Smooth,
    light: np.ndarray,
    side: int,
    monitor: Monitor,
) -> np.ndarray:
    """The relief (h, w) that a level shows, from an estimate, tile by tile.

    Tiles overlap by what a value depends on.
    """
    found = np.zeros_like(relief)
    tiles = list(tiles_of(level.mask, side, REACH, MULTIPLE))
    for k, tile in enumerate(tiles):
        monitor.report("fine relief", k / len(tiles))
        mask = level.mask[tile.outer]
        right, down, *low, uniform = smooth.at(tile.outer)
        shading = _features(level.image[tile.outer], level.mean) - np.stack(low)
        refined = relief_from_shading(
            shading, mask * uniform, (right, down), light, relief[tile.outer]
        )
        found[tile.inner] = np.where(mask, refined, 0)[tile.own]  # tiles end with the object
    return found
