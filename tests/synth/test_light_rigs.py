"""Random lights: reproducible, on the viewer's side, near white, never negative; files are read
unchanged.
"""

from dataclasses import fields
from pathlib import Path

import cv2
import numpy as np
import pytest

from isc_core.datasets.mit_berkeley import load_natural_lights
from isc_core.errors import InputError
from isc_core.io.exr import write_channels
from isc_core.shading.environment_map import directions, shading_under, solid_angles
from isc_core.shading.spherical_harmonics import light_from_reference, real_sh
from synth.light_rigs import RIGS, make_lights
from synth.light_rigs.files import read_panorama
from synth.scene.lights import (
    DirectionalLight,
    EnvironmentLight,
    Light,
    PanelLight,
    PointLight,
    lights_as_environment,
)

INVENTED = ("point", "directional", "area", "sh")
DRAWS = 40
ROWS = 32


def facing() -> np.ndarray:
    """The normals of a ball as a camera sees them, (N, 3)."""
    x, y = np.meshgrid(np.linspace(-0.97, 0.97, 24), np.linspace(-0.97, 0.97, 24))
    x, y = x[x * x + y * y < 0.95], y[x * x + y * y < 0.95]
    return np.stack([x, y, np.sqrt(1 - x * x - y * y)], -1)


def ball(lights: tuple[Light, ...]) -> np.ndarray:
    return shading_under(lights_as_environment(lights, ROWS), facing())


def draws(name: str) -> list[tuple[Light, ...]]:
    return [make_lights(name, np.random.default_rng(seed)) for seed in range(DRAWS)]


def numbers(lights: tuple[Light, ...]) -> list[np.ndarray]:
    return [np.asarray(getattr(light, field.name)) for light in lights for field in fields(light)]


def sunny(rows: int) -> np.ndarray:
    """A panorama: blue above, brown below, a small bright sun up right behind the object."""
    towards = directions(rows)
    picture = np.where(towards[..., 1:2] > 0, (0.3, 0.5, 1.0), (0.25, 0.2, 0.1))
    sun = towards @ (np.array([0.5, 0.5, -0.7]) / np.linalg.norm([0.5, 0.5, -0.7])) > 0.99
    return (picture + 80 * sun[..., None]).astype(np.float32)


def write_panorama(path: Path, picture: np.ndarray) -> Path:
    if path.suffix == ".hdr":
        cv2.imwrite(str(path), picture[..., ::-1])
    else:
        write_channels(path, dict(zip("RGB", np.moveaxis(picture, 2, 0), strict=True)))
    return path


