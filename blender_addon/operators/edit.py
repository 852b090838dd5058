"""Edit a built object: its reflectance, the gains of diffuse and specular light, its illumination.

All of it remains editable in the nodes.
"""
# mypy: allow-subclassing-any, disable-error-code="valid-type"
# ruff: noqa: RUF012 (Blender requires sets for operator options)

from dataclasses import replace
from typing import Any

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, FloatVectorProperty

from isc_core.errors import InputError

from ..datablocks.provenance import KEY
from ..materials.edit_nodes import dichromatic_node
from ..materials.material import set_specular_gain
from ..materials.photo_highlights import can_show_highlights, hide_highlights, show_highlights
from ..runs.messages import sentence
from ..scene.built_object import BuiltObject, find_built, light_owner, selection_problem
from ..scene.copies import find_material, has_other_material, make_material_single_user
from ..scene.sun import ensure_sun, hide_lamps, relight, sun_collection
from ..scene.world import set_sun_mix
from .live_edits import write_edits

_LIGHTS = (
    (
        "OPTIMAL",
        "Estimated Sun",
        "One sun along the direction that best explains the photo's shading, and uniform light",
    ),
    ("CHOSEN", "Custom Direction", "The same sun and uniform light, from another direction"),
    ("RECOVERED", "Recovered Light", "The recovered environment map without a sun"),
)


class NeedsObject:
    """Mixin for operators on an object that ISC has built."""

    poll_message_set: Any  # from bpy.types.Operator

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Return whether an object, camera or sun of ISC is active.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        bool
            Where False, the tooltip gives the reason.
        """
        reason = selection_problem(context.object)
        if reason:
            cls.poll_message_set(reason)
        return not reason


def require_built(context: Any) -> BuiltObject:
    """Return what belongs to the active object.

    Parameters
    ----------
    context : bpy.types.Context
        Blender's context.

    Returns
    -------
    BuiltObject
        As `find_built`.

    Raises
    ------
    InputError
        If no object, camera or sun of ISC is active.
    """
    built = find_built(context.object)
    if built is None:
        raise InputError("no object created by ISC is active: select one")
    return built


class EditOperator(NeedsObject):
    """Mixin for operators that change what ISC has built, as one undo step.

    `edit` changes it, or raises `InputError` before any change.
    """

    report: Any  # from bpy.types.Operator
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        """Apply the edit.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        set of str
            {"FINISHED"}, or {"CANCELLED"} after an error has been reported.
        """
        try:
            built = require_built(context)
            self.edit(built)
            write_edits(find_material(built.object) or built.material)
        except InputError as error:
            self.report({"ERROR"}, sentence(str(error)))
            return {"CANCELLED"}
        return {"FINISHED"}

    def edit(self, built: BuiltObject) -> None:
        """Change an object.

        Parameters
        ----------
        built : BuiltObject
            The active object and what belongs to it.

        Raises
        ------
        InputError
            If the object cannot be changed.
        """
        raise NotImplementedError


class _NodeEdit(EditOperator):
    """Mixin for operators that change values of the node "ISC Dichromatic".

    From a button or a menu they start with the current values, which `read` takes over.
    """

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Start with the object's current values.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        event : bpy.types.Event
            The event that started the operator; not used.

        Returns
        -------
        set of str
            As `execute`.
        """
        del event
        try:
            self.read(dichromatic_inputs(require_built(context)))
        except InputError as error:
            self.report({"ERROR"}, sentence(str(error)))
            return {"CANCELLED"}
        return self.execute(context)

    def read(self, inputs: Any) -> None:
        """Take over the current values.

        Parameters
        ----------
        inputs : bpy.types.NodeInputs
            Of the node "ISC Dichromatic".
        """
        raise NotImplementedError


