"""Tables 2.1 to 2.3, documentation of the code: constraints of reflectance models, specular-free
images, characteristics.

Table 2.1 measures the constraints of a reflectance model on the models as they are called:

    positivity    f_r(v, l) >= 0 for all v, l;      reciprocity    f_r(v, l) = f_r(l, v);
    energy        a(l) = integral of f_r(v, l) cos(v) over the hemisphere of views <= 1 for all l.

Table 2.3 is compared with a saved result: a characteristic without its channels, or a channel
without a characteristic, is an error.

Citation: F. E. Nicodemus et al., "Geometrical considerations and nomenclature for reflectance"
(1977), doi:10.6028/NBS.MONO.160; E. Veach, "Robust Monte Carlo methods for light transport
simulation", thesis, Stanford (1997), which has no DOI (the constraints).

Limits: numbers are the worst over random pairs of directions and over twelve angles; violations
between them are missed.
"""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path

import numpy as np

from isc_core.io.exr import read_channels
from isc_core.result_files.maps_file import LAYERS
from isc_core.result_files.result_folder import save
from isc_core.scene.decomposition import Decomposition
from isc_core.shading.brdf.blinn_phong import BlinnPhong
from isc_core.shading.brdf.dichromatic import Dichromatic
from isc_core.shading.brdf.energy import directional_albedo, reciprocity_error
from isc_core.shading.brdf.ggx import Ggx
from isc_core.shading.brdf.lambert import Lambert
from isc_core.shading.brdf.model import Model
from isc_core.shading.brdf.oren_nayar import OrenNayar
from isc_core.shading.brdf.phong import Phong

from ..measuring.context import Context
from ..measuring.decompositions import decompose_subject
from ..measuring.specular_free_images import (
    KINDS,
    residual_highlight,
    subject_title,
    subjects_with_highlights,
)
from ..report.item import ItemContent, ItemTable, ThesisItem

_PAIRS = 4000
_RECIPROCAL = 1e-9  # tolerance of reciprocity
_KEPT = 1e-3  # numerical error of the energy integral
MODELS: tuple[tuple[str, Model], ...] = (
    ("Lambert, albedo 1", Lambert()),
    ("Oren-Nayar, albedo 1, sigma .2", OrenNayar(sigma=0.2)),
    ("Oren-Nayar, albedo 1, sigma .5", OrenNayar(sigma=0.5)),
    ("Phong, plain, exponent 1", Phong(1.0, 1.0, normalised=False)),
    ("Phong, plain, exponent 20", Phong(normalised=False)),
    ("Phong, normalised, exponent 20", Phong()),
    ("Blinn-Phong, plain, exponent 50", BlinnPhong(scale="plain")),
    ("Blinn-Phong, normalised, exponent 50", BlinnPhong()),
    ("Blinn-Phong, conserving, exponent 50", BlinnPhong(scale="conserving")),
    ("GGX, alpha .1, f0 1", Ggx(0.1, 1.0)),
    ("GGX, alpha .5, f0 1", Ggx(0.5, 1.0)),
    (
        "Dichromatic, white Lambert + GGX alpha .3, f0 .04",
        Dichromatic(np.ones(3), Lambert(), Ggx(0.3)),
    ),
    (
        "Dichromatic, Lambert .9 + GGX alpha .3, f0 .04",
        Dichromatic(np.full(3, 0.9), Lambert(), Ggx(0.3)),
    ),
)


@dataclass(frozen=True)
class ConstraintCheck:
    """Constraints measured for a model.

    Attributes
    ----------
    least : float
        Smallest f_r, 1/sr.
    asymmetry : float
        Largest |f_r(v, l) - f_r(l, v)| / largest f_r.
    most : float
        Largest share of the light that is reflected.
    at : float
        Angle of the light for `most`, degrees.
    """

    least: float
    asymmetry: float
    most: float
    at: float

    @property
    def obeyed(self) -> tuple[bool, bool, bool]:
        """Whether positivity, reciprocity and conservation of energy hold."""
        return self.least >= 0, self.asymmetry <= _RECIPROCAL, self.most <= 1 + _KEPT


def check_constraints(model: Model, seed: int = 0) -> ConstraintCheck:
    """Measure the constraints over random pairs of directions and light from 0 to 85 degrees.

    Parameters
    ----------
    model : Model
        The reflectance model.
    seed : int
        Random seed.

    Returns
    -------
    ConstraintCheck
        The measurements.
    """
    directions = np.random.default_rng(seed).normal(size=(2, _PAIRS, 3))
    directions[..., 2] = np.abs(directions[..., 2])
    view, light = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    least = float(model.value(np.array([0.0, 0, 1]), view, light).min())
    angles = np.append(np.arange(0.0, 81.0, 7.5), 85.0)
    shares = [
        float(np.max(directional_albedo(model, float(np.cos(np.deg2rad(angle))))))
        for angle in angles
    ]
    worst = int(np.argmax(shares))
    return ConstraintCheck(
        least, reciprocity_error(model, _PAIRS, seed), shares[worst], float(angles[worst])
    )


