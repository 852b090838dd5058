"""The request of a decomposition: taken from the panel or from an existing object, and stored with
the object.
"""

import json
import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import PurePath
from typing import Any

import bpy

from isc_core.errors import InputError
from isc_core.photo.names import PHOTO_SUFFIXES

from ..datablocks.provenance import KEY, SOURCE_IMAGE
from ..files.image_source import ImageSource, inspect_image
from ..scene.preparation import OWN_SHADOWS, BuildOptions
from ..worker.commands import CERTAIN

_SUFFIXES = (*PHOTO_SUFFIXES, ".tga", ".webp")
_IMAGE, _MASK, _REQUEST = SOURCE_IMAGE, "isc_source_mask", "isc_request"


@dataclass(frozen=True)
class MethodSettings:
    """How a photo is decomposed; the values are those of `isc decompose`.

    Attributes
    ----------
    model : str
        Value of `--model`.
    separator : str
        Value of `--separator`.
    illumination : str
        Value of `--illumination`.
    camera : str
        Value of `--camera`.
    max_size : int
        Longer side of the object in pixels; 0 keeps the photo's resolution.
    samples : int
        Samples per pixel of Cycles in the scene that is built.
    texture_size : str
        Value of `--texture-size`.
    highlight_odds : str
        Value of `--highlight-odds`.
    highlights, not_highlights : str
        Pixels that are marked, such as "120,80 64,200".
    refine : bool
        Whether the gloss is refined.
    light_colour : str
        Value of `--light-colour`.
    """

    model: str = "joint"
    separator: str = "isc"
    illumination: str = "photo"
    max_size: int = 512
    samples: int = 64
    camera: str = "auto"
    texture_size: str = "photo"
    highlight_odds: str = CERTAIN
    highlights: str = ""
    not_highlights: str = ""
    refine: bool = False
    light_colour: str = "balanced"


@dataclass(frozen=True)
class DecomposeRequest:
    """One photo to decompose, and what to build of its result.

    Images and scenes are given by their full names: undo replaces the datablocks themselves. The
    field names are part of the JSON text that files store.

    Attributes
    ----------
    image : str
        The photo.
    mask : str
        Its mask; "" uses the photo's transparency or black background.
    scale_mask : bool
        Whether to scale the mask to the photo's size.
    method : MethodSettings
        How to decompose.
    build : BuildOptions
        What to build; its `name` is the object's.
    scene : str
        Scene that the request comes from.
    """

    image: str = ""
    mask: str = ""
    scale_mask: bool = False
    method: MethodSettings = field(default_factory=MethodSettings)
    build: BuildOptions = field(default_factory=BuildOptions)
    scene: str = ""

    def to_json(self) -> str:
        """Return the request as text for `request_from_json`."""
        return json.dumps(asdict(self), ensure_ascii=False)


def request_from_json(text: str) -> DecomposeRequest:
    """Read what `DecomposeRequest.to_json` wrote, in this version or another.

    Parameters
    ----------
    text : str
        JSON text; unknown entries are ignored.

    Returns
    -------
    DecomposeRequest
        The request.

    Raises
    ------
    InputError
        If the text is no request.
    """
    try:
        stored = json.loads(text)
        parts = {
            "method": _from_known_fields(MethodSettings, stored["method"]),
            "build": _from_known_fields(BuildOptions, stored["build"]),
        }
        return _from_known_fields(DecomposeRequest, {**stored, **parts})
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(
            "the object does not store how it was created: create it from its photo again"
        ) from error


def require_photo(settings: Any) -> None:
    """Raise if no photo is selected.

    Parameters
    ----------
    settings : ISC_PG_settings
        The panel's settings.

    Raises
    ------
    InputError
        With what to do.
    """
    if settings.image is None:
        raise InputError("no photo is selected: open a file, or choose an image of this file")


