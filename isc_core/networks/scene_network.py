"""Joint prediction of shape, layers, shading and light from a photo.

Problem: shape, layers, shading and light cannot be determined from single pixels. Experience with
many objects under many lights resolves some of the ambiguity, and the quantities share features:
one network predicts all of them, each with its uncertainty.

Equation: a convolutional encoder computes feature maps of the photo, each with half the resolution
of the previous one; a decoder with skip connections returns to full resolution (`encoder_decoder`).
The outputs at each pixel are m (3,), the mean of the probable unit normals, and the deviation of
n_x and n_y from it; the log ratio y (3,) of image and diffuse image, and its scale; the log shading
(3,) of a photo whose mean light is 1, and its scale; and the log odds of a depth edge. The means
and maxima of the coarse feature maps over the object determine the light: mean l and covariance D^2
+ F F' of the 27 coefficients of the log shading, the number of lamps, the direction of the
strongest, and the material of the object. The predictions for the photo and its mirror image are
averaged. y and the shading have Laplace distributions, the normals and the light Gaussian ones.
Each scale is multiplied by a factor fitted on held-out objects.

Citation: O. Ronneberger, P. Fischer, T. Brox, "U-Net", MICCAI 2015,
doi:10.1007/978-3-319-24574-4_28; uncertainties: A. Kendall, Y. Gal, "What uncertainties do we need
in Bayesian deep learning for computer vision?", 2017, arXiv:1703.04977; their factors: C. Guo et
al., "On calibration of modern neural networks", 2017, arXiv:1706.04599. Weights, training images
and losses are our own: `python -m training.networks.scene_network`.

Limits: measured in docs/methods/scene_network.md. Objects are downsampled to a length of 112
pixels.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from ..imaging.blocks import block_means
from ..io.stage_cache import StageCache
from ..scene.light_coefficients_estimate import LightCoefficientsEstimate
from ..scene.light_estimate import LightEstimate, mirrored_places
from ..scene.normal_estimate import NormalEstimate
from ..scene.shading_estimate import ShadingEstimate
from .encoder_decoder import PhotoNetwork
from .frame import NetworkFrame, at_full_size, framed
from .layers import frame_coordinates, inputs_of, softmax

SIDE, LONG_SIDE = 128, 112  # sides of the network's frame and of the object in it, pixels
INPUTS = 6
LIGHT, FACTORS = 27, 3
FACTOR_SCALE = 0.1  # of the covariance's factors, so that they are small initially
COUNTS, PLACE_COUNT, KIND_COUNT = 3, 256, 3
GLOBAL = LIGHT * (2 + FACTORS) + COUNTS + PLACE_COUNT + KIND_COUNT
MIN_LOG_SCALE, MAX_LOG_SCALE = -5.0, 1.5
COARSE = 3  # number of levels, the coarsest ones, that the light is predicted from
MARGIN = 2.0  # offset of the log ratio: favours small ones
_EPSILON = 1e-6


class Head(StrEnum):
    """Outputs at each pixel."""

    NORMAL = "normal"
    NORMAL_SCALE = "normal_scale"
    RATIO = "ratio"
    RATIO_SCALE = "ratio_scale"
    SHADING = "shading"
    SHADING_SCALE = "shading_scale"
    EDGE = "edge"


HEADS: Mapping[Head, slice] = {
    Head.NORMAL: slice(0, 3),
    Head.NORMAL_SCALE: slice(3, 4),
    Head.RATIO: slice(4, 7),
    Head.RATIO_SCALE: slice(7, 8),
    Head.SHADING: slice(8, 11),
    Head.SHADING_SCALE: slice(11, 12),
    Head.EDGE: slice(12, 13),
}
CHANNELS = 13


class Kind(StrEnum):
    """Material of an object, in the order of `ScenePrediction.kinds`."""

    OPAQUE = "opaque"
    MIRROR = "mirror"
    GLASS = "glass"


TEMPERATURES = ("normal", "ratio", "shading", "light")


@dataclass(frozen=True, eq=False)
class RawPrediction:
    """Output of the network in its own frame.

    Attributes
    ----------
    maps : (H, W, CHANNELS) float32 ndarray
        Ordered by `HEADS`; scales as logarithms.
    vector : (GLOBAL,) ndarray
        Mean, log deviations and factors of the light; scores of lamp counts, places and kinds.
    """

    maps: np.ndarray
    vector: np.ndarray


@dataclass(frozen=True)
class SceneNetwork(PhotoNetwork):
    """The scene network; its global prediction is the light."""

    title = "scene network"
    file = "scene_network.npz"
    inputs, outputs, coarse, global_outputs = INPUTS, CHANNELS, COARSE, GLOBAL
    stored = "light", "temperatures"

    @property
    def temperatures(self) -> np.ndarray:
        """Factors (4,) of the scales, ordered by `TEMPERATURES`."""
        return self.calibration

    def fits(self) -> bool:
        """Return whether the shapes of the parts match."""
        return (
            super().fits()
            and self.temperatures.shape == (len(TEMPERATURES),)
            and bool((self.temperatures > 0).all())
        )

    def __call__(self, *frames: tuple[np.ndarray, np.ndarray]) -> list[RawPrediction]:
        """Predict maps and light of photos together, which takes less time than one by one.

        Parameters
        ----------
        *frames : tuple of ((H, W, 3) ndarray, (H, W) bool ndarray)
            Image and mask of a `NetworkFrame`, all of one size.

        Returns
        -------
        list of RawPrediction
        """
        found, levels = self.forward(np.stack([channels_of(*frame) for frame in frames]))
        return [
            RawPrediction(maps, self._light(own, mask))
            for maps, *own, (_, mask) in zip(found, *levels, frames, strict=True)
        ]

    def _light(self, skips: list[np.ndarray], mask: np.ndarray) -> np.ndarray:
        """The vector (GLOBAL,) of means and maxima of the coarse feature maps on the object."""
        cover, features = block_means(mask.astype(np.float64)[..., None], 2), []
        for level, layer in enumerate(skips):
            cover = block_means(cover, 2)
            if level < len(skips) - COARSE:
                continue
            values = layer.astype(np.float64)
            weight = cover[..., 0] / max(float(cover.sum()), _EPSILON)
            features.append(np.einsum("ij,ijc->c", weight, values))
            features.append((values * np.minimum(2 * cover, 1)).max(axis=(0, 1)))
        return self.predict_global(features)


def channels_of(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the channels of the first layer.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray

    Returns
    -------
    (H, W, INPUTS) float32 ndarray
        Log light over the object's mean, the mask, and the coordinates of `frame_coordinates`. All
        are 0 outside the mask.
    """
    place = frame_coordinates(*mask.shape) * mask[..., None]
    return np.concatenate([inputs_of(image, mask), place], axis=2)


