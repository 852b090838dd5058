"""The main job: from one photo of a masked object to its intrinsic scene characteristics.

The photo is brought to the working scale, one of the `models` explains it, and its estimate becomes
maps that satisfy the identities.
"""

import platform
import sys
from contextlib import AbstractContextManager

import numpy as np

from .. import __version__
from ..errors import InputError
from ..imaging.bounding_box import mask_box
from ..imaging.framing import continued_height
from ..imaging.resampling import nearest_samples, resample_height
from ..imaging.row_blocks import row_blocks
from ..io.memory import LARGE_PHOTO, enough_memory, release_memory, require_memory
from ..io.stage_cache import StageCache
from ..photo import Photo
from ..progress import Monitor
from ..scene.decomposition import Decomposition, Provenance, Separation
from ..scene.known_inputs import DepthObservation, KnownInputs, SceneConstraints
from ..scene.object_part import object_part
from ..shading.perspective import view_directions
from ..shading.spherical_harmonics import light_from_reference, light_to_reference
from ..sirfs.priors.prior_set import PriorSet
from .assumption_checks import share_in_blocks
from .expected_error import with_expected_error
from .layers import normals_and_shading
from .models import DecompositionTask, SceneEstimate, Settings, solve
from .perspective import before_camera, lobe_before_camera, with_camera
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

# Memory at its peak: of the libraries, and for a pixel of the working photo, of the maps, and of
# the frame around the part that is decomposed.
_LEAST_BYTES, _WORKING_BYTES, _MAPS_BYTES, _FRAME_BYTES = 250_000_000, 250, 260, 70
_REMEDY = "use a smaller --max-size"
WORKING_SIZE = 512  # long side of the object, pixels
_THINNEST = 12  # pixels
_PACKAGES = ("numpy", "scipy", "numba")


def decompose(
    photo: Photo,
    settings: Settings | None = None,
    *,
    known: KnownInputs | None = None,
    prior_set: PriorSet | None = None,
    name: str = "",
    memory: int | None = None,
    monitor: Monitor | None = None,
    kept: StageCache | None = None,
) -> Decomposition:
    """Decompose a photo into its intrinsic scene characteristics.

    Parameters
    ----------
    photo : Photo
        The photo, linear Rec.709, and the object's mask.
    settings : Settings, optional
        Model and options.
    known : KnownInputs, optional
        Known shape, light or depth, at the photo's full size.
    prior_set : PriorSet, optional
        SIRFS priors; the shipped set by default.
    name : str, optional
        Name of the photo in the result.
    memory : int, optional
        Bytes that the work may need at most; by default what is free.
    monitor : Monitor, optional
        Receives progress; can cancel.
    kept : StageCache, optional
        Results of stages of earlier runs, to which those of this one are added. They change the
        time only.

    Returns
    -------
    Decomposition
        Maps of the size that the settings say, see `Settings.max_size`.

    Raises
    ------
    InputError
        If the settings, the photo or the known quantities are unusable, or memory is too small.
    Cancelled
        If the monitor cancels.
    """
    settings, inputs = settings or Settings(), known or KnownInputs()
    given = _known_json(inputs, prior_set)
    monitor, clock = monitor or Monitor(), Clock()
    settings.check()
    _check_used(settings, inputs, prior_set)
    _check_marks(settings, photo)
    if photo.problem:
        raise InputError(photo.problem)
    if _is_black(photo):
        raise InputError(
            "the photo is black inside the mask: there is nothing to recover; use another photo"
        )
    known_shape = inputs.height is not None or inputs.depth is not None
    inputs.check(photo.mask.shape)
    photo = with_camera(photo, settings, known_shape)
    with clock.stage("prepare"):
        part = object_part(photo, settings.maps_size)
        photo, maps, inputs = part.photo, part.maps, part.known(inputs)
        own_scale = known_shape or settings.model not in SIRFS_MODELS
        of_maps = own_scale or settings.maps_size == WORKING_SIZE
        working = maps if of_maps else _working(photo, maps)
        constraints = _at_scale(inputs, photo, working)
        if not share_in_blocks(maps.mask):
            raise InputError(
                "the mask has no block of 2 x 2 pixels to build a shape from: mark a larger region "
                "or use a larger photo"
            )
    task = DecompositionTask(
        working, maps, settings, constraints, prior_set, monitor, clock, kept=kept
    )
    with _within_memory(
        name or "the photo", working.mask.size, maps.mask.size, part.target.shape, memory
    ):
        estimate = solve(task)
    monitor.report("maps", 0.98)
    provenance = Provenance(
        _settings_json(settings),
        settings.seed,
        _versions(),
        clock.seconds,
        _input_json(maps, part.target.corner, name) | given,
        estimate.diagnostics,
    )
    with clock.stage("maps"):
        result = assemble(maps, estimate, provenance, known_light=inputs.light is not None)
        if estimate.prediction is not None and inputs.height is None:
            # the network's normals, like the solver's, are relative to the ray of each pixel
            normal = _solver_normals(estimate, maps)
            result = with_expected_error(result, estimate.prediction, working, normal)
        result = part.placed(result)
    if maps.mask.size > LARGE_PHOTO:
        release_memory()
    return result


