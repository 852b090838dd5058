"""The files of one object under one light at one level, in the layout of the MIT-Berkeley set.

`laboratory/OBJECT` has the files of a photographed object, `natural/OBJECT` the same images in the
layout of the natural folder, so that both readers work. 16-bit files contain linear values of
1/65535; original = diffuse + specular exactly, in codes.

Equation: one gain for all levels of an object under a light, so that they differ in the specular
layer only: the brightest value of the highest level, and of the shading, is just below 1. Only if
this would darken the diffuse layer too much (99 % of it below 0.02) it is raised to that level, and
highlights clip, in the original and the specular codes. The gain is added to the light's constant
coefficient.

Limits: a diffuse value below one code becomes one code, because the set's readers interpret 0 as
background.
"""

import io
import json
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import scipy.io

from isc_core.io.atomic import new_folder
from isc_core.io.exr import write_channels
from isc_core.shading.spherical_harmonics import light_to_reference

from ..dataset.scene_folder import checksum
from .layers import Layers
from .source import Source

RECORD = "object.json"
_MATLAB_HEADER = b"MATLAB 5.0 MAT-file, written by isc synth glossy-mit".ljust(116)
_WHITE = 65535
_BRIGHTEST = 0.9999
_DARKEST = 0.02  # smallest 99th percentile of the diffuse layer
LABORATORY_FILES = (
    RECORD,
    "original.png",
    "diffuse.png",
    "specular.png",
    "specular.exr",
    "reflectance.png",
    "shading.png",
    "mask.png",
    "depth_valid.png",
    "shading_corrected_color.mat",
    "Z.mat",
    "L.mat",
    "crop_idx.mat",
)
NATURAL_FILES = (
    "L.mat",
    "original.png",
    "diffuse.png",
    "shading_color.png",
    "reflectance.png",
    "mask.png",
)


@dataclass(frozen=True)
class Exposed:
    """An object under one light, scaled for its files.

    Attributes
    ----------
    source : Source
        The object.
    layers : Layers
        Its unscaled layers.
    gain : float
        Factor of `shading`, `diffuse` and the specular layer, (N, 3) each.
    """

    source: Source
    layers: Layers
    gain: float

    @cached_property
    def shading(self) -> np.ndarray:
        """Scaled shading, (N, 3)."""
        return self.gain * self.layers.shading

    @cached_property
    def diffuse(self) -> np.ndarray:
        """Scaled diffuse layer, (N, 3)."""
        return self.source.reflectance * self.shading

    @cached_property
    def light(self) -> np.ndarray:
        """Log-shading coefficients (9, 3) of `shading`, camera frame."""
        light = self.layers.light.copy()
        light[0] += np.log(self.gain) * np.sqrt(4 * np.pi)
        return light

    def strength(self, level: float) -> float:
        """Return the strength at which the specular layer has a given share of all light.

        Parameters
        ----------
        level : float
            The share in per cent.

        Returns
        -------
        float
            Factor of the layer; 0 if that is black.
        """
        return strength_for(level, self.diffuse, self.gain * self.layers.gloss)

    def specular(self, level: float) -> np.ndarray:
        """Return the specular layer, unclipped.

        Parameters
        ----------
        level : float
            Its share of all light in per cent.

        Returns
        -------
        (N, 3) ndarray
            Scaled by `gain`, as `diffuse` is.
        """
        return self.strength(level) * self.gain * self.layers.gloss

    def specular_codes(self, level: float) -> np.ndarray:
        """Return the codes of the specular layer, clipped like the original.

        Parameters
        ----------
        level : float
            Its share of all light in per cent.

        Returns
        -------
        (N, 3) ndarray
            16-bit codes, linear.
        """
        return np.minimum(_codes(self.specular(level)), _WHITE - self.diffuse_codes)

    @cached_property
    def diffuse_codes(self) -> np.ndarray:
        """Codes (N, 3) of the diffuse layer."""
        return np.maximum(_codes(self.diffuse), 1)

    @cached_property
    def shared_files(self) -> dict[str, bytes]:
        """Contents of the files that do not depend on the level, by name; those of the natural
        folder as `natural/NAME`.
        """
        whole, light = self.source.whole, light_to_reference(self.light)
        mask = np.full(len(self.diffuse), _WHITE, np.uint16)
        files = {
            "diffuse.png": _png(whole(self.diffuse_codes)),
            "reflectance.png": _png(whole(_codes(self.source.reflectance))),
            "shading.png": _png(whole(_codes(self.shading.mean(-1)))),
            "mask.png": _png(whole(mask)),
            "depth_valid.png": _png(whole(mask.astype(np.uint8))),
            "shading_corrected_color.mat": _matlab(
                {"shading_correct": whole(self.shading.astype(np.float32))}
            ),
            "Z.mat": _matlab({"depth": whole(self.source.height[self.source.mask], np.nan)}),
            "L.mat": _matlab({"color_lights": {"diffuse": light, "shading": light}}),
            "crop_idx.mat": self.source.crop_file,
        }
        natural = {name: files[name] for name in NATURAL_FILES if name in files}
        natural |= {
            "L.mat": _matlab({"L": light}),
            "shading_color.png": _png(whole(_codes(self.shading))),
        }
        return files | {f"natural/{name}": content for name, content in natural.items()}


