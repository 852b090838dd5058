"""The stage "sirfs": shape, light, shading and reflectance from a diffuse image; known shape or
light is kept.

The image is solved at its own size, as on the MIT-Berkeley set (J. T. Barron, J. Malik 2015,
doi:10.1109/TPAMI.2014.2377712), where it is not black; errors are those of
`isc_core.evaluation.metrics`, against the exact normals of the rays that hit the object.

Limits: shading is exp(SH(normal)), which rendered shading is not; the budget measures the
difference (`measurement.substitution`).
"""

from functools import cache

import numpy as np

from isc_core.errors import InputError
from isc_core.evaluation.evaluate import Estimate
from isc_core.evaluation.metrics import (
    Scores,
    angular_error,
    height_error,
    light_error,
    lmse,
    scaled_mse,
)
from isc_core.imaging.bounding_box import mask_slices
from isc_core.imaging.framing import continued_height
from isc_core.progress import Monitor
from isc_core.shading.occluding_contour import occluding_contour
from isc_core.shading.spherical_harmonics import (
    light_from_reference,
    light_to_reference,
    normal_from_reference,
    real_sh,
)
from isc_core.shading.surface_stencils import normals
from isc_core.sirfs.priors.prior_file import shipped_prior_set
from isc_core.sirfs.priors.priors import Priors
from isc_core.sirfs.problem import Problem
from isc_core.sirfs.settings import isc_weights
from isc_core.sirfs.silhouette import normals_from_silhouette
from isc_core.sirfs.solver import SolverOptions, solve

from ...capture.truth import GroundTruth
from .pictures import directions, exposure, lit, relief
from .types import BLACK, Metric, Stage, StageInputs, StageOptions, StagePicture

_MARGIN = 20  # pixels of background around the object's box, where the image has them
_BRIGHTEST = 50.0  # log shading: beyond it exp overflows float32


def run_sirfs(inputs: StageInputs, options: StageOptions, monitor: Monitor) -> Estimate:
    """Solve for the quantities that are not given.

    Parameters
    ----------
    inputs : StageInputs
        Diffuse image and mask; height and light if known.
    options : StageOptions
        Light prior and threads.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    Estimate
        Maps of the whole frame.

    Raises
    ------
    InputError
        If the diffuse image is black everywhere.
    Cancelled
        If the user cancels.
    """
    if inputs.diffuse is None:
        raise ValueError("SIRFS needs a diffuse image")
    part = _window(inputs.mask)
    diffuse, mask = inputs.diffuse[part], inputs.mask[part]
    height = (
        None
        if inputs.height is None
        else continued_height(inputs.height, inputs.mask)[part].astype(float)
    )
    light = None if inputs.light is None else light_to_reference(inputs.light)
    if height is None or light is None:
        height, light = _solved(diffuse, mask, height, light, options, monitor)
    return _estimate(inputs, part, height, light_from_reference(np.broadcast_to(light, (9, 3))))


def score_sirfs(truth: GroundTruth, answer: Estimate) -> Scores:
    """Compute the six errors; shading and reflectance where the true diffuse image is not black.

    Parameters
    ----------
    truth : GroundTruth
        The scene.
    answer : Estimate
        The estimated maps.

    Returns
    -------
    Scores
        The errors.

    Raises
    ------
    InputError
        If the true diffuse image is black everywhere.
    """
    mask = truth.mask
    seen = mask & (truth.diffuse > BLACK).all(axis=2)
    if not seen.any():
        raise InputError("the diffuse image of the scene is black everywhere: nothing to score")
    layers = (
        (truth.shading.astype(float), answer.shading),
        (truth.reflectance.astype(float), answer.reflectance),
    )
    shading, reflectance = (scaled_mse(true[seen], found[seen]) for true, found in layers)
    return Scores(
        height=height_error(np.where(mask, truth.height, np.nan), answer.height),
        normal=angular_error(truth.normal[mask].astype(float), answer.normal[mask]),
        shading=shading,
        reflectance=reflectance,
        rs_mse=sum(lmse(true, found, seen) for true, found in layers) / 2,
        light=light_error(truth.illumination, answer.light),
    )


def show_sirfs(truth: GroundTruth, answer: Estimate) -> tuple[StagePicture, ...]:
    """Return pictures of the maps, scaled to the truth's brightness.

    Parameters
    ----------
    truth : GroundTruth
        The scene.
    answer : Estimate
        The estimated maps.

    Returns
    -------
    tuple of StagePicture
        The photo, then true and estimated shading, reflectance, normals and height.
    """
    mask = truth.mask
    shown = [StagePicture("photo", lit(exposure(truth.image, mask) * truth.image, mask))]
    for name in ("shading", "reflectance"):
        true, found = getattr(truth, name), getattr(answer, name)
        gain = exposure(true, mask)
        scale = (true[mask] * found[mask]).sum() / max(np.square(found[mask]).sum(), 1e-30)
        shown += [
            StagePicture(f"{name}, true", lit(gain * true, mask)),
            StagePicture(f"{name}, estimated", lit(gain * scale * found, mask)),
        ]
    shown += [
        StagePicture(f"normals, {word}", directions(side.normal, mask))
        for word, side in (("true", truth), ("estimated", answer))
    ]
    span = float(np.ptp(truth.height[mask])) or 1.0
    return (
        *shown,
        *(
            StagePicture(f"height, {word}", relief(side.height, mask, span))
            for word, side in (("true", truth), ("estimated", answer))
        ),
    )


