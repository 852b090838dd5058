"""Small helpers for node trees."""

from typing import Any

import bpy


def node_tree(block: Any) -> bpy.types.NodeTree:
    """The tree of a material or world; before Blender 5 it has to be asked for."""
    if block.node_tree is None:
        block.use_nodes = True
    return block.node_tree


def add_node(
    tree: bpy.types.NodeTree, kind: str, place: tuple[float, float], **settings: Any
) -> bpy.types.Node:
    """A node of `ShaderNode<kind>` (or the full name) at `place`, with its properties set."""
    node = tree.nodes.new(kind if kind.startswith("Node") else f"ShaderNode{kind}")
    node.location = place
    for name, value in settings.items():
        setattr(node, name, value)
    return node


def connect(
    tree: bpy.types.NodeTree, *wires: tuple[bpy.types.NodeSocket, bpy.types.NodeSocket]
) -> None:
    """Links each output to each input."""
    for source, target in wires:
        tree.links.new(source, target)
