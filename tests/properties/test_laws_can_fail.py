"""Every kind of fault makes its property test fail, so no test passes vacuously."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

from isc_core.errors import InputError
from tests.properties import test_decomposition, test_separation, test_tools
from tests.properties.laws import law
from tests.properties.photos import KINDS, MASKS, MadePhoto

Breaks = Callable[[Callable[..., Any]], Callable[..., Any]]


def brighter(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add light to the diffuse layer, so that the layers do not add up."""

    def broken(*args: Any, **kwargs: Any) -> Any:
        found = function(*args, **kwargs)
        return replace(found, diffuse=found.diffuse + np.float32(1e-3))

    return broken


def drifting(function: Callable[..., Any]) -> Callable[..., Any]:
    """Make every second diffuse layer darker."""
    calls = [0]

    def broken(*args: Any, **kwargs: Any) -> Any:
        calls[0] += 1
        found = function(*args, **kwargs)
        return replace(found, diffuse=found.diffuse * np.float32(1 - 0.4 * (calls[0] % 2)))

    return broken


def darker_image(edit: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *args: replace(edit(*args), image=edit(*args).image - 1e30)


SEPARATION = ("threads_does", "frame_around", "flips_and_turns", "exposure")
FAULTS: list[tuple[Any, str, str, Breaks]] = [
    (test_separation, "layers_are_sound", "separate", brighter),
    *((test_separation, name, "separate", drifting) for name in SEPARATION),
    (test_decomposition, "maps_and_mesh", "decompose", brighter),
    *((test_decomposition, name, "decompose", drifting) for name in SEPARATION),
    (test_tools, "edits", "apply_edit", darker_image),
    (test_tools, "filling_stays", "fill", lambda fill: lambda *args: 2 * fill(*args) + 1),
    (test_tools, "filling_some", "fill_at", lambda fill_at: lambda *args: 2 * fill_at(*args) + 1),
    (test_tools, "metrics", "ssim", lambda ssim: lambda *args, **kwargs: 1.5),
]


@pytest.mark.slow
@pytest.mark.parametrize(("module", "word", "function", "breaks"), FAULTS)
def test_a_fault_is_detected(
    monkeypatch: pytest.MonkeyPatch, module: Any, word: str, function: str, breaks: Breaks
) -> None:
    names = [name for name in dir(module) if name.startswith("test_") and word in name]
    monkeypatch.setattr(module, function, breaks(getattr(module, function)))
    with pytest.raises((AssertionError, ExceptionGroup)):
        getattr(module, names[0])()
    assert len(names) == 1


def test_numeric_warnings_fail() -> None:
    @law(st.just(3))
    def warns(size: int) -> None:
        np.log(np.zeros(size))

    with pytest.raises(RuntimeWarning, match="divide by zero"):
        warns()


def test_unclear_refusals_fail() -> None:
    @law(st.just(3))
    def refuses(size: int) -> None:
        raise InputError("bad")

    with pytest.raises(AssertionError, match="InputError"):
        refuses()


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_photo_and_mask_can_be_made(kind: str) -> None:
    for mask in MASKS:
        for shape in ((1, 1), (2, 7), (16, 9)):
            made = MadePhoto(kind, mask, *shape, seed=3)
            light, inside = made.light(), made.inside()
            assert light.shape == (*shape, 3) and light.dtype == np.float32
            assert np.isfinite(light).all() and (light >= 0).all()
            assert inside.shape == shape and inside.any() and made.clipped().shape == shape
