"""The main job: from one photo of a masked object to its intrinsic scene characteristics.

Modified Dichromatic Reflectance (`mdr`): specular and diffuse light are separated first, and shape, light and reflectance are
recovered from the diffuse image: image = reflectance * shading + specular (Akbar 2016, "3D Intrinsic Scene Characteristics
Extraction Framework for a Single Image"). `sirfs` takes the whole photo as diffuse. The baselines are there to compare with.
"""

import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import metadata

import numpy as np
from scipy import ndimage

from . import __version__, baselines
from .decomposition import Decomposition, Provenance, Separation
from .errors import InputError
from .photo import Photo, mask_box
from .progress import Monitor
from .separation import BEST, METHODS, separate
from .sirfs.fitting.prior_set import PriorSet
from .sirfs.frames import light_from_reference, light_to_reference, normal_from_reference, real_sh
from .sirfs.kernel_cache import announce_compilation
from .sirfs.prior_file import shipped_prior_set
from .sirfs.problem import DepthObservation, Terms
from .sirfs.recover import Known, Recovered, RecoverOptions, recover
from .sirfs.resampling import nearest_samples, resample_height
from .sirfs.settings import isc_weights
from .sirfs.solver import SolverOptions
from .sirfs.stencils import normals

SIRFS_MODELS = ("mdr", "sirfs")
BASELINE_MODELS = tuple(baselines.METHODS)
MODELS = SIRFS_MODELS + BASELINE_MODELS
LATER_MODELS = ("mbp", "joint")
ILLUMINATIONS = ("natural", "laboratory")
_PACKAGES = ("numpy", "scipy", "numba")


@dataclass(frozen=True)
class Settings:
    """What a decomposition is asked for.

    `model`: one of `MODELS`. `separator`: one of `separation.METHODS`, used by `mdr`. `illumination`: "natural" or "laboratory", which
    lights to expect. `max_size`: the object's long side in pixels at which the maps are made, 0 for the photo's; SIRFS is solved at a
    size of its own, `recover.SOLVE_SIZE`. `full_size`: the maps are then brought to the photo's resolution. `engine`, `threads`: see
    `SolverOptions`. `seed`: written into the result; no step of these models draws random numbers. `shading_only`: shape-from-shading
    mode, an object of one colour.
    """

    model: str = "mdr"
    separator: str = BEST
    illumination: str = "natural"
    max_size: int = 512
    full_size: bool = False
    engine: str = "auto"
    threads: int = 0
    seed: int = 0
    shading_only: bool = False

    def check(self) -> None:
        """Raises `InputError` for values that mean nothing."""
        if self.model in LATER_MODELS:
            raise InputError(f"the model {self.model} is not available yet: choose {', '.join(MODELS)}")
        for name, value, known in (
            ("model", self.model, MODELS),
            ("separator", self.separator, METHODS),
            ("illumination", self.illumination, ILLUMINATIONS),
            ("engine", self.engine, ("auto", "numba", "numpy")),
        ):
            if value not in known:
                raise InputError(f'unknown {name} "{value}": choose {", ".join(known)}')
        if self.max_size < 0 or self.threads < 0:
            raise InputError("--max-size and --threads cannot be negative: 0 means no limit and all cores")


@dataclass(frozen=True)
class Evidence:
    """What else is known of the scene, at the photo's full size: `height` the exact shape, `depth` an observation of it with holes
    (NaN), both (H, W) in photo pixels toward the viewer; `light` the exact illumination (9, 3), ISC's convention.

    `depth_sigma`: the observation's standard error in photo pixels; `depth_weight`: of its term.
    """

    height: np.ndarray | None = None
    light: np.ndarray | None = None
    depth: np.ndarray | None = None
    depth_sigma: float = 2.0
    depth_weight: float = 10.0


@dataclass(frozen=True)
class _Shape:
    """Height (H, W) and light (9, 3), reference convention, at the working scale, and how they were found."""

    height: np.ndarray
    light: np.ndarray
    status: dict[str, object]
    terms: Terms | None = None


