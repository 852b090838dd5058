"""The contact sheet: one image with all maps of a result.

Exposure: input, diffuse and specular share one exposure, so that they can be compared; reflectance
has its own, and so has shading, which the light shares unless it would be too bright. An exposure
maps the 99.5th percentile of the largest channel inside the mask to 0.95. Pictures are blended in
linear light and encoded as sRGB at the end. Maps are cropped to the object and scaled with their
mask as weight, so that no black bleeds in at the edge.

`relief_panel` draws the height, `other_views` the object from both sides and in another light. The
light is shown on a white sphere.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path, PurePath

import numpy as np
from PIL import Image

from ..errors import InputError
from ..imaging.bounding_box import FramePart
from ..imaging.srgb import srgb_to_linear
from ..io.atomic import new_file
from ..scene.decomposition import Decomposition, Separation
from ..scene.diagnostics import LobeDiagnostics, LobeStatus
from ..scene.lobe_fit import LobeFit, LobeFitOutcome
from ..shading.sphere import sphere_normals
from ..shading.spherical_harmonics import real_sh
from .error_colors import SCALE, error_colors
from .other_views import relit_panel, turned_panels
from .panels import MARGIN, SIDE, Frame, Panel, exposure
from .relief_panel import relief_panel
from .sheet_layout import sheet_of

_SMALL = 480  # pixels: long side of a sheet's thumbnail
_TOO_BRIGHT, _TOO_DARK = (1.0, 0.42, 0.04), (0.06, 0.3, 1.0)  # linear
_NO_ERROR = (0.06, 0.06, 0.06)
# Maps that panels are drawn from.
_SHOWN = ("image", "diffuse", "specular", "reflectance", "shading", "normal", "height")
_FULL_ERROR = 0.1  # of the photo's white: errors above it have the full colour


def contact_sheet(decomposition: Decomposition, part: FramePart | None = None) -> Image.Image:
    """Draw the sheet of a decomposition: twelve panels, 4 x 3, and a title from its provenance.

    Parameters
    ----------
    decomposition : Decomposition
    part : FramePart, optional
        The part of a frame that its maps are of; the title names the size of the frame.

    Returns
    -------
    PIL.Image.Image
    """
    d = decomposition
    frame = Frame.around(d.mask)
    small = {name: frame.scaled(getattr(d, name)) for name in _SHOWN}
    photo, albedo, light = (
        exposure(frame.inside(values)) for values in (d.image, d.reflectance, d.shading)
    )
    share = f"{100 * _share(d.specular, d.image, frame):.1f} % of the light"
    colors = [
        ("image", photo, "Input", ""),
        ("diffuse", photo, "Diffuse", ""),
        ("specular", photo, "Specular", share),
        ("reflectance", albedo, "Reflectance", ""),
        ("shading", light, "Shading", ""),
    ]
    panels = [
        Panel(gain * small[name], frame.coverage, label, remark)
        for name, gain, label, remark in colors
    ]
    panels.append(
        Panel(
            _decoded(0.5 + 0.5 * small["normal"], frame),
            frame.coverage,
            "Normals",
            "x right, y up, z to viewer",
        )
    )
    with ThreadPoolExecutor(1) as pool:  # half of the work
        turned = pool.submit(turned_panels, d, frame, small, photo)
        panels += [relief_panel(d, frame, small), _light_panel(d, light)]
        last = [relit_panel(d, frame, small), _error_panel(d, frame)]
        panels += [*turned.result(), *last]
    shape = d.mask.shape if part is None else part.shape
    return sheet_of(*_title(d, shape), panels, columns=4)


def _light_panel(d: Decomposition, gain: float) -> Panel:
    """The light on a white sphere, which has more normals than the object; darker than by `gain` if
    it would be too bright.
    """
    ball, coverage = _ball(d.illumination)
    gain = min(gain, exposure(ball[coverage > 0.5]))
    return Panel(gain * ball, coverage, "Light", "on a white sphere")


def _error_panel(d: Decomposition, frame: Frame) -> Panel:
    """The expected error of the normals, or the confidence if it is unknown."""
    if d.expected_error is None:
        grey = _decoded(np.clip(frame.scaled(d.confidence), 0, 1), frame)
        color = np.repeat(grey[..., None], 3, axis=2)
        return Panel(color, frame.coverage, "Confidence", "white is 1")
    color = _decoded(error_colors(frame.scaled(d.expected_error.normal)), frame)
    keys = tuple((f"{step}°", code) for step, code in SCALE)
    return Panel(color, frame.coverage, "Normals off by", "", keys)


def _decoded(coded: np.ndarray, frame: Frame) -> np.ndarray:
    """Linear light of sRGB values (N, N) or (N, N, 3) on the object; 0 elsewhere."""
    found, covered = np.zeros(coded.shape, np.float32), frame.coverage > 0
    found[covered] = srgb_to_linear(coded[covered].astype(np.float32))
    return found


def thumbnail(sheet: Path, target: Path) -> None:
    """Write a small JPEG of a sheet, for pages that show many.

    Parameters
    ----------
    sheet, target : Path

    Raises
    ------
    InputError
        If a file cannot be read or written.
    """
    try:
        with Image.open(sheet) as picture:
            small = picture.convert("RGB")
    except OSError as error:
        raise InputError(f"{sheet}: cannot be read ({error})") from error
    small.thumbnail((_SMALL, _SMALL), reducing_gap=2.0)
    with new_file(target) as partial:
        small.save(partial, "JPEG", quality=85)


def separation_sheet(
    separation: Separation, image: np.ndarray, mask: np.ndarray, title: str = ""
) -> Image.Image:
    """Draw the sheet of a separation, 3 x 1: input, diffuse, specular.

    Parameters
    ----------
    separation : Separation
    image : (H, W, 3) ndarray
        Linear.
    mask : (H, W) bool ndarray
    title : str

    Returns
    -------
    PIL.Image.Image
    """
    frame = Frame.around(mask)
    gain = exposure(frame.inside(image))
    share = f"{100 * _share(separation.specular, image, frame):.1f} % of the light"
    maps = [
        (image, "Input", ""),
        (separation.diffuse, "Diffuse", ""),
        (separation.specular, "Specular", share),
    ]
    panels = [
        Panel(gain * frame.scaled(values), frame.coverage, label, remark)
        for values, label, remark in maps
    ]
    return sheet_of(
        title or "Separation", f"{mask.shape[1]} x {mask.shape[0]} px", panels, columns=3
    )


@dataclass(frozen=True)
class LabelledSeparation:
    """A separation in a comparison: the method's name, a remark in grey, and the layers."""

    label: str
    remark: str
    split: Separation


