"""The benchmark of reduced scenes: true maps stay true, and errors are those put in."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.refinement.scenes import photo_of
from benchmarks.sirfs.resized_scenes import ERRORS, errors_of, ratios, reduced

MASK = np.hypot(*(np.mgrid[:48, :48] - 23.5)) < 20


def truth() -> dict[str, np.ndarray]:
    right = np.mgrid[:48, :48][1] / 48.0
    normal = np.stack([right / 2, 0 * right, np.sqrt(1 - right**2 / 4)], axis=2)
    light = np.stack([0.3 + right, 0.4 + right, 0.5 + right], axis=2).astype(np.float32)
    maps = {"normal": normal, "shading": light, "reflectance": 1 / light, "image": light}
    return maps | {"mask": MASK}


@pytest.mark.parametrize("size", [40, 30, 20])
def test_true_maps_have_no_error_at_any_size(size: int) -> None:
    maps = truth()
    photo = photo_of(maps)
    small = photo.resized_to_object(size)
    found = reduced(maps, photo, small)
    assert all(found[name].shape[:2] == small.mask.shape for name in ERRORS)
    np.testing.assert_allclose(found["shading"][small.mask], small.image[small.mask], rtol=1e-5)
    found["normal"] = found["normal"] / np.linalg.norm(found["normal"], axis=2, keepdims=True)
    exact = SimpleNamespace(mask=small.mask, **found)
    np.testing.assert_allclose(errors_of(exact, found), 0, atol=0.05)  # type: ignore[arg-type]


def test_errors_are_those_put_in() -> None:
    maps = truth()
    tilted = maps["normal"][..., [2, 1, 0]] * (-1, 1, 1)
    off = SimpleNamespace(**(maps | {"normal": tilted, "shading": 2 * maps["reflectance"]}))
    normal, shading, reflectance = errors_of(off, maps)  # type: ignore[arg-type]
    assert normal == pytest.approx(90, abs=1e-4) and shading > 0.01 and reflectance < 1e-9


def test_ratios_are_geometric_means() -> None:
    rows = [[1.0, 2.0, 4.0, 0.0], [4.0, 2.0, 1.0, 0.0]]
    twice = [[2.0, 2.0, 16.0, 0.0], [8.0, 2.0, 4.0, 0.0]]
    assert ratios(twice, rows).startswith("normal x2.000 (2.000 to 2.000), shading x1.000")
