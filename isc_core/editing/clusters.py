"""Clusters of an object's reflectance by colour.

Equation: k-means over (a / L, b / L, L / 5) in Oklab of the reflectance in the light's mean colour,
with brightness scaled so that its 99.5th percentile is white. The ratios are invariant where
shading was taken for reflectance, which scales L, a and b alike. Initial centres: each next centre
is the one of a few random pixels that lowers the total distance most (greedy k-means++, seeded);
then Lloyd's iterations; then centres of nearly indistinguishable colours are merged. Clusters are
numbered by size, the largest first.

Citation: S. Lloyd 1982, doi:10.1109/TIT.1982.1056489; D. Arthur, S. Vassilvitskii, "k-means++",
SODA 2007, doi:10.5555/1283383.1283494.
"""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..imaging.guided_filter import affine_fit
from ..imaging.luminance import white_of
from ..scene.decomposition import Decomposition
from .chroma import to_oklab
from .edited import light_color

LARGEST_COUNT = 12
_LIGHTNESS, _DARK = 0.2, 0.15  # the weight of L; the L below which chroma ratios are mostly noise
_MERGE_DISTANCE = 0.045  # centres closer than this are merged
_ROUNDS, _CANDIDATES, _SAMPLES = 60, 12, 20000
_REGULARISATION = 1e-3  # of the white's square: contrasts of the reflectance below it are smoothed
_SOFT_RANGE = 0.7  # width of the soft range: shares within 15 % of 0 and 1 become 0 and 1


@dataclass(frozen=True, eq=False)
class Clusters:
    """Clusters of reflectance.

    Attributes
    ----------
    labels : (H, W) int ndarray
        0 for the largest cluster, -1 outside the mask.
    colors : (K, 3) ndarray
        Linear; each cluster's mean in the light's mean colour.
    shares : (K,) ndarray
        Of the object's pixels, descending.
    reflectance : (H, W, 3) ndarray
        The clustered reflectance.
    """

    labels: np.ndarray
    colors: np.ndarray
    shares: np.ndarray
    reflectance: np.ndarray

    def weight(self, number: int) -> np.ndarray:
        """Return the soft membership of each pixel in a cluster.

        Pixels along its outline are mixtures of two reflectances; their colour gives the
        membership.

        Parameters
        ----------
        number : int
            1 is the largest.

        Returns
        -------
        (H, W) ndarray
            In [0, 1].

        Raises
        ------
        InputError
            If there is no such cluster.
        """
        if not 1 <= number <= len(self.shares):
            raise InputError(
                f"there is no cluster {number}: choose one from 1 to {len(self.shares)}, see "
                "clusters.png"
            )
        mask = self.labels >= 0
        member = (self.labels == number - 1).astype(float)[..., None]
        slope, offset = affine_fit(
            self.reflectance, member, mask, _REGULARISATION * white_of(self.reflectance, mask) ** 2
        )
        share = np.einsum("hwgc,hwg->hwc", slope, self.reflectance)[..., 0] + offset[..., 0]
        return np.where(mask, np.clip((share - 0.5) / _SOFT_RANGE + 0.5, 0, 1), 0)


def find_clusters(d: Decomposition, count: int = 4, seed: int = 0) -> Clusters:
    """Split the object's reflectance into clusters; deterministic for a seed.

    Parameters
    ----------
    d : Decomposition
    count : int
        Largest number of clusters, 1 to 12.
    seed : int
        Not negative.

    Returns
    -------
    Clusters

    Raises
    ------
    InputError
        If `count` or `seed` is out of range.
    """
    if count not in range(1, LARGEST_COUNT + 1):
        raise InputError(f"{count} clusters are not possible: choose 1 to {LARGEST_COUNT}")
    if seed < 0:
        raise InputError(f"{seed} is not a valid seed: choose 0 or more")
    tinted = np.maximum(d.reflectance * light_color(d), 0)
    reflectance = tinted[d.mask]
    lab = to_oklab(reflectance / white_of(tinted, d.mask))
    points = np.stack([_LIGHTNESS * lab[:, 0], *(lab[:, 1:] / np.maximum(lab[:, :1], _DARK)).T], -1)
    centers = _means(points[:: max(1, len(points) // _SAMPLES)], count, np.random.default_rng(seed))
    labels = _merged(centers)[_nearest(points, centers)]
    sizes = np.bincount(labels, minlength=len(centers))
    order = np.argsort(-sizes, kind="stable")[: int((sizes > 0).sum())]
    rank = np.zeros(len(centers), int)
    rank[order] = np.arange(len(order))
    label_map = np.full(d.mask.shape, -1)
    label_map[d.mask] = rank[labels]
    colors = np.stack([reflectance[rank[labels] == k].mean(0) for k in range(len(order))])
    return Clusters(label_map, colors, sizes[order] / len(points), tinted)


def _merged(centers: np.ndarray) -> np.ndarray:
    """(K,) for each centre the first one that it merges with, along chains of close centres."""
    label = np.arange(len(centers))
    near = np.linalg.norm(centers[:, None] - centers, axis=-1) < _MERGE_DISTANCE
    for i, j in np.argwhere(near):
        label[label == label[j]] = min(label[i], label[j])
        label[label == label[i]] = min(label[i], label[j])
    return label


def _means(points: np.ndarray, count: int, generator: np.random.Generator) -> np.ndarray:
    centers = points.mean(0, keepdims=True)
    if count > 1:
        centers = _starts(points, count, generator)
    for _ in range(_ROUNDS):
        labels = _nearest(points, centers)
        sizes = np.bincount(labels, minlength=len(centers))
        sums = np.stack(
            [np.bincount(labels, weights=column, minlength=len(centers)) for column in points.T], 1
        )
        moved = np.where(sizes[:, None] > 0, sums / np.maximum(sizes, 1)[:, None], centers)
        if np.abs(moved - centers).max() < 1e-7:
            break
        centers = moved
    return centers


def _starts(points: np.ndarray, count: int, generator: np.random.Generator) -> np.ndarray:
    centers = [points[generator.integers(len(points))]]
    distance = np.square(points - centers[0]).sum(1)
    while len(centers) < count and distance.max() > 1e-10:
        candidates = generator.choice(len(points), _CANDIDATES, p=distance / distance.sum())
        totals = [np.minimum(distance, np.square(points - points[i]).sum(1)) for i in candidates]
        best = int(np.argmin([total.sum() for total in totals]))
        centers.append(points[candidates[best]])
        distance = totals[best]
    return np.stack(centers)


def _nearest(points: np.ndarray, centers: np.ndarray) -> np.ndarray:
    # The squares of the points are omitted: they are equal for all centres.
    return np.argmin(np.square(centers).sum(1) - 2 * points @ centers.T, axis=1)