def comparison_sheet(
    title: str,
    image: np.ndarray,
    mask: np.ndarray,
    separations: Sequence[LabelledSeparation],
    truth: tuple[np.ndarray, np.ndarray] | None = None,
) -> Image.Image:
    """Draw many separations of one photo: diffuse layer, specular layer and error of each.

    Errors of the diffuse layer are orange where too much light remains and blue where too much was
    removed, saturated from a tenth of the photo's white. Without ground truth the confidence is
    shown instead, white where it is 1. The first three panels are the photo and the ground truth,
    or the photo, its smallest channel and its chromaticity, the inputs of colour-based methods.

    Parameters
    ----------
    title : str
    image : (H, W, 3) ndarray
        Linear.
    mask : (H, W) bool ndarray
    separations : sequence
        Separations to compare, with labels.
    truth : tuple of (H, W, 3) ndarray, optional
        The true diffuse and specular layer.

    Returns
    -------
    PIL.Image.Image
    """
    frame = Frame.around(mask)
    gain = exposure(frame.inside(image))

    def panel(values: np.ndarray, label: str, remark: str = "") -> Panel:
        return Panel(frame.scaled(values), frame.coverage, label, remark)

    if truth is None:
        low, total = image.min(axis=2, keepdims=True), image.sum(axis=2, keepdims=True)
        second = (
            panel(gain * np.repeat(low, 3, axis=2), "Smallest channel"),
            panel(image / np.maximum(total, 1e-9), "Chromaticity"),
        )
    else:
        share = f"{100 * _share(truth[1], image, frame):.1f} % of the light"
        second = (
            panel(gain * truth[0], "True diffuse"),
            panel(gain * truth[1], "True specular", share),
        )
    panels = [panel(gain * image, "Input"), *second]
    for entry in separations:
        split = entry.split
        share = f"{100 * _share(split.specular, image, frame):.1f} % of the light"
        panels += [
            panel(gain * split.diffuse, entry.label, entry.remark),
            panel(gain * split.specular, "Specular", share),
        ]
        if truth is None:
            panels.append(
                panel(
                    np.repeat(srgb_to_linear(split.confidence)[..., None], 3, axis=2), "Confidence"
                )
            )
        else:
            panels.append(
                panel(
                    _error_colors(gain * (split.diffuse - truth[0])),
                    "Error",
                    "orange: too little removed, blue: too much",
                )
            )
    return sheet_of(
        title,
        f"{mask.shape[1]} x {mask.shape[0]} px   ·   {len(separations)} separations",
        panels,
        columns=6,
    )