@dataclass
class _Clock:
    """Seconds spent in each stage."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.seconds[name] = round(time.perf_counter() - start, 4)


def decompose(
    photo: Photo,
    settings: Settings | None = None,
    *,
    evidence: Evidence | None = None,
    prior_set: PriorSet | None = None,
    name: str = "",
    monitor: Monitor | None = None,
) -> Decomposition:
    """Decomposes `photo`; maps are at the working scale (see `Settings.max_size`).

    `name` of the photo, for people. `prior_set`: the shipped one if None. Raises `InputError`, `Cancelled`.
    """
    settings, evidence, monitor = settings or Settings(), evidence or Evidence(), monitor or Monitor()
    settings.check()
    _check_used(settings, evidence, prior_set)
    clock = _Clock()
    with clock.stage("prepare"):
        working = photo.resized_to_object(settings.max_size)
        maps_at = photo if settings.full_size else working
        known = _at_scale(evidence, photo, working)
    monitor.report(f"separating ({settings.separator})" if settings.model == "mdr" else "preparing", 0.03)
    with clock.stage("separation"):
        split = _separate(maps_at, settings, monitor.part(0.03, 0.07))
        diffuse = split.diffuse if maps_at is working else _separate(working, settings, monitor.part(0.07, 0.1)).diffuse
    with clock.stage("shape and light"):
        shape = _recover(diffuse, working, settings, known, prior_set, monitor.part(0.1, 0.95))
    monitor.report("maps", 0.96)
    with clock.stage("maps"):
        height = shape.height if maps_at is working else _enlarged(shape.height, working, maps_at)
        origin = _input_json(maps_at, name)
        provenance = Provenance(_settings_json(settings), settings.seed, _versions(), clock.seconds, origin, shape.status)
        return assemble(maps_at, split, height, shape.light, provenance)


def _check_used(settings: Settings, evidence: Evidence, prior_set: PriorSet | None) -> None:
    """Raises `InputError` where something is given that the model does not look at."""
    if settings.model in SIRFS_MODELS:
        return
    given = (evidence.height, evidence.light, evidence.depth, prior_set)
    if settings.shading_only or any(thing is not None for thing in given):
        models = " or ".join(SIRFS_MODELS)
        raise InputError(f"--shape, --light, --depth, --priors and --shading-only mean nothing to {settings.model}: use --model {models}")


def assemble(photo: Photo, split: Separation, height: np.ndarray, light: np.ndarray, provenance: Provenance) -> Decomposition:
    """Normals, shading and reflectance that follow from `height` (H, W) and `light` (9, 3), reference convention.

    The identities hold by construction: shading = exp(SH(normal)) and reflectance = diffuse / shading, inside the mask.
    """
    mask = photo.mask
    normal = normal_from_reference(normals(height)).astype(np.float32)
    normal[~mask] = (0, 0, 1)
    illumination = light_from_reference(light)
    shading = np.zeros(photo.image.shape, np.float32)
    shading[mask] = np.exp(real_sh(normal[mask].astype(float)) @ illumination)
    reflectance = np.where(mask[..., None], split.diffuse / np.where(mask[..., None], shading, 1), 0).astype(np.float32)
    image = np.where(mask[..., None], photo.image, 0).astype(np.float32)
    return Decomposition(
        image, split.diffuse, split.specular, split.residual, reflectance, shading, normal,
        np.where(mask, height - height[mask].min(), 0).astype(np.float32), mask, _confidence(split, normal, mask), illumination, provenance,
    )  # fmt: skip


def _separate(photo: Photo, settings: Settings, monitor: Monitor) -> Separation:
    method = settings.separator if settings.model == "mdr" else "none"
    return separate(method, photo.image, photo.mask, photo.clipped, monitor=monitor)


def _recover(diffuse: np.ndarray, photo: Photo, settings: Settings, known: Known, prior_set: PriorSet | None, monitor: Monitor) -> _Shape:
    floor = photo.code_value / 2
    if settings.model in BASELINE_MODELS:
        monitor.report(f"shape and light ({settings.model})", 0.0)
        log_image = np.log(np.maximum(np.where(photo.mask[..., None], diffuse, 1), floor))
        guess = baselines.estimate(settings.model, log_image, photo.mask)
        return _Shape(guess.height, guess.light, {"converged": True, "reason": "direct method"})
    announce_compilation(settings.engine, monitor)
    channels = 1 if _is_grey(diffuse, photo.mask) else 3
    priors = (prior_set or shipped_prior_set()).priors(settings.illumination, channels)
    options = RecoverOptions(shading_only=settings.shading_only, solver=SolverOptions(engine=settings.engine, threads=settings.threads))
    weights = isc_weights(settings.illumination, channels)
    light = known.light if known.light is None or channels == 3 else known.light.mean(axis=1, keepdims=True)
    result = recover(
        diffuse[..., :channels], photo.mask, floor, priors, weights, options,
        known=Known(known.height, light, known.depth), monitor=monitor,
    )  # fmt: skip
    return _Shape(result.height, np.broadcast_to(result.light, (9, 3)).copy(), _status(result), result.terms)


def _is_grey(image: np.ndarray, mask: np.ndarray) -> bool:
    inside = image[mask]
    return bool(np.array_equal(inside[:, 0], inside[:, 1]) and np.array_equal(inside[:, 0], inside[:, 2]))


def _status(result: Recovered) -> dict[str, object]:
    trouble = "the solver ran out of evaluations, so the result may not be its best: a cleaner mask or the other --illumination may help"
    return {
        "converged": result.converged,
        "reason": result.reason,
        "loss": result.terms.total,
        "terms": dict(result.terms.__dict__),
        "iterations": result.iterations,
        "evaluations": result.evaluations,
        "help": "" if result.converged else trouble,
    }


def _confidence(split: Separation, normal: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """How far a pixel can be trusted: the separation's own confidence, less where the surface turns away and little is seen of it."""
    return np.where(mask, split.confidence * np.sqrt(np.clip(normal[..., 2], 0, 1)), 0).astype(np.float32)