def _is_black(photo: Photo) -> bool:
    """Whether the object has no light; in most photos, the first of its rows have."""
    rows = (block.rows for block in row_blocks(photo.mask.shape))
    return not any(photo.image[here][photo.mask[here]].any() for here in rows)


def _working(photo: Photo, maps: Photo) -> Photo:
    """The photo at the scale at which shape and light are recovered, whatever the maps' is."""
    longest, thinnest = max(photo.box[2:]), min(photo.box[2:])
    if thinnest * WORKING_SIZE < _THINNEST * longest:
        return maps
    working = photo.resized_to_object(WORKING_SIZE)
    return maps if working.scale == maps.scale else working


def _within_memory(
    name: str, working_size: int, maps_size: int, shape: tuple[int, ...], allowed: int | None
) -> AbstractContextManager[None]:
    """Refuse a photo that needs more memory than allowed; errors of the block say how much."""
    work = f"{name}: {shape[1]} x {shape[0]} pixels to decompose"
    around = max(shape[0] * shape[1] - maps_size, 0)
    needed = _LEAST_BYTES + _WORKING_BYTES * working_size + _MAPS_BYTES * maps_size
    needed += _FRAME_BYTES * around
    require_memory(work, needed, allowed, _REMEDY)
    return enough_memory(work, needed, _REMEDY)


def _check_used(settings: Settings, inputs: KnownInputs, prior_set: PriorSet | None) -> None:
    """Raise `InputError` where something is given that the model does not use."""
    if settings.model in SIRFS_MODELS:
        return
    given = (inputs.height, inputs.light, inputs.depth, prior_set)
    if settings.shading_only or any(value is not None for value in given):
        models = " or ".join(SIRFS_MODELS)
        raise InputError(
            "--shape, --light, --depth, --priors and --shading-only do not apply to "
            f"{settings.model}: use --model {models}"
        )


def _check_marks(settings: Settings, photo: Photo) -> None:
    if photo.marks and settings.model != "joint":
        raise InputError(
            f"--highlight and --not-highlight do not apply to {settings.model}: use --model joint"
        )
    photo.marks.check(photo.mask)


def assemble(
    photo: Photo, estimate: SceneEstimate, provenance: Provenance, *, known_light: bool = False
) -> Decomposition:
    """Compute the maps that follow from an estimate's height and light, before the photo's camera.

    The identities hold by construction: inside the mask shading = exp(SH(normal)) and reflectance =
    diffuse / shading.

    Parameters
    ----------
    photo : Photo
        The photo of the maps.
    estimate : SceneEstimate
        What a model recovered.
    provenance : Provenance
        Origin of the result.
    known_light : bool, optional
        Whether the light was given: a camera does not change it.

    Returns
    -------
    Decomposition
        The maps.
    """
    mask, split, height, camera = photo.mask, estimate.split, estimate.height, photo.camera
    if camera is None:
        normal, shading = normals_and_shading(height, estimate.light, mask)
        light, brdf = light_from_reference(estimate.light), estimate.brdf
    else:
        normal, shading, light = before_camera(estimate, camera, mask, known_light=known_light)
        brdf = lobe_before_camera(estimate, camera, normal, mask)
    reflectance, image = (np.empty((*mask.shape, 3), np.float32) for _ in range(2))
    relative, lowest = np.empty(mask.shape, np.float32), height[mask].min()
    for block in row_blocks(mask.shape):
        rows, inside = block.rows, mask[block.rows]
        here = inside[..., None]
        reflectance[rows] = np.where(
            here, split.diffuse[rows] / np.where(here, shading[rows], 1), 0
        )
        image[rows] = np.where(here, photo.image[rows], 0)
        relative[rows] = np.where(inside, height[rows] - lowest, 0)
    return Decomposition(
        image,
        split.diffuse,
        split.specular,
        split.residual,
        reflectance,
        shading,
        normal,
        relative,
        mask,
        _confidence(split, normal, photo),
        light,
        provenance,
        brdf,
        camera=camera,
    )