class ISC_OT_recolour(_NodeEdit, bpy.types.Operator):
    """Change the reflectance under the same light and highlights."""

    bl_idname = "isc.recolour"
    bl_label = "Recolor"
    bl_description = "Change hue, saturation and value of the object's base color"

    hue: FloatProperty(
        name="Hue",
        description="Rotation of the hue; 0.5 is as in the photo, 0 and 1 the opposite hue",
        default=0.5,
        min=0,
        max=1,
    )
    saturation: FloatProperty(
        name="Saturation",
        description="Factor of the saturation; 0 is gray, 1 is as in the photo",
        default=1,
        min=0,
        max=2,
    )
    value: FloatProperty(
        name="Value",
        description="Factor of the brightness; 1 is as in the photo",
        default=1,
        min=0,
        max=2,
    )

    def read(self, inputs: Any) -> None:
        """Take over the current values; see `_NodeEdit`.

        Parameters
        ----------
        inputs : bpy.types.NodeInputs
            Of the node "ISC Dichromatic".
        """
        self.hue, self.saturation, self.value = (
            inputs[name].default_value for name in ("Hue", "Saturation", "Value")
        )

    def edit(self, built: BuiltObject) -> None:
        """Set the node's inputs; see `EditOperator`.

        Parameters
        ----------
        built : BuiltObject
            The active object; afterwards no other object shares its material.

        Raises
        ------
        InputError
            As `dichromatic_inputs`.
        """
        inputs = single_user_inputs(built)
        inputs["Hue"].default_value = self.hue
        inputs["Saturation"].default_value = self.saturation
        inputs["Value"].default_value = self.value


class ISC_OT_dichromatic(_NodeEdit, bpy.types.Operator):
    """Change the proportion of diffuse and specular light."""

    bl_idname = "isc.dichromatic"
    bl_label = "Diffuse and Specular Gain"
    bl_description = "Scale the object's diffuse and specular reflection"

    diffuse_gain: FloatProperty(
        name="Diffuse",
        description="Factor of the diffuse reflection",
        default=1,
        min=0,
        max=10,
    )
    specular_gain: FloatProperty(
        name="Specular",
        description="Factor of the highlights; 0 is diffuse",
        default=1,
        min=0,
        max=10,
    )

    def read(self, inputs: Any) -> None:
        """Take over the current values; see `_NodeEdit`.

        Parameters
        ----------
        inputs : bpy.types.NodeInputs
            Of the node "ISC Dichromatic".
        """
        self.diffuse_gain = inputs["Diffuse Gain"].default_value
        self.specular_gain = inputs["Specular Gain"].default_value

    def edit(self, built: BuiltObject) -> None:
        """Set the nodes' inputs, of the lobe and of the photo's highlights; see `EditOperator`.

        Parameters
        ----------
        built : BuiltObject
            The active object; afterwards no other object shares its material.

        Raises
        ------
        InputError
            As `dichromatic_inputs`.
        """
        single_user_inputs(built)["Diffuse Gain"].default_value = self.diffuse_gain
        set_specular_gain(find_material(built.object), self.specular_gain)


class ISC_OT_photo_highlights(EditOperator, bpy.types.Operator):
    """Show the photo's own highlights, or those of the surface."""

    bl_idname = "isc.photo_highlights"
    bl_label = "Photo Highlights"
    bl_description = (
        "Show the photo's highlights instead of the material's until light, camera or object move"
    )

    show: BoolProperty(name="Show", description="Show the highlights of the photo", default=True)

    def edit(self, built: BuiltObject) -> None:
        """Add or remove the layer; see `EditOperator`.

        Parameters
        ----------
        built : BuiltObject
            The active object; afterwards no other object shares its material.

        Raises
        ------
        InputError
            As `dichromatic_inputs`, or if the material has no such image.
        """
        single_user_inputs(built)
        material = find_material(built.object) or built.material
        if not self.show:
            hide_highlights(material)
        elif can_show_highlights(material):
            show_highlights(material)
        else:
            raise InputError(
                f"{material.name} has no image of the photo's highlights: create the object again"
            )


