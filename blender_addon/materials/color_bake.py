"""Edited base colours as a texture.

Equation: base colour = g v rotated(rho; hue, saturation), as the group "ISC Dichromatic" computes
it, clipped at 1 and coded in 8 bits; see `dichromatic`. Where the gloss is edited, rho is the one
under the edited specular layer, see `isc_core.lobe_fitting.specular_layer`.

Citation: A. R. Smith, "Color gamut transform pairs", SIGGRAPH 1978, doi:10.1145/965139.807361 (hue,
saturation and value).

Four million pixels take seconds. The colours are therefore computed row by row, in any thread, and
from the packed file of an image that the extension has made: only the main thread may read the
pixels of an image, which blocks the window.

Limits: a base colour brighter than white is clipped.
"""

from collections.abc import Callable
from dataclasses import dataclass

import bpy
import numpy as np

from isc_core.imaging.srgb import srgb_codes, srgb_to_linear
from isc_core.io.png import decode_png
from isc_core.lobe_fitting.specular_layer import SpecularLayer

from ..datablocks.images import SRGB, ImageFile, coded_file, scaled_file, unmodified_file
from .coated_surface import light_from_numbers, surface_from_codes

UNCHANGED = 1e-6  # as in the group
_ROWS = 32  # computed between two checks for cancellation


@dataclass(frozen=True)
class ColorEdit:
    """An edit of the base colour.

    Attributes
    ----------
    hue : float
        Rotation of the hue; 0.5 changes nothing.
    saturation : float
        Factor of the saturation; 1 changes nothing.
    gain : float
        Factor of all channels; 1 changes nothing.
    """

    hue: float = 0.5
    saturation: float = 1.0
    gain: float = 1.0

    @property
    def values(self) -> tuple[float, float, float]:
        """The three numbers."""
        return self.hue, self.saturation, self.gain

    @property
    def only_scales(self) -> bool:
        """Whether hue and saturation stay."""
        return bool(np.abs(np.subtract(self.values[:2], (0.5, 1.0))).max() <= UNCHANGED)

    @property
    def changes_nothing(self) -> bool:
        """Whether the edited colour is the recovered one."""
        return bool(np.abs(np.subtract(self.values, (0.5, 1.0, 1.0))).max() <= UNCHANGED)


@dataclass(frozen=True, eq=False)
class ColorSource:
    """The colours of an image, for another thread.

    Attributes
    ----------
    png : bytes
        The image's file, with sRGB codes; b"" if only the pixels are known.
    pixels : (H, W, 4) ndarray of float32 or None
        The pixels as Blender has them, row 0 at the bottom.
    is_coded : bool
        Whether the pixels are sRGB codes.
    """

    png: bytes = b""
    pixels: np.ndarray | None = None
    is_coded: bool = True

    @property
    def codes(self) -> np.ndarray | None:
        """(H, W, 3) uint8, sRGB, row 0 at the top; None if the colours have no codes."""
        if self.png:
            return decode_png(self.png)
        if self.pixels is None or not self.is_coded:
            return None
        return (255 * self.pixels[::-1, :, :3] + 0.5).astype(np.uint8)

    @property
    def values(self) -> np.ndarray:
        """(H, W, 3), row 0 at the top: codes, or linear values where the colours have none."""
        if (codes := self.codes) is not None:
            return codes
        assert self.pixels is not None
        return self.pixels[::-1, :, :3]


@dataclass(frozen=True)
class GlossEdit:
    """An edit of the gloss above a base colour, and what the colour below is computed from.

    Attributes
    ----------
    level, roughness : float
        As edited.
    normals : bytes
        The file of the object's coded normals, see `coated_surface`.
    light : tuple of float
        Numbers of its `RecoveredLight`.
    variation : bytes
        The file of the spatial factor of the level; b"" if that is one number.
    """

    level: float
    roughness: float
    normals: bytes
    light: tuple[float, ...]
    variation: bytes = b""

    def layer(self) -> SpecularLayer | None:
        """Compute the layer of the edited gloss.

        Returns
        -------
        SpecularLayer or None
            None without gloss.
        """
        variation = decode_png(self.variation)[..., 0] if self.variation else None
        light = light_from_numbers(self.light)
        surface = surface_from_codes(decode_png(self.normals), light, variation)
        return surface.layer(self.level, self.roughness)


