"""Which settings have no effect with the others, and why; the panels disable these settings."""

from typing import Any

# Models of `isc_core` that solve for light and shape together, and those that remove highlights.
SIRFS_MODELS = ("joint", "mdr", "mbp", "sirfs")
SEPARATING_MODELS = ("joint", "mdr", "mbp")
_MARKS = ("highlights", "not_highlights")


def unused_reason(settings: Any, name: str) -> str:
    """Return why a setting has no effect now.

    Parameters
    ----------
    settings : ISC_PG_settings
        The panel's settings.
    name : str
        Name of the setting.

    Returns
    -------
    str
        One short line; "" where the setting has an effect.
    """
    model = settings.bl_rna.properties["model"].enum_items[settings.model].name
    if name in (*_MARKS, "highlight_odds") and settings.model != "joint":
        return "Requires the Joint model"
    if name in _MARKS and settings.each:
        return "Not used with Each Object"
    if name in ("separator", "refine") and settings.model not in SEPARATING_MODELS:
        return f"{model} keeps highlights"
    if name in ("illumination", "light_color") and settings.model not in SIRFS_MODELS:
        return f"{model} recovers no light"
    if name in ("back", "triangles") and settings.displacement:
        return "Not used with Displacement"
    if name == "samples" and not settings.own_scene:
        return "Used with New Scene only"
    return ""
