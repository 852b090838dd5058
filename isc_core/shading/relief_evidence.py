"""Whether fine changes of brightness are relief or paint, for each paint of an object.

Problem: a patch of grey print may look like relief under some light. Over many patches they differ:
relief has strong contrast where shading changes fast with the slope, and along that direction;
paint is independent of the light. One object can have both: a printed label beside a knitted
sleeve. They rarely have the same colour.

Equation: with y the log luminance less its Gaussian average, the gain g = d log S / d slope, and
the weight v, which is 0 at edges of paint (`paint_edges.uniformity`), the moments of a block of
8 x 8 pixels are those of

    e = log (mean v y^2 / mean v),   b = log (mean |g| + .05)

and the energies of the changes along and across g, a = mean v |g| (dy / d along g)^2 and a'. Each
block pools those of the whole object with the weights

    w_ij = exp(-|c_i - c_j|^2 / (2 * .2^2)) + 8 / N

where c is the mean of `paint_edges.paint_features`, and N the number of blocks: blocks of its own
paint, and a little of the whole object, in case there are few. The evidence of a block is

    c = correlation of e and b,   r = log (sum w a / sum w a')

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

Limits: print and relief of one colour get an intermediate probability. A pattern of stripes that is
aligned with the light by chance looks like relief. Where the light is the same from everywhere
there is no evidence.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..imaging.blocks import block_means, means_inside
from ..imaging.channels import mean_channel
from ..imaging.smoothing import masked_gaussian

BLOCK = 8  # pixels
_SMOOTH = 2.0  # standard deviation of the average, pixels
_DARK = 0.01  # of the object's mean light
_LEAST_GAIN = 0.05
_LEAST_UNIFORM = 0.3  # of a block: below, it consists of edges of paint
_FEWEST = 30  # blocks
_PAINT = 0.2  # deviation of c within one paint
_OF_ALL = 8.0  # blocks of the whole object that count
_NOTHING, _ALL = 0.3, 0.6  # probabilities: up to the one nothing is added, from the other all
_TINY = 1e-8


@dataclass(frozen=True, eq=False)
class Evidence:
    """Evidence of blocks.

    Attributes
    ----------
    correlation : (rows, columns) ndarray
        c above.
    along : (rows, columns) ndarray
        r above.
    """

    correlation: np.ndarray
    along: np.ndarray


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

    def probability(self, evidence: Evidence) -> np.ndarray:
        """Return the probability of relief.

        Parameters
        ----------
        evidence : Evidence

        Returns
        -------
        (rows, columns) ndarray
        """
        odds = self.offset + self.correlation * evidence.correlation + self.along * evidence.along
        return np.asarray(1 / (1 + np.exp(-np.clip(odds, -30, 30))))


RULE = ReliefRule(-1.95, 5.87, 2.27)


def added_share(probability: np.ndarray) -> np.ndarray:
    """Return which share of a relief is added, b of the module.

    Parameters
    ----------
    probability : ndarray
        Of relief, in [0, 1].

    Returns
    -------
    ndarray
    """
    return np.clip((probability - _NOTHING) / (_ALL - _NOTHING), 0, 1)


def fine_change(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Compute the fine changes of log luminance, y of the module.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear diffuse light over the object's mean.
    mask : (H, W) bool ndarray

    Returns
    -------
    (H, W) ndarray
        0 outside of the mask.
    """
    luminance = np.log(np.where(mask, mean_channel(image), 1) + _DARK)
    return np.where(mask, luminance - masked_gaussian(luminance, mask, _SMOOTH), 0)


def block_moments(
    image: np.ndarray,
    mask: np.ndarray,
    gain: tuple[np.ndarray, np.ndarray],
    uniform: np.ndarray,
    blocks: int = 1,
) -> np.ndarray:
    """Compute what the blocks of one level of a photo contribute to the evidence.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear diffuse light over the object's mean; sides are multiples of 8 times `blocks`.
    mask : (H, W) bool ndarray
    gain : tuple of (H, W) ndarray
        Derivatives of log shading by the slopes dz/dx and dz/dy, x right and y down.
    uniform : (H, W) ndarray
        Weight v, in [0, 1].
    blocks : int, optional
        The moments of this many by this many blocks are averaged.

    Returns
    -------
    (H / 8 / blocks, W / 8 / blocks, 8) ndarray
        The share of blocks that count, their means of e, b, e^2, b^2, e b, a and a'.
    """
    change, size = fine_change(image, mask), np.hypot(*gain)
    share = block_means(uniform.astype(np.float64), BLOCK)
    counts = (block_means(mask.astype(np.float64), BLOCK) == 1) & (share > _LEAST_UNIFORM)
    energy = block_means(change**2 * uniform, BLOCK) / np.maximum(share, _LEAST_UNIFORM)
    e, b = np.log(energy + _TINY), np.log(block_means(size, BLOCK) + _LEAST_GAIN)
    down, right = np.gradient(change)
    changes = right * gain[0] + down * gain[1], right * gain[1] - down * gain[0]
    along, across = (
        block_means(one**2 * uniform / np.maximum(size, 1e-6), BLOCK) for one in changes
    )
    moments = np.stack([np.ones_like(e), e, b, e * e, b * b, e * b, along, across], axis=2)
    return block_means(moments * counts[..., None], blocks)


def paint_evidence(
    levels: Sequence[np.ndarray], paint: np.ndarray, mask: np.ndarray
) -> Evidence | None:
    """Compute the evidence of each block, from all blocks of its paint.

    Parameters
    ----------
    levels : sequence of (rows, columns, 8) ndarray
        Of `block_moments`, all for the blocks of the coarsest level.
    paint : (H, W, 3) ndarray
        In which pixels of one paint are alike, on the coarsest level.
    mask : (H, W) bool ndarray
        The object, on the coarsest level.

    Returns
    -------
    Evidence or None
        0 outside of the object; None where the object is too small.
    """
    colour, inside = means_inside(paint, mask, BLOCK)
    counts = levels[0][..., 0] > 0
    if counts.sum() < _FEWEST:
        return None
    wanted, known = colour[inside > 0], colour[counts]
    apart = np.square(wanted[:, None] - known[None]).sum(axis=2, dtype=np.float64)
    weights = np.exp(apart / (-2 * _PAINT**2)) + _OF_ALL / len(known)
    found = np.mean([_evidence(_pooled(weights, one[counts])) for one in levels], axis=0)
    maps = np.zeros((2, *inside.shape))
    maps[:, inside > 0] = found
    return Evidence(*maps)


def _pooled(weights: np.ndarray, moments: np.ndarray) -> np.ndarray:
    # A matrix product's sums would depend on the number of threads.
    return np.einsum("ij,jk->ki", weights, moments)


def _evidence(pooled: np.ndarray) -> np.ndarray:
    """Both parts (2, n) of the evidence from pooled moments (8, n)."""
    e, b, ee, bb, eb = pooled[1:6] / np.maximum(pooled[0], 1e-9)
    size = np.sqrt(np.maximum((ee - e * e) * (bb - b * b), _TINY))
    return np.stack([(eb - e * b) / size, np.log((pooled[6] + _TINY) / (pooled[7] + _TINY))])
