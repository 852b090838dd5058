"""Fits the network of `isc_core.separation.highlight_cue`, for all objects and with each left out.

  python -m benchmarks.highlight_training --data ../shared/data/mit_berkeley_train --glossy DIR --scenes DIR -o OUT

`--glossy`: what `isc synth glossy-mit` made of the set. `--scenes`: folders of `isc synth`, any number of levels deep. Every glossy photo
is seen once more with its gloss at another strength, drawn at random; the set's diffuse images, and the glossy sets' of one level, say what
matt is. Writes OUT/OBJECT.npz, which has not seen OBJECT, and OUT/all.npz, which ships as `isc_core/data/highlight_cue.npz`.

Loss: Huber's, of log(image / diffuse), each photo as heavy as the others, by Adam (D. P. Kingma, J. Ba 2015, arXiv:1412.6980). Few hidden
units, noise on the features and weight decay: without them objects that were not seen came out worse than nothing done.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from isc_core.datasets import list_objects, load_object
from isc_core.exr import read_channels
from isc_core.separation.highlight_cue import CueNetwork, features, reduced

_HIDDEN, _EPOCHS, _BATCH, _RATE, _DECAY, _NOISE = 16, 14, 4096, 3e-3, 1e-3, 0.25
_HUBER, _MARGIN = 0.4, 2.0
_PIXELS = {"glossy": 800, "matt": 800, "scene": 300}
_WEIGHT = {"glossy": 1.0, "matt": 2.0, "scene": 0.7}
_MOST = 0.93  # of a pixel's light: more of it being gloss teaches nothing


@dataclass(frozen=True)
class Sample:
    """Pixels of one photo: features (N, F) and log(image / diffuse) (N,); `kind`: one of `_PIXELS`; `name` of its object, or ""."""

    found: np.ndarray
    excess: np.ndarray
    kind: str
    name: str


def sample(image: np.ndarray, diffuse: np.ndarray, mask: np.ndarray, kind: str, name: str) -> Sample:
    """The pixels of a photo whose diffuse layer is known; (H, W, 3), (H, W, 3), (H, W) bool."""
    rows, columns = np.nonzero(mask.any(axis=1))[0], np.nonzero(mask.any(axis=0))[0]
    box = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    small, inside, _ = reduced(image[box], mask[box])
    matt, _, _ = reduced(diffuse[box], mask[box])
    share = np.clip(1 - matt[inside].mean(axis=1) / np.maximum(small[inside].mean(axis=1), 1e-9), 0, _MOST)
    return Sample(features(small, inside), -np.log(1 - share).astype(np.float32), kind, name)


def photos_of(data: Path, glossy: Path, name: str, rng: np.random.Generator) -> Iterator[Sample]:
    """All samples of one object of the set."""
    for light in ("natural", "laboratory"):
        matt = load_object(data, name, light, "diffuse")
        yield sample(matt.image, matt.image, matt.valid, "matt", name)
    for folder in sorted(p for p in glossy.iterdir() if p.is_dir()):
        seen, diffuse = load_object(folder, name, "laboratory", "original"), load_object(folder, name, "laboratory", "diffuse").image
        yield sample(seen.image, diffuse, seen.valid, "glossy", name)
        other = diffuse + np.exp(rng.uniform(-1.5, 1)) * np.maximum(seen.image - diffuse, 0)
        yield sample(other, diffuse, seen.valid, "glossy", name)
        if folder.name.startswith("level-25"):
            yield sample(diffuse, diffuse, seen.valid, "matt", name)


def photos_of_scenes(scenes: Path, rng: np.random.Generator) -> Iterator[Sample]:
    """All samples of rendered scenes."""
    for path in sorted(scenes.rglob("maps.exr")):
        channels = read_channels(path)
        image, specular = (np.stack([channels[f"{layer}.{c}"] for c in "RGB"], -1) for layer in ("image", "specular"))
        mask = (channels["mask.A"] > 0.5) & (image.min(axis=2) > 1e-5)
        if mask.sum() >= 300:
            for gain in (1.0, float(np.exp(rng.uniform(-1.5, 1.5)))):
                yield sample(image + (gain - 1) * specular, image - specular, mask, "scene", "")


def fit(samples: list[Sample], rng: np.random.Generator) -> CueNetwork:
    """The network that explains `samples` best."""
    chosen = [(s, rng.choice(len(s.excess), min(_PIXELS[s.kind], len(s.excess)), replace=False)) for s in samples]
    found, wanted = (np.concatenate([getattr(s, field)[k] for s, k in chosen]) for field in ("found", "excess"))
    weight = np.concatenate([np.full(len(k), _WEIGHT[s.kind], np.float32) for s, k in chosen])
    mean, deviation = found.mean(axis=0), found.std(axis=0) + 1e-3
    found = (found - mean) / deviation
    count = found.shape[1]
    parts = [rng.normal(0, count**-0.5, (count, _HIDDEN)), np.zeros(_HIDDEN), rng.normal(0, _HIDDEN**-0.5, _HIDDEN), np.zeros(1)]
    moments = [(np.zeros_like(p), np.zeros_like(p)) for p in parts]
    steps = _EPOCHS * (len(found) // _BATCH)
    for step in range(steps):
        if step % (len(found) // _BATCH) == 0:
            order = rng.permutation(len(found))
        batch = order[(step * _BATCH) % (len(found) // _BATCH * _BATCH) :][:_BATCH]
        noisy = found[batch] + rng.normal(0, _NOISE, (len(batch), count)).astype(np.float32)
        slopes = _gradient(parts, noisy, wanted[batch], weight[batch])
        rate = _RATE * 0.5 * (1 + np.cos(np.pi * step / steps)) + 1e-5
        for part, (first, second), slope in zip(parts, moments, slopes, strict=True):
            first += 0.1 * (slope - first)
            second += 0.01 * (slope**2 - second)
            part -= rate * first / (1 - 0.9 ** (step + 1)) / (np.sqrt(second / (1 - 0.99 ** (step + 1))) + 1e-8)
    hidden, hidden_bias, output = (p.astype(np.float32) for p in parts[:3])
    return CueNetwork(mean, deviation, hidden, hidden_bias, output, float(parts[3][0]))


def _gradient(parts: list[np.ndarray], found: np.ndarray, wanted: np.ndarray, weight: np.ndarray) -> list[np.ndarray]:
    """Of the mean loss by the network's four parts."""
    hidden, hidden_bias, output, output_bias = parts
    layer = np.tanh(found @ hidden + hidden_bias)
    raised = layer @ output + output_bias - _MARGIN
    error = np.clip(np.logaddexp(0, raised) - wanted, -_HUBER, _HUBER)
    slope = error * weight / (1 + np.exp(-raised)) / len(found)
    back = slope[:, None] * output * (1 - layer**2)
    return [found.T @ back + _DECAY * hidden, back.sum(axis=0), layer.T @ slope + _DECAY * output, slope.sum(keepdims=True)]


def write(path: Path, network: CueNetwork) -> None:
    """An archive that `read_network` reads."""
    np.savez(path, **vars(network))


def main() -> None:
    """Fits and writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("--data", "--glossy", "--scenes"):
        parser.add_argument(name, type=Path, required=True)
    parser.add_argument("-o", "--output", type=Path, required=True)
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    names = list_objects(given.data, "laboratory")
    samples = [s for k, name in enumerate(names) for s in photos_of(given.data, given.glossy, name, np.random.default_rng(k))]
    samples += photos_of_scenes(given.scenes, np.random.default_rng(len(names)))
    for left_out in (*names, None):
        network = fit([s for s in samples if left_out is None or s.name != left_out], np.random.default_rng(0))
        write(given.output / f"{left_out or 'all'}.npz", network)
        print(left_out or "all", flush=True)


if __name__ == "__main__":
    main()