@dataclass(frozen=True, eq=False)
class LayerPrediction:
    """The network's prediction of a photo's layers.

    Attributes
    ----------
    log_ratio : (H, W, 3) ndarray
    ratio_scale : (H, W) ndarray
        As in `ScenePrediction`.
    log_shading : (H, W, 3) ndarray
        That of `ScenePrediction.shading`.
    """

    log_ratio: np.ndarray
    ratio_scale: np.ndarray
    log_shading: np.ndarray


@dataclass(frozen=True, eq=False)
class ScenePrediction:
    """The network's prediction for a photo.

    Attributes
    ----------
    normals : NormalEstimate
    log_ratio : (H, W, 3) ndarray
        Median of the log of image over diffuse image, >= 0.
    ratio_scale : (H, W) ndarray
        Mean absolute error of `log_ratio`, > 0 on the object.
    shading : ShadingEstimate
    light : LightCoefficientsEstimate
    counts : (3,) ndarray
        Probabilities of no, one and several lamps.
    places : (256,) ndarray
        Probabilities of `scene.light_estimate.PLACES` for the strongest lamp, if there is one.
    kinds : (3,) ndarray
        Probabilities of `Kind`.
    edge : (H, W) ndarray
        Probability of a depth edge.
    """

    normals: NormalEstimate
    log_ratio: np.ndarray
    ratio_scale: np.ndarray
    shading: ShadingEstimate
    light: LightCoefficientsEstimate
    counts: np.ndarray
    places: np.ndarray
    kinds: np.ndarray
    edge: np.ndarray

    @property
    def log_shading(self) -> np.ndarray:
        """Expected log shading (H, W, 3)."""
        return self.shading.log_shading

    @property
    def lamps(self) -> LightEstimate:
        """The prediction of the lamps."""
        none, one, several = (float(share) for share in self.counts)
        return LightEstimate(none, one, several, self.places)


def predict_scene(
    image: np.ndarray,
    mask: np.ndarray,
    network: SceneNetwork | None = None,
    kept: StageCache | None = None,
) -> ScenePrediction:
    """Predict shape, layers, shading and light of a photo.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear, not negative inside the mask.
    mask : (H, W) bool ndarray
    network : SceneNetwork, optional
        By default the shipped one.
    kept : StageCache, optional
        Keeps the network's output for the next run.

    Returns
    -------
    ScenePrediction
    """
    network = network or SceneNetwork.shipped()
    frame = framed(image, mask, SIDE, LONG_SIDE)
    small, direct, mirrored = _run(frame, network, kept)
    factors = dict(zip(TEMPERATURES, network.temperatures, strict=True))
    full = at_full_size(small, frame, mask)
    part = {head: full[..., place] for head, place in HEADS.items()}
    return ScenePrediction(
        NormalEstimate(part[Head.NORMAL], _scale(part[Head.NORMAL_SCALE], mask, factors["normal"])),
        part[Head.RATIO],
        _scale(part[Head.RATIO_SCALE], mask, factors["ratio"]),
        ShadingEstimate(
            part[Head.SHADING],
            # the standard deviation of a Laplace distribution
            _scale(part[Head.SHADING_SCALE], mask, np.sqrt(2) * factors["shading"]),
        ),
        *_light_of(direct, mirrored, factors["light"]),
        1 / (1 + np.exp(-part[Head.EDGE][..., 0])) * mask,
    )


