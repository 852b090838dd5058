"""A plain material that stands in for the group "ISC Dichromatic" while a file is written for
programs that know no node groups.

Equation: base colour = min(1, g v turned(rho; hue, saturation)), as the group computes it: `turned`
is Blender's Hue/Saturation, v the value, g the gain of the paint. It is baked into an image of 8
bits, coded as sRGB, for that is what base colours of glTF and its like hold. Roughness is the
group's, the level the group's times its gain. Where the highlights come from the photo's image the
group's level is 0, and the fitted one takes its place: a file without that image is to be as glossy
as the photo.

Citation: A. R. Smith, "Color gamut transform pairs", SIGGRAPH 1978, doi:10.1145/965139.807361 (hue,
saturation and value).

Limits: paint brighter than white is cut at 1. The level is one number: its variation over the
object stays behind.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy
import numpy as np

from isc_core.errors import InputError
from isc_core.srgb import linear_to_srgb, srgb_to_linear

from .material import dichromatic_node, shows_highlights
from .nodes import node_tree
from .provenance import SPECULAR_LEVEL

_UNTOUCHED = 1e-6  # as in the group


@contextmanager
def stand_in(thing: bpy.types.Object, material: bpy.types.Material) -> Iterator[bpy.types.Material]:
    """Puts the plain version of `material` on the object `thing` in its place, and takes it away
    again with all that it needed.

    Raises `InputError` if the paint comes from nodes that are no image.
    """
    plain = bpy.data.materials.new("plain")
    try:
        _fill(plain, thing, material)
        with _worn(thing, material, plain):
            yield plain
    finally:
        images = [node.image for node in plain.node_tree.nodes if node.type == "TEX_IMAGE"]
        bpy.data.materials.remove(plain)
        for image in images:
            bpy.data.images.remove(image)


def recoloured(paint: np.ndarray, hue: float, saturation: float, gain: float) -> np.ndarray:
    """Linear paint (..., 3), >= 0, as the group's nodes turn it: a `hue` of 0.5 and a `saturation`
    of 1 change nothing. Not cut at 1.
    """
    if abs(hue - 0.5) <= _UNTOUCHED and abs(saturation - 1) <= _UNTOUCHED:
        return gain * paint
    value, low = paint.max(-1), paint.min(-1)
    spread = np.where(value > low, value - low, 1.0)
    red, green, blue = np.moveaxis(paint, -1, 0)
    sector = np.where(green == value, 2 + (blue - red) / spread, 4 + (red - green) / spread)
    sector = np.where(red == value, (green - blue) / spread, sector) + 6 * (hue + 0.5)
    share = np.clip(saturation * (value - low) / np.where(value > 0, value, 1.0), 0, 1)
    place = (np.array([5.0, 3.0, 1.0]) + sector[..., None]) % 6
    turned = (value * share)[..., None] * np.clip(np.minimum(place, 4 - place), 0, 1)
    return np.asarray(gain * (value[..., None] - turned))


def _fill(plain: bpy.types.Material, thing: bpy.types.Object, material: bpy.types.Material) -> None:
    tree = node_tree(plain)
    surface = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    group = dichromatic_node(material)
    if group is None:
        return
    given = group.inputs
    level = given["Specular Level"].default_value
    if level == 0 and shows_highlights(material):
        level = float(thing.get(SPECULAR_LEVEL, 0.0))
    surface.inputs["Roughness"].default_value = given["Roughness"].default_value
    surface.inputs["Specular IOR Level"].default_value = (
        0.5 * level * given["Specular Gain"].default_value
    )  # Blender's plastic is 0.5
    gain = given["Value"].default_value * given["Diffuse Gain"].default_value
    edits = (given["Hue"].default_value, given["Saturation"].default_value, gain)
    if not given["Reflectance"].is_linked:
        color = recoloured(np.array(given["Reflectance"].default_value[:3]), *edits)
        surface.inputs["Base Color"].default_value = (*np.clip(color, 0, 1), 1.0)
        return
    source = given["Reflectance"].links[0].from_node
    if source.type != "TEX_IMAGE" or source.image is None or not source.image.size[0]:
        raise InputError(
            f"the paint of {thing.name} does not come from an image: connect one to the node's Reflectance, or bake it"
        )
    picture = tree.nodes.new("ShaderNodeTexImage")
    picture.image = _baked(source.image, *edits)
    tree.links.new(picture.outputs["Color"], surface.inputs["Base Color"])


def _baked(image: bpy.types.Image, hue: float, saturation: float, gain: float) -> bpy.types.Image:
    """The paint's image after the edits, 8 bits, sRGB."""
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    colors = pixels.reshape(-1, 4)[:, :3].astype(float)
    if (
        not image.is_float and image.colorspace_settings.name == "sRGB"
    ):  # Blender gives the codes of such an image, of others the light
        colors = srgb_to_linear(colors)
    baked = bpy.data.images.new("paint", width, height, alpha=False, float_buffer=False)
    baked.colorspace_settings.name = "sRGB"
    coded = np.ones((width * height, 4), np.float32)
    coded[:, :3] = linear_to_srgb(np.clip(recoloured(colors, hue, saturation, gain), 0, 1))
    baked.pixels.foreach_set(coded.ravel())
    return baked


@contextmanager
def _worn(thing: Any, material: bpy.types.Material, plain: bpy.types.Material) -> Iterator[None]:
    """The object with `plain` in the slots of `material`; else in its first slot; in one of its
    own, for a while, where it has none.
    """
    lent = not thing.material_slots
    if lent:
        thing.data.materials.append(None)
    slots = list(thing.material_slots)
    worn = [(slot, slot.material) for slot in slots if slot.material == material] or [
        (slots[0], slots[0].material)
    ]
    try:
        for slot, _ in worn:
            slot.material = plain
        yield
    finally:
        for slot, before in worn:
            slot.material = before
        if lent:
            thing.data.materials.clear()
