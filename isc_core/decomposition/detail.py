"""Relief finer than SIRFS is solved at, from coarse to fine, at the photo's own resolution.

Problem: SIRFS is solved with the object 256 pixels long. Finer relief stays in the reflectance.

Equation: levels of the photo, each half as large as the one before, from the finest that is asked
for down to about the solver's size. With the height Z of SIRFS, the light's log shading S, and the
detail network's band b_k of level k (`networks.detail_network`),

    R_k = 2 U R_(k+1) + b_k(I_k, grad Z_k, dS / d grad Z_k, v)
    height = Z + a R_0

each in the pixels of its level. What the whole object says of relief (`relief_evidence`) is v, from
-1 to 1, and a a constant. The light and the overall shape do not change: each band is without
what the next coarser level holds.

Citation: P. J. Burt, E. H. Adelson, "The Laplacian pyramid as a compact image code", IEEE Trans.
Communications 31(4), 1983, doi:10.1109/TCOM.1983.1095851; linear shape from shading: A. Pentland
1990, doi:10.1007/BF00054993.

Tiles: the network sees one tile at a time with all that its values depend on around it, and sums
exactly: relief is the same, bit for bit, for tiles of any size.

Limits: relief is where the light from SIRFS says; where that light is from the wrong side, dents
become bumps.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import takewhile

import numpy as np

from ..imaging.blocks import block_means
from ..imaging.bounding_box import mask_slices
from ..imaging.row_blocks import row_blocks
from ..imaging.tiles import Place, tiles_of
from ..networks.detail_network import (
    MULTIPLE,
    REACH,
    TILE,
    DetailNetwork,
    predict_relief,
    raised_at,
)
from ..progress import Monitor
from ..shading.relief_evidence import RULE, Evidence, ReliefRule, evidence_of, mean_evidence
from ..shading.spherical_harmonics import light_from_reference, normal_from_reference, real_sh
from ..sirfs.recover import Window
from .task import DecompositionTask, SceneEstimate

_SOLVED = 300  # pixels: the coarsest level's object is not longer
_TELLING = 1200  # pixels: levels with a longer object are not asked for evidence
_MARGIN = 16
_STEP = 0.02  # of slopes, for the derivative of shading
SMALLEST_TILE = 160  # twice the network's reach: smaller tiles take several times as long


@dataclass(frozen=True)
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
            inside = self.mask[here]
            share = block_means(inside.astype(np.float32), 2)
            light = block_means(np.where(inside[..., None], self.image[here], 0), 2)
            image[block.rows] = light / np.maximum(share, 1e-9)[..., None]
            mask[block.rows] = share >= 0.5
        return Level(image, mask)


@dataclass(frozen=True)
class _Smooth:
    """What is known of the smooth surface on a level, interpolated where it is asked for.

    Attributes
    ----------
    maps : (h, w, 4) ndarray
        Slopes and derivatives of log shading by them: of the level, or of the next coarser one.
    coarser : bool
    """

    maps: np.ndarray
    coarser: bool

    def at(self, place: Place) -> tuple[np.ndarray, np.ndarray]:
        """Return slopes and derivatives (n, m, 2) at some rows and columns, of even numbers."""
        part = raised_at(self.maps, place) if self.coarser else self.maps[place]
        return part[..., :2], part[..., 2:]

    def finer(self, shape: tuple[int, ...]) -> "_Smooth":
        """Return the same for the next finer level; `shape` is that of this one."""
        whole = np.concatenate(self.at((slice(0, shape[0]), slice(0, shape[1]))), axis=2)
        return _Smooth(whole.astype(np.float32), True)


def with_fine_relief(task: DecompositionTask, estimate: SceneEstimate) -> SceneEstimate:
    """Add the relief that the photo of the maps shows to an estimate's height.

    Parameters
    ----------
    task : DecompositionTask
        The photo and the settings. Where the shape is known or was measured, it stays as it is.
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
    known = task.known
    if not task.settings.detail or known.height is not None or known.depth is not None:
        return estimate
    with task.clock.stage("fine relief"):
        relief = fine_relief(
            estimate.split.diffuse,
            task.maps.mask,
            estimate.height,
            estimate.light,
            task.settings.detail,
            task.monitor.part(0.96, 0.98),
            task.options.detail_network,
            tile=task.tile,
        )
    return replace(estimate, height=estimate.height + relief)


