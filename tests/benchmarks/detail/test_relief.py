"""Relief maps, the normals of displaced bodies, and the rendered sets."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from benchmarks.detail.bodies import Wrap, displaced_normals

torch = pytest.importorskip("torch")
pytest.importorskip("mitsuba")

from benchmarks.detail.print_maps import PrintKind, draw_print  # noqa: E402
from benchmarks.detail.relief_maps import (  # noqa: E402
    OCTAVES,
    ReliefKind,
    draw_relief,
    octave_window,
)
from benchmarks.detail.rendering import SetKind, render  # noqa: E402
from benchmarks.detail.sets import bodies_in, read_truth, write_scene  # noqa: E402

SIDE = 96
ROOM = np.linspace(0.2, 1.8, 32)[:, None, None] * np.ones((32, 64, 3))


@pytest.mark.parametrize("kind", list(ReliefKind))
def test_each_octave_of_a_relief_has_the_requested_slope(kind: ReliefKind) -> None:
    wanted = (0.12, 0.05, 0.08)
    found = draw_relief(kind, wanted, np.random.default_rng(5), 128)
    spectrum = np.fft.fft2(found.height)
    frequency = np.hypot(np.fft.fftfreq(128), np.fft.fftfreq(128)[:, None])
    outside = sum(octave_window(frequency, one) for one in OCTAVES) == 0
    assert np.abs(spectrum[outside]).max() < 1e-9 * np.abs(spectrum).max()
    # neighbouring octaves overlap and may add up or cancel
    rms = np.sqrt(np.square(found.slope).sum(0).mean())
    assert 0.6 * np.linalg.norm(wanted) < rms < 1.5 * np.linalg.norm(wanted)


def test_slopes_are_the_derivatives_of_the_height() -> None:
    found = draw_relief(ReliefKind.BUMPS, (0.1, 0.0, 0.0), np.random.default_rng(1), 128)
    for axis, slope in ((1, found.slope[0]), (0, found.slope[1])):
        # central differences of waves of 8 pixels or more pass at least sinc(1/4)
        central = (np.roll(found.height, -1, axis) - np.roll(found.height, 1, axis)) / 2
        assert np.corrcoef(central.ravel(), slope.ravel())[0, 1] > 0.99
        assert 0.9 < central.std() / slope.std() < 1


@pytest.mark.parametrize("axis_depth", [-np.inf, -0.6])
def test_normals_are_those_of_the_displaced_surface(axis_depth: float) -> None:
    """Finite differences of a displaced ball, its normals turned by the formula."""
    wrap = Wrap(0.4, axis_depth, 0.9, 2 / 1024)
    rng = np.random.default_rng(0)
    normal = rng.normal(size=(300, 3)) + (0, 0, 5)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal[normal[:, 2] > 0.6]
    wave = 2 * np.pi / 16 * np.array([0.8, 0.6])

    def displaced(point: np.ndarray) -> np.ndarray:
        unit = point / np.linalg.norm(point, axis=1, keepdims=True)
        height = 0.5 * np.sin(wrap.at(unit)[0] @ wave) * wrap.pixel
        return unit * (1 + height[:, None])

    slope = 0.5 * np.cos(wrap.at(normal)[0] @ wave)[:, None] * wave
    found = displaced_normals(normal, wrap.at(normal)[1], slope)
    first = np.cross(normal, (0.0, 1, 0))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normal, first)
    step = 1e-5
    along = [displaced(normal + step * t) - displaced(normal - step * t) for t in (first, second)]
    expected = np.cross(*along)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert np.degrees(np.arccos(np.clip((found * normal).sum(1), -1, 1))).max() > 5
    assert_allclose(found, expected, atol=2e-3)


@pytest.mark.parametrize("kind", list(PrintKind))
def test_paint_is_a_reflectance(kind: PrintKind) -> None:
    found = draw_print(kind, np.random.default_rng(3), 96)
    assert found.shape == (96, 96, 3)
    assert found.min() > 0
    assert found.max() < 1
    assert found.std() > 0.005


@pytest.mark.slow
def test_relief_bends_normals_and_print_does_not(tmp_path: Path) -> None:
    scenes = [render(kind, 0, 1, [ROOM], SIDE) for kind in SetKind]
    relief, printed, mixed, parts, drawn = scenes
    for scene in scenes:
        assert_allclose(np.linalg.norm(scene.normal[scene.mask], axis=1), 1, atol=1e-5)
        assert not scene.normal[~scene.mask].any()
        assert max(np.ptp(np.nonzero(scene.mask), axis=1)) + 1 == pytest.approx(
            SIDE * 860 / 1024, abs=2
        )
        write_scene(tmp_path, scene)
    assert np.array_equal(printed.normal, printed.smooth)
    assert np.array_equal(drawn.normal, drawn.smooth)
    cosine = (parts.normal * parts.smooth).sum(2)[parts.mask]
    assert 15 < np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean() < 60
    cosine = (relief.normal * relief.smooth).sum(2)[relief.mask]
    assert 3 < np.degrees(np.sqrt(np.mean(2 - 2 * np.minimum(cosine, 1)))) < 25
    bent = np.abs(mixed.normal - mixed.smooth).max(2)[mixed.mask] > 1e-3
    assert 0.2 < bent.mean() < 0.7
    again = render(SetKind.RELIEF, 0, 1, [ROOM], SIDE)
    assert np.array_equal(again.codes, relief.codes)
    (body,) = bodies_in(tmp_path, SetKind.RELIEF)
    truth = read_truth(body)
    assert np.array_equal(truth.mask, relief.mask)
    assert_allclose(truth.normal, relief.normal, atol=1e-4)
    assert_allclose(truth.smooth, relief.smooth, atol=1e-4)
