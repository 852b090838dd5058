"""Options of the separator."""

from dataclasses import dataclass

import numpy as np

from ...errors import InputError


@dataclass(frozen=True)
class IscOptions:
    """Options of the separator.

    Ramps are pairs: 0 up to the first number, 1 from the second on (descending ones reversed).

    Attributes
    ----------
    hues : int
        Cells around the circle of hues, >= 6.
    cell : float
        Side of the grid's cells as a share of the object's longer side, in (0, 1].
    low_quantile : float
        Quantile of min I / max I over pixels of similar hue that is the diffuse ratio, in (0, 1); a
        lower one removes more.
    borrowed : float
        Votes of the pixels of similar hue everywhere in a cell; >= 0.
    colourful : tuple[float, float]
        Ramp of the bright pixels' saturation, sum C / sum max I.
    smooth : tuple[float, float]
        Ramp of the roughness of the whole candidate, descending.
    smooth_here : tuple[float, float]
        Ramp of the local roughness, descending.
    unmixed : tuple[float, float]
        Ramp of the reflectance mixing of the whole candidate, falling.
    bright : tuple[float, float]
        Ramp of min I over its mean.
    clear : tuple[float, float]
        Ramp of s over `scatter` times the remainder, by hue.
    scatter : float
        See `clear`.
    scatter_here : float
        Least relative scatter of q by place.
    coloured : tuple[float, float]
        Ramp of 1 - min / max of the reflectance, by place.
    present : tuple[float, float]
        Ramp of C over that of similar pixels.
    unmixed_here, smooth_by_place : tuple[float, float]
        As above, by place.
    proven : tuple[float, float]
        Ramp of the gain around which `faint` applies.
    faint : tuple[float, float]
        Ramp of s over its error, near proven highlights.
    filters : bool
        Whether to use the filter statistics too, see `filter_statistics`: fewer false highlights,
        fewer true ones.
    odds : float
        Odds of a highlight against print that a region must exceed, >= 0; 0: colour alone decides.
    """

    hues: int = 48
    cell: float = 0.08
    low_quantile: float = 0.25
    borrowed: float = 100.0
    colourful: tuple[float, float] = (0.43, 0.51)
    smooth: tuple[float, float] = (0.43, 0.35)
    smooth_here: tuple[float, float] = (0.8, 0.5)
    unmixed: tuple[float, float] = (0.55, 0.3)
    bright: tuple[float, float] = (1.0, 1.6)
    clear: tuple[float, float] = (0.3, 0.85)
    scatter: float = 0.035
    scatter_here: float = 0.1
    coloured: tuple[float, float] = (0.35, 0.5)
    present: tuple[float, float] = (0.62, 1.05)
    unmixed_here: tuple[float, float] = (0.3, 0.05)
    smooth_by_place: tuple[float, float] = (0.8, 0.5)
    proven: tuple[float, float] = (0.5, 0.95)
    faint: tuple[float, float] = (0.2, 1.0)
    filters: bool = False
    odds: float = 1.0


VARIANTS: dict[str, IscOptions] = {"improved": IscOptions()}


def check_options(options: IscOptions, prior: np.ndarray | None, mask: np.ndarray) -> None:
    """Check options and prior.

    Parameters
    ----------
    options : IscOptions
    prior : (H, W) ndarray or None
    mask : (H, W) bool ndarray

    Raises
    ------
    InputError
        If one is invalid.
    """
    if (
        options.hues < 6
        or not 0 < options.cell <= 1
        or not 0 < options.low_quantile < 1
        or not 0 <= options.borrowed < np.inf
    ):
        raise InputError(
            "hues must be at least 6, cell within (0, 1], low_quantile within (0, 1), borrowed at "
            "least 0"
        )
    if not 0 <= options.odds < np.inf:
        raise InputError(f"odds must be finite and at least 0, such as 1, not {options.odds:g}")
    if not (0 <= options.scatter < np.inf and 0 <= options.scatter_here < np.inf):
        raise InputError("scatter and scatter_here must be finite and at least 0")
    for name, ends in vars(options).items():
        if isinstance(ends, tuple) and (
            len(ends) != 2 or not np.isfinite(ends).all() or ends[0] == ends[1]
        ):
            raise InputError(f"{name} must be two different numbers, the ends of a ramp")
    if prior is None:
        return
    if prior.shape != mask.shape:
        raise InputError(f"the prior must have the photo's size {mask.shape}, not {prior.shape}")
    if not np.isfinite(prior[mask]).all() or prior[mask].min() < 0 or prior[mask].max() > 1:
        raise InputError("the prior must lie within [0, 1] inside the mask")
