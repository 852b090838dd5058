"""Random convolutions of an encoder and a decoder, as an archive holds them."""

import numpy as np


def random_convolutions(
    rng: np.random.Generator,
    ends: tuple[int, int],
    down: tuple[int, ...],
    up: tuple[int, ...],
) -> dict[str, np.ndarray]:
    """Draw weights and biases; `ends` are the channels of a block that go in and come out."""
    shapes, inputs = list[tuple[int, int]](), ends[0]
    for width in down:
        shapes += [(inputs, width), (width, width)]
        inputs = width
    for skip, width in zip(down[-2::-1], up, strict=True):
        shapes += [(skip + inputs, width), (width, width)]
        inputs = width
    arrays: dict[str, np.ndarray] = {}
    for k, (rows, columns) in enumerate([*shapes, (inputs, ends[1])]):
        kernel = rng.normal(0, (2 / (9 * rows)) ** 0.5, (9, rows, columns))
        arrays[f"weight{k:02d}"] = kernel.astype(np.float16)
        arrays[f"bias{k:02d}"] = rng.normal(0, 0.1, columns).astype(np.float16)
    return arrays
