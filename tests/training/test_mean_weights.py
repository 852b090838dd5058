"""Means of weights."""

from pathlib import Path

import numpy as np
import pytest

from isc_core.errors import InputError

pytest.importorskip("torch")

from training.mean_weights import mean_weights


def test_mean_keeps_types_and_refuses_other_networks(tmp_path: Path) -> None:
    """Half floats stay half floats; arrays of other shapes, and no archives, get one line."""
    first, second, other = (tmp_path / f"{name}.npz" for name in "abc")
    np.savez(first, weight=np.array([1.0, 3.0], np.float16), scale=np.float32(2))
    np.savez(second, weight=np.array([2.0, -3.0], np.float16), scale=np.float32(4))
    np.savez(other, weight=np.zeros(3, np.float16), scale=np.float32(4))
    mean = mean_weights([first, second])
    assert mean["weight"].tolist() == [1.5, 0.0]
    assert mean["weight"].dtype == np.float16
    assert mean["scale"] == 3
    with pytest.raises(InputError, match=r"c\.npz: a network of another kind"):
        mean_weights([first, other])
    other.write_bytes(b"no archive")
    with pytest.raises(InputError, match=r"c\.npz"):
        mean_weights([other])