def fine_relief(
    diffuse: np.ndarray,
    mask: np.ndarray,
    height: np.ndarray,
    light: np.ndarray,
    finest: int,
    monitor: Monitor | None = None,
    network: DetailNetwork | None = None,
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
        Length of the object, pixels, at the finest level that is looked at.
    monitor : Monitor, optional
    network : DetailNetwork, optional
        By default the shipped one.
    rule : ReliefRule, optional
        By default the shipped one.
    tile : int
        Side of the tiles that the network sees, pixels, a multiple of 8: memory alone depends on
        it.

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
    evidence = pyramid.evidence()
    relief = pyramid.relief(finest, rule.belief(evidence), monitor, network, tile)
    relief *= np.float32(rule.factor)
    return relief


@dataclass(frozen=True)
class Pyramid:
    """The levels of a photo with what is known of its smooth surface.

    Attributes
    ----------
    mask : (H, W) bool ndarray
        Of the photo.
    frame : _Frame
        The part of the photo that is looked at.
    levels : list of Level
        The finest first.
    slope, gain : (h, w, 2) ndarray
        Slopes of the smooth surface and derivatives of log shading by them, at the coarsest level.
    """

    mask: np.ndarray
    frame: "_Frame"
    levels: list[Level]
    slope: np.ndarray
    gain: np.ndarray

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
        slope = slopes(frame.coarsest(height))
        return cls(mask, frame, levels, slope, shading_gain(slope, light))

    def evidence(self) -> Evidence | None:
        """Return what the whole object says of relief; None where it is too small."""
        telling, found = takewhile(lambda one: one[1] <= _TELLING, self._from_coarsest()), []
        for level, _, smooth in telling:
            _, gain = smooth.at((slice(0, level.mask.shape[0]), slice(0, level.mask.shape[1])))
            found.append(evidence_of(level.image / level.mean, level.mask, gain))
        return mean_evidence(found)

    def relief(
        self,
        finest: int,
        belief: float,
        monitor: Monitor | None = None,
        network: DetailNetwork | None = None,
        tile: int = TILE,
    ) -> np.ndarray:
        """Find the relief, R_0 of the module.

        Parameters
        ----------
        finest, monitor, network, tile
            As for `fine_relief`.
        belief : float
            What the object's fine changes are: -1 paint, 0 unknown, 1 relief.

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
        coarsest, done = self.levels[-1].mask.shape, 0.0
        relief: np.ndarray = np.zeros(tuple(n // 2 for n in coarsest), np.float32)
        for level, length, smooth in self._from_coarsest():
            relief = _enlarged(relief)
            share = 0.75 * level.mask.size / self.levels[0].mask.size
            if length <= finest:
                _add_band(
                    relief, level, smooth, belief, network, tile, monitor.part(done, done + share)
                )
            done += share
        whole = self.frame.window.put(relief, self.mask.shape)
        whole[~self.mask] = 0
        return whole

    def _from_coarsest(self) -> Iterator[tuple[Level, float, _Smooth]]:
        """Each level with the object's length and the smooth surface, the coarsest first."""
        smooth = _Smooth(np.concatenate([self.slope, self.gain], axis=2), False)
        for k in range(len(self.levels) - 1, -1, -1):
            level = self.levels[k]
            yield level, self.frame.length / 2**k, smooth
            if k:
                smooth = smooth.finer(level.mask.shape)


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
        """A height at the coarsest level, in its pixels; the box's border goes on around it."""
        of_box = Window(-_MARGIN, -_MARGIN, self.window.height, self.window.width)
        coarse = of_box.cut_replicated(height[self.box])
        for _ in range(self.halvings):
            coarse = block_means(coarse, 2) / 2
        return coarse


def _enlarged(relief: np.ndarray) -> np.ndarray:
    """A relief on the next finer level, in its pixels."""
    rows, columns = (2 * n for n in relief.shape)
    fine = np.empty((rows, columns), np.float32)
    for block in row_blocks((rows // 2, 2 * columns)):
        here = slice(2 * block.rows.start, 2 * block.rows.stop)
        fine[here] = 2 * raised_at(relief, (here, slice(0, columns)))
    return fine


def _add_band(
    relief: np.ndarray,
    level: Level,
    smooth: _Smooth,
    belief: float,
    network: DetailNetwork | None,
    side: int,
    monitor: Monitor,
) -> None:
    """Add the band of a level to `relief` (h, w), tile by tile; tiles overlap by what the network
    looks at.
    """
    tiles = list(tiles_of(level.mask, side, REACH, MULTIPLE))
    for k, tile in enumerate(tiles):
        monitor.report("fine relief", k / len(tiles))
        slope, gain = smooth.at(tile.outer)
        found = predict_relief(
            level.image[tile.outer] / level.mean,
            level.mask[tile.outer],
            slope,
            gain,
            belief,
            network,
        )
        relief[tile.inner] += found[tile.own]


def slopes(height: np.ndarray) -> np.ndarray:
    """Return dz/dx and dz/dy, x right and y down.

    Parameters
    ----------
    height : (H, W) ndarray

    Returns
    -------
    (H, W, 2) ndarray
    """
    down, right = np.gradient(height)
    return np.stack([right, down], axis=2)


def shading_gain(slope: np.ndarray, light: np.ndarray) -> np.ndarray:
    """Return the derivatives of log shading, averaged over channels, by the slopes.

    Parameters
    ----------
    slope : (H, W, 2) ndarray
        dz/dx, dz/dy, x right and y down.
    light : (9, 3) ndarray
        Log-shading SH coefficients, reference convention.

    Returns
    -------
    (H, W, 2) ndarray
    """
    coefficients = light_from_reference(light).mean(axis=1)

    def log_shading(right: np.ndarray, down: np.ndarray) -> np.ndarray:
        normal = np.stack([-down, -right, np.ones_like(right)], axis=-1)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        return np.einsum("hwk,k->hw", real_sh(normal_from_reference(normal)), coefficients)

    p, q = slope[..., 0], slope[..., 1]
    return np.stack(
        [
            (log_shading(p + _STEP, q) - log_shading(p - _STEP, q)) / (2 * _STEP),
            (log_shading(p, q + _STEP) - log_shading(p, q - _STEP)) / (2 * _STEP),
        ],
        axis=2,
    )
