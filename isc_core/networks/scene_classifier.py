"""Classification of a photo's scene: opaque surface under one light, or a violated assumption.

Problem: for a mirror, glass, or a surface under several sources there also are a shape, a
reflectance and a light that explain the photo, but wrong ones. Their appearance reveals them: an
environment bent along the silhouette, or repeated highlights of one form.

Equation: an encoder of convolutions (`networks.layers`) computes feature maps of the photo. Mean,
deviation and fourth moment of each channel over the object make f (n,), and the probability of each
kind is

    P = softmax(W' ((sqrt f - m) / s) + b),

averaged over the photo and its mirror image.

Citation: O. Ronneberger, P. Fischer, T. Brox, "U-Net", MICCAI 2015,
doi:10.1007/978-3-319-24574-4_28 (the encoder); pooled moments: A. Babenko, V. Lempitsky,
"Aggregating local deep features for image retrieval", ICCV 2015, doi:10.1109/ICCV.2015.150.
Weights, training scenes and loss are our own: `python -m training.networks.scene_classifier`.

Limits: measured in docs/methods/scene_classification.md. A mirror of an environment without detail
looks like an opaque surface, and two sources may look like two bumps.
"""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from .layers import average_pool, encoded, is_encoder, softmax
from .loader import Network, Parameters
from .network_input import standardise_input

ORDINARY, MIRROR, GLASS, LAMPS = KINDS = ("ordinary", "mirror", "glass", "lamps")
LONG_SIDE = 144  # of the object in the network's input, in pixels
_MOMENTS = 3
_LEAST, _MOST = 1e-6, 1e4
_INVALID = "these are not the weights of a scene classifier"


@dataclass(frozen=True)
class SceneClassifier(Network):
    """The classifier of a photo's scene. Raises `InputError` where parts do not fit each other.

    Attributes
    ----------
    weights : tuple of (9, inputs, outputs) float32 ndarray
        Of the convolutions, two for each level.
    biases : tuple of (outputs,) float32 ndarray
    middle, scale : (n,) ndarray
        m and s of the module.
    head : (n, 4) ndarray
        W of the module.
    odds : (4,) ndarray
        b of the module.
    """

    title = "scene classifier"
    file = "scene_classifier.npz"

    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]
    middle: np.ndarray
    scale: np.ndarray
    head: np.ndarray
    odds: np.ndarray

    def __post_init__(self) -> None:
        if not is_encoder(self.weights, self.biases):
            raise InputError(_INVALID)
        count = _MOMENTS * sum(w.shape[-1] for w in self.weights[1::2])
        expected = [(count,), (count,), (count, len(KINDS)), (len(KINDS),)]
        fits = [part.shape for part in (self.middle, self.scale, self.head, self.odds)] == expected
        if not (fits and (self.scale > 0).all()):
            raise InputError(_INVALID)

    @classmethod
    def from_parameters(cls, parameters: Parameters) -> "SceneClassifier":
        """Build the network.

        Parameters
        ----------
        parameters : Parameters
            The content of its archive.

        Returns
        -------
        SceneClassifier

        Raises
        ------
        InputError, KeyError
            If the parameters do not fit.
        """
        head = (parameters.others[name] for name in ("middle", "scale", "head", "odds"))
        return cls(parameters.weights, parameters.biases, *head)

    def __call__(self, image: np.ndarray, mask: np.ndarray) -> np.ndarray:
        """Return the probabilities (4,) of `KINDS` for an input of `standardise_input`."""
        features = (np.sqrt(self._moments(image, mask)) - self.middle) / self.scale
        score = np.einsum("n,nk->k", features, self.head) + self.odds
        return softmax(score)

    def _moments(self, image: np.ndarray, mask: np.ndarray) -> np.ndarray:
        steps = iter(zip(self.weights, self.biases, strict=True))
        cover, moments = mask.astype(float)[..., None], []
        for layer in encoded(image, mask, steps, len(self.weights) // 2):
            cover = average_pool(cover)
            weight, values = cover[..., 0] / cover.sum(), np.minimum(layer.astype(float), _MOST)
            first, second, fourth = (
                np.einsum("ij,ijc->c", weight, values**power) for power in (1, 2, 4)
            )
            moments += [
                first,
                np.sqrt(np.maximum(second - first**2, _LEAST)),
                (fourth + _LEAST**2) ** 0.25,
            ]
        return np.concatenate(moments) + _LEAST


def classify_scene(
    image: np.ndarray, mask: np.ndarray, network: SceneClassifier | None = None
) -> dict[str, float]:
    """Return the probability of each kind of scene.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear, not negative inside the mask.
    mask : (H, W) bool ndarray
    network : SceneClassifier, optional
        By default the shipped one.

    Returns
    -------
    dict of str to float
        By `KINDS`; they sum to 1.
    """
    prepared = standardise_input(image, mask, LONG_SIDE)
    light, cover = prepared.image, prepared.mask
    predict = network or SceneClassifier.shipped()
    shares = 0.5 * (predict(light, cover) + predict(light[:, ::-1], cover[:, ::-1]))
    return {kind: float(share) for kind, share in zip(KINDS, shares, strict=True)}