def sirfs_maps(answer: Estimate) -> dict[str, np.ndarray]:
    """Return the channels of the maps, named as `isc decompose` names them.

    Parameters
    ----------
    answer : Estimate
        The stage's result.

    Returns
    -------
    dict of str to (H, W) ndarray
        By channel name: "reflectance.R".
    """
    layers = {
        "reflectance": (answer.reflectance, "RGB"),
        "shading": (answer.shading, "RGB"),
        "normal": (answer.normal, "XYZ"),
    }
    planes = {
        f"{name}.{letter}": values[..., k]
        for name, (values, letters) in layers.items()
        for k, letter in enumerate(letters)
    }
    return planes | {"height.Z": answer.height}


def _window(mask: np.ndarray) -> tuple[slice, slice]:
    rows, columns = mask_slices(mask)
    return slice(max(rows.start - _MARGIN, 0), rows.stop + _MARGIN), slice(
        max(columns.start - _MARGIN, 0), columns.stop + _MARGIN
    )


def _solved(
    diffuse: np.ndarray,
    mask: np.ndarray,
    height: np.ndarray | None,
    light: np.ndarray | None,
    options: StageOptions,
    monitor: Monitor,
) -> tuple[np.ndarray, np.ndarray]:
    """Height (h, w) and light (9, C) in the window, reference convention."""
    valid = mask & (diffuse > BLACK).all(axis=2)
    if not valid.any():
        raise InputError(
            "the diffuse image is black everywhere inside the mask: it has no shape cue"
        )
    inside = diffuse[valid]
    channels = (
        1
        if np.array_equal(inside[:, :1], inside[:, 1:2])
        and np.array_equal(inside[:, :1], inside[:, 2:])
        else 3
    )
    priors = _priors(options.illumination, channels)
    log_image = np.where(
        valid[..., None], np.log(np.maximum(diffuse[..., :channels].astype(float), BLACK)), 0.0
    )
    field = None if priors.silhouette is None else normals_from_silhouette(mask, priors.silhouette)
    weights = isc_weights(options.illumination, channels)
    problem = Problem(
        log_image, valid, mask, occluding_contour(mask), priors, weights, silhouette=field
    )
    known = light if light is None or channels == 3 else light.mean(axis=1, keepdims=True)
    found = solve(
        problem,
        SolverOptions(threads=options.threads),
        known_height=height,
        known_light=known,
        monitor=monitor,
    )
    return found.height, found.light


@cache
def _priors(illumination: str, channels: int) -> Priors:
    return shipped_prior_set(illumination).priors(illumination, channels)


def _estimate(
    inputs: StageInputs, part: tuple[slice, slice], height: np.ndarray, light: np.ndarray
) -> Estimate:
    """Maps of the whole frame from height (h, w) in the window and light (9, 3), camera frame."""
    mask = inputs.mask
    whole_height, normal = np.zeros(mask.shape), np.zeros((*mask.shape, 3))
    whole_height[part], normal[part] = height, normal_from_reference(normals(height))
    whole_height[~mask], normal[~mask] = 0, (0, 0, 1)
    return with_normals(inputs, whole_height, normal, light)


def with_normals(
    inputs: StageInputs, height: np.ndarray, normal: np.ndarray, light: np.ndarray
) -> Estimate:
    """Derive shading and reflectance: shading = exp(SH(normal)), reflectance = diffuse / shading.

    Parameters
    ----------
    inputs : StageInputs
        Mask and diffuse image.
    height : (H, W) ndarray
        Pixels toward the viewer.
    normal : (H, W, 3) ndarray
        Unit normals, camera frame.
    light : (9, 3) ndarray
        Log-shading coefficients, camera frame.

    Returns
    -------
    Estimate
        The maps.
    """
    assert inputs.diffuse is not None
    inside = inputs.mask[..., None]
    shading = np.where(
        inside, np.exp(np.clip(real_sh(normal.astype(float)) @ light, -_BRIGHTEST, _BRIGHTEST)), 0
    )
    reflectance = np.where(inside, inputs.diffuse / np.where(inside, shading, 1), 0)
    return Estimate(height, normal, shading, reflectance, light)


SIRFS = Stage(
    name="sirfs",
    title="Shape, light, shading and reflectance from a diffuse image (SIRFS)",
    needs=("diffuse",),
    metrics=(
        Metric("average", "avg", "", given_by=("shape", "light")),
        Metric("height", "Z-MAE", "px", given_by=("shape",)),
        Metric("normal", "N-MAE", "rad", given_by=("shape",)),
        Metric("shading", "S-MSE"),
        Metric("reflectance", "R-MSE"),
        Metric("rs_mse", "RS-MSE"),
        Metric("light", "L-MSE", given_by=("light",)),
    ),
    run=run_sirfs,
    score=score_sirfs,
    show=show_sirfs,
    maps=sirfs_maps,
)