def color_source(image: bpy.types.Image) -> ColorSource:
    """Return the colours of an image, without reading its pixels if it is unchanged.

    Parameters
    ----------
    image : bpy.types.Image
        The image.

    Returns
    -------
    ColorSource
        Its colours.
    """
    if image.colorspace_settings.name == SRGB and (png := unmodified_file(image)):
        return ColorSource(png)
    return ColorSource(b"", _pixels(image), _is_coded(image))


def edited_file(
    source: ColorSource,
    edit: ColorEdit,
    stopped: Callable[[], bool] = lambda: False,
    gloss: GlossEdit | None = None,
) -> ImageFile | None:
    """Compute edited colours; may run in another thread.

    Parameters
    ----------
    source : ColorSource
        The colours.
    edit : ColorEdit
        Their edit.
    stopped : callable, optional
        Returns whether they are no longer needed.
    gloss : GlossEdit, optional
        The edit of the gloss above; then the colours are those without a layer above.

    Returns
    -------
    ImageFile or None
        PNG in sRGB; None if stopped.
    """
    if gloss is None and edit.only_scales and (codes := source.codes) is not None:
        return None if stopped() else scaled_file(codes, edit.gain)
    given, layer = source.values, None if gloss is None else gloss.layer()
    edited = np.empty(given.shape, np.uint8)
    for top in range(0, len(given), _ROWS):
        if stopped():
            return None
        rows = slice(top, top + _ROWS)
        colors = _linear(given[rows])
        if layer is not None:
            colors = layer.rows_under(colors, top)
        edited[rows] = srgb_codes(recolour_reflectance(colors, *edit.values))
    return coded_file(edited)


def recolour_reflectance(
    reflectance: np.ndarray, hue: float, saturation: float, gain: float
) -> np.ndarray:
    """Apply the group's colour edits.

    Parameters
    ----------
    reflectance : (..., 3) ndarray
        Linear Rec.709, 0 or more.
    hue : float
        Rotation of the hue; 0.5 changes nothing.
    saturation : float
        Factor of the saturation; 1 changes nothing.
    gain : float
        Factor of all channels.

    Returns
    -------
    (..., 3) ndarray
        Linear Rec.709, not clipped at 1.
    """
    if abs(hue - 0.5) <= UNCHANGED and abs(saturation - 1) <= UNCHANGED:
        return gain * reflectance
    value, low = reflectance.max(-1), reflectance.min(-1)
    spread = np.where(value > low, value - low, 1.0)
    red, green, blue = np.moveaxis(reflectance, -1, 0)
    sector = np.where(green == value, 2 + (blue - red) / spread, 4 + (red - green) / spread)
    sector = np.where(red == value, (green - blue) / spread, sector) + 6 * (hue + 0.5)
    share = np.clip(saturation * (value - low) / np.where(value > 0, value, 1.0), 0, 1)
    place = (np.array([5.0, 3.0, 1.0]) + sector[..., None]) % 6
    removed = (value * share)[..., None] * np.clip(np.minimum(place, 4 - place), 0, 1)
    return np.asarray(gain * (value[..., None] - removed))


def linear_colors(image: bpy.types.Image) -> np.ndarray:
    """Return the colours of an image.

    Parameters
    ----------
    image : bpy.types.Image
        The image.

    Returns
    -------
    (H, W, 3) ndarray
        Linear Rec.709, row 0 at the bottom.
    """
    colors = _pixels(image)[..., :3].astype(float)
    return np.asarray(srgb_to_linear(colors)) if _is_coded(image) else colors


def _linear(values: np.ndarray) -> np.ndarray:
    """Linear colours of sRGB codes, or as they are."""
    if values.dtype != np.uint8:
        return values.astype(float)
    return np.asarray(srgb_to_linear(np.arange(256) / 255)[values])


def _pixels(image: bpy.types.Image) -> np.ndarray:
    """(H, W, 4) float32, row 0 at the bottom."""
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(height, width, 4)


def _is_coded(image: bpy.types.Image) -> bool:
    """Whether Blender returns codes for the pixels, and no linear values."""
    return not image.is_float and bool(image.colorspace_settings.name == SRGB)