def request_from_settings(scene: Any) -> DecomposeRequest:
    """Return the request of a scene's panel.

    Parameters
    ----------
    scene : bpy.types.Scene
        The scene.

    Returns
    -------
    DecomposeRequest
        The request.

    Raises
    ------
    InputError
        If the photo is missing, or a mask image is chosen but missing.
    """
    settings = scene.isc
    require_photo(settings)
    masked = settings.mask_source == "IMAGE"
    if masked and settings.mask is None:
        raise InputError(
            "no mask image is selected: choose one, cut one out with Select Box, "
            "or set Mask to Automatic"
        )
    if masked and settings.mask == settings.image:
        raise InputError(
            "the mask is the photo itself: choose another image, or set Mask to Automatic"
        )
    return DecomposeRequest(
        image=settings.image.name_full,
        mask=settings.mask.name_full if masked else "",
        scale_mask=settings.scale_mask,
        method=MethodSettings(
            **{
                part.name: getattr(settings, part.name)
                for part in fields(MethodSettings)
                if part.name not in ("camera", "light_colour")
            },
            camera=_camera(settings),
            light_colour=_light_colour(settings),
        ),
        build=build_options(settings, object_key(settings.image, each=settings.each)),
        scene=scene.name_full,
    )


def _camera(settings: Any) -> str:
    """Value of `--camera`."""
    by_length = settings.camera == "focal_length"
    return f"{settings.focal_length:g}" if by_length else str(settings.camera)


def _light_colour(settings: Any) -> str:
    """Value of `--light-colour`."""
    by_color = settings.light_color == "custom"
    color = (f"{part:.4g}" for part in settings.custom_light_color)
    return ",".join(color) if by_color else str(settings.light_color)


def build_options(settings: Any, name: str) -> BuildOptions:
    """Return what the panel's settings build.

    Parameters
    ----------
    settings : ISC_PG_settings
        The settings; options that the panel does not offer keep their defaults.
    name : str
        Name of the object, "" for the result's own.

    Returns
    -------
    BuildOptions
        The options.
    """
    offered = settings.bl_rna.properties.keys()
    chosen = {
        part.name: getattr(settings, part.name)
        for part in fields(BuildOptions)
        if part.name in offered
    }
    own_shadows = OWN_SHADOWS[settings.shadows]
    return BuildOptions(
        **{**chosen, "own_shadows": own_shadows, "photo_resolution": True, "name": name}
    )


def inspect_images(
    request: DecomposeRequest,
) -> tuple[ImageSource, ImageSource | None, tuple[int, int] | None]:
    """Determine how photo and mask are handed to the worker.

    Parameters
    ----------
    request : DecomposeRequest
        The request.

    Returns
    -------
    photo : ImageSource
        The photo.
    mask : ImageSource or None
        The mask.
    size : tuple of int or None
        Width and height to scale the mask to.

    Raises
    ------
    InputError
        If an image is missing or cannot be used.
    """
    image = find_by_full_name(bpy.data.images, request.image)
    mask = find_by_full_name(bpy.data.images, request.mask) if request.mask else None
    if image is None or (request.mask and mask is None):
        missing = request.mask if image else request.image
        raise InputError(f"the image {missing} is no longer in this file: choose another")
    photo = inspect_image(image)
    if mask is None:
        return photo, None, None
    if request.scale_mask and tuple(image.size) != tuple(mask.size):
        return photo, inspect_image(mask, as_pixels=True), (int(image.size[0]), int(image.size[1]))
    if image.has_data and mask.has_data and tuple(image.size) != tuple(mask.size):
        raise InputError(
            f"the mask is {mask.size[0]} x {mask.size[1]} pixels, the photo {image.size[0]} x "
            f"{image.size[1]}: choose another mask, or enable Scale Mask"
        )
    return photo, inspect_image(mask), None


def find_by_full_name(blocks: Any, name: str) -> Any:
    """Find a datablock by its full name, which distinguishes linked ones.

    Parameters
    ----------
    blocks : bpy_prop_collection
        For example `bpy.data.images`.
    name : str
        Full name.

    Returns
    -------
    bpy.types.ID or None
        The datablock.
    """
    return next((block for block in blocks if block.name_full == name), None)


def track_names(request: DecomposeRequest) -> Callable[[], DecomposeRequest]:
    """Follow the datablocks of a request while the user may rename them.

    Parameters
    ----------
    request : DecomposeRequest
        The request.

    Returns
    -------
    callable
        Returns the request with the present names; the names of deleted datablocks are unchanged.
    """
    kinds = {"image": "images", "mask": "images", "scene": "scenes"}
    numbers = {}
    for part, kind in kinds.items():
        block = find_by_full_name(getattr(bpy.data, kind), getattr(request, part))
        if block is not None:
            numbers[part] = block.session_uid

    def renamed() -> DecomposeRequest:
        names = {
            part: block.name_full
            for part, number in numbers.items()
            for block in getattr(bpy.data, kinds[part])
            if block.session_uid == number
        }
        return replace(request, **names)

    return renamed


