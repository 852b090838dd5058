"""Joint MDR: shape and light see only what can be believed, and say what the paint under a highlight is.

Problem: MDR believes its separation. On grey paint, where colours tell nothing, that leaves the highlights in the diffuse image, and SIRFS
makes pale paint and wrong shape of them.

Equation: image = D + s, D = reflectance * shading. The start is MDR's diffuse image D_0. Where `highlight_cue` expects the light to be
e^y times the diffuse one, D_1 = D_0 e^-(y - y_0)+, y_0 what the separation by colour has taken already. Where y is large
(`Doubt.doubtful`), too little of the paint is seen for any reflectance to be believed: SIRFS sees these pixels' outline and no more, and

    log R = average of log R around them,   D = min(I, R exp(SH(normal)))

follows from what it has found. An object is touched only where its highlights stand out beyond doubt (`JointOptions`).

Energy: E = E_SIRFS(log D; height, light) + b sum_c mean_T log(D_c / I_c), over the pixels T that are not doubtful, at the same crop. The
second term belongs to the change of variables from D to what was seen: a density of log D is one of I times 1 / D. The start is SIRFS on
D_0. The step is kept if E has fallen, else the start stays, so that E never rises. There is one step.

Citation: inpainting of highlights that keeps to the light: P. Tan, S. Lin, L. Quan, H.-Y. Shum 2003, doi:10.1109/ICCV.2003.1238333;
averages of what is known: H. Knutsson and C.-F. Westin 1993, doi:10.1109/CVPR.1993.341081.

Limits: a broad veil without a peak stays. Paint that ends under a highlight is continued smoothly. Strong white texture (fur, print) hides
highlights: such objects are left to the separation by colour.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..decomposition import Separation
from ..separation.highlight_cue import CueNetwork, highlight_excess
from ..separation.smoothing import masked_gaussian
from .layers import separated, shaded
from .lobe import fit_specular
from .shape import Shape, energy_of, recover_shape
from .task import Answer, Task

_TAKEN = "highlights were taken off with the help of shape and light"
_NOTHING_LEFT = "no highlights but those that colour shows: the same as mdr"
_NOT_BETTER = "the energy did not fall: the same as mdr"
_REACHES = (0.004, 0.008, 0.016, 0.03, 0.06, 0.12, 0.25)  # of the object's diagonal: how far paint is continued from
_SPECK = 0.005  # of the object's diagonal
_ENOUGH = 0.1  # of a neighbourhood that is known: nearer ones decide


@dataclass(frozen=True)
class JointOptions:
    """Highlights are there if the largest y of `highlight_cue` is above `seed`, or by `above_usual` above what 90 % of the object show.
    `doubtful`: the y from which a pixel's reflectance is not believed. `change_of_variables`: b of the energy."""

    seed: float = 0.67
    above_usual: float = 0.52
    doubtful: float = 0.3
    change_of_variables: float = 5.0


@dataclass(frozen=True)
class Doubt:
    """`diffuse` (H, W, 3): D_1. `doubtful` (H, W) bool: where not even that is to be believed; never all of the mask."""

    diffuse: np.ndarray
    doubtful: np.ndarray


def joint(task: Task, options: JointOptions | None = None) -> Answer:
    """MDR, and where highlights are left the step beyond it, if that lowers the energy. Raises `InputError`, `Cancelled`."""
    options, monitor, method = options or JointOptions(), task.monitor, task.settings.separator
    monitor.report(f"separating ({method})", 0.03)
    with task.clock.stage("separation"):
        split = separated(task.maps, method, monitor.part(0.03, 0.06))
        diffuse = split.diffuse if task.one_scale else separated(task.working, method, monitor.part(0.06, 0.08)).diffuse
        found = doubt(task.working.image, diffuse, task.working.mask, options)
    shape = recover_shape(diffuse, task, monitor.part(0.08, 0.92 if found is None else 0.5))
    taken = False
    if found is not None:
        better = recover_shape(found.diffuse, task, monitor.part(0.5, 0.92), found.doubtful)
        taken = _falls(diffuse, found, shape, better, task, options)
    if taken:
        shape, split = better, _split(split, better, task, options)
    lobe = fit_specular(split, shape, task, monitor.part(0.92, 0.96))
    said = _TAKEN if taken else _NOTHING_LEFT if found is None else _NOT_BETTER
    return Answer(split, shape.height, shape.light, shape.status | lobe.status | {"joint": said}, lobe.brdf)


