"""Figures 1.2 to 1.5: classical shape from shading, and images with their characteristics.

The sphere and the vase are closed forms, lit by one distant light as both methods assume:
brightness = max(0, n . l). The vase is z = sqrt(f(y)^2 - x^2) with f(y) = .15 - .1 y (6 y + 1)^2 (y
- 1)^2 (3 y - 2), the usual one in comparisons of such methods. The third object has known height,
but its own albedo and light. Both methods are models of `isc_core.baselines`, which also estimate
the light.

Citation: P.-S. Tsai and M. Shah (1994), doi:10.1016/0262-8856(94)90002-7; K. Ikeuchi and B. K. P.
Horn (1981), doi:10.1016/0004-3702(81)90023-0; the vase: R. Zhang, P.-S. Tsai, J. E. Cryer and M.
Shah, "Shape from shading: a survey" (1999), doi:10.1109/34.784284.

Limits: it is not known which methods and objects the thesis shows in 1.2 and 1.3.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from isc_core import baselines
from isc_core.evaluation.metrics import angular_error, height_error, truth_normal
from isc_core.shading.lights import toward

from ..drawing.panels import COLOURS, Panel, characteristic_panels, panel_figure
from ..images.subject import Subject
from ..measuring.context import Context, JsonRow
from ..measuring.decompositions import decompose_subject, illumination_of
from ..report.item import ItemContent, ItemTable, ThesisItem

LIGHT = toward(-0.4, 0.5, 1.0)
ALBEDO, _DARKEST = 0.8, 1e-3
_NAMES = {
    "sfs-tsai-shah": "Tsai & Shah 1994",
    "sfs-ikeuchi-horn": "Ikeuchi & Horn 1981",
    "naive": "flat (doing nothing)",
}


@dataclass(frozen=True, eq=False)
class ShadedObject:
    """An object of known shape.

    Attributes
    ----------
    name : str
        Name in tables.
    image : (H, W, 3) ndarray
        Linear image.
    mask : (H, W) ndarray
        Boolean mask.
    height : (H, W) ndarray
        Pixels; NaN where unknown.
    """

    name: str
    image: np.ndarray
    mask: np.ndarray
    height: np.ndarray


def sphere(size: int) -> ShadedObject:
    """Render a ball under `LIGHT` that fills 90 % of the picture.

    Parameters
    ----------
    size : int
        Pixels per side of the picture.

    Returns
    -------
    ShadedObject
    """
    radius = 0.45 * size
    axis = (np.arange(size) + 0.5 - size / 2) / radius
    x, y = np.meshgrid(axis, -axis)
    square = 1 - x * x - y * y
    mask = square > 0
    z = np.sqrt(np.maximum(square, 0))
    return _lit("sphere", np.stack([x, y, z], -1), mask, radius * z)


def vase(size: int) -> ShadedObject:
    """Render the vase of the survey under `LIGHT`, as high as the picture.

    Parameters
    ----------
    size : int
        Pixels per side of the picture.

    Returns
    -------
    ShadedObject
    """
    x, y = np.meshgrid((np.arange(size) + 0.5) / size - 0.5, 1 - (np.arange(size) + 0.5) / size)
    f = 0.15 - 0.1 * y * (6 * y + 1) ** 2 * (y - 1) ** 2 * (3 * y - 2)
    slope = np.gradient(f[:, 0], y[:, 0])[:, None]
    square = f * f - x * x
    mask = (square > 0) & (y > 0.02) & (y < 0.98)
    z = np.sqrt(np.maximum(square, 0))
    # The gradient of x^2 + z^2 - f(y)^2, which needs no division where the vase turns away.
    normal = np.stack([x, -f * slope, z], -1)
    return _lit(
        "vase",
        normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12),
        mask,
        size * z,
    )


def _lit(name: str, normal: np.ndarray, mask: np.ndarray, height: np.ndarray) -> ShadedObject:
    shade = np.where(mask, np.maximum(normal @ LIGHT, 0), 0)
    return ShadedObject(
        name, ALBEDO * np.repeat(shade[..., None], 3, axis=2), mask, np.where(mask, height, np.nan)
    )


def shaded_objects(context: Context) -> tuple[ShadedObject, ...]:
    """Return the sphere, the vase, and the first diffuse subject of known height.

    Parameters
    ----------
    context : Context
        The run; its pictures are smaller if it is quick.

    Returns
    -------
    tuple of ShadedObject
        Two if there is no such subject.
    """
    size = 64 if context.quick else 160
    found: list[ShadedObject] = [sphere(size), vase(size)]
    for subject in context.subjects("diffuse"):
        if subject.truth is not None:
            height = np.where(subject.mask, subject.truth.height, np.nan)
            return (*found, ShadedObject(subject.name, subject.image, subject.mask, height))
    return tuple(found)


@dataclass(frozen=True, eq=False)
class RecoveredShape:
    """Result of a method.

    Attributes
    ----------
    height : (H, W) ndarray
        Pixels.
    angle : (H, W) ndarray
        Degrees between true and estimated normals; NaN where unknown.
    height_share : float
        Mean height error after the best offset / range of the true height.
    """

    height: np.ndarray
    angle: np.ndarray
    height_share: float

    @property
    def mean_angle(self) -> float:
        """Mean angle, degrees."""
        return float(np.nanmean(self.angle))


def recover_shape(shaded: ShadedObject, method: str) -> RecoveredShape:
    """Estimate the shape of an object.

    Parameters
    ----------
    shaded : ShadedObject
        The object.
    method : str
        One of `baselines.METHODS`.

    Returns
    -------
    RecoveredShape
        Shape and errors.

    Raises
    ------
    InputError
        If the method is unknown.
    """
    log_image = np.log(
        np.maximum(
            np.where(shaded.mask[..., None], shaded.image, 1), _DARKEST * float(shaded.image.max())
        )
    )
    height = baselines.estimate(method, log_image, shaded.mask).height
    true, found = truth_normal(shaded.height), truth_normal(height)
    known = shaded.mask & np.isfinite(true[..., 2])
    angle = np.full(shaded.mask.shape, np.nan)
    angle[known] = [
        np.degrees(angular_error(one, other))
        for one, other in zip(true[known], found[known], strict=True)
    ]
    share = height_error(shaded.height, height) / max(
        float(np.ptp(shaded.height[np.isfinite(shaded.height)])), 1e-9
    )
    return RecoveredShape(height, angle, share)


def _errors(context: Context) -> list[JsonRow]:
    def compute() -> list[JsonRow]:
        rows: list[JsonRow] = []
        for shaded in shaded_objects(context):
            for method in _NAMES:
                found = recover_shape(shaded, method)
                rows.append(
                    {
                        "object": shaded.name,
                        "method": method,
                        "height": found.height_share,
                        "angle": found.mean_angle,
                    }
                )
        return rows

    return context.rows("shape from shading", compute)


def _shape_from_shading(method: str, context: Context) -> ItemContent:
    shown = []
    for shaded in shaded_objects(context):
        found = recover_shape(shaded, method)
        true = shaded.height - np.nanmin(shaded.height)
        ends = 0.0, float(np.nanmax(true))
        shown += [
            Panel(f"{shaded.name}: image", shaded.image, shaded.mask),
            Panel("true height (pixels)", true, shaded.mask, ends),
            Panel(
                "estimated height (pixels)",
                found.height + np.nanmedian((true - found.height)[shaded.mask]),
                shaded.mask,
                ends,
            ),
            Panel("error of the normals (degrees)", found.angle, shaded.mask, (0, 60)),
        ]
    rows = _errors(context)
    cells = [
        (
            str(r["object"]),
            _NAMES[str(r["method"])],
            float(r["height"] or 0),
            float(r["angle"] or 0),
        )
        for r in rows
    ]
    header = ("object", "method", "height error / range", "normal error (degrees)")
    table = ItemTable(
        header,
        tuple(cells),
        "Mean errors inside the mask; heights after the best offset. The light is "
        "estimated as well.",
    )
    own = [float(r["angle"] or 0) for r in rows if r["method"] == method]
    flat = [float(r["angle"] or 0) for r in rows if r["method"] == "naive"]
    better = sum(a < b for a, b in zip(own, flat, strict=True))
    angles = ", ".join(f"{angle:.0f}" for angle in own)
    here = (
        f"{_NAMES[method]}: normals off by {angles} degrees; better than a flat shape "
        f"on {better} of {len(own)} objects."
    )
    text = (
        f"{here} Heights share a colour scale per object; errors above 60 degrees are "
        "drawn as 60. The brightness of the last object depends on albedo as well as "
        "shape."
    )
    return ItemContent((table,), (panel_figure(shown, 4),), text)


def _characteristics(kind: str, context: Context) -> ItemContent:
    subject: Subject = context.subjects(kind)[0]
    d = decompose_subject(context, subject)
    errors = d.identity_errors()
    table = ItemTable(
        ("identity", "largest error"),
        (
            ("image = diffuse + specular + residual", errors.image),
            ("diffuse = reflectance * shading", errors.shading_product),
            ("shading = exp(SH(normal))", errors.sh),
            ("length of the normals = 1", errors.normal_length),
        ),
        f"{subject.name}: accuracy of the identities. Errors of images are shares of "
        "the largest value; that of the shading is relative.",
    )
    share = float(d.specular[d.mask].sum() / d.image[d.mask].sum())
    state = (
        "all identities hold" if not errors.broken() else f"broken: {'; '.join(errors.broken())}"
    )
    text = (
        f"{subject.name}, the first subject of its kind, by `isc decompose --model "
        f"mdr --illumination {illumination_of(subject)}`: {100 * share:.1f} % of its "
        f"light was estimated as specular; {state}. {COLOURS}"
    )
    return ItemContent((table,), (panel_figure(characteristic_panels(d), 4),), text)


def _item(number: str, title: str, make: Callable[[Context], ItemContent]) -> ThesisItem:
    return ThesisItem("figure", number, title, make)


ITEMS: tuple[ThesisItem, ...] = (
    ThesisItem(
        "figure",
        "1.1",
        "Illustration of the introduction",
        None,
        "an illustration without computation or measurement",
    ),
    _item(
        "1.2",
        "Shape from shading: Tsai & Shah compared with the truth",
        partial(_shape_from_shading, "sfs-tsai-shah"),
    ),
    _item(
        "1.3",
        "Shape from shading: Ikeuchi & Horn compared with the truth",
        partial(_shape_from_shading, "sfs-ikeuchi-horn"),
    ),
    _item(
        "1.4",
        "An image with significant specularity and its characteristics",
        partial(_characteristics, "specular"),
    ),
    _item(
        "1.5", "A synthetic image and its characteristics", partial(_characteristics, "synthetic")
    ),
)
