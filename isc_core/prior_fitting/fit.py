"""Fits every prior of SIRFS to a selection of training objects.

Each statistic has its own module. In the statistics of absolute colour, objects have equal weights;
in those of smoothness, pairs of pixels do. No random numbers.

Citation: J. T. Barron, J. Malik (2015), "Shape, illumination, and reflectance from shading",
doi:10.1109/TPAMI.2014.2377712.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

from ..errors import InputError
from ..progress import Monitor
from ..sirfs.priors.absolute_table import splat
from ..sirfs.priors.color_mixture import ColorCells, fit_color_mixture
from ..sirfs.priors.lights import Contrast, fit_contrast, fit_light, mirrored, permuted, scaled
from ..sirfs.priors.prior_set import FitRecord, LightPriors, PriorSet
from ..sirfs.priors.scale_mixture import Magnitudes, ScaleMixture, fit_scale_mixture
from .absolute_color import COLOR_NODES, GREY_NODES, TableFitOptions, fit_absolute_table
from .silhouette import fit_silhouette
from .statistics import ObjectStatistics
from .whitening import parsimony_whitening


@dataclass(frozen=True)
class LightFitOptions:
    """Options of the fit of the light priors.

    Attributes
    ----------
    natural_contrast : Contrast or None
        Factors on the environments' coefficients; None fits them to the training objects' natural
        lights. Likelihood alone gives 2.6 in brightness (1.9 if colour shares the factor); held-out
        accuracy is best nearer 1.6 in brightness and 0.7 in colour, the default.
    split_contrast : bool
        Whether brightness and colour have separate factors.
    mirror : bool
        Whether the mirror images of lights are samples, too.
    permute_natural, permute_laboratory : bool
        Whether all permutations of a light's channels are samples.
    laboratory_ridge : tuple of float
        See `fit_light`; ten lights leave many directions unobserved, so a ridge makes held-out
        lights much more likely.
    floor : float
        Added where the solver whitens, see `GaussianLight`.
    photo_contrast : Contrast
        Factors on the coefficients of photos' lights.
    photo_ridge : tuple of float
        See `fit_light`.
    """

    natural_contrast: Contrast | None = field(default_factory=lambda: Contrast(1.6, 0.7))
    split_contrast: bool = True
    mirror: bool = True
    permute_natural: bool = False
    permute_laboratory: bool = True
    laboratory_ridge: tuple[float, float] = (0.05, 0.0005)
    floor: float = 0.01
    photo_contrast: Contrast = field(default_factory=Contrast)
    photo_ridge: tuple[float, float] = (0.02, 0.0005)


@dataclass(frozen=True)
class FitOptions:
    """Options of the fit of the priors.

    Attributes
    ----------
    components : int
        Components of the scalar mixtures.
    iterations : int
        Steps of expectation maximisation, for all mixtures.
    whiten_floor : float
        See `whitening`.
    absolute, grey_absolute : TableFitOptions
        The tables of absolute reflectance. The smoothness of the grey one maximises the likelihood
        of held-out objects; with only 256 nodes, it can be fitted closely.
    light : LightFitOptions
    relief, texture : float
        Deviations that are added to those of the differences of curvature (1 / pixel) and of log
        reflectance: synthetic objects and paints are smoother than real ones, which would cause a
        spike of the costs at 0.
    """

    components: int = 40
    iterations: int = 200
    whiten_floor: float = 0.01
    absolute: TableFitOptions = field(default_factory=TableFitOptions)
    grey_absolute: TableFitOptions = field(
        default_factory=lambda: TableFitOptions(smoothness=24.0, tolerance=1e-7, max_steps=3000)
    )
    light: LightFitOptions = field(default_factory=LightFitOptions)
    relief: float = 0.0
    texture: float = 0.0

    def with_fitted_contrast(self) -> "FitOptions":
        """Return options that fit the contrast of the natural lights to the objects' own lights."""
        return replace(self, light=replace(self.light, natural_contrast=None))


# For synthetic objects and paints. Both values were chosen on held-out objects.
SYNTHETIC = FitOptions(relief=0.003, texture=0.02)
# As published (Barron & Malik 2015): unscaled lights, no ridge, the table's constant 512. The
# defaults are ours.
PUBLISHED = FitOptions(
    light=LightFitOptions(natural_contrast=Contrast(), laboratory_ridge=(0.0, 0.0)),
    absolute=TableFitOptions(512.0),
)


