"""The main job: from one photo of a masked object to its intrinsic scene characteristics.

The photo is brought to the scale of the work, one of the `models` explains it, and its answer
becomes maps that keep the identities.
"""

import platform
from importlib import metadata

import numpy as np

from .. import __version__
from ..errors import InputError
from ..imaging.bounding_box import mask_box
from ..imaging.framing import continued_height
from ..imaging.resampling import nearest_samples
from ..photo import Photo
from ..progress import Monitor
from ..scene.decomposition import Decomposition, Provenance, Separation
from ..scene.known_inputs import DepthObservation, KnownInputs, SceneConstraints
from ..shading.spherical_harmonics import light_from_reference, light_to_reference
from ..sirfs.priors.prior_set import PriorSet
from .assumption_checks import share_in_blocks
from .layers import shaded
from .models import DecompositionTask, SceneEstimate, Settings, solve
from .settings import BASELINE_MODELS, ILLUMINATIONS, MODELS, SEPARATING_MODELS, SIRFS_MODELS
from .task import Clock

__all__ = [
    "BASELINE_MODELS",
    "ILLUMINATIONS",
    "MODELS",
    "SIRFS_MODELS",
    "KnownInputs",
    "Settings",
    "assemble",
    "decompose",
]

_PACKAGES = ("numpy", "scipy", "numba")


def decompose(
    photo: Photo,
    settings: Settings | None = None,
    *,
    evidence: KnownInputs | None = None,
    prior_set: PriorSet | None = None,
    name: str = "",
    monitor: Monitor | None = None,
) -> Decomposition:
    """Decomposes `photo`; maps are at the working scale (see `Settings.max_size`).

    `name` of the photo, for people. `prior_set`: the shipped one if None. Raises `InputError`,
    `Cancelled`.
    """
    settings, evidence, monitor = (
        settings or Settings(),
        evidence or KnownInputs(),
        monitor or Monitor(),
    )
    settings.check()
    _check_used(settings, evidence, prior_set)
    if not photo.image[photo.mask].any():
        raise InputError(
            "the photo is black inside the mask: there is nothing to recover; use another photo"
        )
    clock = Clock()
    with clock.stage("prepare"):
        working = photo.resized_to_object(settings.max_size)
        maps = photo if settings.full_size else working
        known = _at_scale(evidence, photo, working)
        if not share_in_blocks(maps.mask):
            raise InputError(
                "the mask holds no block of 2 x 2 pixels to build a shape of: mark a larger region or use a larger photo"
            )
    answer = solve(DecompositionTask(working, maps, settings, known, prior_set, monitor, clock))
    monitor.report("maps", 0.96)
    provenance = Provenance(
        _settings_json(settings),
        settings.seed,
        _versions(),
        clock.seconds,
        _input_json(maps, name),
        answer.diagnostics,
    )
    with clock.stage("maps"):
        return assemble(maps, answer, provenance)


def _check_used(settings: Settings, evidence: KnownInputs, prior_set: PriorSet | None) -> None:
    """Raises `InputError` where something is given that the model does not look at."""
    if settings.model in SIRFS_MODELS:
        return
    given = (evidence.height, evidence.light, evidence.depth, prior_set)
    if settings.shading_only or any(thing is not None for thing in given):
        models = " or ".join(SIRFS_MODELS)
        raise InputError(
            f"--shape, --light, --depth, --priors and --shading-only mean nothing to {settings.model}: use --model {models}"
        )


def assemble(photo: Photo, answer: SceneEstimate, provenance: Provenance) -> Decomposition:
    """Normals, shading and reflectance that follow from the answer's height and light; `photo` is
    the one of its maps.

    The identities hold by construction: shading = exp(SH(normal)) and reflectance = diffuse /
    shading, inside the mask.
    """
    mask, split, height = photo.mask, answer.split, answer.height
    normal, shading = shaded(height, answer.light, mask)
    reflectance = np.where(
        mask[..., None], split.diffuse / np.where(mask[..., None], shading, 1), 0
    ).astype(np.float32)
    image = np.where(mask[..., None], photo.image, 0).astype(np.float32)
    return Decomposition(
        image,
        split.diffuse,
        split.specular,
        split.residual,
        reflectance,
        shading,
        normal,
        np.where(mask, height - height[mask].min(), 0).astype(np.float32),
        mask,
        _confidence(split, normal, mask),
        light_from_reference(answer.light),
        provenance,
        answer.brdf,
    )


def _confidence(split: Separation, normal: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """How far a pixel can be trusted: the separation's own confidence, less where the surface turns
    away and little is seen of it.
    """
    return np.where(mask, split.confidence * np.sqrt(np.clip(normal[..., 2], 0, 1)), 0).astype(
        np.float32
    )


def _at_scale(evidence: KnownInputs, photo: Photo, working: Photo) -> SceneConstraints:
    """The evidence on the working photo's grid and in its pixels."""
    factor = working.scale / photo.scale
    for what, values in (("shape", evidence.height), ("depth", evidence.depth)):
        if values is not None and values.shape != photo.mask.shape:
            (rows, columns), (h, w) = values.shape, photo.mask.shape
            raise InputError(
                f"the {what} map is {columns} x {rows} but the photo {w} x {h}: give it at the photo's full size"
            )
    light = (
        None if evidence.light is None else light_to_reference(np.asarray(evidence.light, float))
    )
    height = (
        None
        if evidence.height is None
        else nearest_samples(evidence.height, working.mask.shape, factor) * factor
    )
    if height is not None and not np.isfinite(height[working.mask]).all():
        raise InputError(
            "the known shape has holes inside the mask: give it as --depth, which may have holes"
        )
    height = None if height is None else continued_height(height, working.mask)
    if evidence.depth is None:
        return SceneConstraints(height, light)
    seen = nearest_samples(evidence.depth, working.mask.shape, factor) * factor
    if not np.isfinite(seen[working.mask]).any():
        raise InputError(
            "the depth map has no value inside the mask, only holes: is it a map of this photo?"
        )
    return SceneConstraints(
        height, light, DepthObservation(seen, evidence.depth_sigma * factor, evidence.depth_weight)
    )


def _settings_json(settings: Settings) -> dict[str, object]:
    values: dict[str, object] = dict(settings.__dict__)
    if settings.model not in SEPARATING_MODELS:
        values["separator"] = None
    return values


def _versions() -> dict[str, str]:
    versions = {"isc": __version__, "python": platform.python_version()}
    for package in _PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return versions


def _input_json(photo: Photo, name: str) -> dict[str, object]:
    source = photo.original
    return {
        "name": name,
        "sha256": source.sha256,
        "size": list(source.size),
        "scale": photo.scale,
        "crop_box": list(mask_box(photo.mask)),
        "transfer": source.transfer,
        "bit_depth": source.bit_depth,
        "mask_from": source.mask_from,
    }