def _constraints(context: Context) -> ItemContent:
    rows = []
    for name, model in MODELS:
        found = check_constraints(model, context.seed)
        words = ["yes" if obeyed else "no" for obeyed in found.obeyed]
        rows.append(
            (name, found.least, words[0], found.asymmetry, words[1], found.most, found.at, words[2])
        )
    header = (
        "model",
        "least f_r (1/sr)",
        "positive",
        "asymmetry",
        "reciprocal",
        "largest share reflected",
        "light from (degrees)",
        "conserves energy",
    )
    text = (
        "A model used in an energy balance or a renderer must obey all three. Models "
        "with a strength are tested at strength 1, the maximum. Plain Phong and "
        "Blinn-Phong, as published, are radiance per irradiance across the beam: not "
        "reciprocal, and the reflected share depends on the exponent. The usual factor "
        "of Blinn-Phong reflects up to 7.5 % too much, which the conserving one "
        "corrects; Oren-Nayar's short form up to 1.5 % at grazing light. A diffuse "
        "body with a specular lobe can reflect more than it receives, since the lobe "
        "takes nothing from the body: the dichromatic model describes images, not "
        "energy."
    )
    return ItemContent(
        (
            ItemTable(
                header,
                tuple(rows),
                f"Measured on {_PAIRS} pairs of directions and 12 angles of the light.",
            ),
        ),
        text=text,
    )


def _specular_free(context: Context) -> ItemContent:
    subjects = subjects_with_highlights(
        (*context.subjects("specular"), *context.subjects("synthetic"))
    )
    rows = []
    for kind in KINDS:
        left = [residual_highlight(kind, subject) for subject in subjects]
        rows.append(
            (
                kind.name,
                kind.formula,
                kind.citation,
                f"`{kind.function}`",
                kind.methods,
                100 * float(np.mean(left)),
                100 * max(left),
            )
        )
    header = (
        "image",
        "formula",
        "citation",
        "function",
        "used by",
        "residual highlight (%), mean",
        "largest",
    )
    text = (
        "min and max are over the channels of a pixel, Σ is their sum. The residual "
        f"highlight is measured on {', '.join(map(subject_title, subjects))}, offsets "
        "common to the whole object excluded. Two methods have invariants that are not "
        "images: `mallick_2006` the hue and chroma in a plane across white, `isc` the "
        "chroma max I − min I."
    )
    return ItemContent((ItemTable(header, tuple(rows)),), text=text)


@dataclass(frozen=True)
class CharacteristicEntry:
    """One part of a decomposition, as documented.

    Attributes
    ----------
    name, symbol, unit, frame : str
        As written in the table.
    field : str
        Field of `Decomposition`.
    shape : str
        Shape of the array; H and W are those of the picture.
    stored : str
        Keys of `decomposition.json`, for parts without channels.
    """

    name: str
    symbol: str
    unit: str
    frame: str
    field: str
    shape: str
    stored: str = ""


_LINEAR = "linear Rec.709, the photo's unit"
CHARACTERISTICS = (
    CharacteristicEntry("photo", "I", _LINEAR, "image", "image", "H, W, 3"),
    CharacteristicEntry("diffuse light", "D", _LINEAR, "image", "diffuse", "H, W, 3"),
    CharacteristicEntry("specular light", "s", _LINEAR, "image", "specular", "H, W, 3"),
    CharacteristicEntry("residual", "I − D − s", _LINEAR, "image", "residual", "H, W, 3"),
    CharacteristicEntry(
        "reflectance", "R = D / S", "none, up to one scale", "image", "reflectance", "H, W, 3"
    ),
    CharacteristicEntry(
        "shading",
        "S = exp Σ L_k Y_k(n)",
        "the photo's unit, up to one scale",
        "image",
        "shading",
        "H, W, 3",
    ),
    CharacteristicEntry(
        "normal",
        "n",
        "none, length 1",
        "camera: x right, y up, z to the viewer",
        "normal",
        "H, W, 3",
    ),
    CharacteristicEntry(
        "height",
        "z",
        "pixels, from the object's lowest point",
        "camera: toward the viewer",
        "height",
        "H, W",
    ),
    CharacteristicEntry("mask", "Ω", "object or not", "image", "mask", "H, W"),
    CharacteristicEntry("confidence", "c", "none, 0 to 1", "image", "confidence", "H, W"),
    CharacteristicEntry(
        "light",
        "L",
        "none: of log shading",
        "camera, spherical harmonics",
        "illumination",
        "9, 3",
        "illumination",
    ),
    CharacteristicEntry(
        "specular lobe",
        "α, f0, lights",
        "none; strength in the photo's unit",
        "camera",
        "brdf",
        "one lobe",
        "brdf",
    ),
    CharacteristicEntry(
        "expected error",
        "",
        "degrees; natural logarithm",
        "image",
        "expected_error",
        "two of H, W",
        "status.expected_error",
    ),
    CharacteristicEntry("camera", "f", "pixels", "image", "camera", "a focal length", "camera"),
    CharacteristicEntry("visibility", "V", "", "image", "visibility", "H, W, RGB", "visibility"),
    CharacteristicEntry("indirect", "I", "shading", "image", "indirect", "H, W, RGB", "indirect"),
    CharacteristicEntry(
        "environment", "E", "radiance", "camera", "environment", "rows, columns, RGB", "environment"
    ),
    CharacteristicEntry(
        "coverage", "a", "0 to 1", "photo", "cover", "rows, columns of the photo", "in mask.png"
    ),
    CharacteristicEntry(
        "origin",
        "",
        "",
        "",
        "provenance",
        "text and numbers",
        "settings, seed, versions, timings, input, status",
    ),
)


