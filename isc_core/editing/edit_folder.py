"""The files of an edit: the picture, in the photo's own encoding, and a contact sheet.

`edit.json` records the parameters and measurements; `edited.png` has the photo's bit depth (16 for
9 to 15), encoding, colour profile and alpha (none for a photo of floats; 16-bit sRGB where a PNG
cannot represent the encoding, such as camera raw); `edited.exr` is the same picture in linear
light, premultiplied by alpha; `before_after.png` is the contact sheet; `clusters.png`, of
recolouring, shows the clusters to choose from. A folder appears completely or not at all.

Limits: pixels outside the mask of a float photo with partly transparent pixels are bit-identical
only if its file is an EXR with plain R, G, B; else they are rounded by the product with alpha.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..imaging.bounding_box import FramePart
from ..imaging.luminance import white_of
from ..io.atomic import new_folder, require_writable
from ..io.decoders.png import write_png
from ..io.decoders.raw import CAMERA_RAW
from ..io.exr import read_channels, write_channels
from ..photo import Photo, Raster, encode_like
from ..photo.primaries import to_rec709
from ..photo.transfer import PROFILE
from ..result_files.contact_sheet import MapPanel, edit_sheet
from ..result_files.panels import Panel
from ..scene.decomposition import Decomposition
from ..scene.part_of_result import ResultPart
from .clusters import Clusters
from .compositing import composite
from .edited import Edited, light_color

FILES = ("edit.json", "edited.png", "edited.exr", "before_after.png", "clusters.png")
_FADED = 0.06


@dataclass(frozen=True)
class Original:
    """The photo to apply the edit to.

    Attributes
    ----------
    photo : Photo
        Its light and mask at full size.
    raster : Raster
        The values in its file.
    path : Path or None
        The file.
    """

    photo: Photo
    raster: Raster
    path: Path | None = None


@dataclass(frozen=True)
class Sheet:
    """Content of the contact sheet.

    Attributes
    ----------
    title, subtitle : str
    others : sequence of Panel
        Panels that follow the pictures.
    layers : bool
        Whether the layers are shown.
    """

    title: str
    subtitle: str = ""
    others: Sequence[Panel] = ()
    layers: bool = True


@dataclass(frozen=True)
class Record:
    """Content of `edit.json`, ready for JSON.

    Attributes
    ----------
    action : str
    parameters, measured : mapping
    """

    action: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    measured: Mapping[str, Any] = field(default_factory=dict)


def require_writable_edit(folder: Path | str, inputs: Iterable[Path | None] = ()) -> None:
    """Check, before the work, that an edit can be written without loss of its inputs.

    Parameters
    ----------
    folder : Path or str
    inputs : iterable of Path

    Raises
    ------
    InputError
        If it cannot.
    """
    require_writable(folder, FILES, inputs)


def save_edit(
    stored: ResultPart, edit: Edited, folder: Path | str, record: Record, sheet: Sheet, *,
    original: Original | None = None, clusters: Clusters | None = None,
) -> None:  # fmt: skip
    """Write the folder of an edit.

    Parameters
    ----------
    stored : ResultPart
        The pictures show its frame.
    edit : Edited
        Of this part.
    folder : Path or str
    record : Record
    sheet : Sheet
    original : Original, optional
        The edit is applied to this photo; by default the picture has the size of the maps.
    clusters : Clusters, optional
        Shown in `clusters.png`.

    Raises
    ------
    InputError
        If the folder cannot be replaced or written, or the photo is not the result's.
    """
    d = stored.result
    picture = _picture(stored, edit) if original is None else _photo(stored, edit, original)
    pair = [
        MapPanel(picture.before, picture.mask, "Before"),
        MapPanel(picture.image, picture.mask, "After" if sheet.layers else "In the best light"),
    ]
    layers = (
        [
            MapPanel(edit.diffuse, d.mask, "Diffuse, after"),
            MapPanel(edit.specular, d.mask, "Specular, after"),
        ]
        if sheet.layers
        else []
    )
    with new_folder(folder, FILES) as partial:
        if picture.raster.peak is not None:
            write_png(partial / "edited.png", picture.raster)
        write_channels(partial / "edited.exr", _linear_planes(picture, original))
        edit_sheet(
            sheet.title,
            sheet.subtitle,
            [*pair, *layers],
            sheet.others,
            columns=4 if sheet.layers else 5,
        ).save(partial / "before_after.png")
        if clusters is not None:
            cluster_sheet(d, clusters).save(partial / "clusters.png")
        text = {
            "schema_version": 1,
            **record.__dict__,
            "notes": list(edit.notes),
            "of_photo": original is not None,
        }
        (partial / "edit.json").write_text(
            json.dumps(text, indent=2, allow_nan=False) + "\n", encoding="utf-8"
        )


@dataclass(frozen=True, eq=False)
class _Picture:
    """An edited picture: the part with the object, in linear light, and the stored values of all of
    it.
    """

    image: np.ndarray  # (h, w, 3)
    mask: np.ndarray  # (h, w)
    before: np.ndarray  # (h, w, 3)
    changed: np.ndarray  # (h, w)
    place: FramePart
    raster: Raster


def _linear_planes(picture: _Picture, original: Original | None) -> dict[str, np.ndarray]:
    """R, G, B times alpha, and A."""
    place, alpha = picture.place, picture.raster.alpha
    if original is None:  # the image is 0 outside the mask, which is the alpha
        planes = {name: place.placed(picture.image[..., c]) for c, name in enumerate("RGB")}
    else:
        planes = {name: original.photo.image[..., c].copy() for c, name in enumerate("RGB")}
        cover = None if alpha is None else np.where(alpha > 0, alpha, np.float32(1))
        for c, plane in enumerate(planes.values()):
            place.cut(plane)[...] = picture.image[..., c]
            if cover is not None:
                plane *= cover
        planes |= _stored_elsewhere(planes, original, place.placed(picture.changed))
    return planes if alpha is None else planes | {"A": alpha}


def _stored_elsewhere(
    planes: Mapping[str, np.ndarray], original: Original, changed: np.ndarray
) -> dict[str, np.ndarray]:
    """Planes with the values of the photo's EXR file where nothing changes, which the product might
    round; those that the file has.
    """
    path = original.path
    if (
        path is None
        or path.suffix.lower() != ".exr"
        or to_rec709(original.raster.space) is not None
    ):
        return {}
    stored = read_channels(path)
    return {
        name: np.where(changed, plane, stored[name])
        for name, plane in planes.items()
        if name in stored and stored[name].shape == changed.shape
    }


def cluster_sheet(d: Decomposition, clusters: Clusters) -> Any:
    """Draw the clusters: for each, the reflectance with all others faded, labelled with its number.

    Parameters
    ----------
    d : Decomposition
    clusters : Clusters

    Returns
    -------
    PIL.Image.Image
    """
    reflectance = d.reflectance * light_color(d)
    maps = [MapPanel(reflectance, d.mask, "Reflectance")]
    for number, share in enumerate(clusters.shares, 1):
        weight = clusters.weight(number)[..., None]
        grey = np.full(3, _FADED * white_of(reflectance, d.mask))
        values = weight * reflectance + (1 - weight) * grey
        maps.append(
            MapPanel(values, d.mask, f"Cluster {number}", f"{100 * share:.0f} % of the object")
        )
    return edit_sheet("Clusters", "isc edit RESULT recolour --cluster N", maps)


def _photo(stored: ResultPart, edit: Edited, original: Original) -> _Picture:
    """The photo with the edit."""
    done, raster = composite(stored, edit, original.photo), original.raster
    transfer = original.photo.original.transfer
    coded = encode_like(raster, transfer, done.image, done.changed, done.place)
    return _Picture(done.image, done.photo.mask, done.photo.image, done.changed, done.place, coded)


def _picture(stored: ResultPart, edit: Edited) -> _Picture:
    """The edited maps, with the mask as alpha."""
    d, part = stored.result, stored.part
    given = d.provenance.input
    bits, transfer = given.get("bit_depth", 8), str(given.get("transfer", "srgb"))
    if transfer == PROFILE or given.get("colour_profile") == CAMERA_RAW:
        transfer = "srgb"  # a PNG cannot represent the photo's encoding
    peak = None if bits == 32 else 65535 if bits > 8 else 255
    kind = np.float32 if peak is None else np.uint16 if bits > 8 else np.uint8
    empty = Raster(np.zeros(d.image.shape, kind), None, peak, 32 if peak is None else bits)
    codes = encode_like(empty, transfer, edit.image, d.mask).values
    alpha = part.placed(d.mask.astype(np.float32))
    whole = replace(empty, values=part.placed(codes), alpha=alpha)
    return _Picture(edit.image, d.mask, d.image, d.mask, part, whole)
