"""What a decomposition is asked for: taken from the panel, or from an object that was made before;
kept with what is made of it.
"""

import json
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import PurePath
from typing import Any

import bpy

from isc_core.errors import InputError

from ..files.image_export import Picture, examine
from ..scene.build import SHADOWS, BuildOptions
from ..scene.provenance import KEY, SOURCE_IMAGE

_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".exr", ".hdr", ".tga", ".webp")
_IMAGE, _MASK, _REQUEST = SOURCE_IMAGE, "isc_source_mask", "isc_request"


@dataclass(frozen=True)
class Method:
    """How the photo is taken apart; the names are those of `isc decompose`.

    `samples`: rays a pixel in the scene that is built.
    """

    model: str = "joint"
    separator: str = "isc"
    illumination: str = "natural"
    max_size: int = 256
    samples: int = 64


@dataclass(frozen=True)
class Request:
    """One decomposition to be made and built; images and scenes by their full names, since undoing
    replaces the things themselves.

    `image`: the photo. `mask`: its mask, or nothing for the photo's transparency or black border;
    `scale_mask`: to the photo's size. `scene`: that asks. `build`: what is made of the result, its
    `name` the object's.
    """

    image: str = ""
    mask: str = ""
    scale_mask: bool = False
    method: Method = field(default_factory=Method)
    build: BuildOptions = field(default_factory=BuildOptions)
    scene: str = ""

    def to_json(self) -> str:
        """The request as text; `request_from_json` reads it."""
        return json.dumps(asdict(self), ensure_ascii=False)


def request_from_json(text: str) -> Request:
    """What `Request.to_json` wrote, in this version or another.

    Raises `InputError` for anything else.
    """
    try:
        stored = json.loads(text)
        parts = {
            "method": _known(Method, stored["method"]),
            "build": _known(BuildOptions, stored["build"]),
        }
        return _known(Request, {**stored, **parts})
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(
            "it is not known how this object was made: decompose its photo again"
        ) from error


def request_from_settings(scene: Any) -> Request:
    """The request of a scene's panel.

    Raises `InputError` if there is no photo, or no mask where one is wanted.
    """
    settings = scene.isc
    if settings.image is None:
        raise InputError(
            "there is no photo: open a file, or choose an image that is in Blender already"
        )
    masked = settings.mask_source == "IMAGE"
    if masked and settings.mask is None:
        raise InputError(
            "there is no mask image: choose one, cut one out of a box, or set Mask to Alpha or Black"
        )
    if masked and settings.mask == settings.image:
        raise InputError(
            "the mask is the photo itself: choose another image, or set Mask to Alpha or Black"
        )
    return Request(
        settings.image.name_full,
        settings.mask.name_full if masked else "",
        settings.scale_mask,
        Method(**{part.name: getattr(settings, part.name) for part in fields(Method)}),
        build_options(settings, key_of(settings.image)),
        scene.name_full,
    )


def build_options(settings: Any, name: str) -> BuildOptions:
    """What the panel says is to be built, under that name; the rest, which Blender's own panels
    show, stays as it is.
    """
    offered = settings.bl_rna.properties.keys()
    chosen = {
        part.name: getattr(settings, part.name)
        for part in fields(BuildOptions)
        if part.name in offered
    }
    return BuildOptions(**{**chosen, "own_shadows": SHADOWS[settings.shadows], "name": name})


def pictures_of(request: Request) -> tuple[Picture, Picture | None, tuple[int, int] | None]:
    """How photo and mask leave Blender, and the size (width, height) that the mask is to be scaled
    to, if it is.

    Raises `InputError`, with what to do, for images that cannot be used.
    """
    image, mask = (
        named(bpy.data.images, request.image),
        named(bpy.data.images, request.mask) if request.mask else None,
    )
    if image is None or (request.mask and mask is None):
        raise InputError(
            f"the image {request.mask if image else request.image} is not in this file any more: choose another"
        )
    photo = examine(image)
    if mask is None:
        return photo, None, None
    if request.scale_mask:
        return photo, examine(mask, as_pixels=True), (int(image.size[0]), int(image.size[1]))
    if image.has_data and mask.has_data and tuple(image.size) != tuple(mask.size):
        (width, height), (wide, high) = mask.size, image.size
        raise InputError(
            f"the mask is {width} x {height} pixels, the photo {wide} x {high}: choose another mask, or tick Scale Mask"
        )
    return photo, examine(mask), None


def named(blocks: Any, name: str) -> Any:
    """The datablock of that full name, which tells linked ones apart; None if there is none."""
    return next((block for block in blocks if block.name_full == name), None)


def key_of(image: Any) -> str:
    """What to call what is made of an image: its name without a suffix, unless another image's
    object is called so already.
    """
    name = PurePath(image.name.replace("/", "_").replace("\\", "_"))
    plain = name.stem if name.suffix.lower() in _SUFFIXES else str(name)
    taken = any(
        thing.get("isc_key") == plain and thing.get(_IMAGE) not in (None, image)
        for thing in bpy.data.objects
    )
    return image.name if taken else plain


def remember(thing: Any, request: Request) -> None:
    """Writes into an object how it was made, under the name it was given; its images are pointed
    at, so that they stay with it whatever they are called.
    """
    thing[_REQUEST] = replace(request, build=replace(request.build, name=str(thing[KEY]))).to_json()
    for role, name in ((_IMAGE, request.image), (_MASK, request.mask)):
        image = named(bpy.data.images, name) if name else None
        if image is not None:
            thing[role] = image
        elif role in thing:
            del thing[role]


def remembered(thing: Any, scene: Any, max_size: int) -> Request:
    """The request that an object was made by, at another size; images as they are called now.

    Raises `InputError` if they have gone.
    """
    request = request_from_json(thing.get(_REQUEST, ""))
    for role, name in ((_IMAGE, request.image), (_MASK, request.mask)):
        if (name or role == _IMAGE) and thing.get(role) is None:
            what = "photo" if role == _IMAGE else "mask"
            raise InputError(
                f"the {what} that {thing.name} was made of is not in this file: open it, and press Decompose"
            )
    mask = thing[_MASK].name_full if request.mask else ""
    method = replace(request.method, max_size=max_size)
    return replace(
        request, image=thing[_IMAGE].name_full, mask=mask, method=method, scene=scene.name_full
    )


def _known(kind: type, stored: dict[str, Any]) -> Any:
    """A dataclass of those values that it has fields for.

    Raises `TypeError` if they have no names.
    """
    if not isinstance(stored, dict):
        raise TypeError(f"{stored!r} has no names")
    names = {part.name for part in fields(kind)}
    return kind(**{name: value for name, value in stored.items() if name in names})