def predict_layers(
    image: np.ndarray,
    mask: np.ndarray,
    network: SceneNetwork | None = None,
    kept: StageCache | None = None,
) -> LayerPrediction:
    """Predict the layers and the shading of a photo, with half of the memory of `predict_scene`.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear, not negative inside the mask.
    mask : (H, W) bool ndarray
    network : SceneNetwork, optional
        By default the shipped one.
    kept : StageCache, optional
        As of `predict_scene`.

    Returns
    -------
    LayerPrediction
    """
    network = network or SceneNetwork.shipped()
    frame = framed(image, mask, SIDE, LONG_SIDE)
    small, _, _ = _run(frame, network, kept)
    factor = network.temperatures[TEMPERATURES.index("ratio")]
    ratio, log_scale, shading = (
        at_full_size(small[..., HEADS[head]], frame, mask)
        for head in (Head.RATIO, Head.RATIO_SCALE, Head.SHADING)
    )
    return LayerPrediction(ratio, _scale(log_scale, mask, factor), shading)


def _run(
    frame: NetworkFrame, network: SceneNetwork, kept: StageCache | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The mean maps (SIDE, SIDE, CHANNELS), and the vectors for the photo and its mirror image."""
    if kept is None:
        return _computed(frame, network)
    names = "maps", "direct", "mirrored"
    found = kept.arrays(
        "scene network",
        (frame.image, frame.mask, *network.parameters()),
        lambda: dict(zip(names, _computed(frame, network), strict=True)),
    )
    maps, direct, mirrored = (found[name] for name in names)
    return maps, direct, mirrored


def _computed(
    frame: NetworkFrame, network: SceneNetwork
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What `_run` returns."""
    image, mask = frame.image, frame.mask
    direct, mirrored = network((image, mask), (image[:, ::-1], mask[:, ::-1]))
    maps = _activated(direct.maps), _activated(mirrored.maps[:, ::-1]) * _MIRRORED
    return 0.5 * (maps[0] + maps[1]), direct.vector, mirrored.vector


_MIRRORED = np.ones(CHANNELS, np.float32)
_MIRRORED[HEADS[Head.NORMAL].start] = -1


def _activated(maps: np.ndarray) -> np.ndarray:
    """Maps with the log ratio transformed to its final, non-negative form, so that they can be
    averaged.
    """
    found = maps.copy()
    ratio = HEADS[Head.RATIO]
    found[..., ratio] = np.logaddexp(0, maps[..., ratio] - np.float32(MARGIN))
    return found


def _scale(log_scale: np.ndarray, mask: np.ndarray, factor: float) -> np.ndarray:
    scale = factor * np.exp(np.clip(log_scale[..., 0], MIN_LOG_SCALE, MAX_LOG_SCALE))
    return np.where(mask, scale, 0)


_MIRROR_SIGNS = np.array([1, 1, 1, -1, -1, 1, 1, -1, 1.0])  # signs of the harmonics under mirroring


def _light_of(
    direct: np.ndarray, mirrored: np.ndarray, factor: float
) -> tuple[LightCoefficientsEstimate, np.ndarray, np.ndarray, np.ndarray]:
    """The light, the lamps' counts and places, and the kinds, averaged over both predictions."""
    signs = np.tile(_MIRROR_SIGNS, 3)
    first, second = _split_vector(direct), _split_vector(mirrored)
    mean = (first[0] + signs * second[0]) / 2
    covariance = (_covariance(first) + signs[:, None] * _covariance(second) * signs) / 2
    estimate = LightCoefficientsEstimate(mean.reshape(3, 9).T, factor**2 * covariance)
    counts, places, kinds = ((softmax(first[k]), softmax(second[k])) for k in range(3, len(first)))
    flipped = places[1][mirrored_places()]
    return (
        estimate,
        (counts[0] + counts[1]) / 2,
        (places[0] + flipped / flipped.sum()) / 2,
        (kinds[0] + kinds[1]) / 2,
    )


def _split_vector(vector: np.ndarray) -> list[np.ndarray]:
    sizes = (LIGHT, LIGHT, LIGHT * FACTORS, COUNTS, PLACE_COUNT, KIND_COUNT)
    return np.split(vector, np.cumsum(sizes)[:-1])


def _covariance(parts: list[np.ndarray]) -> np.ndarray:
    scale = np.exp(np.clip(parts[1], MIN_LOG_SCALE, MAX_LOG_SCALE))
    factors = FACTOR_SCALE * parts[2].reshape(LIGHT, FACTORS)
    return np.diag(scale**2) + np.einsum("if,jf->ij", factors, factors)