def channels_of(characteristic: CharacteristicEntry) -> tuple[str, ...]:
    """Return the channels of a part in `maps.exr`.

    Parameters
    ----------
    characteristic : CharacteristicEntry
        The part.

    Returns
    -------
    tuple of str
        None if the part is stored elsewhere.
    """
    return tuple(
        f"{characteristic.field}.{letter}" for letter in LAYERS.get(characteristic.field, "")
    )


def check_characteristics(d: Decomposition, folder: Path) -> tuple[str, ...]:
    """Compare the list of characteristics with a saved result.

    Parameters
    ----------
    d : Decomposition
        A result.
    folder : Path
        Folder to save it to.

    Returns
    -------
    tuple of str
        Differences in fields, shapes and channels; empty if all agree.
    """
    save(d, folder)
    channels = read_channels(folder / "maps.exr")
    height, width = d.mask.shape
    listed = {one.field for one in CHARACTERISTICS}
    wrong = [
        f"{one.name} is no longer a field" for one in CHARACTERISTICS if not hasattr(d, one.field)
    ]
    wrong += [f"{field.name} is not listed" for field in fields(d) if field.name not in listed]
    for one in CHARACTERISTICS:
        wrong += [f"{name} is not in the file" for name in channels_of(one) if name not in channels]
        value = getattr(d, one.field, None)
        shape = one.shape.replace("H", str(height)).replace("W", str(width))
        if isinstance(value, np.ndarray) and ", ".join(map(str, value.shape)) != shape:
            wrong.append(f"{one.name} has shape {value.shape}")
    known = {name for one in CHARACTERISTICS for name in channels_of(one)} | {
        f"lobe.{letter}" for letter in "RGB"
    }
    return (
        *wrong,
        *(f"{name} is in the file but not listed" for name in channels if name not in known),
    )


def _characteristics(context: Context) -> ItemContent:
    d = decompose_subject(context, context.subjects("specular")[0])
    with tempfile.TemporaryDirectory() as folder:
        wrong = check_characteristics(d, Path(folder) / "result")
    rows = []
    for one in CHARACTERISTICS:
        value = getattr(d, one.field)
        kept = str(value.dtype) if isinstance(value, np.ndarray) else ""
        rows.append(
            (
                one.name,
                one.symbol,
                one.unit,
                one.frame,
                one.shape,
                kept,
                ", ".join(channels_of(one)) or f"JSON: {one.stored}",
            )
        )
    header = (
        "characteristic",
        "symbol",
        "unit",
        "frame",
        "shape",
        "numbers",
        "in the result folder",
    )
    text = (
        "Y_k are orthonormal real spherical harmonics in the order (0,0) (1,-1) (1,0) "
        "(1,1) (2,-2) (2,-1) (2,0) (2,1) (2,2). Maps are 0 outside the mask, normals "
        "(0, 0, 1). If a lobe was fitted, `lobe.R .G .B` is the specular light that it "
        "predicts. "
        + (
            "Compared with a saved result: all fields, shapes and channels are as listed."
            if not wrong
            else f"NOT as listed: {'; '.join(wrong)}."
        )
    )
    return ItemContent(
        (
            ItemTable(
                header,
                tuple(rows),
                "Channels are those of `maps.exr`, JSON is `decomposition.json`.",
            ),
        ),
        text=text,
    )


_table: Callable[..., ThesisItem] = partial(ThesisItem, "table")
ITEMS: tuple[ThesisItem, ...] = (
    _table("2.1", "Functional constraints of reflectance models", _constraints),
    _table("2.2", "Specular-free images", _specular_free),
    _table("2.3", "Characteristics and their storage", _characteristics),
)
