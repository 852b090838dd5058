"""The steps that several models take: separating a photo, and shading a recovered shape."""

from dataclasses import replace

import numpy as np

from ..photo.photo import Photo
from ..progress import Monitor
from ..scene.decomposition import Separation
from ..separation import separate
from ..shading.spherical_harmonics import (
    light_from_reference,
    light_to_reference,
    normal_from_reference,
    real_sh,
)
from ..shading.surface_stencils import normals
from .task import Task


def separated(photo: Photo, method: str, monitor: Monitor | None = None) -> Separation:
    """The photo's layers by a method of `separation.METHODS`. Raises `InputError`, `Cancelled`."""
    return separate(method, photo.image, photo.mask, photo.clipped, monitor=monitor)


def separated_first(task: Task) -> tuple[Separation, Separation]:
    """The layers of the maps' photo by the separator of the settings, and those of the working one.

    Raises `InputError`, `Cancelled`.
    """
    method, monitor = task.settings.separator, task.monitor
    monitor.report(f"separating ({method})", 0.03)
    with task.clock.stage("separation"):
        split = (
            separated(task.maps, method, monitor.part(0.03, 0.06))
            if task.split is None
            else task.split
        )
        return split, split if task.one_scale else separated(
            task.working, method, monitor.part(0.06, 0.08)
        )


def unseparated(task: Task) -> tuple[Separation, np.ndarray]:
    """All light taken as diffuse: the layers of the maps' photo, and the diffuse image (H, W, 3) of
    the working one.
    """
    task.monitor.report("preparing", 0.03)
    with task.clock.stage("separation"):
        split = separated(task.maps, "none")
        return split, split.diffuse if task.one_scale else separated(task.working, "none").diffuse


def scale_confidence(split: Separation, share: float = 0.5) -> Separation:
    """The same layers, with that share of their confidence."""
    return replace(split, confidence=np.float32(share) * split.confidence)


def shaded(
    height: np.ndarray, light: np.ndarray, mask: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Normals (H, W, 3), camera frame, (0, 0, 1) outside the mask, and shading (H, W, 3), 0
    outside, float32: shading = exp(SH(normal)).

    `height` (H, W) and `light` (9, 3) in the reference convention.
    """
    normal = normal_from_reference(normals(height)).astype(np.float32)
    normal[~mask] = (0, 0, 1)
    shading = np.zeros((*mask.shape, 3), np.float32)
    shading[mask] = np.exp(
        np.einsum("nk,kc->nc", real_sh(normal[mask].astype(float)), light_from_reference(light))
    )
    return normal, shading


def shifted(light: np.ndarray, log_colour: np.ndarray | float) -> np.ndarray:
    """The light (9, C), reference convention, with `log_colour`, (3,) or one number, added to the
    log shading; of one channel the mean.
    """
    ours, gain = light_from_reference(light), np.broadcast_to(log_colour, 3)
    ours[0] += np.sqrt(4 * np.pi) * (gain if ours.shape[1] == 3 else gain.mean())
    return light_to_reference(ours)
