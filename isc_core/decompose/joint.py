"""Joint MDR: what shape and light explain tells a highlight from paint where colour cannot, and
what paint is under it.

Problem: MDR believes a separation by colour. On grey paint, where colours tell nothing, that leaves
the highlights in the diffuse image: shape and light are bent to explain them, and the reflectance
shows them as bright paint.

Equation: image = D + s, D = R exp(SH(normal)). The start is the separation by colour, D_0, and what
the layer network has learned of the form of highlights (`networks.layer_network`): it expects y =
log(I / D) with an error b, and D_1 = min(D_0, I e^-max(y - b / 2, 0)), the light between D_0 and
D_1 held to be nearly white (`separation.support.light_tint`). SIRFS on D_1 gives shape and light. They give
a better separation: where the network took much of what colour had left (`ResidualHighlights.doubtful`), too
little of the paint is seen to be believed; it is continued from around, in the light that falls
there,

    log R = average of log D_1 - SH(normal) over what is near and not doubtful,   D = min(D_1, R
    exp(SH(normal)))

An object is touched only where highlights stand out that colour has left (`JointOptions`): else the
answer is MDR's.

Energy: E = E_SIRFS(log D; height, light) + b sum_c mean log(D_c / I_c). The second term belongs to
the change of variables from D to what was seen: a density of log D is one of I times 1 / D. The
step from D_1 to D is kept if E falls by it, else D_1 stays: E never rises. There is one step: SIRFS
again on D bends the shape by what the continued paint gets wrong, and did not pay
(docs/methods/joint.md).

Citation: inpainting of highlights that keeps to the light: P. Tan, S. Lin, L. Quan, H.-Y. Shum
2003, doi:10.1109/ICCV.2003.1238333; averages of what is known: H. Knutsson and C.-F. Westin 1993,
doi:10.1109/CVPR.1993.341081.

Limits: those of the network. A broad veil without a peak stays. Paint that ends under a highlight
is continued smoothly.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np
from scipy import ndimage

from ..imaging.smoothing import masked_gaussian
from ..networks.layer_network import LayerNetwork, NetworkOptions, log_ratio, shipped_network
from ..scene.decomposition import Separation
from ..separation.support.light_tint import held_to_light
from .layers import separated_first, shaded
from .lobe import fit_specular
from .shape import Shape, energy_of, recover_shape, trust_of
from .task import Answer, Task

_TAKEN = "highlights that colour does not show were taken off, and the paint under them continued with the help of shape and light"
_NOT_CONTINUED = "highlights that colour does not show were taken off; continuing the paint under them did not lower the energy"
_NOTHING_LEFT = "no highlights but those that colour shows: the same as mdr"
_REACHES = (
    0.004,
    0.008,
    0.016,
    0.03,
    0.06,
    0.12,
    0.25,
)  # of the object's diagonal: how far paint is continued from
_HALF = 0.5  # of the object doubtful: there is nothing to continue its paint from
_SPECK = 0.005  # of the object's diagonal
_ENOUGH = 0.1  # of a neighbourhood that is known: nearer ones decide
Found = TypeVar("Found")


@dataclass(frozen=True)
class JointOptions:
    """`above_usual`: highlights stand out if the largest y that colour has left is by so much above
    what 90 % of the object show. `doubtful`: from which y on paint is not believed.
    `change_of_variables`: b of the energy. `network`: how it is asked.
    """

    above_usual: float = 0.3
    doubtful: float = 0.15
    change_of_variables: float = 5.0
    network: NetworkOptions = field(default_factory=NetworkOptions)


@dataclass(frozen=True)
class ResidualHighlights:
    """`diffuse` (H, W, 3):

    D_1. `doubtful` (H, W) bool: where not even that is to be believed; never more than half of the
    mask.
    """

    diffuse: np.ndarray
    doubtful: np.ndarray


@dataclass(frozen=True)
class Explain(Generic[Found]):
    """How shape and light are found and asked: `solve` gives them for a diffuse image (H, W, 3);
    `shading` (H, W, 3) is what they give, above 0 inside the mask; `energy` is the SIRFS objective
    of a diffuse image at them. All of one photo's pixels.
    """

    solve: Callable[[np.ndarray], Found]
    shading: Callable[[Found], np.ndarray]
    energy: Callable[[np.ndarray, Found], float]


@dataclass(frozen=True)
class Step(Generic[Found]):
    """`shape`: what `Explain.solve` gave.

    `diffuse` (H, W, 3): what is left in the end. `taken`: whether paint was continued.
    """

    shape: Found
    diffuse: np.ndarray
    taken: bool


def joint(task: Task, options: JointOptions | None = None) -> Answer:
    """MDR on what colour and form tell of the layers; the step beyond it, if the energy falls.

    Raises `InputError`, `Cancelled`.
    """
    options, monitor, working = options or JointOptions(), task.monitor, task.working
    split, layers = separated_first(task)
    with task.clock.stage("separation"):
        found = doubt(working.image, layers.diffuse, working.mask, options)
    trust = trust_of(believed(layers.confidence, found), task.settings.confidence_weights)
    explain = Explain(
        solve=lambda image: recover_shape(image, task, monitor.part(0.08, 0.9), trust),
        shading=lambda shape: shaded(shape.working_height, shape.light, working.mask)[1],
        energy=lambda image, shape: energy_of(image, shape, task, trust),
    )
    step = stepped(found, layers.diffuse, working.mask, explain, options)
    said = _NOTHING_LEFT
    if found is not None:
        said = _TAKEN if step.taken else _NOT_CONTINUED
        split = _split(split, found, step, task, options)
    lobe = fit_specular(split, step.shape, task, monitor.part(0.92, 0.96))
    return Answer(
        split,
        step.shape.height,
        step.shape.light,
        step.shape.status | lobe.status | {"joint": said},
        lobe.brdf,
    )


def stepped(
    found: ResidualHighlights | None,
    by_colour: np.ndarray,
    mask: np.ndarray,
    explain: Explain[Found],
    options: JointOptions,
) -> Step[Found]:
    """Shape and light of D_1, then the step to D where E falls by it.

    `found`: what `doubt` says of the separation's diffuse image `by_colour` (H, W, 3), which stays
    where that is None.
    """
    if found is None:
        return Step(explain.solve(by_colour), by_colour, False)
    start = found.diffuse
    shape = explain.solve(start)
    cleaner = repaint(found, explain.shading(shape), start, mask)
    before, after = explain.energy(start, shape), explain.energy(cleaner, shape)
    taken = lowers_energy(before, after, start, cleaner, mask, options)
    return Step(shape, cleaner if taken else start, taken)


def doubt(
    image: np.ndarray,
    diffuse: np.ndarray,
    mask: np.ndarray,
    options: JointOptions | None = None,
    network: LayerNetwork | None = None,
) -> ResidualHighlights | None:
    """Where the highlights of `image` (H, W, 3) are that a separation's `diffuse` (H, W, 3) still
    shows; None if none stand out.

    `network`: the shipped one if None.
    """
    options, inside = options or JointOptions(), mask[..., None]
    expected, _ = log_ratio(image, mask, network or shipped_network(), options.network)
    taken = np.log(
        np.maximum(np.where(inside, image, 1), 1e-9)
        / np.maximum(np.where(inside, diffuse, 1), 1e-9)
    )
    left = np.where(inside, np.maximum(expected - np.maximum(taken, 0), 0), 0)
    level = left.mean(axis=2)
    # What is a few pixels wide does not count: texture is.
    broad = ndimage.grey_opening(level, max(3, 2 * round(_SPECK * _diagonal(mask)) + 1))[mask]
    if float(broad.max()) - float(np.quantile(broad, 0.9)) <= options.above_usual:
        return None
    doubtful = ndimage.binary_opening(level > options.doubtful, np.ones((2, 2))) & mask
    if doubtful[mask].mean() > _HALF:
        doubtful = np.zeros_like(mask)
    cleaner = held_to_light(diffuse, diffuse * np.exp(-left), options.network.tint)
    return ResidualHighlights(cleaner.astype(diffuse.dtype), doubtful)


def believed(confidence: np.ndarray, found: ResidualHighlights | None) -> np.ndarray:
    """A separation's `confidence` (H, W), 0 where `found` doubts."""
    return (
        confidence if found is None else np.where(found.doubtful, 0, confidence).astype(np.float32)
    )


