"""Environments keep their light when they are reduced and blurred."""

from pathlib import Path

import numpy as np
import pytest

from isc_core.errors import InputError
from isc_core.io.exr import write_channels
from isc_core.shading.environment_map import directions, solid_angles
from training.world.environments import ROWS, read_panoramas, smoothed_levels
from training.world.procedural_environments import procedural_room, procedural_sky, studio


def light(environment: np.ndarray) -> np.ndarray:
    return (environment * solid_angles(len(environment))[..., None]).sum((0, 1), dtype=float)


def photo(rows: int = ROWS, seed: int = 0) -> np.ndarray:
    return np.exp(np.random.default_rng(seed).normal(size=(rows, 2 * rows, 3))).astype(np.float32)


def write(path: Path, picture: np.ndarray) -> None:
    write_channels(path, {name: picture[..., k] for k, name in enumerate("RGB")})


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for k in range(12):
        write(tmp_path / f"place{'abcdefghijkl'[k]}.exr", photo(2 * ROWS, k))
    return tmp_path


def test_a_panorama_keeps_its_light(folder: Path) -> None:
    first = read_panoramas(folder)[0]
    assert first.name == "placea" and first.radiance.shape == (ROWS, 2 * ROWS, 3)
    np.testing.assert_allclose(light(first.radiance), light(photo(2 * ROWS, 0)), rtol=1e-6)


@pytest.mark.slow
def test_one_of_six_is_held_out_and_the_split_is_stable(folder: Path) -> None:
    def held_out() -> list[str]:
        return [one.name for one in read_panoramas(folder) if one.held_out]

    before = held_out()
    assert len(before) == 2 and held_out() == before
    write(folder / "z_later.exr", photo(2 * ROWS))
    assert held_out() == before


def test_what_is_held_out_has_no_sibling_to_learn_from(tmp_path: Path) -> None:
    for name in ("hall_01", "hall_02", "hall_03", "hall_04", "hall_05", "quay"):
        write(tmp_path / f"{name}.exr", photo())
    assert [one.name for one in read_panoramas(tmp_path) if one.held_out] == ["quay"]


@pytest.mark.parametrize("value", [np.nan, np.inf, -0.1])
def test_a_panorama_with_impossible_light_is_refused(tmp_path: Path, value: float) -> None:
    picture = photo()
    picture[3, 4, 1] = value
    write(tmp_path / "bad.exr", picture)
    with pytest.raises(InputError, match="bad.exr has NaN, infinite or negative"):
        read_panoramas(tmp_path)


def test_a_folder_without_panoramas_or_with_other_pictures_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="has no .exr or .hdr file"):
        read_panoramas(tmp_path)
    write(tmp_path / "square.exr", np.ones((64, 64, 3), np.float32))
    with pytest.raises(InputError, match="64 x 64 pixels"):
        read_panoramas(tmp_path)


def test_lobes_keep_the_mean_and_a_uniform_environment() -> None:
    environment, widths = photo(), (0.05, 0.2, 0.6)
    levels = smoothed_levels(environment, widths)
    assert levels.shape == (3, ROWS, 2 * ROWS, 3)
    for level in levels:
        np.testing.assert_allclose(light(level), light(environment), rtol=1e-5)
    assert (np.diff(levels.std((1, 2, 3))) < 0).all()
    uniform = smoothed_levels(np.ones((ROWS, 2 * ROWS, 3)), widths)
    np.testing.assert_allclose(uniform, 1, rtol=1e-5)


def test_a_lobe_is_symmetric_about_the_mirrored_direction() -> None:
    lamp = np.zeros((ROWS, 2 * ROWS, 3))
    lamp[12, 20] = 1
    level = smoothed_levels(lamp, (0.3,))[0, ..., 0]
    toward = directions(ROWS)
    cosine = toward @ toward[12, 20]
    assert level.argmax() == 12 * 2 * ROWS + 20
    for low in (0.2, 0.5, 0.8):
        ring = level[(cosine > low) & (cosine < low + 0.02)]
        assert len(ring) > 4 and ring.std() < 0.06 * ring.mean()
    assert (level[cosine < -0.2] == 0).all()


@pytest.mark.parametrize("draw", [procedural_room, procedural_sky, studio])
def test_invented_environments_are_light_of_all_kinds(draw) -> None:
    some = [draw(np.random.default_rng(seed), 16) for seed in range(8)]
    for environment in some:
        assert environment.shape == (16, 32, 3) and environment.dtype == np.float32
        assert np.isfinite(environment).all() and (environment > 0).all()
    np.testing.assert_array_equal(some[3], draw(np.random.default_rng(3), 16))
    assert np.std([np.log(one.mean()) for one in some]) > 0.1