@pytest.mark.parametrize("name", INVENTED)
def test_the_same_seed_gives_the_same_lights_and_another_one_others(name: str) -> None:
    first, again, other = (
        numbers(make_lights(name, np.random.default_rng(seed))) for seed in (7, 7, 8)
    )
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    assert len(first) != len(other) or not all(
        np.array_equal(a, b) for a, b in zip(first, other, strict=True)
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", INVENTED)
def test_every_draw_lights_what_the_viewer_sees(name: str) -> None:
    for lights in draws(name):
        shading = ball(lights).mean(1)
        assert (shading > 0.02 * shading.max()).mean() > 0.5
        assert 0.3 < shading.max() < 4


@pytest.mark.slow
@pytest.mark.parametrize("name", INVENTED)
def test_generated_lights_are_nearly_white_but_not_equal(name: str) -> None:
    shading = np.array([ball(lights).mean(0) for lights in draws(name)])
    tint = shading / shading.mean(1, keepdims=True)
    assert np.abs(tint - 1).max() < 0.1
    assert tint.std(0).min() > 0.003


@pytest.mark.parametrize(
    ("name", "kind"),
    [("point", PointLight), ("directional", DirectionalLight), ("area", PanelLight)],
)
def test_small_lights_come_alone_or_in_pairs_and_mostly_with_ambient_light(
    name: str, kind: type
) -> None:
    lamps = [sum(isinstance(light, kind) for light in lights) for lights in draws(name)]
    around = [
        [light for light in lights if isinstance(light, EnvironmentLight)] for lights in draws(name)
    ]
    assert set(lamps) == {1, 2}
    share = np.mean([bool(found) for found in around])
    assert share == 1 if name == "area" else 0.55 < share < 0.95
    levels = [ball(tuple(found)).mean() for found in around if found]
    assert min(levels) > 0.015
    assert max(levels) < 0.25


def test_harmonic_environments_have_contrast_and_no_details() -> None:
    for (light,) in draws("sh"):
        assert isinstance(light, EnvironmentLight)
        spread = light.radiance.mean(-1)
        assert spread.max() > 1.5 * (spread * solid_angles(len(spread))).sum() / (4 * np.pi)
        step = np.abs(np.diff(spread, axis=1)).max() / spread.max()
        assert step < 0.25


@pytest.mark.parametrize("name", ["area", "sh"])
def test_light_comes_from_the_viewers_side(name: str) -> None:
    towards, solid = directions(ROWS), solid_angles(ROWS)
    for lights in draws(name):
        assert (
            lights_as_environment(lights, ROWS).mean(-1) * solid * towards[..., 2]
        ).sum() >= -1e-6


@pytest.mark.slow
def test_natural_lights_give_the_shading_of_the_file(shared: Path) -> None:
    folder = shared / "data" / "mit_berkeley_train"
    lights = load_natural_lights(folder)
    for seed in range(4):
        pick = int(np.random.default_rng(seed).integers(lights.shape[2]))
        wanted = np.exp(real_sh(facing()) @ light_from_reference(lights[..., pick]))
        found = make_lights("natural", np.random.default_rng(seed), folder)
        assert isinstance(found[0], EnvironmentLight)
        error = shading_under(found[0].radiance, facing()) / wanted - 1
        assert np.sqrt(np.square(error).mean()) < 0.02


@pytest.mark.parametrize("suffix", [".hdr", ".exr"])
@pytest.mark.parametrize(("height", "rows"), [(48, 64), (256, 128)])
def test_a_panorama_keeps_its_light(tmp_path: Path, suffix: str, height: int, rows: int) -> None:
    picture = sunny(height)
    radiance = read_panorama(write_panorama(tmp_path / f"sky{suffix}", picture))
    assert radiance.shape == (rows, 2 * rows, 3)
    normals = np.array([[0, 1.0, 0], [0, -1, 0], [1, 0, 0], [0, 0, 1], [0.5, 0.5, -np.sqrt(0.5)]])
    wanted, found = (shading_under(p, normals) for p in (picture, radiance))
    np.testing.assert_allclose(found / found.mean(), wanted / wanted.mean(), rtol=0.02)


def test_a_panorama_is_turned_until_it_lights_the_viewers_side(tmp_path: Path) -> None:
    """In the file the sun stands behind the object."""
    write_panorama(tmp_path / "a.exr", sunny(64))
    write_panorama(tmp_path / "b.hdr", sunny(64)[..., ::-1])
    plain = read_panorama(tmp_path / "a.exr")
    for seed in range(12):
        (light,) = make_lights("hdr", np.random.default_rng(seed), tmp_path)
        assert isinstance(light, EnvironmentLight)
        assert shading_under(light.radiance, np.array([[0, 0, 1.0]])).mean() >= 0.8 - 1e-6
        np.testing.assert_allclose(
            np.sort(light.radiance.mean(-1)), np.sort(plain.mean(-1)), rtol=0.1, atol=0.02
        )


def test_files_that_are_no_environments_are_refused(tmp_path: Path) -> None:
    picture = np.ones((32, 64, 3), np.float32)
    (tmp_path / "empty").mkdir()
    cases = {
        "hdr": [
            (tmp_path / "absent.hdr", "no such file"),
            (tmp_path / "empty", "has no .exr or .hdr file"),
            (write_panorama(tmp_path / "square.exr", picture[:, :32]), "twice as wide as high"),
            (write_panorama(tmp_path / "black.exr", 0 * picture), "is black"),
            (tmp_path / "sky.png", "clip the radiance"),
        ],
        "natural": [(tmp_path, "natural_lights.mat")],
    }
    for name, wrong in cases.items():
        for source, words in wrong:
            with pytest.raises(InputError, match=words):
                make_lights(name, np.random.default_rng(0), source)


@pytest.mark.parametrize("name", ["natural", "hdr"])
def test_lights_of_files_need_the_files(name: str) -> None:
    with pytest.raises(InputError, match="read from files"):
        make_lights(name, np.random.default_rng(0))


def test_an_unknown_light_lists_the_known_ones() -> None:
    with pytest.raises(InputError, match=", ".join(RIGS)):
        make_lights("candle", np.random.default_rng(0))
