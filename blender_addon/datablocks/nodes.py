"""Node trees: access to them, new nodes, links."""

from typing import Any

import bpy


def node_tree(block: Any) -> bpy.types.NodeTree:
    """Return the node tree of a material or world, created where needed (before Blender 5).

    Parameters
    ----------
    block : bpy.types.Material or bpy.types.World
        The datablock.

    Returns
    -------
    bpy.types.NodeTree
        Its node tree.
    """
    if block.node_tree is None:
        block.use_nodes = True
    return block.node_tree


def add_node(
    tree: bpy.types.NodeTree, kind: str, location: tuple[float, float], **settings: Any
) -> bpy.types.Node:
    """Add a node.

    Parameters
    ----------
    tree : bpy.types.NodeTree
        The tree.
    kind : str
        Type without the prefix "ShaderNode", or the full type.
    location : tuple of float
        Position in the node editor.
    **settings
        Properties of the node.

    Returns
    -------
    bpy.types.Node
        The node.
    """
    node = tree.nodes.new(kind if kind.startswith("Node") else f"ShaderNode{kind}")
    node.location = location
    for name, value in settings.items():
        setattr(node, name, value)
    return node


def connect(
    tree: bpy.types.NodeTree, *links: tuple[bpy.types.NodeSocket, bpy.types.NodeSocket]
) -> None:
    """Link pairs of an output and an input.

    Parameters
    ----------
    tree : bpy.types.NodeTree
        The tree.
    *links : tuple of bpy.types.NodeSocket
        Output and input.
    """
    for source, target in links:
        tree.links.new(source, target)
