"""The maps of a result as OpenEXR files: `maps.exr` with all layers, and the main maps in `maps/`.

Problem: in a photo by a phone, the object often covers a tenth of the frame. Around it every map is
constant, but thirty channels of twelve megapixels take ten seconds to write and to read.

Method: the files of a large frame store the object's part, with a pixel around it. Their data
window says where it is in the frame, the display window; `AROUND` of `scene.part_of_result` has
the values around it.

Limits: programs that ignore the display window show the part only. Frames of up to 2 megapixels
are stored whole.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..imaging.bounding_box import FramePart
from ..io.exr import read_windowed, write_channels
from ..io.limits import Limits
from ..scene.decomposition import COLOR_MAPS, Decomposition

MAPS = "maps.exr"
ENVIRONMENT = "environment.exr"
LAYERS = {
    **dict.fromkeys(COLOR_MAPS, "RGB"),
    "normal": "XYZ",
    "height": "Z",
    "mask": "A",
    "confidence": "Y",
}
LOBE = {"lobe": "RGB"}
REFINED_LIGHT = {"visibility": "RGB", "indirect": "RGB"}
EXPECTED_ERROR = ("expected_error.normal", "expected_error.reflectance")
SINGLE = {
    "diffuse": "RGB",
    "specular": "RGB",
    "reflectance": "RGB",
    "shading": "RGB",
    "normal": "RGB",
    "height": "Y",
}
_LEAST_PIXELS = 1 << 21  # of a frame that is not stored whole
_RIM = 1  # pixels around the object: programs that extend the edges of a part extend these
# A small object in a large frame compresses to a hundredth.
_LIMITS = Limits(max_bytes=1 << 33)


def stored_part(mask: np.ndarray) -> FramePart:
    """Return the part of a frame that files store.

    Parameters
    ----------
    mask : (H, W) bool ndarray

    Returns
    -------
    FramePart
    """
    if mask.size <= _LEAST_PIXELS:
        return FramePart.whole((mask.shape[0], mask.shape[1]))
    return FramePart.around(mask, _RIM)


def map_channels(d: Decomposition) -> dict[str, np.ndarray]:
    """Return the channels of `maps.exr`.

    Parameters
    ----------
    d : Decomposition

    Returns
    -------
    dict of str to (H, W) or (H, W, 3) ndarray
        Views; colour images under the names of their layers.

    Raises
    ------
    ValueError
        If a map has NaN or infinite values.
    """
    channels = layer_channels({name: getattr(d, name) for name in LAYERS}, LAYERS)
    if d.brdf is not None:
        channels |= layer_channels({"lobe": d.brdf.predicted}, LOBE)
    if (error := d.expected_error) is not None:
        channels |= dict(zip(EXPECTED_ERROR, (error.normal, error.reflectance), strict=True))
    for name, letters in REFINED_LIGHT.items():
        if (layer := getattr(d, name)) is not None:
            channels |= layer_channels({name: layer}, {name: letters})
    if broken := sorted(_broken(channels)):
        raise ValueError(f"NaN or infinite values in {', '.join(broken)}")
    return channels


def write_maps(
    d: Decomposition, channels: Mapping[str, np.ndarray], part: FramePart, folder: Path
) -> None:
    """Write the EXR files of a result.

    Parameters
    ----------
    d : Decomposition
        Cut to the part.
    channels : mapping
        Its `map_channels`.
    part : FramePart
    folder : Path
        It has a folder `maps`.

    Raises
    ------
    OSError
        If a file cannot be written completely.
    """
    write_channels(folder / MAPS, channels, part.corner, part.shape)
    for name, letters in SINGLE.items():
        values = getattr(d, name)
        planes = {letters: values} if name in COLOR_MAPS else _planes(values, list(letters))
        write_channels(folder / "maps" / f"{name}.exr", planes, part.corner, part.shape)


def write_environment(radiance: np.ndarray, folder: Path) -> None:
    """Write the refined light as an image.

    Parameters
    ----------
    radiance : (h, 2 h, 3) ndarray
    folder : Path
    """
    write_channels(folder / ENVIRONMENT, _planes(radiance, list("RGB")))


@dataclass(frozen=True, eq=False)
class StoredMaps:
    """The channels of a file `maps.exr`.

    Attributes
    ----------
    path : Path
    channels : dict of str to (h, w) ndarray
        Of the part.
    part : FramePart
    """

    path: Path
    channels: dict[str, np.ndarray]
    part: FramePart

    @classmethod
    def read(cls, path: Path) -> "StoredMaps":
        """Read a file.

        Parameters
        ----------
        path : Path

        Returns
        -------
        StoredMaps

        Raises
        ------
        InputError
            If it is missing or damaged.
        """
        stored = read_windowed(path, _LIMITS)
        rows, columns = next(iter(stored.channels.values())).shape
        x, y = stored.corner
        if x < 0 or y < 0 or y + rows > stored.frame[0] or x + columns > stored.frame[1]:
            raise InputError(f"{path} has data outside its frame: it is not a result of isc")
        part = FramePart(slice(y, y + rows), slice(x, x + columns), stored.frame)
        if part.is_whole and "mask.A" in stored.channels:  # of earlier versions
            part = stored_part(stored.channels["mask.A"] > 0.5)
            return cls(path, {key: part.cut(one) for key, one in stored.channels.items()}, part)
        return cls(path, stored.channels, part)

    def layers(self, layers: Mapping[str, str]) -> dict[str, np.ndarray]:
        """Return layers of the part.

        Parameters
        ----------
        layers : mapping of str to str
            Letters of the channels of each layer; "" for a channel without letters.

        Returns
        -------
        dict of str to (h, w) or (h, w, 3) ndarray

        Raises
        ------
        InputError
            If a channel is missing, or has values that are not finite.
        """
        names = {
            layer: [f"{layer}.{letter}" for letter in letters] or [layer]
            for layer, letters in layers.items()
        }
        wanted = [name for group in names.values() for name in group]
        if missing := [name for name in wanted if name not in self.channels]:
            raise InputError(
                f"{self.path} lacks the channel {missing[0]}: it is not a result of isc decompose, "
                "or is damaged"
            )
        if broken := [name for name in wanted if not np.isfinite(self.channels[name]).all()]:
            raise InputError(
                f"{self.path} has NaN or infinite values in {broken[0]}: it is damaged; decompose "
                "the photo again"
            )
        return {layer: self._joined(group) for layer, group in names.items()}

    def _joined(self, names: list[str]) -> np.ndarray:
        planes = [self.channels[name] for name in names]
        return planes[0] if len(planes) == 1 else np.stack(planes, -1)


def layer_channels(
    maps: Mapping[str, np.ndarray], layers: Mapping[str, str]
) -> dict[str, np.ndarray]:
    """Return the channels of layers, as `write_channels` takes them.

    Parameters
    ----------
    maps : mapping of str to (H, W) or (H, W, 3) ndarray
        By layer.
    layers : mapping of str to str
        Letters of the channels of each layer.

    Returns
    -------
    dict of str to (H, W) or (H, W, 3) ndarray
        Colour images under the names of their layers.
    """
    channels: dict[str, np.ndarray] = {}
    for name, letters in layers.items():
        if letters == "RGB":
            channels[name] = maps[name]
        else:
            channels |= _planes(maps[name], [f"{name}.{letter}" for letter in letters])
    return channels


def _planes(values: np.ndarray, names: list[str]) -> dict[str, np.ndarray]:
    return {
        name: values[..., index] if values.ndim == 3 else values for index, name in enumerate(names)
    }


def _broken(channels: Mapping[str, np.ndarray]) -> Iterator[str]:
    """The channels with values that are not finite."""
    for name, values in channels.items():
        planes = {name: values}
        if values.ndim == 3:
            planes = _planes(values, [f"{name}.{letter}" for letter in "RGB"])
        yield from (plane for plane in planes if not np.isfinite(planes[plane]).all())