def repaint(
    found: ResidualHighlights, shading: np.ndarray, start: np.ndarray, mask: np.ndarray
) -> np.ndarray:
    """The diffuse image (H, W, 3), nowhere above `start` (H, W, 3), with the paint of doubtful
    pixels continued from around them.

    `shading` (H, W, 3): > 0 inside `mask`.
    """
    known, inside = mask & ~found.doubtful, mask[..., None]
    log_paint = np.log(
        np.maximum(
            np.where(known[..., None], found.diffuse / np.where(inside, shading, 1), 1), 1e-9
        )
    )
    paint = np.exp(_continued(log_paint, known, mask))
    diffuse = np.where(found.doubtful[..., None], paint * shading, found.diffuse)
    return np.where(inside, np.minimum(diffuse, start), 0).astype(start.dtype)


def lowers_energy(
    before: float,
    after: float,
    start: np.ndarray,
    cleaner: np.ndarray,
    mask: np.ndarray,
    options: JointOptions,
) -> bool:
    """Whether E falls from `start` (H, W, 3), where the SIRFS objective is `before`, to `cleaner`
    (H, W, 3), where it is `after`.
    """
    darker = np.log(np.maximum(cleaner[mask], 1e-9) / np.maximum(start[mask], 1e-9))
    return (
        after + options.change_of_variables * float(darker.sum(axis=1).mean(dtype=float)) < before
    )