def object_key(image: Any, *, each: bool = False) -> str:
    """Return the name of the object built from an image.

    Parameters
    ----------
    image : bpy.types.Image
        The photo.
    each : bool, optional
        Whether it is the common name of several objects.

    Returns
    -------
    str
        The name that was given before, as the image may have been renamed. At first the image's
        name without its suffix, or with it, if another image's object has that name. Blender's
        number of the image is no part of it.
    """
    if given := _given_name(image, each):
        return given
    whole = image.name.replace("/", "_").replace("\\", "_")
    unnumbered = PurePath(re.sub(r"\.\d{3,}$", "", whole))
    numbered = str(unnumbered) != whole and unnumbered.suffix.lower() in _SUFFIXES
    name = unnumbered if numbered else PurePath(whole)
    plain = name.stem if name.suffix.lower() in _SUFFIXES else whole
    taken = any(
        obj.get(KEY) == plain and obj.get(_IMAGE) not in (None, image) for obj in bpy.data.objects
    )
    return whole if taken and not numbered else plain


def _given_name(image: Any, each: bool) -> str:
    """The name of what was built from an image; "" if nothing was."""
    for obj in bpy.data.objects:
        if obj.library is None and obj.get(_IMAGE) == image and KEY in obj:
            with suppress(InputError):
                build = request_from_json(obj.get(_REQUEST, "")).build
                if build.each == each:
                    return build.name if each else str(obj[KEY])
    return ""


def store_request(obj: Any, request: DecomposeRequest) -> None:
    """Store in an object how it was made, under the name it was given, or that of its photo.

    The object also points to the images, so that they stay with it when they are renamed.

    Parameters
    ----------
    obj : bpy.types.Object
        The object.
    request : DecomposeRequest
        How it was made.
    """
    named = request
    if not request.build.each:
        named = replace(request, build=replace(request.build, name=str(obj[KEY])))
    obj[_REQUEST] = named.to_json()
    for role, name in ((_IMAGE, request.image), (_MASK, request.mask)):
        image = find_by_full_name(bpy.data.images, name) if name else None
        if image is not None:
            obj[role] = image
        elif role in obj:
            del obj[role]


def stored_request(obj: Any, scene: Any, max_size: int) -> DecomposeRequest:
    """Return the request that made an object, at another size.

    Parameters
    ----------
    obj : bpy.types.Object
        The object.
    scene : bpy.types.Scene
        Scene of the new request.
    max_size : int
        New longer side of the object in pixels.

    Returns
    -------
    DecomposeRequest
        The request, with the current names of its images.

    Raises
    ------
    InputError
        If the object stores no request, or its images are missing.
    """
    request = request_from_json(obj.get(_REQUEST, ""))
    for role, name in ((_IMAGE, request.image), (_MASK, request.mask)):
        if (name or role == _IMAGE) and obj.get(role) is None:
            what = "photo" if role == _IMAGE else "mask"
            raise InputError(
                f"the {what} of {obj.name} is not in this file: open it, and press Create Object"
            )
    return replace(
        request,
        image=obj[_IMAGE].name_full,
        mask=obj[_MASK].name_full if request.mask else "",
        method=replace(request.method, max_size=max_size),
        scene=scene.name_full,
    )


def _from_known_fields(kind: type, stored: dict[str, Any]) -> Any:
    """A dataclass from those values that it has fields for."""
    if not isinstance(stored, dict):
        raise TypeError(f"{stored!r} is not a mapping")
    names = {part.name for part in fields(kind)}
    return kind(**{name: value for name, value in stored.items() if name in names})


def parse_points(text: str) -> list[tuple[int, int]]:
    """Read the points of a field of the panel.

    Parameters
    ----------
    text : str
        Such as "120,80 64,200".

    Returns
    -------
    list of (x, y)

    Raises
    ------
    InputError
        If a word is not a point.
    """
    points = []
    for word in text.split():
        try:
            x, y = (int(part) for part in word.split(","))
        except ValueError as error:
            raise InputError(f"{word!r} is not a point: use column,row, such as 120,80") from error
        points.append((x, y))
    return points
