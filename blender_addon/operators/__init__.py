"""Operators of the panels; `CLASSES` lists them for registration."""

from .asset import ISC_OT_save_asset
from .decompose import ISC_OT_confirm_overwrite, ISC_OT_decompose, ISC_OT_redo
from .edit import (
    ISC_OT_dichromatic,
    ISC_OT_own_material,
    ISC_OT_photo_highlights,
    ISC_OT_recolour,
    ISC_OT_relight,
)
from .export import ISC_OT_export, ISC_OT_export_textures
from .mask import ISC_OT_cut_mask, ISC_OT_draw_box, ISC_OT_new_mask, ISC_OT_take_mask
from .modal import ISC_OT_cancel
from .notes import ISC_OT_show_notes
from .photo_import import ISC_FH_photo, ISC_OT_photo_as_object
from .photo_points import (
    ISC_OT_auto_mask,
    ISC_OT_clear_highlights,
    ISC_OT_clear_points,
    ISC_OT_mark_highlight,
    ISC_OT_mark_point,
)
from .result import (
    ISC_OT_build_result,
    ISC_OT_import_result,
    ISC_OT_read_result,
    ISC_OT_return_to_scene,
)

CLASSES = (
    ISC_OT_photo_as_object,
    ISC_FH_photo,
    ISC_OT_decompose,
    ISC_OT_redo,
    ISC_OT_confirm_overwrite,
    ISC_OT_cancel,
    ISC_OT_show_notes,
    ISC_OT_cut_mask,
    ISC_OT_take_mask,
    ISC_OT_new_mask,
    ISC_OT_draw_box,
    ISC_OT_auto_mask,
    ISC_OT_mark_point,
    ISC_OT_clear_points,
    ISC_OT_mark_highlight,
    ISC_OT_clear_highlights,
    ISC_OT_build_result,
    ISC_OT_import_result,
    ISC_OT_read_result,
    ISC_OT_return_to_scene,
    ISC_OT_save_asset,
    ISC_OT_recolour,
    ISC_OT_dichromatic,
    ISC_OT_own_material,
    ISC_OT_photo_highlights,
    ISC_OT_relight,
    ISC_OT_export,
    ISC_OT_export_textures,
)