@dataclass(frozen=True, eq=False)
class MapPanel:
    """A map of the object on a sheet.

    Attributes
    ----------
    values : (H, W, 3) ndarray
        Linear.
    mask : (H, W) bool ndarray
    label, remark : str
    own_exposure : bool
        Whether to use its own exposure instead of the first map's.
    """

    values: np.ndarray
    mask: np.ndarray
    label: str
    remark: str = ""
    own_exposure: bool = False


def edit_sheet(
    title: str,
    subtitle: str,
    maps: Sequence[MapPanel],
    others: Sequence[Panel] = (),
    columns: int = 4,
) -> Image.Image:
    """Draw the sheet of an edit.

    Parameters
    ----------
    title, subtitle : str
    maps : sequence of MapPanel
        Shown with the exposure of the first.
    others : sequence of Panel
        (320, 320) pixels each, unchanged.
    columns : int

    Returns
    -------
    PIL.Image.Image
    """
    first = exposure(maps[0].values[maps[0].mask])
    panels = []
    for entry in maps:
        frame, gain = (
            Frame.around(entry.mask),
            exposure(entry.values[entry.mask]) if entry.own_exposure else first,
        )
        panels.append(
            Panel(gain * frame.scaled(entry.values), frame.coverage, entry.label, entry.remark)
        )
    panels += others
    return sheet_of(title, subtitle, panels, min(columns, len(panels)))


def _error_colors(error: np.ndarray) -> np.ndarray:
    """Errors (H, W, 3), 1 being the photo's white, as colours (H, W, 3), linear."""
    mean = error.mean(axis=2, keepdims=True)
    weight = np.clip(np.abs(mean) / _FULL_ERROR, 0, 1)
    return (1 - weight) * np.array(_NO_ERROR) + weight * np.where(
        mean > 0, np.array(_TOO_BRIGHT), np.array(_TOO_DARK)
    )


def _share(part: np.ndarray, whole: np.ndarray, frame: Frame) -> float:
    light, of = (float(frame.inside(one).sum(dtype=np.float64)) for one in (part, whole))
    return light / max(of, 1e-9)


def _ball(illumination: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A white sphere under the light, (N, N, 3), and its coverage, (N, N)."""
    normal, coverage = sphere_normals(SIDE, SIDE * (0.5 - MARGIN) * 0.9)
    seen, color = coverage > 0, np.zeros((SIDE, SIDE, 3), np.float32)
    color[seen] = np.exp(real_sh(normal[seen]) @ illumination)
    return color, coverage.astype(np.float32)


def _title(d: Decomposition, shape: tuple[int, ...]) -> tuple[str, str]:
    given, settings = d.provenance.input, d.provenance.settings
    diagnostics = d.provenance.diagnostics
    name = PurePath(str(given.get("name", ""))).name or "Decomposition"
    if given.get("object"):
        name += f", object {given['object']}"
    parts = [f"{shape[1]} x {shape[0]} px"]
    parts += [
        str(settings[key]) for key in ("model", "separator", "illumination") if settings.get(key)
    ]
    if diagnostics.loss is not None:
        parts.append(f"loss {diagnostics.loss:.2f}")
    if diagnostics.converged is not None:
        parts.append("converged" if diagnostics.converged else "stopped early")
    if d.brdf is not None:
        parts.append(_gloss(d.brdf, diagnostics.lobe))
    if diagnostics.warnings:
        parts.append(f"note: {', '.join(one.kind for one in diagnostics.warnings)}")
    return name, "   ·   ".join(parts)


def _gloss(fit: LobeFit, lobe: LobeDiagnostics | None) -> str:
    """Summary of the fit; roughness as in Blender and glTF."""
    if lobe is not None and lobe.status == LobeStatus.HIDDEN:
        return "highlights hidden by clipping"
    if fit.blender_roughness is None:
        return (
            "no highlights" if fit.outcome == LobeFitOutcome.NO_SPECULAR else "gloss undetermined"
        )
    return f"roughness {'' if fit.determined else 'at most '}{fit.blender_roughness:.2f}"