def _solver_normals(estimate: SceneEstimate, maps: Photo) -> np.ndarray | None:
    """The normals before those of a camera; None without a camera."""
    if maps.camera is None:
        return None
    return normals_and_shading(estimate.height, estimate.light, maps.mask)[0]


def _confidence(split: Separation, normal: np.ndarray, photo: Photo) -> np.ndarray:
    """The confidence where no error can be expected: that of the separation, lower where the
    surface turns away from the viewer.
    """
    facing = normal[..., 2]
    if photo.camera is not None:
        height, width = photo.mask.shape
        facing = (normal * view_directions(photo.camera, (height, width))).sum(axis=2)
    return np.where(photo.mask, split.confidence * np.sqrt(np.clip(facing, 0, 1)), 0).astype(
        np.float32
    )


def _at_scale(inputs: KnownInputs, photo: Photo, working: Photo) -> SceneConstraints:
    """The known quantities on the working photo's grid and in its pixels."""
    factor = working.scale / photo.scale
    light = None if inputs.light is None else light_to_reference(np.asarray(inputs.light, float))
    height = None if inputs.height is None else _shape_at_scale(inputs.height, photo, working)
    if inputs.depth is None:
        return SceneConstraints(height, light)
    seen = nearest_samples(inputs.depth, working.mask.shape, factor) * factor
    if not np.isfinite(seen[working.mask]).any():
        raise InputError(
            "the depth map has no value inside the mask, only holes: is it a map of this photo?"
        )
    return SceneConstraints(
        height, light, DepthObservation(seen, inputs.depth_sigma * factor, inputs.depth_weight)
    )


def _shape_at_scale(height: np.ndarray, photo: Photo, working: Photo) -> np.ndarray:
    """A known shape on the working photo's grid, smoothly: terraces would have other normals."""
    if not np.isfinite(height[photo.mask]).all():
        raise InputError(
            "the known shape has holes inside the mask: give it as --depth, which may have holes"
        )
    whole = continued_height(height, photo.mask)
    small = resample_height(whole, working.mask.shape, working.scale / photo.scale)
    return continued_height(small, working.mask)


def _settings_json(settings: Settings) -> dict[str, object]:
    values: dict[str, object] = dict(settings.__dict__)
    if settings.model not in SEPARATING_MODELS:
        values["separator"] = None
    return values


def _versions() -> dict[str, str]:
    """Versions of what computed: a package that is not loaded had no part in the result."""
    versions = {"isc": __version__, "python": platform.python_version()}
    loaded = ((package, sys.modules.get(package)) for package in _PACKAGES)
    return versions | {package: str(one.__version__) for package, one in loaded if one}


def _input_json(photo: Photo, corner: tuple[int, int], name: str) -> dict[str, object]:
    """The source of a part of the maps whose upper left pixel is `corner`."""
    source = photo.original
    left, top, width, height = mask_box(photo.mask)
    return {
        "name": name,
        "sha256": source.sha256,
        "size": list(source.size),
        "scale": photo.scale,
        "crop_box": [left + corner[0], top + corner[1], width, height],
        "transfer": source.transfer,
        "bit_depth": source.bit_depth,
        "colour_profile": source.colour_profile,
        "reading_notes": [{"kind": one.kind.value, "value": one.value} for one in source.notes],
        "mask_from": source.mask_from,
        **({"object": source.object_number} if source.object_number else {}),
        **_marks_json(photo, corner),
        **({} if source.confidence is None else {"mask_confidence": round(source.confidence, 4)}),
    }


def _known_json(inputs: KnownInputs, prior_set: PriorSet | None) -> dict[str, object]:
    """What was given besides the photo; empty if nothing was."""
    given = {
        "shape": inputs.height,
        "light": inputs.light,
        "depth": inputs.depth,
        "priors": prior_set,
    }
    names = [name for name, value in given.items() if value is not None]
    if inputs.depth is None:
        return {"known": names} if names else {}
    return {
        "known": names,
        "depth_sigma": float(inputs.depth_sigma),
        "depth_weight": float(inputs.depth_weight),
    }


def _marks_json(photo: Photo, corner: tuple[int, int]) -> dict[str, object]:
    """Pixels of the file that a user has marked, by kind."""
    marks = photo.marks.moved(*corner).scaled(1 / photo.scale)
    return {
        f"marked_{name}": [[int(x), int(y)] for x, y in places]
        for name, places in (("highlights", marks.highlights), ("paint", marks.paint))
        if places
    }