def _at_scale(evidence: Evidence, photo: Photo, working: Photo) -> Known:
    """The evidence on the working photo's grid and in its pixels."""
    factor = working.scale / photo.scale
    for what, values in (("shape", evidence.height), ("depth", evidence.depth)):
        if values is not None and values.shape != photo.mask.shape:
            (rows, columns), (h, w) = values.shape, photo.mask.shape
            raise InputError(f"the {what} map is {columns} x {rows} but the photo {w} x {h}: give it at the photo's full size")
    light = None if evidence.light is None else light_to_reference(np.asarray(evidence.light, float))
    height = None if evidence.height is None else nearest_samples(evidence.height, working.mask.shape, factor) * factor
    if height is not None and not np.isfinite(height[working.mask]).all():
        raise InputError("the known shape has holes inside the mask: give it as --depth, which may have holes")
    height = None if height is None else _continued(height, working.mask)
    if evidence.depth is None:
        return Known(height, light)
    seen = nearest_samples(evidence.depth, working.mask.shape, factor) * factor
    if not np.isfinite(seen[working.mask]).any():
        raise InputError("the depth map has no value inside the mask, only holes: is it a map of this photo?")
    return Known(height, light, DepthObservation(seen, evidence.depth_sigma * factor, evidence.depth_weight))


def _continued(height: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """The height (H, W) inside the mask, going on outside as it arrives at the rim (by point reflection): normals look one pixel out."""
    rim = ndimage.distance_transform_edt(~mask, return_distances=False, return_indices=True)
    rows, columns = (np.clip(2 * r - i, 0, n - 1) for r, i, n in zip(rim, np.indices(mask.shape), mask.shape, strict=True))
    at_rim = height[tuple(rim)]
    return np.where(mask, height, np.where(mask[rows, columns], 2 * at_rim - height[rows, columns], at_rim))


def _enlarged(height: np.ndarray, working: Photo, full: Photo) -> np.ndarray:
    """The working height on the full photo's grid and in its pixels, smoothly."""
    return resample_height(height, full.mask.shape, full.scale / working.scale)


def _settings_json(settings: Settings) -> dict[str, object]:
    values: dict[str, object] = dict(settings.__dict__)
    if settings.model != "mdr":
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
