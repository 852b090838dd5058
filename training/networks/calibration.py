"""Calibrate the uncertainties of a scene network on held-out bodies and light.

  python -m training.networks.calibration WORLD... --panoramas DIR --weights NPZ -o SCENE.npz

Equation: with errors e and stated scales s on held-out photos, the scales are multiplied by the
68 % quantile of |e| / s for the normals' components (a normal distribution), by the 63 % quantile
for log ratio and log shading (Laplace), and by the square root of the mean squared Mahalanobis
distance over 27 for the light.

Citation: C. Guo et al., "On calibration of modern neural networks", 2017, arXiv:1706.04599 (one
factor, fitted on held-out data).

Limits: one factor for each kind of prediction.
"""

import argparse
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

from isc_core.errors import InputError
from isc_core.io.atomic import new_file, require_writable_file
from isc_core.io.npy import read_arrays
from isc_core.networks.scene_network import (
    FACTOR_SCALE,
    FACTORS,
    HEADS,
    LIGHT,
    MARGIN,
    MAX_LOG_SCALE,
    MIN_LOG_SCALE,
    TEMPERATURES,
    Head,
)

from ..world.files import Split
from ..world.recipes import Shares
from ..world.samples import Sample
from .scene_batches import SceneBatches, SceneDraws, read_world
from .scene_module import SceneNetworkModule, network_channels

_NORMAL, _LAPLACE = 0.6827, 1 - np.exp(-1)  # shares within one scale
_BATCHES, _SIZE = 24, 32
_SPARSE = 7  # of the pixels, one in so many: neighbours are correlated


def temperatures(network: SceneNetworkModule, samples: Iterable[Sample]) -> np.ndarray:
    """Fit the factors of the scales.

    Parameters
    ----------
    network : SceneNetworkModule
    samples : iterable of Sample
        Held out.

    Returns
    -------
    (4,) float32 ndarray
        By `TEMPERATURES`.
    """
    gathered: dict[str, list[np.ndarray]] = {name: [] for name in TEMPERATURES}
    network.eval()
    with torch.no_grad():
        for sample in samples:
            for name, values in _relative_errors(network, sample).items():
                gathered[name].append(values.numpy())
    found = {name: np.concatenate(values) for name, values in gathered.items()}
    return np.array(
        [
            np.quantile(found["normal"], _NORMAL),
            np.quantile(found["ratio"], _LAPLACE),
            np.quantile(found["shading"], _LAPLACE),
            np.sqrt(np.minimum(found["light"], 20).mean()),
        ],
        np.float32,
    )


def _relative_errors(network: SceneNetworkModule, sample: Sample) -> dict[str, torch.Tensor]:
    """Errors over stated scales, flat; for the light squared, over 27."""
    maps, vector = network(network_channels(sample.photo, sample.mask))
    part = {head: maps[:, place] for head, place in HEADS.items()}
    scale = {
        head: torch.exp(part[head].clamp(MIN_LOG_SCALE, MAX_LOG_SCALE))
        for head in (Head.NORMAL_SCALE, Head.RATIO_SCALE, Head.SHADING_SCALE)
    }
    opaque = sample.kind == 0
    known = (sample.known > 0) & opaque[:, None, None, None]
    normal = (part[Head.NORMAL] - sample.normal)[:, :2].abs() / scale[Head.NORMAL_SCALE]
    ratio = functional.softplus(part[Head.RATIO] - MARGIN) - sample.ratio
    difference = torch.where(known, part[Head.SHADING] - sample.log_shading, torch.nan)
    offset = difference.flatten(1).nanmedian(1).values[:, None, None, None]
    shading = (difference - offset).abs() / scale[Head.SHADING_SCALE]
    mean, log_scale, factors = vector[:, : LIGHT * (2 + FACTORS)].split(
        [LIGHT, LIGHT, LIGHT * FACTORS], dim=1
    )
    factors = FACTOR_SCALE * factors.reshape(-1, LIGHT, FACTORS)
    deviation = torch.exp(log_scale.clamp(MIN_LOG_SCALE, MAX_LOG_SCALE))
    covariance = torch.diag_embed(deviation**2) + factors @ factors.mT
    off = (sample.light - mean)[..., None]
    distance = (off * torch.linalg.solve(covariance, off)).sum((1, 2)) / LIGHT
    return {
        "normal": normal[known.expand_as(normal)][::_SPARSE],
        "ratio": (ratio.abs() / scale[Head.RATIO_SCALE])[known.expand_as(ratio)][::_SPARSE],
        "shading": shading[known.expand_as(shading)][::_SPARSE],
        "light": distance[opaque],
    }


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("worlds", type=Path, nargs="+", metavar="WORLD", help="folders or packs of isc world")
    add("--panoramas", type=Path, metavar="DIR", help="panoramas (default: those of a pack)")
    add("--weights", type=Path, required=True, metavar="NPZ", help="what was fitted")
    add("-o", "--output", type=Path, required=True, metavar="NPZ", help="where to write it")
    add("--seed", type=int, default=0, help="seed of the fit (default: %(default)s)")
    given = parser.parse_args()
    try:
        require_writable_file(given.output)
        arrays = dict(read_arrays(given.weights))
        network = SceneNetworkModule.of(arrays)
        world = read_world(given.worlds, given.panoramas, (Split.UNSEEN_BODY,), given.seed)
    except InputError as error:
        parser.error(str(error))
    draw = SceneBatches(
        SceneDraws(
            world.views[Split.UNSEEN_BODY],
            world.atlas,
            world.held_out_environments,
            _SIZE,
            Shares(),
        ),
        world.bank,
    )
    rng = np.random.default_rng([given.seed, 5])
    torch.manual_seed(given.seed)
    found = temperatures(network, (draw(rng) for _ in range(_BATCHES)))
    print(", ".join(f"{name} {value:.3f}" for name, value in zip(TEMPERATURES, found, strict=True)))
    with new_file(given.output) as temporary, temporary.open("wb") as file:
        # Not compressed: that saves a fourteenth of the bytes, and costs each command 30 ms.
        np.savez(file, **{**arrays, "temperatures": found})


if __name__ == "__main__":
    main()