class ISC_OT_own_material(EditOperator, bpy.types.Operator):
    """Give the object a material that no copy shares."""

    bl_idname = "isc.own_material"
    bl_label = "Make Material Single-User"
    bl_description = "Give the object its own material, so that edits do not affect its copies"

    def edit(self, built: BuiltObject) -> None:
        """Copy the material; see `EditOperator`.

        Parameters
        ----------
        built : BuiltObject
            The active object; afterwards no other object shares its material.

        Raises
        ------
        InputError
            As `dichromatic_inputs`.
        """
        single_user_inputs(built)


class ISC_OT_relight(EditOperator, bpy.types.Operator):
    """Replace the environment map by a sun, or restore it."""

    bl_idname = "isc.relight"
    bl_label = "Relight"
    bl_description = "Light the object with one sun and uniform light, or as in the photo"

    light: EnumProperty(
        name="Light", description="Light of the object", items=_LIGHTS, default="OPTIMAL"
    )
    direction: FloatVectorProperty(
        name="Direction",
        description=(
            "Direction from the object toward the sun (right, away from the viewer, up), "
            "of any length"
        ),
        subtype="XYZ",
        size=3,
        default=(-0.5, -0.7, 0.5),
    )
    strength: FloatProperty(
        name="Strength",
        description="Factor of the sun's strength",
        default=1,
        min=0,
        soft_max=10,
    )
    ambient: FloatProperty(
        name="Uniform Light",
        description="Factor of the light from all directions",
        default=1,
        min=0,
        soft_max=10,
    )

    def edit(self, built: BuiltObject) -> None:
        """Set the sun and the world; see `EditOperator`.

        Parameters
        ----------
        built : BuiltObject
            The active object and what belongs to it; of several objects of a photo, the light is
            that of the largest one.

        Raises
        ------
        InputError
            If the object does not store its light, or the direction is zero.
        """
        built = light_owner(built)
        obj = built.object
        if self.light == "RECOVERED":
            relight(obj, False, built.scene)
            return
        direction, irradiance, ambient = (
            _stored_vector(obj, f"isc_sun_{name}") for name in ("direction", "strength", "ambient")
        )
        if self.light == "CHOSEN":
            right, away, up = self.direction
            direction = np.array([right, up, -away])  # in the camera frame
        length = float(np.linalg.norm(direction))
        if length < 1e-9:
            raise InputError("the direction is zero: enter another")
        collection = sun_collection(obj, built.scene or bpy.context.scene)
        ensure_sun(obj[KEY], collection, direction / length, self.strength * irradiance)
        set_sun_mix(built.world, self.ambient * ambient, True)
        hide_lamps(obj[KEY], True)


def dichromatic_inputs(built: BuiltObject) -> Any:
    """Return the inputs of the material's node "ISC Dichromatic".

    Parameters
    ----------
    built : BuiltObject
        The object.

    Returns
    -------
    bpy.types.NodeInputs
        The inputs.

    Raises
    ------
    InputError
        If the node is missing, the object has another material, or the material is linked from
        another file.
    """
    if has_other_material(built.object, built.material):
        raise InputError(
            f"{built.object.name} has another material: assign {built.material.name} to it first"
        )
    node = dichromatic_node(built.material)
    if node is None:
        raise InputError("the material has no node group ISC Dichromatic: create the object again")
    if built.material.library is not None:
        raise InputError(
            f"{built.material.name} is linked from another file: "
            "make it local first (Object > Relations > Make Local)"
        )
    return node.inputs


def single_user_inputs(built: BuiltObject) -> Any:
    """Return the inputs of the node "ISC Dichromatic" in a material that no copy shares.

    Parameters
    ----------
    built : BuiltObject
        The object; gets its own material if it shares one.

    Returns
    -------
    bpy.types.NodeInputs
        The inputs.

    Raises
    ------
    InputError
        As `dichromatic_inputs`.
    """
    dichromatic_inputs(built)
    own = make_material_single_user(built.object, built.material)
    return dichromatic_inputs(replace(built, material=own))


def _stored_vector(obj: Any, name: str) -> np.ndarray:
    if name not in obj:
        raise InputError(f"{obj.name} does not store its light: import its result again")
    return np.array(obj[name], np.float64)
