"""Whether an object's fine changes of brightness are relief or paint, from the whole object.

Problem: a patch of grey print may look like relief under some light. Over the whole object they
differ: relief has strong contrast where shading changes fast with the slope, and along that
direction; paint is independent of the light.

Equation: with y the log luminance less its Gaussian average and the gain g = d log S / d slope,
over the blocks of 8 x 8 pixels inside the object,

    c = correlation of log mean y^2 and log (mean |g| + .05)
    r = log (sum |g| (dy / d along g)^2 / sum |g| (dy / d across g)^2)

averaged over the levels of the photo; relief has r > 0, since it changes log shading by g . grad.
The probability of relief is logistic in c and r,

    p = 1 / (1 + exp(-(w_0 + w_c c + w_r r)))

Relief is multiplied by

    b(p) = (p - .3) / .3, at least 0 and at most 1,

so that nothing is added where paint is clearly more likely, and all of it where relief is. The
weights are fitted to the validation set of rendered objects by `benchmarks.detail.relief_rule`.

Citation: the direction of the light shows in the spectrum of relief: A. Pentland, "Finding the
illuminant direction", JOSA 72, 1982, doi:10.1364/JOSA.72.000448; M. Chantler et al., "Classifying
surface texture while simultaneously estimating illumination direction", IJCV 62, 2005,
doi:10.1007/s11263-005-4635-4.

Limits: one probability for an object, so an object with both print and relief gets an intermediate
one. A pattern of stripes that is aligned with the light by chance looks like relief. Where the
light is the same from everywhere there is no evidence.
"""

from dataclasses import dataclass

import numpy as np

from ..imaging.blocks import block_means
from ..imaging.smoothing import masked_gaussian

_BLOCK = 8  # pixels
_SMOOTH = 2.0  # standard deviation of the average, pixels
_DARK = 0.01  # of the object's mean light
_LEAST_GAIN = 0.05
_FEWEST = 30  # blocks
_NOTHING, _ALL = 0.3, 0.6  # probabilities: up to the one nothing is added, from the other all


@dataclass(frozen=True)
class Evidence:
    """Evidence of a level, or its mean over levels.

    Attributes
    ----------
    correlation : float
        c above.
    along : float
        r above.
    """

    correlation: float
    along: float


@dataclass(frozen=True)
class ReliefRule:
    """Logistic regression of the probability of relief.

    Attributes
    ----------
    offset, correlation, along : float
        Weights of the logistic regression.
    """

    offset: float
    correlation: float
    along: float

    def probability(self, evidence: Evidence) -> float:
        """Return the probability of relief.

        Parameters
        ----------
        evidence : Evidence

        Returns
        -------
        float
        """
        odds = self.offset + self.correlation * evidence.correlation + self.along * evidence.along
        return float(1 / (1 + np.exp(-np.clip(odds, -30, 30))))

    def share(self, evidence: Evidence | None) -> float:
        """Return the factor of the relief that was found.

        Parameters
        ----------
        evidence : Evidence or None

        Returns
        -------
        float
            0 without evidence, so that no relief is added.
        """
        return 0.0 if evidence is None else added_share(self.probability(evidence))


RULE = ReliefRule(-1.43, 2.66, 1.91)


def added_share(probability: float) -> float:
    """Return which share of a relief is added, b of the module.

    Parameters
    ----------
    probability : float
        Of relief, in [0, 1].

    Returns
    -------
    float
    """
    return float(np.clip((probability - _NOTHING) / (_ALL - _NOTHING), 0, 1))


def evidence_of(
    image: np.ndarray, mask: np.ndarray, gain: tuple[np.ndarray, np.ndarray]
) -> Evidence | None:
    """Compute the evidence of one level of a photo.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear diffuse light over the object's mean; sides are multiples of 8.
    mask : (H, W) bool ndarray
    gain : tuple of (H, W) ndarray
        Derivatives of log shading by the slopes dz/dx and dz/dy, x right and y down.

    Returns
    -------
    Evidence or None
        None where the object is too small.
    """
    luminance = np.log(np.where(mask, image.mean(axis=2), 1) + _DARK)
    change = np.where(mask, luminance - masked_gaussian(luminance, mask, _SMOOTH), 0)
    whole = block_means(mask.astype(np.float64), _BLOCK) == 1
    if whole.sum() < _FEWEST:
        return None
    size = np.hypot(*gain)
    energy, mean = block_means(change**2, _BLOCK)[whole], block_means(size, _BLOCK)[whole]
    down, right = np.gradient(change)
    along = right * gain[0] + down * gain[1]
    across = right * gain[1] - down * gain[0]
    ratios = [
        float(block_means(part**2 / np.maximum(size, 1e-6), _BLOCK)[whole].sum())
        for part in (along, across)
    ]
    if min(ratios) <= 0:
        return None
    return Evidence(
        _correlation(np.log(energy + 1e-8), np.log(mean + _LEAST_GAIN)),
        float(np.log(ratios[0] / ratios[1])),
    )


def mean_evidence(found: list[Evidence | None]) -> Evidence | None:
    """Average the evidence of several levels.

    Parameters
    ----------
    found : list of Evidence or None

    Returns
    -------
    Evidence or None
        None if no level has evidence.
    """
    known = [one for one in found if one is not None]
    if not known:
        return None
    return Evidence(
        float(np.mean([one.correlation for one in known])),
        float(np.mean([one.along for one in known])),
    )


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    a, b = a - a.mean(), b - b.mean()
    size = float(np.sqrt((a * a).sum() * (b * b).sum()))
    return float((a * b).sum()) / size if size > 0 else 0.0
