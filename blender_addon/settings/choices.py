"""The items of the enumerations in the panels.

Blender saves the choice of an enumeration as a number. Every item therefore has an explicit number,
which must not change: files of earlier versions keep their choices when identifiers are renamed.
"""

from ..worker.commands import CERTAIN

EnumItem = tuple[str, str, str, int]


def numbered(*items: tuple[str, str, str]) -> tuple[EnumItem, ...]:
    """Return the items of an enumeration with the numbers that files store.

    Parameters
    ----------
    *items : tuple of str
        Identifier, label and tooltip.

    Returns
    -------
    tuple of EnumItem
        The items, numbered from 0.
    """
    return tuple((*item, number) for number, item in enumerate(items))


MODELS = numbered(
    (
        "joint",
        "Joint",
        "Separate highlights by color and shape, recover shape, light and reflectance, "
        "and continue the reflectance under the highlights",
    ),
    (
        "mdr",
        "MDR",
        "Remove highlights by color, then recover shape, light and reflectance from the "
        "diffuse image",
    ),
    (
        "mbp",
        "MBP",
        "Recover shape, light and reflectance from the photo, then remove highlights from the "
        "reflectance",
    ),
    ("sirfs", "SIRFS", "Recover shape, light and reflectance of a photo without highlights"),
    ("naive", "Naive", "Baseline: flat shape under uniform light"),
    ("retinex", "Retinex", "Baseline: smooth changes are shading, sharp changes are reflectance"),
    ("sfs-tsai-shah", "Tsai-Shah", "Baseline: linear shape from shading"),
    ("sfs-ikeuchi-horn", "Ikeuchi-Horn", "Baseline: regularized shape from shading"),
)
HIGHLIGHT_ODDS = numbered(
    (
        CERTAIN,
        "Certain",
        "Remove certain highlights only; print stays, and some highlights with it",
    ),
    ("1", "Likely", "Remove what is more likely a highlight than print, including some print"),
    ("0", "All", "Remove everything that looks like a highlight, including print"),
)
SEPARATORS = numbered(
    ("isc", "ISC", "Remove only what color proves to be a highlight"),
    (
        "network",
        "Network",
        "Network trained on rendered glossy objects; also separates highlights from white "
        "reflectance, where color alone cannot",
    ),
    (
        "sparse_coding",
        "Sparse Coding",
        "Remove the part of the photo that a dictionary of diffuse patches cannot represent",
    ),
    (
        "chaotic_segmentation",
        "Chaotic Segmentation",
        "Remove what exceeds thresholds found by chaotic search, and inpaint it",
    ),
    ("shen_2013", "Shen 2013", "Real-time: chromaticity ranges by pixel clustering"),
    ("shen_2009", "Shen 2009", "Modified specular-free image"),
    ("akashi_2016", "Akashi 2016", "Sparse non-negative matrix factorization"),
    ("kim_2013", "Kim 2013", "Dark channel prior and optimization"),
    ("yang_2010", "Yang 2010", "Bilateral filter of the maximum chromaticity"),
    ("tan_2005", "Tan 2005", "Iterative comparison of neighboring chromaticities"),
    (
        "mallick_2006",
        "Mallick 2006",
        "Partial differential equation in a color space aligned with the light",
    ),
    ("yoon_2006", "Yoon 2006", "Ratios of neighboring pixels in specular-free images"),
    ("none", "None", "Keep the highlights"),
)
ILLUMINATIONS = numbered(
    ("photo", "Photo", "Any light, in a photo with balanced colors"),
    ("natural", "Natural", "Smooth light of any color from all directions"),
    ("laboratory", "Laboratory", "One strong light source in a dark room"),
)
LIGHT_COLORS = numbered(
    ("balanced", "Balanced", "Nearly white, as the camera's white balance leaves it"),
    (
        "estimate",
        "Estimate",
        "Estimate the color from the highlights, for warm or cold light; nearly white where they "
        "do not determine it",
    ),
    ("free", "Any", "Highlights are white, but diffuse light may have any color"),
    (
        "toned",
        "Toned",
        "A gray photo with a tone, such as sepia, which becomes part of the base color",
    ),
    ("custom", "Custom", "Use the given color"),
)
CAMERAS = numbered(
    (
        "auto",
        "Automatic",
        "Use the focal length in the photo's metadata, or an orthographic camera without one",
    ),
    ("orthographic", "Orthographic", "Assume parallel rays"),
    ("focal_length", "Perspective", "Use the given focal length"),
)
MASK_SOURCES = numbered(
    (
        "ALPHA",
        "Automatic",
        "Use the photo's transparency or black background; without either, find the object",
    ),
    (
        "IMAGE",
        "Image",
        "Use another image, in which the object is white on black or opaque on transparent",
    ),
)
SPECULAR_SOURCES = numbered(
    (
        "lobe",
        "Material",
        "Use the recovered roughness and specular level; highlights move with light and view",
    ),
    ("image", "Photo", "Use the photo's highlights, fixed to the surface"),
    ("none", "None", "Create an object without highlights"),
)
BACKS = numbered(
    ("open", "Open", "Build no back"),
    ("flat", "Flat", "Build a plane, and a wall along the outline, for reliefs"),
    ("rounded", "Rounded", "Build a back that is as round as the outline"),
    ("mirrored", "Mirrored", "Mirror the visible side"),
)
OWN_SHADOWS_ITEMS = numbered(
    (
        "auto",
        "Auto",
        "On in a scene with other objects, off in a new scene; an updated object keeps its setting",
    ),
    (
        "on",
        "On",
        "Cast shadows, also on the object itself, in addition to those in the recovered light",
    ),
    ("off", "Off", "Cast no shadows; the object looks as in the photo"),
)
TEXTURE_SIZES = numbered(
    ("photo", "Photo", "Use the resolution of the photo"),
    ("4096", "4K", "At most 4096 pixels"),
    ("2048", "2K", "At most 2048 pixels"),
    ("1024", "1K", "At most 1024 pixels"),
    ("maps", "Maps", "Use the resolution of the maps, which Size sets"),
)