def fit_priors(
    statistics: Mapping[str, ObjectStatistics],
    natural_lights: np.ndarray,
    options: FitOptions | None = None,
    monitor: Monitor | None = None,
) -> PriorSet:
    """Fit the priors of a selection of objects.

    Parameters
    ----------
    statistics : mapping of str to ObjectStatistics
        See `collect_statistics`; the order does not matter.
    natural_lights : (9, 3, n) ndarray
        Lights of environments, reference convention.
    options : FitOptions, optional
    monitor : Monitor, optional

    Returns
    -------
    PriorSet

    Raises
    ------
    InputError
        If there are fewer than two objects.
    Cancelled
        If the monitor cancels.
    """
    options, monitor = options or FitOptions(), monitor or Monitor()
    objects = _objects(statistics)
    lights, contrast = fit_lights(objects, natural_lights, options.light)
    return _fit(statistics, lights, contrast, options, monitor)


def fit_photo_priors(
    statistics: Mapping[str, ObjectStatistics],
    photo_lights: np.ndarray,
    options: FitOptions | None = None,
    monitor: Monitor | None = None,
) -> PriorSet:
    """Fit the priors of photos: objects of any source, and lights of photos.

    Parameters
    ----------
    statistics : mapping of str to ObjectStatistics
        Their lights are not used; the order does not matter.
    photo_lights : (n, 9, 3) ndarray
        Lights of white-balanced photos, reference convention. Of `LightFitOptions`, `mirror`,
        `photo_contrast`, `photo_ridge` and `floor` apply.
    options : FitOptions, optional
    monitor : Monitor, optional

    Returns
    -------
    PriorSet
        For photos only.

    Raises
    ------
    InputError
        If there are fewer than two objects.
    Cancelled
        If the monitor cancels.
    """
    options, monitor = options or FitOptions(), monitor or Monitor()
    given = options.light
    lights = _augmented(photo_lights, given.mirror, False)
    fitted = scaled(fit_light(lights, given.photo_ridge, given.floor), given.photo_contrast)
    return _fit(statistics, LightPriors(photo=fitted), given.photo_contrast, options, monitor)


def _objects(statistics: Mapping[str, ObjectStatistics]) -> list[ObjectStatistics]:
    if len(statistics) < 2:
        raise InputError("priors need at least two training objects: give a folder with more")
    return [statistics[name] for name in sorted(statistics)]


def _fit(
    statistics: Mapping[str, ObjectStatistics],
    lights: LightPriors,
    contrast: Contrast,
    options: FitOptions,
    monitor: Monitor,
) -> PriorSet:
    """Fit the statistics of the objects, and combine them with the light priors."""
    objects = _objects(statistics)
    monitor.report("smoothness of shape and reflectance", 0.0)
    curvature, grey_smoothness = (
        _widened(
            fit_scale_mixture(Magnitudes.merged(parts), options.components, options.iterations),
            added,
        )
        for parts, added in (
            ([o.curvature for o in objects], options.relief),
            ([o.grey_smoothness for o in objects], options.texture),
        )
    )
    color_smoothness = fit_color_mixture(
        ColorCells.merged(o.color_smoothness for o in objects), options.iterations
    )
    color_smoothness = replace(
        color_smoothness, variances=color_smoothness.variances + options.texture**2
    )
    whiten = fit_whitening(objects, options.whiten_floor)
    grey_absolute = fit_absolute_table(
        grey_histogram(objects),
        options.grey_absolute,
        _steps("absolute grey", monitor.part(0.25, 0.3)),
    )
    absolute = fit_absolute_table(
        color_histogram(objects, whiten),
        options.absolute,
        _steps("absolute colour", monitor.part(0.3, 1.0)),
    )
    silhouette = fit_silhouette([o.silhouette for o in objects])
    record = FitRecord(tuple(sorted(statistics)), contrast, _as_text(options))
    monitor.report("priors fitted", 1.0)
    return PriorSet(
        curvature,
        grey_smoothness,
        color_smoothness,
        whiten,
        absolute,
        grey_absolute,
        silhouette,
        lights,
        record,
    )


