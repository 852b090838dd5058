"""The fit of a gloss at the working scale, without the held-out pixels.

Method: the objective F of `gloss_objective` is minimised starting from the light of the initial
lobe and from the two brightest spots of the specular layer; the lowest F is used. Further lamps
start at the brightest spot of the residual, and are kept if F decreases by more than the number of
their unknowns. The object is divided into blocks of pixels, a quarter as wide as the bright area;
in the order of their specular light, every fifth is held out.

Citation: M. Stone 1974, doi:10.1111/j.2517-6161.1974.tb00994.x (held-out data).

Limits: those of `gloss_objective`. Held-out pixels are close to fitted ones.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from ..io.stage_cache import Arrays, KeptStages
from ..lobe_fitting.specular_level import lamp_shading
from ..lobe_fitting.starts import light_of_half_vector
from ..numerics.lbfgs import LbfgsOptions, NumpyAlgebra, minimise
from ..progress import Monitor
from ..scene.decomposition import Decomposition
from ..scene.lobe_fit import LobeFit
from ..shading.brdf.ggx import F0
from .gloss_objective import (
    Gloss,
    GlossData,
    GlossObjective,
    height_slopes,
    normals_from_slopes,
    rendered,
    thresholded,
)
from .height_bumps import HeightBumps
from .held_out import held_out_blocks, pixels_of
from .working_scale import WorkingScale

_SPACINGS, _SLOPES = (0.03, 0.12), (0.1, 0.1)  # spacings: fractions of the object's longer side
_MIN_SPACING = 2.0  # pixels
_BLOCKS, _SHARE = (2, 8), 5  # sides of a block, pixels; one in this many blocks is held out
_BRIGHT, _ACROSS = 0.3, 4  # of the peak; blocks across the bright area
_SPOTS = 2
_SPOT, _FAINT = 0.4, 0.15  # fractions of the peak: at the edge of a spot, of the faintest spot
_MIN_DISTANCE = 3  # pixels
_LAMP_UNKNOWNS = 4


@dataclass(frozen=True, eq=False)
class GlossProblem:
    """The data of the fit of a gloss.

    Attributes
    ----------
    work : WorkingScale
        The maps.
    data : GlossData
        All pixels.
    held : (N,) ndarray of bool
        Held-out pixels.
    bumps : HeightBumps or None
        Degrees of freedom of the shape; None keeps the shape.
    """

    work: WorkingScale
    data: GlossData
    held: np.ndarray
    bumps: HeightBumps | None

    @property
    def fitted(self) -> GlossData:
        """The data without the held-out pixels."""
        return replace(self.data, weight=np.where(self.held, 0.0, 1.0))

    def unpacked(self, x: np.ndarray) -> Gloss:
        """Return the gloss of a vector of unknowns.

        Parameters
        ----------
        x : (M,) ndarray
            From `Gloss.packed`.

        Returns
        -------
        Gloss
        """
        return Gloss.unpacked(x, 0 if self.bumps is None else self.bumps.size)

    def normal(self, gloss: Gloss) -> np.ndarray:
        """Return the normals of the changed shape.

        Parameters
        ----------
        gloss : Gloss

        Returns
        -------
        (h, w, 3) ndarray
            Unit vectors.
        """
        down, right = self.data.down, self.data.right
        if self.bumps is None:
            return normals_from_slopes(down, right)
        more_down, more_right = height_slopes(self.bumps.height(gloss.bumps))
        return normals_from_slopes(down + more_down, right + more_right)


def gloss_problem(d: Decomposition, fit: LobeFit, work: WorkingScale, seed: int) -> GlossProblem:
    """Set up the fit of a result's gloss.

    Parameters
    ----------
    d : Decomposition
    fit : LobeFit
        Its lobe, with known roughness and a light.
    work : WorkingScale
        Its maps, reduced.
    seed : int
        Of the random choice of held-out blocks.

    Returns
    -------
    GlossProblem
    """
    assert fit.alpha is not None
    down, right = work.slopes
    direction = np.asarray(fit.lights[0].direction, float)
    data = GlossData(
        work.specular[work.mask],
        work.clipped[work.mask],
        np.ones(int(work.mask.sum())),
        down,
        right,
        work.mask,
        fit.alpha,
        direction,
        np.pi * lamp_shading(d, direction),
    )
    moves = d.camera is None and "shape" not in d.provenance.known
    return GlossProblem(work, data, _held_out(work, seed), bumps_of(work) if moves else None)


def bumps_of(work: WorkingScale, step: int = 1) -> HeightBumps:
    """Return the degrees of freedom of the shape.

    Parameters
    ----------
    work : WorkingScale
    step : int, optional
        As for `HeightBumps.spaced`: the same bumps on the result's own maps.

    Returns
    -------
    HeightBumps
    """
    height, width = work.mask.shape
    spacings = tuple(max(share * max(height, width), _MIN_SPACING) for share in _SPACINGS)
    return HeightBumps.spaced((height, width), spacings, _SLOPES, step)


@dataclass(frozen=True, eq=False)
class Minimiser:
    """Minimises F, or takes the minimum from an earlier run.

    Attributes
    ----------
    steps : int
        Maximum number for each start.
    kept : KeptStages or None
        Results of earlier runs, to which those of this one are added.
    inputs : tuple of ndarray
        All that a minimum depends on, besides the start and which pixels are fitted.
    """

    steps: int
    kept: KeptStages | None = None
    inputs: tuple[np.ndarray, ...] = ()

    def __call__(self, objective: GlossObjective, x: np.ndarray, monitor: Monitor) -> float:
        """Minimise F in place.

        Parameters
        ----------
        objective : GlossObjective
        x : (M,) ndarray
            Changed in place.
        monitor : Monitor

        Returns
        -------
        float
            The loss.
        """

        def each(step: int, loss: float) -> None:
            fraction = min(step / self.steps, 1.0)
            monitor.report("refining the gloss", fraction, f"loss {loss:.1f}")

        def compute() -> Arrays:
            limits = LbfgsOptions(iterations=self.steps, loss_tolerance=1e-4)
            found = x.copy()
            loss = minimise(objective, found, limits, NumpyAlgebra(), each).loss
            return {"x": found, "loss": np.array(loss)}

        inputs = (*self.inputs, np.array(self.steps), objective.weight, x)
        found = (
            compute() if self.kept is None else self.kept.arrays("gloss minimum", inputs, compute)
        )
        x[:] = found["x"]
        return float(found["loss"])


def fit_gloss(problem: GlossProblem, lamps: int, minimised: Minimiser, monitor: Monitor) -> Gloss:
    """Fit a gloss to the pixels that are not held out.

    Parameters
    ----------
    problem : GlossProblem
    lamps : int
        Maximum number.
    minimised : Minimiser
    monitor : Monitor

    Returns
    -------
    Gloss

    Raises
    ------
    Cancelled
        If the user cancels.
    """
    data, work = problem.fitted, problem.work
    objective, starts = GlossObjective(data, problem.bumps), list[tuple[float, np.ndarray]]()
    for k, direction in enumerate([data.direction, *_spots(data.specular, work, _SPOTS)]):
        x = _start(problem, direction)
        part = monitor.part(0.2 * k, 0.2 * (k + 1))
        starts.append((minimised(objective, x, part), x))
    loss, x = min(starts, key=lambda one: one[0])
    for count in range(2, lamps + 1):
        gloss = problem.unpacked(x)
        light = rendered(gloss, problem.normal(gloss)[work.mask])
        residual = data.weight * (data.specular - thresholded(gloss, light, data.peak))
        spots = _spots(residual, work, 1)
        if not spots:
            break
        found = replace(
            gloss,
            directions=np.vstack([gloss.units, spots[0]]),
            log_strengths=np.append(gloss.log_strengths, gloss.log_strengths.max() - 1),
        ).packed()
        part = monitor.part(0.6 + 0.2 * (count - 2), 0.6 + 0.2 * (count - 1))
        lower = minimised(objective, found, part)
        if lower > loss - _LAMP_UNKNOWNS:
            break
        loss, x = lower, found
    return problem.unpacked(x)


def explained(problem: GlossProblem, gloss: Gloss, start: np.ndarray) -> tuple[float, float]:
    """Return the shares of the squared held-out light that the initial and the new gloss explain.

    Parameters
    ----------
    problem : GlossProblem
    gloss : Gloss
    start : (N,) ndarray
        Prediction of the initial lobe.

    Returns
    -------
    before, after : float
        Negative where the prediction is worse than none; clipped pixels are ignored.
    """
    data, which = problem.data, problem.held & ~problem.data.clipped
    light = rendered(gloss, problem.normal(gloss)[problem.work.mask])
    total = max(float(np.square(data.specular[which]).sum()), 1e-30)
    errors = (start - data.specular, light - data.specular)
    before, after = (1 - float(np.square(error[which]).sum()) / total for error in errors)
    return before, after


def _start(problem: GlossProblem, direction: np.ndarray) -> np.ndarray:
    """The initial unknowns: one lamp whose highlight has the peak of the specular layer."""
    data = problem.data
    height = float(np.log(4 * np.pi * data.alpha**2 * data.peak / F0))
    return Gloss(
        np.zeros(0 if problem.bumps is None else problem.bumps.size),
        direction[None],
        np.array([min(height, float(np.log(data.irradiance)))]),
        float(np.log(data.alpha)),
        data.log_level,
    ).packed()


def _held_out(work: WorkingScale, seed: int) -> np.ndarray:
    values = work.specular[work.mask]
    bright = float(np.sqrt((values > _BRIGHT * values.max()).sum()))
    side = int(np.clip(bright / _ACROSS, *_BLOCKS))
    blocks = held_out_blocks(np.where(work.mask, work.specular, 0), side, _SHARE, seed)
    return pixels_of(blocks, side, work.mask.shape)[work.mask]


def _spots(values: np.ndarray, work: WorkingScale, count: int) -> list[np.ndarray]:
    """Lights (3,) that the recovered normals reflect at the brightest spots of `values` (N,)."""
    image = np.zeros(work.mask.shape)
    image[work.mask] = np.maximum(values, 0)
    image = ndimage.gaussian_filter(image, 1.0)
    faintest, found = _FAINT * float(image.max()), list[np.ndarray]()
    while len(found) < count and image.max() > faintest:
        peak = np.unravel_index(int(np.argmax(image)), image.shape)
        label, _ = ndimage.label(image > _SPOT * image[peak])
        spot = label == label[peak]
        half = (work.normal[spot] * image[spot][:, None]).sum(axis=0)
        half[2] = max(half[2], 0.2 * float(np.linalg.norm(half)))
        found.append(light_of_half_vector(half / np.linalg.norm(half)))
        image = np.where(ndimage.binary_dilation(spot, iterations=_MIN_DISTANCE), 0, image)
    return found
