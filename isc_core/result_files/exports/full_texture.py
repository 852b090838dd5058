"""The base colour at the resolution of the photo, where the maps are coarser.

Problem: light and shape vary slowly, but texture does not: maps of 512 pixels lose detail of a
photo of 2,400. With (.)^ for bilinear upsampling, I the photo, D its diffuse layer, S its specular
layer and B the base colour of the maps, all linear, and <I> the photo averaged over the pixels of
the maps,

    d = D^ + g (I - <I>^)                  d = I - S^, where g = 1
    T = B^ min(4, max(1/4, d / D^))
    T <- T (B / <T>)^                      twice, so that <T> = B

g falls from 1 to 0 where the specular layer's share of the light grows from 0.4 to 0.8: there,
detail finer than the maps belongs to the highlight. The outermost pixel of the mask, which often
includes background, and all of an outline that fades to black (`mesh.dark_rings`), take the ratio
of the nearest interior pixel, and the surroundings its colour.

Citation: the ratio of a fine to a coarse image that multiplies a coarse layer is that of
G. Petschnigg et al., "Digital photography with flash and no-flash image pairs", ACM Transactions on
Graphics 23 (2004), 664-672, doi:10.1145/1015706.1015777.

Limits: shading and highlights that are finer than the maps become base colour.
"""

from dataclasses import dataclass

import numpy as np

from ...filters.distance import distance_to, nearest_pixels
from ...filters.morphology import eroded
from ...imaging.area_resize import AreaFilter
from ...imaging.bounding_box import mask_slices
from ...imaging.upsampling import enlarged
from ...photo import Photo
from ...scene.decomposition import Decomposition
from ..mesh.base_color import base_color, dark_rings, nearest_inside
from ..mesh.options import MeshOptions
from ..mesh.texture_codes import color_codes

_MOST = 4.0  # the largest ratio of fine to coarse diffuse light, and the inverse of the smallest
_ALL_DETAIL, _NO_DETAIL = 0.4, 0.8  # specular shares: all detail up to, none from
_ROUNDS = 2
_RIM = 2  # map pixels beyond the mask that are filled with colours of its rim
_BLEED = MeshOptions().bleed


def full_texture(photo: Photo, d: Decomposition, longest: int = 0) -> np.ndarray | None:
    """Return the base colour of the mesh at the photo's resolution, over the frame of the maps.

    Parameters
    ----------
    photo : Photo
        The photo that was decomposed, at full resolution.
    d : Decomposition
    longest : int
        Upper limit of the texture's long side; 0 for the photo's.

    Returns
    -------
    (H', W', 3) uint8 ndarray or None
        sRGB codes; None if the maps have the same resolution.
    """
    scale = float(d.provenance.input.get("scale", 1.0))
    sharp = _limited(photo, longest, max(d.mask.shape) * photo.scale / scale)
    factor = sharp.scale / scale
    if factor <= 1:
        return None
    height, width = (round(n * factor) for n in d.mask.shape)
    codes = np.empty((height, width, 3), np.uint8)
    base, _ = base_color(d.reflectance, d.mask, _BLEED)
    mean = base[d.mask].astype(np.float64).mean(0)
    codes[:] = color_codes(mean[None, None])
    rows, columns = _box(sharp.mask[:height, :width], round((_BLEED + 2) * factor))
    codes[rows, columns] = color_codes(_texture(sharp, d, base, (rows, columns), factor))
    return codes


def _limited(photo: Photo, longest: int, frame: float) -> Photo:
    """The photo downscaled so that the frame of the maps, now `frame` pixels, has at most
    `longest`.
    """
    if longest <= 0 or frame <= longest:
        return photo
    return photo.resized_to_object(max(1, int(max(photo.box[2:]) * longest / frame)))


def _box(mask: np.ndarray, margin: int) -> tuple[slice, slice]:
    rows, columns = (
        slice(max(0, part.start - margin), min(size, part.stop + margin))
        for part, size in zip(mask_slices(mask), mask.shape, strict=True)
    )
    return rows, columns