def _widened(mixture: ScaleMixture, deviation: float) -> ScaleMixture:
    """The density of the sum of a sample of the mixture and Gaussian noise of this deviation."""
    return replace(mixture, deviations=np.sqrt(mixture.deviations**2 + deviation**2))


def _steps(stage: str, monitor: Monitor) -> Callable[[float], None]:
    """Report the steps of a table's fit; their number is unknown, so the fraction approaches 1."""
    count = itertools.count(1)

    def on_step(loss: float) -> None:
        monitor.report(stage, 1 - 0.98 ** next(count), f"loss {loss:.4f}")

    return on_step


def fit_whitening(objects: Sequence[ObjectStatistics], floor: float = 0.01) -> np.ndarray:
    """Return the whitening of log reflectance; objects have equal weights.

    Parameters
    ----------
    objects : sequence of ObjectStatistics
    floor : float
        Added to the second moments of log reflectance along the principal axes.

    Returns
    -------
    (3, 3) ndarray
        Symmetric.
    """
    return parsimony_whitening(np.mean([o.second_moment() for o in objects], axis=0), floor)


def color_histogram(
    objects: Sequence[ObjectStatistics], whiten: np.ndarray, nodes: int = COLOR_NODES
) -> np.ndarray:
    """Return the histogram of whitened log reflectance; objects have equal weights.

    Parameters
    ----------
    objects : sequence of ObjectStatistics
    whiten : (3, 3) ndarray
    nodes : int

    Returns
    -------
    (nodes, nodes, nodes) ndarray
        Sum 1.
    """
    return _histogram([o.log_reflectance @ whiten.T for o in objects], nodes)


def grey_histogram(objects: Sequence[ObjectStatistics], nodes: int = GREY_NODES) -> np.ndarray:
    """Return the histogram of grey log reflectance; objects have equal weights.

    Parameters
    ----------
    objects : sequence of ObjectStatistics
    nodes : int
        Number of nodes.

    Returns
    -------
    (nodes,) ndarray
        Sum 1.
    """
    return _histogram([o.grey_log_reflectance for o in objects], nodes)


def _histogram(points: Sequence[np.ndarray], nodes: int) -> np.ndarray:
    weights = [np.full(len(p), 1 / (len(p) * len(points))) for p in points]
    return splat(np.concatenate(points).astype(float), nodes, np.concatenate(weights))


def fit_lights(
    objects: Sequence[ObjectStatistics], natural_lights: np.ndarray, options: LightFitOptions
) -> tuple[LightPriors, Contrast]:
    """Fit the light priors.

    Parameters
    ----------
    objects : sequence of ObjectStatistics
    natural_lights : (9, 3, n) ndarray
    options : LightFitOptions

    Returns
    -------
    lights : LightPriors
    contrast : Contrast
        Factors on the contrast of `natural_lights`.
    """
    natural, laboratory = (
        [getattr(o, name) for o in objects] for name in ("natural_light", "laboratory_light")
    )
    if any(light is None for light in (*natural, *laboratory)):
        raise InputError("the lights of some training objects are unknown: leave these out")
    environments = fit_light(
        _augmented(natural_lights.transpose(2, 0, 1), options.mirror, options.permute_natural),
        floor=options.floor,
    )
    contrast = options.natural_contrast
    if contrast is None:
        contrast = fit_contrast(environments, np.array(natural), options.split_contrast)
    augmented = _augmented(np.array(laboratory), options.mirror, options.permute_laboratory)
    return LightPriors(
        scaled(environments, contrast),
        fit_light(augmented, options.laboratory_ridge, options.floor),
    ), contrast


def _augmented(lights: np.ndarray, mirror: bool, permute: bool) -> np.ndarray:
    if mirror:
        lights = mirrored(lights)
    return permuted(lights) if permute else lights


def _as_text(options: FitOptions) -> dict[str, str]:
    """Every option by its dotted name."""
    text = {}
    for entry in fields(options):
        value = getattr(options, entry.name)
        if isinstance(value, TableFitOptions | LightFitOptions):
            text.update(
                {
                    f"{entry.name}.{inner.name}": str(getattr(value, inner.name))
                    for inner in fields(value)
                }
            )
        else:
            text[entry.name] = str(value)
    return text