def exposed(source: Source, layers: Layers, highest_level: float) -> Exposed:
    """Scale layers as described in the module.

    Parameters
    ----------
    source : Source
        The object.
    layers : Layers
        Its layers.
    highest_level : float
        Largest specular share, per cent.

    Returns
    -------
    Exposed
        The scaled object.
    """
    diffuse = source.reflectance * layers.shading
    image = diffuse + strength_for(highest_level, diffuse, layers.gloss) * layers.gloss
    usual = float(np.quantile(diffuse.max(-1), 0.99))
    unclipped, lifted = _BRIGHTEST / float(image.max()), _DARKEST / max(usual, 1e-12)
    return Exposed(
        source, layers, min(max(unclipped, lifted), _BRIGHTEST / float(layers.shading.max()))
    )


def strength_for(level: float, diffuse: np.ndarray, gloss: np.ndarray) -> float:
    """Return the factor at which a specular layer has a given share of the light.

    Parameters
    ----------
    level : float
        The share, per cent of both layers.
    diffuse, gloss : (N, 3) ndarray
        The diffuse layer, and the specular layer at strength 1.

    Returns
    -------
    float
        The factor; 0 for a black specular layer.
    """
    mirrored = float(gloss.sum(dtype=float))
    return (
        level / (100 - level) * float(diffuse.sum(dtype=float)) / mirrored if mirrored > 0 else 0.0
    )


def write_object(root: Path, picture: Exposed, level: float, variant: str | None = None) -> None:
    """Write natural/OBJECT and then laboratory/OBJECT, each completely or not at all.

    Parameters
    ----------
    root : Path
        Folder of the set.
    picture : Exposed
        The object.
    level : float
        Specular share, per cent.
    variant : str, optional
        Of Mitsuba, for the record, if it traced the shadows.

    Raises
    ------
    InputError
        If the folders cannot be written.
    """
    name, shared = picture.source.name, picture.shared_files
    specular = picture.specular(level)
    codes = picture.specular_codes(level)
    original = {"original.png": _png(picture.source.whole(picture.diffuse_codes + codes))}
    natural = {
        file.removeprefix("natural/"): content
        for file, content in shared.items()
        if file.startswith("natural/")
    } | original
    with new_folder(root / "natural" / name, NATURAL_FILES) as folder:
        for file in NATURAL_FILES:
            (folder / file).write_bytes(natural[file])
    frame = picture.source.whole(specular.astype(np.float32))
    with new_folder(root / "laboratory" / name, LABORATORY_FILES) as folder:
        for file in LABORATORY_FILES:
            if file in shared | original:
                (folder / file).write_bytes((shared | original)[file])
        (folder / "specular.png").write_bytes(_png(picture.source.whole(codes)))
        write_channels(
            folder / "specular.exr", {channel: frame[..., k] for k, channel in enumerate("RGB")}
        )
        files = {file: checksum(folder / file) for file in LABORATORY_FILES[1:]}
        record = asdict(object_record(picture, level, codes))
        record |= {"variant": variant, "files": files}
        (folder / RECORD).write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def is_written(root: Path, name: str) -> bool:
    """Check whether all files of an object exist; folders are always complete.

    Parameters
    ----------
    root : Path
        Folder of the set.
    name : str
        The object.

    Returns
    -------
    bool
        Whether nothing is missing.
    """
    natural, laboratory = (
        (root / light / name, files)
        for light, files in (("natural", NATURAL_FILES), ("laboratory", LABORATORY_FILES))
    )
    return all(
        (folder / file).is_file() for folder, files in (natural, laboratory) for file in files
    )