@dataclass(frozen=True, eq=False)
class _Grids:
    """The relation of a part of the photo to the maps.

    `inside`: (h, w) bool, the object in that part. `area`: from the part to the maps. `factor`:
    photo pixels per map pixel. `start`: row and column of the part. `nearest`: for each pixel of
    the maps, the nearest one of the object.
    """

    inside: np.ndarray
    area: AreaFilter
    factor: float
    start: tuple[int, int]
    nearest: tuple[np.ndarray, ...]

    def up(self, plane: np.ndarray) -> np.ndarray:
        return enlarged(plane.astype(np.float32), self.inside.shape, self.factor, self.start)

    def filled(self, plane: np.ndarray) -> np.ndarray:
        """A map, extended beyond the object."""
        return np.asarray(plane[self.nearest])

    def down(self, plane: np.ndarray, default: np.ndarray) -> np.ndarray:
        """Averages over the object's part of each map pixel; elsewhere the default."""
        weight = self.area(self.inside)
        total = self.area(plane * self.inside)
        return np.divide(total, weight, out=default.astype(np.float32), where=weight > 0)


def _grids(mask: np.ndarray, box: tuple[slice, slice], d: Decomposition, factor: float) -> _Grids:
    whole, (rows, columns) = AreaFilter.of(mask.shape, 1 / factor), box
    height, width = d.mask.shape
    area = AreaFilter(
        whole.rows.part(slice(0, height), rows),
        whole.columns.part(slice(0, width), columns),
        whole.full[:height, :width],
    )
    return _Grids(mask[box], area, factor, (rows.start, columns.start), nearest_pixels(d.mask))


def _texture(
    photo: Photo,
    d: Decomposition,
    base: np.ndarray,
    box: tuple[slice, slice],
    factor: float,
) -> np.ndarray:
    """(h, w, 3) float32, linear: the texture in that part of the photo."""
    grids = _grids(photo.mask, box, d, factor)
    rings = dark_rings(d.reflectance, distance_to(~d.mask))
    rim = max(1, round(factor * rings))
    interior = _interior(grids.inside, rim)
    near, source = nearest_inside(interior, round(_RIM * factor) + 1 + rim)
    beyond = ~interior
    beyond.reshape(-1)[near] = False
    outside = ~grids.inside.reshape(-1)[near]
    share = d.specular.sum(-1) / np.maximum((d.diffuse + d.specular).sum(-1), 1e-12)
    gain = grids.up(np.clip((_NO_DETAIL - grids.filled(share)) / (_NO_DETAIL - _ALL_DETAIL), 0, 1))
    texture = np.empty((*grids.inside.shape, 3), np.float32)
    for channel in range(3):
        plane, color = photo.image[box][..., channel], base[..., channel]
        coarse = grids.filled(grids.down(plane, d.image[..., channel]))
        diffuse = np.maximum(grids.up(grids.filled(d.diffuse[..., channel])), 1e-6)
        ratio = 1 + gain * (plane - grids.up(coarse)) / diffuse
        ratio = np.where(interior, np.clip(ratio, 1 / _MOST, _MOST), 1)
        ratio.reshape(-1)[near] = ratio.reshape(-1)[source]
        coarse_color = grids.up(color)
        fine = coarse_color * ratio
        for _ in range(_ROUNDS):
            correction = color / np.maximum(grids.down(fine, color), 1e-6)
            fine *= grids.up(grids.filled(np.clip(correction, 0.5, 2)))
        fine.reshape(-1)[near[outside]] = fine.reshape(-1)[source[outside]]
        texture[..., channel] = np.where(beyond, coarse_color, fine)
    return texture


def _interior(mask: np.ndarray, rim: int) -> np.ndarray:
    """The mask without its outermost pixels; the whole mask if nothing would remain."""
    inner = eroded(mask, rim, beyond=True)
    return inner if inner.any() else mask
