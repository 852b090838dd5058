"""Editing an object that was built: its paint, the gains of paint and gloss, its light.

All of it stays editable in the nodes.
"""
# mypy: allow-subclassing-any, disable-error-code="valid-type"
# ruff: noqa: RUF012 (Blender wants its options as sets)

from dataclasses import replace
from typing import Any

import bpy
import numpy as np
from bpy.props import EnumProperty, FloatProperty, FloatVectorProperty

from isc_core.errors import InputError

from ..scene.build import Built, find
from ..scene.copies import material_of, own_material
from ..scene.material import dichromatic_node, set_specular_gain
from ..scene.provenance import KEY
from ..scene.sun import ensure_sun, relight
from ..scene.world import mix_sun

_LIGHTS = (
    (
        "OPTIMAL",
        "Best Direction",
        "One sun along the direction that best explains the photo's shading, even light beside it",
    ),
    ("CHOSEN", "Chosen Direction", "The same sun from another direction"),
    ("RECOVERED", "Recovered Light", "The environment as it was recovered, no sun"),
)


class EditOperator:
    """A mixin for operators that change what ISC built:

    `edit` does, within one undo step, or raises `InputError` before it changes.
    """

    report: Any  # Blender's own
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        """With an object, camera or sun of ISC active."""
        if find(context.object) is None:
            cls.poll_message_set("Choose an object that ISC made")  # type: ignore[attr-defined]
            return False
        return True

    def execute(self, context: Any) -> set[str]:
        """Edits."""
        built = find(context.object)
        try:
            if built is None:
                raise InputError("choose an object that ISC made")
            self.edit(built)
        except InputError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}

    def edit(self, built: Built) -> None:
        """Changes what was built. Raises `InputError`."""
        raise NotImplementedError


class ISC_OT_recolour(EditOperator, bpy.types.Operator):
    """Other paint under the same light and gloss."""

    bl_idname = "isc.recolour"
    bl_label = "Recolour"
    bl_description = "Give the object other paint; its texture, light and gloss stay"

    hue: FloatProperty(
        name="Hue",
        description="Turns the hue: 0.5 as in the photo, 0 and 1 the opposite",
        default=0.5,
        min=0,
        max=1,
    )
    saturation: FloatProperty(
        name="Saturation", description="0 is grey, 1 as in the photo", default=1, min=0, max=2
    )
    value: FloatProperty(
        name="Value",
        description="Factor of the paint's brightness: 1 as in the photo",
        default=1,
        min=0,
        max=2,
    )

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Begins with what is set now."""
        del event
        inputs = inputs_of(find(context.object))
        self.hue, self.saturation, self.value = (
            inputs[name].default_value for name in ("Hue", "Saturation", "Value")
        )
        return self.execute(context)

    def edit(self, built: Built) -> None:
        """Sets the node's inputs."""
        inputs = own_inputs_of(built)
        for name, value in (
            ("Hue", self.hue),
            ("Saturation", self.saturation),
            ("Value", self.value),
        ):
            inputs[name].default_value = value


class ISC_OT_dichromatic(EditOperator, bpy.types.Operator):
    """Paint and gloss in other proportions."""

    bl_idname = "isc.dichromatic"
    bl_label = "Paint and Gloss"
    bl_description = "Make the light of the paint, and that of the gloss, stronger or weaker"

    diffuse_gain: FloatProperty(
        name="Paint",
        description="Factor of the light that the paint scatters",
        default=1,
        min=0,
        max=10,
    )
    specular_gain: FloatProperty(
        name="Gloss", description="Factor of the highlights: 0 is matt", default=1, min=0, max=10
    )

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Begins with what is set now."""
        del event
        inputs = inputs_of(find(context.object))
        self.diffuse_gain, self.specular_gain = (
            inputs["Diffuse Gain"].default_value,
            inputs["Specular Gain"].default_value,
        )
        return self.execute(context)

    def edit(self, built: Built) -> None:
        """Sets the nodes' inputs: highlights may come from the lobe or from the photo."""
        own_inputs_of(built)["Diffuse Gain"].default_value = self.diffuse_gain
        set_specular_gain(material_of(built.object), self.specular_gain)


class ISC_OT_own_material(EditOperator, bpy.types.Operator):
    """Paint and gloss that no copy shares."""

    bl_idname = "isc.own_material"
    bl_label = "Own Paint and Gloss"
    bl_description = "Give the object a material of its own: now its copies, or what it was copied from, change with it"

    def edit(self, built: Built) -> None:
        """Copies the material."""
        own_inputs_of(built)


class ISC_OT_relight(EditOperator, bpy.types.Operator):
    """One sun instead of the environment, or the environment again."""

    bl_idname = "isc.relight"
    bl_label = "Relight"
    bl_description = (
        "Light the object by one sun and even light beside it, or again as in the photo"
    )

    light: EnumProperty(
        name="Light", description="What lights the object", items=_LIGHTS, default="OPTIMAL"
    )
    direction: FloatVectorProperty(
        name="Direction",
        description="From the object toward the chosen sun: right, away from the viewer, up; of any length",
        subtype="XYZ",
        size=3,
        default=(-0.5, -0.7, 0.5),
    )
    strength: FloatProperty(
        name="Strength", description="Factor of the sun's light", default=1, min=0, soft_max=10
    )
    ambient: FloatProperty(
        name="Even Light",
        description="Factor of the light from all around",
        default=1,
        min=0,
        soft_max=10,
    )

    def edit(self, built: Built) -> None:
        """Sets the sun and the world."""
        thing = built.object
        if self.light == "RECOVERED":
            relight(thing, False)
            return
        direction, irradiance, even = (
            _stored(thing, f"isc_sun_{name}") for name in ("direction", "strength", "ambient")
        )
        if self.light == "CHOSEN":
            right, away, up = self.direction
            direction = np.array([right, up, -away])  # in the camera's frame
        length = float(np.linalg.norm(direction))
        if length < 1e-9:
            raise InputError("the direction has no length: say where the sun stands")
        ensure_sun(thing[KEY], built.collection, direction / length, self.strength * irradiance)
        mix_sun(built.world, self.ambient * even, True)


def inputs_of(built: Built | None) -> Any:
    """The inputs of the material's node "ISC Dichromatic".

    Raises `InputError` if it has gone or belongs to another file.
    """
    if built is None or (node := dichromatic_node(built.material)) is None:
        raise InputError(
            "the material has no node group ISC Dichromatic any more: decompose the photo again"
        )
    if built.material.library is not None:
        raise InputError(
            f"{built.material.name} is linked from another file: make it local first (Object, Relations, Make Local)"
        )
    return node.inputs


def own_inputs_of(built: Built) -> Any:
    """As `inputs_of`, on a material that no copy of the object shares: made where it has none.

    Raises `InputError` as that does.
    """
    inputs_of(built)
    own = own_material(built.object, built.material)
    return inputs_of(replace(built, material=own))


def _stored(thing: Any, name: str) -> np.ndarray:
    if name not in thing:
        raise InputError(
            f"it is not known where the light of {thing.name} comes from: import its result again"
        )
    return np.array(thing[name], np.float64)
