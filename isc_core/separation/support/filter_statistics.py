"""A prior for highlights from the statistics of filter outputs, for the separator `isc`.

Problem: highlights are compact and bounded by steep flanks, shading is smooth, reflectance is
piecewise constant. So the outputs of small filters are distributed differently on diffuse and on
specular light (thesis, section 3.6.5.1, figure 3.12), and the outputs around a pixel are
informative whatever the colours are.

Equation: L = log of the smoothed intensity over the object's; at widths w, shares of the object's
diagonal, the outputs r_f are the slope w dL, the curvature w^2 ddL (along both axes, one histogram)
and the difference of Gaussians G_w L - G_2w L. Each has a histogram over asinh(r / spread), which
is fine in the middle and coarse in the heavy tails, once with and once without a highlight. With G
the mean over the neighbourhood,

    p = 1 / (1 + exp(-Lambda / T)),    Lambda = G sum_f log(h_f(r_f | highlight) / h_f(r_f | none)).

Neighbouring outputs are far from independent, so Lambda is overconfident: the temperature T, chosen
on held-out scenes, corrects that. Both classes have equal weight: 0.5 is neutral, as in the `prior`
of `isc`. `python -m benchmarks.separation.filter_statistics fit` fits histograms and T to rendered
scenes.

Citation: H. Akbar 2016; heavy-tailed outputs of derivative filters: B. A. Olshausen and D. J. Field
1996, doi:10.1038/381607a0, J. Huang and D. Mumford 1999, doi:10.1109/CVPR.1999.786990; the
temperature: C. Guo et al. 2017, arXiv:1706.04599.

Limits: round shapes under a near light source look like broad highlights and vice versa;
docs/methods/filter_statistics.md measures the benefit.
"""

import importlib.resources
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...filters.interpolation import linear_interpolation, resampled_plane
from ...imaging.blocks import padded_means_inside
from ...imaging.bounding_box import mask_slices
from ...imaging.smoothing import masked_gaussian
from ...io.npy import parse_arrays
from ...io.regular_files import read_regular

WIDTHS = (0.006, 0.015, 0.04)  # of the object's diagonal
KINDS = ("slope", "curvature", "difference")
FILTERS = tuple((kind, width) for width in WIDTHS for kind in KINDS)
BINS = 25  # odd: the middle one is around 0
# asinh(r / spread) at the outermost edges, about 27 spreads; larger values fall into the last bins.
_REACH = 4.0
_POOLED = 0.05  # of the diagonal: sigma of the averaging of the log-likelihood ratios
_DARK = 0.05  # of the mean intensity: below it, logarithms are dominated by noise
_MAX_SIDE = 192  # pixels: longer objects are block-averaged before filtering
_MARGIN = 0.02  # distance that probabilities keep from 0 and 1
_ARRAYS = ("spread", "without", "highlight", "temperature")


@dataclass(frozen=True, eq=False)
class FilterTable:
    """Histograms of filter outputs. F = len(FILTERS).

    Attributes
    ----------
    spread : (F,) ndarray
        Unit of each filter's outputs, greater than 0.
    without, highlight : (F, BINS) ndarray
        Histograms, greater than 0, each of sum 1.
    temperature : float
        Greater than 0.
    """

    spread: np.ndarray
    without: np.ndarray
    highlight: np.ndarray
    temperature: float

    def evidence(self, outputs: np.ndarray) -> np.ndarray:
        """Return log-likelihood ratios, summed over filters.

        Parameters
        ----------
        outputs : (N, F, 2) ndarray
            An axis that is not finite is neutral.

        Returns
        -------
        (N,) ndarray
        """
        ratio = np.log(self.highlight / self.without)
        total = np.zeros(outputs.shape[0])
        for number, unit in enumerate(self.spread):
            values = outputs[:, number]
            valid = np.isfinite(values)
            terms = np.where(valid, ratio[number][bins(np.where(valid, values, 0), unit)], 0)
            total += terms.sum(axis=1) / np.maximum(valid.sum(axis=1), 1)
        return total


def bins(values: np.ndarray, spread: float) -> np.ndarray:
    """Return the histogram bin of each output of a filter.

    Parameters
    ----------
    values : ndarray
        Outputs of the filter.
    spread : float
        Unit of the outputs, greater than 0.

    Returns
    -------
    int64 ndarray
        In [0, BINS), of the shape of `values`.
    """
    place = (np.arcsinh(values / spread) / _REACH + 1) * (BINS / 2)
    return np.clip(place, 0, BINS - 1).astype(np.int64)


def bin_edges() -> np.ndarray:
    """Return the edges (BINS + 1,) of the histograms, in units of asinh(output / spread)."""
    return np.linspace(-_REACH, _REACH, BINS + 1)


@cache
def shipped_table() -> FilterTable:
    """Return the table that ships with the package."""
    resource = importlib.resources.files(__package__) / "data" / "filter_statistics.npz"
    return _read(resource.read_bytes(), "the shipped table")


def read_table(path: str | Path) -> FilterTable:
    """Read a table of `benchmarks.separation.filter_statistics fit`.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    FilterTable

    Raises
    ------
    InputError
        If the file holds none.
    """
    try:
        data = read_regular(path, remedy="use a table of filter statistics")
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from error
    return _read(data, str(path))