def _split(
    start: Separation,
    found: ResidualHighlights,
    step: Step[Shape],
    task: Task,
    options: JointOptions,
) -> Separation:
    """The layers of the maps' photo, whose separation is `start`;

    `found` and `step` are those of the working one.
    """
    photo, diffuse, shape = task.maps, step.diffuse, step.shape
    if not task.one_scale:
        of_maps = doubt(photo.image, start.diffuse, photo.mask, options)
        if of_maps is None:
            return start
        found, diffuse = of_maps, of_maps.diffuse
        if step.taken:
            _, shading = shaded(shape.height, shape.light, photo.mask)
            diffuse = repaint(of_maps, shading, of_maps.diffuse, photo.mask)
    diffuse = diffuse.astype(np.float32)
    specular = np.where(
        photo.mask[..., None], start.specular + (start.diffuse - diffuse), 0
    ).astype(np.float32)
    return Separation(diffuse, specular, start.residual, believed(start.confidence, found))


def _continued(values: np.ndarray, known: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """`values` (H, W, 3) where they are not `known`: averages of the nearest ones that are."""
    diagonal = _diagonal(mask)
    answer, settled = np.zeros_like(values), np.zeros(known.shape)
    for reach in _REACHES:
        sigma = max(reach * diagonal, 1.0)
        near = np.clip(
            ndimage.gaussian_filter(known.astype(float), sigma, truncate=3) / _ENOUGH, 0, 1
        )
        share = ((1 - settled) * near)[..., None]
        answer += share * masked_gaussian(values, known, sigma)
        settled += share[..., 0]
    rest = values[known].mean(axis=0)
    return np.where(known[..., None], values, answer + (1 - settled)[..., None] * rest)


def _diagonal(mask: np.ndarray) -> float:
    rows, columns = np.nonzero(mask)
    return float(np.hypot(np.ptp(rows) + 1, np.ptp(columns) + 1))
