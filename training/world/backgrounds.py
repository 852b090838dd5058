"""Panoramas at one size, as backgrounds and as light of rendered scenes.

Limits: 256 rows: crops of a few degrees are blurred.
"""

from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

from isc_core.errors import InputError
from isc_core.photo import read_linear

from .environments import FILES, read_panoramas

ROWS = 256
_MAX_LIGHT = 6e4  # half floats end at 65504


def panoramas_in(folder: Path, held_out: bool) -> np.ndarray:
    """Read panoramas at one size, with the split of `read_panoramas`.

    Parameters
    ----------
    folder : Path
    held_out : bool
        Whether to read the held-out ones, or the others.

    Returns
    -------
    (N, ROWS, 2 ROWS, 3) float16 ndarray
        Linear.

    Raises
    ------
    InputError
        If there is none, or one cannot be used.
    """
    wanted = {one.name for one in read_panoramas(folder) if one.held_out == held_out}
    size, found = (ROWS, 2 * ROWS), list[np.ndarray]()
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in FILES and path.stem in wanted:
            light = torch.from_numpy(read_linear(path, "linear")).permute(2, 0, 1)[None].float()
            light = functional.interpolate(light, size, mode="bilinear", antialias=True)[0]
            found.append(light.clamp(max=_MAX_LIGHT).permute(1, 2, 0).numpy().astype(np.float16))
    if not found:
        raise InputError(f"{folder} has too few panoramas to hold one out: six are enough")
    return np.stack(found)