@dataclass(frozen=True)
class ObjectRecord:
    """The content of `object.json`, except for the checksums and the variant of Mitsuba.

    Attributes
    ----------
    object : str
        Name of the object.
    pixels : int
        Number of its pixels.
    specular_share, specular_share_of_codes : float
        Specular share of the light, unclipped and in the files.
    clipped_share : float
        Share of the clipped pixels.
    gain, gloss_strength : float
        Factors of both layers and of the specular layer.
    light_fit_residual, environment_fit_residual : float
        Relative RMS of the misfits, see `Layers`.
    gloss_noise : float
        Relative RMS of the specular layer's standard error.
    panel : dict or None
        The panel, by the fields of `PanelLight`.
    """

    object: str
    pixels: int
    specular_share: float
    specular_share_of_codes: float
    clipped_share: float
    gain: float
    gloss_strength: float
    light_fit_residual: float
    environment_fit_residual: float
    gloss_noise: float
    panel: dict[str, list[float]] | None


def object_record(picture: Exposed, level: float, codes: np.ndarray) -> ObjectRecord:
    """Measure the values that `object.json` records.

    Parameters
    ----------
    picture : Exposed
        The object.
    level : float
        Specular share, per cent.
    codes : (N, 3) ndarray
        Codes of the specular layer.

    Returns
    -------
    ObjectRecord
        The record.
    """
    specular, layers = picture.specular(level), picture.layers
    both = float(specular.sum(dtype=float) + picture.diffuse.sum(dtype=float))
    in_codes = float(
        codes.sum(dtype=float) / (codes.sum(dtype=float) + picture.diffuse_codes.sum(dtype=float))
    )
    clipped = (picture.diffuse + specular > 1).any(-1)
    panel = (
        None
        if layers.panel is None
        else {key: np.asarray(value).tolist() for key, value in asdict(layers.panel).items()}
    )
    return ObjectRecord(
        object=picture.source.name,
        pixels=len(specular),
        specular_share=float(specular.sum(dtype=float)) / both,
        specular_share_of_codes=in_codes,
        clipped_share=float(clipped.mean()),
        gain=picture.gain,
        gloss_strength=picture.strength(level),
        light_fit_residual=layers.light_residual,
        environment_fit_residual=layers.environment_residual,
        gloss_noise=layers.noise,
        panel=panel,
    )


def _codes(values: np.ndarray) -> np.ndarray:
    return np.rint(np.clip(values, 0, 1) * _WHITE).astype(np.uint16)


def _png(pixels: np.ndarray) -> bytes:
    """Encode codes (h, w) or (h, w, 3) as PNG."""
    done, content = cv2.imencode(
        ".png", pixels[..., ::-1] if pixels.ndim == 3 else pixels, [cv2.IMWRITE_PNG_COMPRESSION, 3]
    )
    if not done:
        raise OSError("the PNG encoder returned nothing")
    return content.tobytes()


def _matlab(variables: dict[str, Any]) -> bytes:
    """Encode a MATLAB 5 file; its header has no date, so that equal values give equal bytes."""
    stream = io.BytesIO()
    scipy.io.savemat(stream, variables, do_compression=True)
    return _MATLAB_HEADER + stream.getvalue()[len(_MATLAB_HEADER) :]