def doubt(
    image: np.ndarray, diffuse: np.ndarray, mask: np.ndarray, options: JointOptions | None = None, network: CueNetwork | None = None
) -> Doubt | None:
    """Where the highlights of `image` (H, W, 3) are that a separation's `diffuse` (H, W, 3) still shows; None if there are none."""
    options = options or JointOptions()
    excess = highlight_excess(image, mask, network)
    if not _stands_out(excess, mask, options):
        return None
    inside = mask[..., None]
    light = np.where(inside, image, 0).mean(axis=2)
    taken = np.log(np.maximum(light, 1e-9) / np.maximum(np.where(inside, diffuse, 0).mean(axis=2), 1e-9))
    left = np.where(mask, np.maximum(excess - np.maximum(taken, 0), 0), 0)
    doubtful = ndimage.binary_opening(left > options.doubtful, np.ones((2, 2))) & mask
    if doubtful[mask].mean() > 0.5:
        return None
    return Doubt((diffuse * np.exp(-left)[..., None]).astype(diffuse.dtype), doubtful)


def _stands_out(excess: np.ndarray, mask: np.ndarray, options: JointOptions) -> bool:
    """Whether the expected highlights are more than the object's texture gives by itself; what is a few pixels wide does not count."""
    side = max(3, 2 * round(_SPECK * _diagonal(mask)) + 1)
    broad = ndimage.grey_opening(excess, side)[mask]
    peak = float(broad.max())
    return peak > options.seed or peak - float(np.quantile(broad, 0.9)) > options.above_usual


def repaint(found: Doubt, shading: np.ndarray, mask: np.ndarray, image: np.ndarray) -> np.ndarray:
    """The diffuse image (H, W, 3) with the paint of doubtful pixels continued from around them; `shading` (H, W, 3) > 0 inside `mask`."""
    known = mask & ~found.doubtful
    if not found.doubtful.any():
        return found.diffuse
    log_paint = np.log(np.maximum(np.where(known[..., None], found.diffuse / np.where(mask[..., None], shading, 1), 1), 1e-9))
    paint = np.exp(_continued(log_paint, known, mask))
    return np.where(found.doubtful[..., None], np.minimum(paint * shading, image), found.diffuse).astype(found.diffuse.dtype)


def _falls(start: np.ndarray, found: Doubt, shape: Shape, better: Shape, task: Task, options: JointOptions) -> bool:
    """Whether the energy of the step lies below that of the start."""
    before = energy_of(start, shape, task, found.doubtful)
    trusted = task.working.mask & ~found.doubtful
    darker = np.log(np.maximum(found.diffuse[trusted], 1e-9) / np.maximum(start[trusted], 1e-9))
    return bool(better.status["loss"] + options.change_of_variables * float(darker.sum(axis=1).mean(dtype=float)) < before)


def _split(start: Separation, shape: Shape, task: Task, options: JointOptions) -> Separation:
    """The layers of the maps' photo under the shape that was found."""
    photo = task.maps
    found = doubt(photo.image, start.diffuse, photo.mask, options)
    if found is None:
        return start
    _, shading = shaded(shape.height, shape.light, photo.mask)
    inside = photo.mask[..., None]
    diffuse = np.where(inside, np.minimum(repaint(found, shading, photo.mask, photo.image), start.diffuse), 0).astype(np.float32)
    image = np.where(inside, photo.image, 0).astype(np.float32)
    specular = np.where(inside, image - diffuse - start.residual, 0).astype(np.float32)
    return Separation(diffuse, specular, start.residual, np.where(found.doubtful, 0, start.confidence).astype(np.float32))


def _continued(values: np.ndarray, known: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """`values` (H, W, 3) where they are not `known`: averages of the nearest ones that are."""
    diagonal = _diagonal(mask)
    answer, settled = np.zeros_like(values), np.zeros(known.shape)
    for reach in _REACHES:
        sigma = max(reach * diagonal, 1.0)
        near = np.clip(ndimage.gaussian_filter(known.astype(float), sigma, truncate=3) / _ENOUGH, 0, 1)
        share = ((1 - settled) * near)[..., None]
        answer += share * masked_gaussian(values, known, sigma)
        settled += share[..., 0]
    rest = values[known].mean(axis=0)
    return np.where(known[..., None], values, answer + (1 - settled)[..., None] * rest)


def _diagonal(mask: np.ndarray) -> float:
    rows, columns = np.nonzero(mask)
    return float(np.hypot(np.ptp(rows) + 1, np.ptp(columns) + 1))
