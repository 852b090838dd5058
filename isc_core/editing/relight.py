"""Relighting: the object under the rotated recovered light, or under another light.

Equation: diffuse' = reflectance S'(n), with S' by the new light: exp(sum_k L'_k Y_k(n)), one
distant light with an ambient term, or the irradiance of an environment map (see
`shading.environment_map`). Highlights have one of these modes:

    keep     they do not change;
    scale    they follow their pixel's shading, specular' = specular S' / S, at most fourfold;
    remove   they vanish;
    render   a lobe is rendered under the new light, with the strength under which it has the
             present layer's energy in the present light.

A lobe under the present light is rendered with the distant light that best explains the specular
layer, or else with that of the fit, since the recovered light is too smooth for highlights; without
either, or where the new light is unrelated to the present one, with the recovered light. This light
rotates with a rotated light. By default ("auto") a
rotation fades from the present layer to the rendered one, by exp(-(angle / 10 degrees)^2) of the
angle by which this light moves: small rotations cause small changes, and a highlight far from its
original position is entirely rendered.

Citation: R. Ramamoorthi, P. Hanrahan 2001, doi:10.1145/383259.383317; H. Akbar 2016 (relighting).

Limits: no cast shadows, old or new: those of the photo remain in the reflectance. Light from behind
the object is unobserved.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError
from ..imaging.luminance import luminance
from ..imaging.window import as_map
from ..lobe_fitting.light_direction import explain_specular
from ..scene.decomposition import Decomposition
from ..shading.brdf.model import check_range
from ..shading.environment_map import environment_from_shading, resampled, shading_under
from ..shading.lights import VIEW, DirectionalLight
from ..shading.lobe_rendering import Lobe, lobe_in_environment, lobe_under
from ..shading.radiance import sh_shading
from .edited import Edited, edited, light_color
from .lobes import known_lobe, strength_of

HIGHLIGHTS = ("auto", "keep", "scale", "remove", "render")
_MAX_SCALE = 4.0  # largest factor by which scaling brightens a highlight
_ROWS = 32  # of environment maps for diffuse shading
_LOBE_ROWS = 16  # of environment maps for lobes, where each sample is expensive
_FADE = 10.0  # degrees of a light's rotation over which highlights change from kept to rendered


@dataclass(frozen=True, eq=False)
class NewLight:
    """A light of exactly one of three kinds; raises `InputError` otherwise.

    Attributes
    ----------
    coefficients : (9, 3) ndarray or None
        SH coefficients of log shading, Rec.709.
    directional : DirectionalLight or None
    environment : (rows, 2 rows, 3) ndarray or None
        Environment map of linear radiance, not negative.
    rotation : (3, 3) ndarray or None
        Rotation from the recovered light to `coefficients`; None for another light.
    """

    coefficients: np.ndarray | None = None
    directional: DirectionalLight | None = None
    environment: np.ndarray | None = None
    rotation: np.ndarray | None = None

    def __post_init__(self) -> None:
        if (
            sum(
                part is not None for part in (self.coefficients, self.directional, self.environment)
            )
            != 1
        ):
            raise InputError(
                "a new light needs exactly one of coefficients, directional and environment"
            )
        if self.environment is not None:
            shape = np.shape(self.environment)
            if len(shape) != 3 or shape[2] != 3:
                raise InputError(f"an environment map has shape {shape}: give (rows, 2 rows, 3)")
            if shape[1] != 2 * shape[0] or shape[0] < 2:
                raise InputError(
                    f"an environment map is twice as wide as high, not {shape[1]} x {shape[0]}: "
                    "use a full panorama"
                )
            check_range("the environment's radiance", self.environment, 0, np.inf)

    def shading(self, normals: np.ndarray) -> np.ndarray:
        """Return the shading of white diffuse surfaces.

        Parameters
        ----------
        normals : (N, 3) ndarray
            Unit normals. Camera frame: x right, y up, z toward the viewer.

        Returns
        -------
        (N, 3) ndarray
        """
        if self.coefficients is not None:
            return sh_shading(normals, self.coefficients)
        if self.directional is not None:
            return self.directional.shading(normals)
        return shading_under(
            np.asarray(self._environment(_ROWS), float), np.asarray(normals, float)
        )

    def lobe(self, lobe: Lobe, normals: np.ndarray, view: np.ndarray = VIEW) -> np.ndarray:
        """Return the radiance of a lobe of strength 1.

        Parameters
        ----------
        lobe : Lobe
        normals : (N, 3) ndarray
            Unit normals. Camera frame: x right, y up, z toward the viewer.
        view : (3,) or (N, 3) ndarray, optional
            Unit vectors toward the viewer.

        Returns
        -------
        (N, 3) ndarray
        """
        if self.directional is not None:
            ambient = np.broadcast_to(self.directional.ambient, (_LOBE_ROWS, 2 * _LOBE_ROWS, 3))
            direct = lobe_under(lobe, normals, self.directional, view)
            return direct + lobe_in_environment(lobe, normals, ambient, view)
        viewer = view if view.ndim == 1 else view.mean(axis=0) / np.linalg.norm(view.mean(axis=0))
        return lobe_in_environment(lobe, normals, self._environment(_LOBE_ROWS, viewer), view)

    def _environment(self, rows: int, viewer: np.ndarray = VIEW) -> np.ndarray:
        if self.coefficients is not None:
            return environment_from_shading(self.coefficients, rows, viewer=viewer)
        assert self.environment is not None
        return (
            resampled(self.environment, rows) if len(self.environment) > rows else self.environment
        )


@dataclass(frozen=True)
class Relighting:
    """Options of relighting. Raises `InputError` outside these ranges.

    Attributes
    ----------
    highlights : str
        One of `HIGHLIGHTS`; "auto" renders where a lobe is known and scales otherwise.
    lobe : Lobe or None
        The lobe to render; None for the fitted one.
    exposure : float
        Factor of the new light, greater than 0.
    balanced : bool
        Whether to scale the new light to the mean colour of the present light, and to its mean
        brightness over the object: for lights whose unit is not the photo's.
    """

    highlights: str = "auto"
    lobe: Lobe | None = None
    exposure: float = 1.0
    balanced: bool = False

    def __post_init__(self) -> None:
        if self.highlights not in HIGHLIGHTS:
            raise InputError(
                f'unknown choice "{self.highlights}" for the highlights: {", ".join(HIGHLIGHTS)}'
            )
        check_range("exposure", self.exposure, 1e-6, 1e6)


def relight(d: Decomposition, light: NewLight, choice: Relighting | None = None) -> Edited:
    """Return the scene under another light.

    The recovered light itself, at exposure 1, returns the image bit by bit, except for highlights
    that are removed or rendered.

    Parameters
    ----------
    d : Decomposition
    light : NewLight
    choice : Relighting, optional

    Returns
    -------
    Edited

    Raises
    ------
    InputError
        If the light leaves the object black.
    """
    choice = choice or Relighting()
    same = light.coefficients is not None and np.array_equal(light.coefficients, d.illumination)
    untouched = same and choice.exposure == 1
    if untouched and choice.highlights not in ("remove", "render") and choice.lobe is None:
        return edited(d)
    normals = d.normal[d.mask].astype(float)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    new = light.shading(normals)
    if not luminance(new).any():
        raise InputError(
            "the new light reaches no visible part of the object: move it to the front, or add "
            "ambient light"
        )
    old = d.shading[d.mask].astype(float)
    factor = np.full(3, choice.exposure)
    if choice.balanced:
        tint = light_color(d)
        factor = (
            factor
            * tint
            * float(
                luminance(d.reflectance[d.mask] * old).sum()
                / luminance(d.reflectance[d.mask] * new * tint).sum()
            )
        )
    rotation = np.eye(3) if same else light.rotation
    highlights, note = _highlights(
        d, light, choice, normals, new * factor / np.maximum(old, 1e-9), factor, rotation
    )
    diffuse = d.diffuse if untouched else d.reflectance * as_map(new * factor, d.mask)
    return edited(d, diffuse, highlights, (note,) if note else ())


def _highlights(
    d: Decomposition,
    light: NewLight,
    choice: Relighting,
    normals: np.ndarray,
    ratio: np.ndarray,
    factor: np.ndarray,
    rotation: np.ndarray | None,
) -> tuple[np.ndarray, str]:
    """The new specular layer, and a note on it.

    `rotation` (3, 3): from the present light to this one; None for an unrelated light.
    """
    lobe = choice.lobe or known_lobe(d)
    mode = (
        choice.highlights
        if choice.highlights != "auto"
        else "render"
        if lobe is not None
        else "scale"
    )
    present = d.specular
    if mode == "keep" or not present[d.mask].any():
        return present, ""
    if mode == "remove":
        return np.zeros_like(present), ""
    if mode == "scale":
        note = (
            ""
            if choice.highlights == "scale"
            else "the gloss is unknown, so the highlights follow the shading and do not move"
        )
        scale = choice.exposure * np.minimum(ratio / choice.exposure, _MAX_SCALE)
        return as_map(present[d.mask] * scale, d.mask), note
    lobe = lobe or Lobe()
    view, sources = d.view_inside, () if rotation is None else _highlight_lights(d)
    if not sources or rotation is None:
        before = luminance(NewLight(coefficients=d.illumination).lobe(lobe, normals, view)).sum()
        strength = luminance(present[d.mask]).sum() / max(float(before), 1e-12)
        note = (
            ""
            if light.coefficients is None
            else "the highlights are rendered in a smooth light, so they are broad"
        )
        return as_map(strength * factor * light.lobe(lobe, normals, view), d.mask), note
    moved = [replace(one, direction=rotation @ one.direction) for one in sources]
    before, after = (
        as_map(np.sum([lobe_under(lobe, normals, one, view) for one in lights], axis=0), d.mask)
        for lights in (sources, moved)
    )
    still = (
        _kept_share(sources[0].direction, moved[0].direction)
        if choice.highlights == "auto" and choice.lobe is None
        else 0.0
    )
    return factor * (still * present + (1 - still) * strength_of(d, lobe, before, None) * after), ""


def _highlight_lights(d: Decomposition) -> tuple[DirectionalLight, ...]:
    """The lights that cause the highlights; none if unknown.

    The first is the brightest, and has luminance 1 perpendicular to its direction.
    """
    fit = explain_specular(d)
    lights = () if d.brdf is None or d.brdf.alpha is None else d.brdf.lights
    if not fit.determined and not lights:
        return ()
    fitted = 0.0 if d.brdf is None or not lights else d.brdf.explained
    found = (
        [(fit.light.direction, fit.light.irradiance)]
        if fit.determined and fit.explained >= fitted
        else [(one.direction, one.strength_light) for one in lights]
    )
    unit = max(float(luminance(found[0][1])), 1e-12)
    return tuple(DirectionalLight(direction, color / unit) for direction, color in found)


def _kept_share(before: np.ndarray, after: np.ndarray) -> float:
    """The share of the present highlights to keep when their light moves from one direction to
    another.
    """
    # From the chord, which is accurate for small angles.
    angle = np.degrees(2 * np.arcsin(min(float(np.linalg.norm(after - before)) / 2, 1.0)))
    return float(np.exp(-np.square(angle / _FADE)))
