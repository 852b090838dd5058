"""New images and a new mesh without users, created in short steps.

The window stays responsive between two steps. An undo may remove what was created since the last
undo step, and loading a file removes everything; Python references would then be invalid.
Datablocks are therefore identified by their `session_uid`, which is the same after an undo and is
not reused.
"""

from collections.abc import Generator, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import bpy

from .images import ImageFile, ImageRole, new_image
from .mesh import MeshArrays, fill_mesh

Outcome = TypeVar("Outcome")


@dataclass
class StagedBlocks:
    """New datablocks, until they are taken.

    Attributes
    ----------
    images : dict of ImageRole to int
        `session_uid` of the images, by role.
    mesh : int
        `session_uid` of the mesh; 0 before it is created.
    """

    images: dict[ImageRole, int] = field(default_factory=dict)
    mesh: int = 0

    @property
    def exist(self) -> bool:
        """Whether Blender still has all of them."""
        present = {block.session_uid for block in (*bpy.data.images, *bpy.data.meshes)}
        return present.issuperset((*self.images.values(), self.mesh))

    def take_image(self, role: ImageRole) -> bpy.types.Image | None:
        """Hand over an image, which is then no longer one of these.

        Parameters
        ----------
        role : ImageRole

        Returns
        -------
        bpy.types.Image or None
            None if there is none.
        """
        return _find(bpy.data.images, self.images.pop(role, 0))

    def take_mesh(self) -> bpy.types.Mesh:
        """Hand over the mesh, which is then no longer one of these.

        Returns
        -------
        bpy.types.Mesh
            The mesh.
        """
        number, self.mesh = self.mesh, 0
        return _find(bpy.data.meshes, number)

    def discard(self) -> None:
        """Remove the datablocks that were not handed over."""
        for blocks, number in (
            *((bpy.data.images, number) for number in self.images.values()),
            (bpy.data.meshes, self.mesh),
        ):
            if (block := _find(blocks, number)) is not None:
                blocks.remove(block)
        self.images.clear()
        self.mesh = 0


def stage(
    files: Mapping[ImageRole, ImageFile], arrays: MeshArrays, base: int = 0
) -> Generator[None, None, StagedBlocks]:
    """Create images and a mesh, one datablock per step; removes them if closed early.

    Parameters
    ----------
    files : dict of ImageRole to ImageFile
        Files of the images, by role.
    arrays : MeshArrays
        The mesh.
    base : int, optional
        `session_uid` of a mesh whose materials and properties are copied; 0 for none.

    Returns
    -------
    StagedBlocks
        The datablocks. Some are missing if an undo removed them in the meantime.
    """
    blocks, complete = StagedBlocks(), False
    try:
        for role, file in files.items():
            blocks.images[role] = new_image(file).session_uid
            yield
        mesh = _copy(base)
        blocks.mesh = mesh.session_uid
        fill_mesh(mesh, arrays)
        yield
        complete = True
        return blocks
    finally:
        if not complete:
            blocks.discard()


def run_to_end(steps: Generator[Any, None, Outcome]) -> Outcome:
    """Run all steps at once, where no window would be blocked.

    Parameters
    ----------
    steps : generator
        The steps.

    Returns
    -------
    Any
        What they return.
    """
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            outcome: Outcome = stop.value
            return outcome


def _copy(base: int) -> bpy.types.Mesh:
    """A copy of a mesh, without its shape keys; a new one if there is no such mesh."""
    source = _find(bpy.data.meshes, base)
    if source is None:
        return bpy.data.meshes.new("isc")
    mesh = source.copy()
    if mesh.shape_keys is not None:  # which only an object can remove
        holder = bpy.data.objects.new("isc", mesh)
        holder.shape_key_clear()
        bpy.data.objects.remove(holder)
    return mesh


def _find(blocks: Any, number: int) -> Any:
    return next((block for block in blocks if block.session_uid == number), None)