def _read(data: bytes, name: str) -> FilterTable:
    try:
        arrays = parse_arrays(data, name)
        with np.errstate(invalid="ignore"):  # non-finite values are rejected below
            spread, without, highlight, temperature = (
                np.asarray(arrays[key], float) for key in _ARRAYS
            )
    except (ValueError, KeyError) as error:
        raise InputError(
            f"{name} is not a table of filter statistics: fit one with "
            "`python -m benchmarks.separation.filter_statistics`"
        ) from error
    shape = (len(FILTERS), BINS)
    fit = (
        spread.shape == shape[:1]
        and without.shape == shape
        and highlight.shape == shape
        and temperature.shape == ()
    )
    if not fit or not all(
        (np.isfinite(values) & (values > 0)).all()
        for values in (spread, without, highlight, temperature)
    ):
        raise InputError(
            f"{name} does not match the filters of this version: refit it with "
            "`python -m benchmarks.separation.filter_statistics`"
        )
    return FilterTable(spread, without, highlight, float(temperature))


def highlight_prior(
    image: np.ndarray, mask: np.ndarray, table: FilterTable | None = None
) -> np.ndarray:
    """Return the probability of a visible highlight at each pixel.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear, not negative inside the mask, of any exposure.
    mask : (H, W) bool ndarray
    table : FilterTable, optional
        By default the shipped one.

    Returns
    -------
    (H, W) float32 ndarray
        In [0.02, 0.98]; 0.5 outside the mask.

    Raises
    ------
    InputError
        If the mask is empty.
    """
    if not mask.any():
        raise InputError("the mask is empty: mark at least the object's pixels")
    table, box = table or shipped_table(), mask_slices(mask)
    intensity = np.where(mask[box], image[box].mean(axis=2, dtype=float), 0)
    light, inside, factor = reduced(intensity, mask[box])
    pooled = pooled_evidence(light, inside, table) / table.temperature
    if factor > 1:
        filled = np.where(inside, pooled, masked_gaussian(pooled, inside, 1.0))
        down, across = (
            linear_interpolation((np.arange(n) + 0.5) / factor - 0.5, m)
            for n, m in zip(intensity.shape, filled.shape, strict=True)
        )
        pooled = resampled_plane(filled, down, across)
    probability = np.full(mask.shape, 0.5, np.float32)
    probability[box] = np.where(
        mask[box], np.clip(1 / (1 + np.exp(-np.clip(pooled, -50, 50))), _MARGIN, 1 - _MARGIN), 0.5
    )
    return probability


def reduced(intensity: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Average intensity and mask over blocks of the mask's pixels, to at most 192 a side.

    Parameters
    ----------
    intensity : (H, W) ndarray
    mask : (H, W) bool ndarray

    Returns
    -------
    intensity, mask : (h, w) ndarray
    side : int
        Of the blocks.
    """
    factor = -(-max(mask.shape) // _MAX_SIDE)
    if factor == 1:
        return intensity, mask, 1
    means, covered = padded_means_inside(intensity, mask, factor)
    inside = covered > 0.5 if (covered > 0.5).any() else covered > 0
    return np.where(inside, means, 0), inside, factor


def pooled_evidence(intensity: np.ndarray, mask: np.ndarray, table: FilterTable) -> np.ndarray:
    """Return Lambda, the log-likelihood ratios averaged over the neighbourhood.

    Parameters
    ----------
    intensity : (H, W) ndarray
        Not negative.
    mask : (H, W) bool ndarray
    table : FilterTable

    Returns
    -------
    (H, W) ndarray
        0 outside the mask.
    """
    ratios = np.zeros(mask.shape)
    ratios[mask] = table.evidence(filter_outputs(intensity, mask))
    return np.where(mask, masked_gaussian(ratios, mask, _POOLED * _diagonal(mask)), 0)


def filter_outputs(intensity: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the filters' outputs at the pixels of a mask, in the order of `FILTERS`.

    Parameters
    ----------
    intensity : (H, W) ndarray
        Not negative.
    mask : (H, W) bool ndarray

    Returns
    -------
    (N, F, 2) ndarray
        The two axes, or one value and NaN; NaN where a neighbour is outside the mask.
    """
    mean = max(float(intensity[mask].mean(dtype=float)), 1e-30)
    logarithm = np.where(mask, np.log(np.maximum(intensity, 0) / mean + _DARK), 0)
    outputs: list[np.ndarray] = []
    for width in WIDTHS:
        sigma = max(width * _diagonal(mask), 0.5)
        smooth = masked_gaussian(logarithm, mask, sigma)
        slopes, curvatures = [], []
        for axis in (0, 1):
            before, after = _neighbour(smooth, mask, 1, axis), _neighbour(smooth, mask, -1, axis)
            slopes.append((sigma * (after - before) / 2)[mask])
            curvatures.append((sigma**2 * (after - 2 * smooth + before))[mask])
        difference = (smooth - masked_gaussian(logarithm, mask, 2 * sigma))[mask]
        outputs += [
            np.stack(slopes, 1),
            np.stack(curvatures, 1),
            np.stack([difference, np.full_like(difference, np.nan)], 1),
        ]
    return np.stack(outputs, axis=1)


def _neighbour(values: np.ndarray, mask: np.ndarray, step: int, axis: int) -> np.ndarray:
    """The values `step` pixels before, along the axis; NaN outside the mask."""
    padded = np.pad(np.where(mask, values, np.nan), 1, constant_values=np.nan)
    return np.roll(padded, step, axis)[1:-1, 1:-1]


def _diagonal(mask: np.ndarray) -> float:
    """Diagonal of the object's box, in pixels."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    return float(np.hypot(rows[-1] - rows[0] + 1, columns[-1] - columns[0] + 1))
