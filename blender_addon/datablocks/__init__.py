"""Blender's datablocks as ISC marks, finds and fills them; what the modules of `scene` share."""
