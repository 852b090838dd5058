"""The weighing of an object's colourfulness."""

import numpy as np
import pytest

from isc_core.separation.support.highlight_cues import ramp
from isc_core.separation.support.saturation_gate import saturation_gate


@pytest.mark.parametrize(
    ("saturation", "expected"), [(0.0, 0.0), (0.45, 0.0), (0.5, 0.5), (0.55, 1.0), (1.0, 1.0)]
)
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e4])
def test_evidence_rises_with_saturation_and_not_with_exposure(
    saturation: float, expected: float, scale: float
) -> None:
    colour = np.array([1.0, 1 - saturation / 2, 1 - saturation])
    image = scale * np.random.default_rng(0).random((20, 30, 1)) * colour
    assert saturation_gate(image, np.ones((20, 30), bool)) == pytest.approx(expected, abs=1e-9)


def test_only_usable_pixels_count() -> None:
    image = np.broadcast_to([1.0, 0.5, 0.2], (10, 10, 3)).copy()
    image[5:] = 3.0
    usable = np.zeros((10, 10), bool)
    assert saturation_gate(image, usable) == 0
    usable[:5] = True
    assert saturation_gate(image, usable) == 1
    usable[5:] = True
    assert saturation_gate(image, usable) == 0


def test_the_step_is_smooth_and_rises() -> None:
    values = np.array([ramp(x, (0.2, 0.6)) for x in np.linspace(0, 1, 201)])
    assert (
        values[0] == 0
        and values[-1] == 1
        and (np.diff(values) >= 0).all()
        and np.diff(values).max() < 0.02
    )
