"""Joint MDR: recovered shape and light separate highlights that colour cannot, and restore the
albedo under them.

Problem: MDR relies on a separation by colour. On grey albedo, where colour carries no information,
that leaves highlights in the diffuse image: shape and light are bent to explain them, and the
reflectance shows them as bright albedo.

Equation: image = D + s, D = R exp(SH(normal)). The start is the separation by colour, D_0, and what
the scene network adds: t is a lower bound of the log(I / D) that it predicts
(`separation.support.ratio_bound`), and D_1 = min(D_0, I e^-t), the light between D_0 and D_1 being
nearly white (`separation.support.light_tint`). On a grey photo, t is the mean of its channels, so
that the layers are grey, too. Colour and form decide together, region by region,
what of that was a highlight and what was print (`separation.support.highlight_evidence`); the image
is restored where it was print. The paint under clipped highlights is inpainted
(`separation.support.clipped_texture`). SIRFS on D_1 gives shape and light. They give a better
separation: where the network removed much of what colour had left
(`ResidualHighlights.unreliable`), too little of the albedo is visible; it is inpainted from the
surroundings, with the shading at that place,

    log R = average of log D_1 - SH(normal) over nearby reliable pixels,
    D = min(D_1, R exp(SH(normal)))

Form adds to colour only where highlights stand out that colour has left
(`separation.support.ratio_bound`).

Energy: E = E_SIRFS(log D; height, light) + b sum_c mean log(D_c / I_c). The second term belongs to
the change of variables from D to the observed image: a density of log D is one of I times 1 / D.
The step from D_1 to D is kept if E falls, otherwise D_1 stays: E never rises. There is one step:
SIRFS again on D distorts the shape by the errors of the inpainted albedo, and was no gain
(docs/methods/joint.md).

Citation: inpainting of highlights that respects the illumination: P. Tan, S. Lin, L. Quan, H.-Y.
Shum 2003, doi:10.1109/ICCV.2003.1238333; averages of known values: H. Knutsson and C.-F. Westin
1993, doi:10.1109/CVPR.1993.341081.

Limits: those of the network. A broad veil without a peak stays. Albedo that ends under a highlight
is inpainted smoothly.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from ..filters.components import labelled, means
from ..filters.gaussian import gaussian_average
from ..filters.morphology import dilated, opened_by_blocks
from ..imaging.bounding_box import mask_diagonal
from ..imaging.channels import averaged_if_grey
from ..imaging.row_blocks import row_blocks
from ..imaging.smoothing import masked_gaussian
from ..networks.scene_network import (
    LayerPrediction,
    ScenePrediction,
    predict_layers,
    predict_scene,
)
from ..photo.highlight_marks import HighlightMarks
from ..scene.decomposition import Separation
from ..scene.diagnostics import JointOutcome
from ..separation import HIGHLIGHT_ODDS
from ..separation.support.clipped_texture import inpaint_clipped
from ..separation.support.highlight_evidence import classify_highlights
from ..separation.support.layers import keep_highlights, restore_image
from ..separation.support.light_tint import limit_tint
from ..separation.support.ratio_bound import (
    RemovalOptions,
    highlights_stand_out,
    ratio_lower_bound,
)
from .layers import normals_and_shading, separated_at_both_scales
from .lobe import fit_specular
from .shape import Shape, confidence_weight, energy_of, recover_shape
from .task import DecompositionTask, SceneEstimate

# shares of the object's diagonal: radii of the averages that inpaint albedo
_REACHES = (
    0.004,
    0.008,
    0.016,
    0.03,
    0.06,
    0.12,
    0.25,
)
_HALF = 0.5  # of the object unreliable: too little is left to inpaint its albedo from
_SPREAD = 2  # pixels around clipped ones that mix with them
_MOSTLY = 0.5  # of a clipped hole lies in a kept region
_ENOUGH = 0.1  # of a neighbourhood known: nearer ones decide


@dataclass(frozen=True)
class JointOptions:
    """Thresholds of highlights, and the weight of the step beyond MDR.

    Attributes
    ----------
    unreliable_from : float
        t above which albedo is unreliable.
    change_of_variables : float
        b of the energy.
    deviations : float
        Of the predicted log ratio, by which it is lowered, see `ratio_lower_bound`.
    removal : RemovalOptions
        When light that the network predicts to be a highlight is removed.
    odds : float
        Least odds at which removed light is taken for a highlight; above 0.
    """

    unreliable_from: float = 0.15
    change_of_variables: float = 5.0
    deviations: float = 1.6
    removal: RemovalOptions = field(default_factory=RemovalOptions)
    odds: float = HIGHLIGHT_ODDS


@dataclass(frozen=True, eq=False)
class ResidualHighlights:
    """Highlights that a separation by colour has left.

    Attributes
    ----------
    diffuse : (H, W, 3) ndarray
        D_1, the diffuse image without them.
    unreliable : (H, W) ndarray of bool
        Where even `diffuse` shows too little of the albedo; at most half of the mask.
    """

    diffuse: np.ndarray
    unreliable: np.ndarray


@dataclass(frozen=True)
class SupportedLayers:
    """What colour and form support together.

    Attributes
    ----------
    split : Separation
        By colour; where nothing supports a highlight, diffuse is the image and the rest 0.
    residual : ResidualHighlights or None
        What form adds; None if nothing.
    doubtful : float
        As `highlight_evidence.ClassifiedHighlights.doubtful`.
    """

    split: Separation
    residual: ResidualHighlights | None
    doubtful: float

    @property
    def diffuse(self) -> np.ndarray:
        """The diffuse image (H, W, 3) of both."""
        return self.split.diffuse if self.residual is None else self.residual.diffuse


@dataclass(frozen=True, eq=False)
class JointStep:
    """Shape and light of D_1, and the diffuse image after the step.

    Attributes
    ----------
    shape : Shape
        Recovered from D_1.
    diffuse : (h, w, 3) ndarray
        D if the step was kept, otherwise D_1.
    kept : bool
        Whether albedo was inpainted.
    """

    shape: Shape
    diffuse: np.ndarray
    kept: bool


def joint(task: DecompositionTask, options: JointOptions | None = None) -> SceneEstimate:
    """Run MDR on layers from colour and the network, then the step beyond it if the energy falls.

    Parameters
    ----------
    task : DecompositionTask
        The photo and the settings.
    options : JointOptions, optional
        Thresholds; by default those of the settings.

    Returns
    -------
    SceneEstimate
        Its layers keep only what colour and form support.

    Raises
    ------
    InputError
        If the photo cannot be separated or the known quantities do not fit.
    Cancelled
        If the monitor cancels.
    """
    options = options or JointOptions(odds=task.settings.highlight_odds)
    monitor, working = task.monitor, task.working
    split, layers = separated_at_both_scales(task)
    task = replace(task, split=None)
    with task.clock.stage("separation"):
        support = supported_layers(
            working.image,
            layers,
            working.mask,
            task.prediction,
            options,
            working.clipped,
            working.marks,
        )
    layers, residual = support.split, support.residual
    weight = confidence_weight(
        without_unreliable(layers.confidence, residual), task.settings.confidence_weights
    )
    step = _step(task, residual, layers.diffuse, weight, options)
    outcome = JointOutcome.UNCHANGED
    if residual is not None:
        outcome = JointOutcome.INPAINTED if step.kept else JointOutcome.REMOVED
    split = _split(layers if task.one_scale else split, residual, step, task, options)
    lobe = fit_specular(split, step.shape, task, monitor.part(0.92, 0.96))
    diagnostics = replace(
        step.shape.diagnostics,
        lobe=lobe.diagnostics,
        joint=outcome,
        doubtful_highlights=round(support.doubtful, 4),
    )
    return SceneEstimate(split, step.shape.height, step.shape.light, diagnostics, lobe.brdf)


def _step(
    task: DecompositionTask,
    residual: ResidualHighlights | None,
    by_colour: np.ndarray,
    weight: np.ndarray | None,
    options: JointOptions,
) -> JointStep:
    """Shape and light of D_1, then the step to D where E falls; `by_colour` (h, w, 3) is D_0."""
    monitor, mask = task.monitor.part(0.08, 0.9), task.working.mask
    if residual is None:
        return JointStep(recover_shape(by_colour, task, monitor, weight), by_colour, False)
    start = residual.diffuse
    shape = recover_shape(start, task, monitor, weight)
    _, shading = normals_and_shading(
        shape.working_height, shape.light, mask, task.options.layer_dtype
    )
    cleaner = inpaint_albedo(residual, shading, start, mask)
    before, after = (energy_of(diffuse, shape, task, weight) for diffuse in (start, cleaner))
    kept = lowers_energy(before, after, start, cleaner, mask, options)
    return JointStep(shape, cleaner if kept else start, kept)


def supported_layers(
    image: np.ndarray,
    split: Separation,
    mask: np.ndarray,
    prediction: ScenePrediction | LayerPrediction | None = None,
    options: JointOptions | None = None,
    clipped: np.ndarray | None = None,
    marks: HighlightMarks | None = None,
) -> SupportedLayers:
    """Add the network's highlights to those found by colour, and keep what both support.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear Rec.709.
    split : Separation
        By colour.
    mask : (H, W) ndarray of bool
        The object.
    prediction : ScenePrediction or LayerPrediction, optional
        Of the image; by default that of the shipped network.
    options : JointOptions, optional
        Thresholds.
    clipped : (H, W) ndarray of bool, optional
        The paint under clipped highlights is inpainted.
    marks : HighlightMarks, optional
        Places that a user has marked as highlight or print.

    Returns
    -------
    SupportedLayers
    """
    options, prediction = options or JointOptions(), prediction or predict_scene(image, mask)
    residual = detect_residual_highlights(image, split.diffuse, mask, prediction, options)
    cleaner = split.diffuse if residual is None else residual.diffuse
    form = prediction.log_ratio, prediction.ratio_scale
    classified = classify_highlights(image, cleaner, mask, *form, options.odds, marks, clipped)
    hidden = _hidden(classified.kept, clipped, mask)
    kept = classified.kept | hidden
    split = keep_highlights(split, image, kept, mask)
    diffuse = split.diffuse
    if residual is not None:
        diffuse = restore_image(cleaner, image, kept, mask, out=cleaner)
    if hidden.any():
        whole = inpaint_clipped(diffuse, image, hidden, mask, prediction.log_shading)
        diffuse = diffuse if residual is not None else diffuse.copy()
        np.copyto(diffuse, whole, where=hidden[..., None])
    if residual is not None and kept.any():
        added = ResidualHighlights(diffuse, residual.unreliable & kept)
        return SupportedLayers(split, added, classified.doubtful)
    split = _with_diffuse(split, diffuse) if hidden.any() else split
    return SupportedLayers(split, None, classified.doubtful)


def _hidden(kept: np.ndarray, clipped: np.ndarray | None, mask: np.ndarray) -> np.ndarray:
    """Where highlights hide the paint (H, W) bool: clipped pixels and their neighbours, which mix
    with them, in holes that belong to kept regions for the larger part.
    """
    if clipped is None or not clipped.any():
        return np.zeros_like(kept)
    holes = dilated(clipped, _SPREAD) & mask
    labels, count = labelled(holes, corners=True)
    belongs = np.concatenate([[False], means(kept, labels, count) > _MOSTLY])
    return np.asarray(belongs[labels])


def _with_diffuse(split: Separation, diffuse: np.ndarray) -> Separation:
    """The layers of the same image with another diffuse layer; what it loses is specular."""
    specular = np.maximum(split.specular + (split.diffuse - diffuse), 0)
    return replace(split, diffuse=diffuse, specular=specular.astype(split.specular.dtype))


def detect_residual_highlights(
    image: np.ndarray,
    diffuse: np.ndarray,
    mask: np.ndarray,
    prediction: ScenePrediction | LayerPrediction | None = None,
    options: JointOptions | None = None,
) -> ResidualHighlights | None:
    """Find highlights that a separation by colour has left in the diffuse image.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear Rec.709.
    diffuse : (H, W, 3) ndarray
        The separation's diffuse layer.
    mask : (H, W) ndarray of bool
        The object.
    prediction : ScenePrediction or LayerPrediction, optional
        Of the image; by default that of the shipped network.
    options : JointOptions, optional
        Thresholds.

    Returns
    -------
    ResidualHighlights or None
        None if no highlights stand out.
    """
    options = options or JointOptions()
    expected = ratio_lower_bound(prediction or predict_scene(image, mask), options.deviations)
    expected = averaged_if_grey(expected, image, mask)
    left = np.empty(image.shape, np.result_type(image, diffuse, expected))
    for block in row_blocks(mask.shape):
        rows = block.rows
        left[rows] = _remaining_ratio(image[rows], diffuse[rows], expected[rows], mask[rows])
    if not highlights_stand_out(left, mask, options.removal.stands_out):
        return None
    much = left.mean(axis=2) > options.unreliable_from
    unreliable = opened_by_blocks(much) & mask
    if unreliable[mask].mean() > _HALF:
        unreliable = np.zeros_like(mask)
    cleaner = np.empty_like(diffuse)
    for block in row_blocks(mask.shape):
        before = diffuse[block.rows]
        after = before * np.exp(-left[block.rows])
        cleaner[block.rows] = limit_tint(before, after, options.removal.tint)
    return ResidualHighlights(cleaner, unreliable)


def _remaining_ratio(
    image: np.ndarray, diffuse: np.ndarray, expected: np.ndarray, mask: np.ndarray
) -> np.ndarray:
    """Predicted log(I / D) (h, w, 3) less that of the separation by colour, at least 0."""
    inside = mask[..., None]
    taken = np.log(
        np.maximum(np.where(inside, image, 1), 1e-9)
        / np.maximum(np.where(inside, diffuse, 1), 1e-9)
    )
    return np.where(inside, np.maximum(expected - np.maximum(taken, 0), 0), 0)


def without_unreliable(confidence: np.ndarray, residual: ResidualHighlights | None) -> np.ndarray:
    """Set a separation's confidence to 0 where its albedo is unreliable.

    Parameters
    ----------
    confidence : (H, W) ndarray
        In [0, 1].
    residual : ResidualHighlights or None
        The residual highlights.

    Returns
    -------
    (H, W) ndarray
        The lower confidence; unchanged for None.
    """
    if residual is None:
        return confidence
    return np.where(residual.unreliable, 0, confidence).astype(np.float32)


def inpaint_albedo(
    residual: ResidualHighlights, shading: np.ndarray, start: np.ndarray, mask: np.ndarray
) -> np.ndarray:
    """Inpaint the albedo of unreliable pixels from their surroundings.

    Parameters
    ----------
    residual : ResidualHighlights
        D_1 and its unreliable pixels.
    shading : (H, W, 3) ndarray
        Above 0 inside the mask.
    start : (H, W, 3) ndarray
        Upper bound of the result.
    mask : (H, W) ndarray of bool
        The object.

    Returns
    -------
    (H, W, 3) ndarray
        The diffuse image.
    """
    known, inside = mask & ~residual.unreliable, mask[..., None]
    log_albedo = np.log(
        np.maximum(
            np.where(known[..., None], residual.diffuse / np.where(inside, shading, 1), 1), 1e-9
        )
    )
    albedo = np.exp(_continued(log_albedo, known, mask))
    diffuse = np.where(residual.unreliable[..., None], albedo * shading, residual.diffuse)
    return np.where(inside, np.minimum(diffuse, start), 0).astype(start.dtype)


def lowers_energy(
    before: float,
    after: float,
    start: np.ndarray,
    cleaner: np.ndarray,
    mask: np.ndarray,
    options: JointOptions,
) -> bool:
    """Decide whether E falls from D_1 to D.

    Parameters
    ----------
    before, after : float
        SIRFS objective at `start` and at `cleaner`.
    start, cleaner : (H, W, 3) ndarray
        D_1 and D.
    mask : (H, W) ndarray of bool
        The object.
    options : JointOptions
        The weight b.

    Returns
    -------
    bool
        Whether the step is kept.
    """
    darker = np.log(np.maximum(cleaner[mask], 1e-9) / np.maximum(start[mask], 1e-9))
    return (
        after + options.change_of_variables * float(darker.sum(axis=1).mean(dtype=float)) < before
    )


def _split(
    start: Separation,
    residual: ResidualHighlights | None,
    step: JointStep,
    task: DecompositionTask,
    options: JointOptions,
) -> Separation:
    """The layers of the maps' photo, whose separation by colour is `start`, supported where the
    two scales are one; `residual` and `step` are those of the working photo.
    """
    photo, diffuse, shape, dtype = task.maps, step.diffuse, step.shape, task.options.layer_dtype
    if not task.one_scale and (residual is not None or start.specular.any()):
        of_maps = supported_layers(
            photo.image,
            start,
            photo.mask,
            predict_layers(photo.image, photo.mask, task.options.scene_network, task.kept),
            options,
            photo.clipped,
            photo.marks,
        )
        start, residual = of_maps.split, None if residual is None else of_maps.residual
        if residual is not None:
            diffuse = residual.diffuse
            if step.kept:
                _, shading = normals_and_shading(shape.height, shape.light, photo.mask, dtype)
                diffuse = inpaint_albedo(residual, shading, diffuse, photo.mask)
    if residual is None:
        return start
    diffuse = diffuse.astype(dtype)
    specular = np.where(
        photo.mask[..., None], np.maximum(start.specular + (start.diffuse - diffuse), 0), 0
    ).astype(np.float32)
    confidence = without_unreliable(start.confidence, residual)
    return Separation(diffuse, specular, start.residual, confidence)


def _continued(values: np.ndarray, known: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """`values` (H, W, 3), replaced by averages of the nearest known ones where not `known`."""
    diagonal = mask_diagonal(mask)
    answer, settled = np.zeros_like(values), np.zeros(known.shape)
    for reach in _REACHES:
        sigma = max(reach * diagonal, 1.0)
        near = np.clip(gaussian_average(known.astype(float), sigma, cut=3) / _ENOUGH, 0, 1)
        share = ((1 - settled) * near)[..., None]
        answer += share * masked_gaussian(values, known, sigma)
        settled += share[..., 0]
    rest = values[known].mean(axis=0)
    return np.where(known[..., None], values, answer + (1 - settled)[..., None] * rest)
