"""The specular level is limited to what the photo shows of the mirrored environment map."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from isc_core.lobe_fitting.specular_level import SpecularSource, fitted_specular
from isc_core.lobe_fitting.specular_upper_bound import bounded_specular, specular_upper_bound
from isc_core.result_files.arrays_file import ARRAYS
from isc_core.result_files.result_folder import save
from isc_core.scene.decomposition import Decomposition
from isc_core.shading.environment_map import recovered_environment
from tests.core.result_files.test_arrays_file import glossy


@pytest.mark.slow
def test_plastic_mirrors_a_25th_of_an_even_sky_in_front() -> None:
    d = glossy()
    facing = replace(d, normal=np.broadcast_to(np.array([0, 0, 1], np.float32), d.normal.shape))
    even = np.broadcast_to(np.array([2.0, 1.0, 0.5]), (16, 32, 3))
    grey = replace(facing, image=np.full_like(d.image, 0.02))
    assert specular_upper_bound(grey, 0.3, even) == pytest.approx(0.02 / (0.04 * 2.0), rel=0.1), (
        "the brightest channel decides"
    )
    assert specular_upper_bound(grey, 0.3, 2 * even) == pytest.approx(
        0.5 * specular_upper_bound(grey, 0.3, even), rel=1e-5
    )
    assert specular_upper_bound(grey, 0.3, 0 * even) == np.inf


@pytest.mark.parametrize("roughness", [0.2, 0.4])
def test_an_even_sky_is_mirrored_alike_from_all_sides(roughness: float) -> None:
    d, even = glossy(), np.ones((16, 32, 3))
    tilted = replace(d, normal=np.where(d.normal[..., 2:] > 0.7, d.normal, np.float32([0, 0, 1])))
    grey = replace(tilted, image=np.full_like(d.image, 0.02))
    assert specular_upper_bound(grey, roughness, even) == pytest.approx(0.5, rel=0.08)


@pytest.mark.slow
def test_a_level_that_the_photo_has_no_room_for_is_lowered_and_others_stay() -> None:
    d = glossy()
    gloss = fitted_specular(d)
    assert gloss.specular is not None and gloss.roughness is not None
    assert vars(bounded_specular(d)) == vars(gloss)
    room = specular_upper_bound(d, gloss.roughness, recovered_environment(d.illumination, 16))
    shown = bounded_specular(stronger(d, 100.0))
    assert gloss.specular < room < 100 * gloss.specular
    assert shown.specular == pytest.approx(room)
    assert (shown.specular_source, shown.roughness) == (SpecularSource.LOWERED, gloss.roughness)


@pytest.mark.slow
def test_channels_of_zero_tell_nothing_of_the_room() -> None:
    d = glossy()
    env_map = recovered_environment(d.illumination, 16)
    image = d.image.copy()
    rows, columns = np.nonzero(d.mask)
    image[rows[::8], columns[::8], 2] = 0
    assert specular_upper_bound(replace(d, image=image), 0.4, env_map) == pytest.approx(
        specular_upper_bound(d, 0.4, env_map), rel=0.1
    )


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1.0, 100.0])
def test_every_file_of_a_result_has_the_same_level(tmp_path: Path, factor: float) -> None:
    d = stronger(glossy(), factor)
    save(d, tmp_path / "out", arrays=True)
    with np.load(tmp_path / "out" / ARRAYS) as arrays:
        level = float(arrays["specular_level"])
    described = json.loads((tmp_path / "out" / "decomposition.json").read_text(encoding="utf-8"))[
        "mesh"
    ]["specular"]
    chunk = (tmp_path / "out" / "mesh.glb").read_bytes()
    size = int.from_bytes(chunk[12:16], "little")
    extension = json.loads(chunk[20 : 20 + size])["materials"][0]["extensions"][
        "KHR_materials_specular"
    ]
    written = extension["specularFactor"] * max(extension.get("specularColorFactor", [1]))
    assert described["source"] == (SpecularSource.FITTED if factor == 1 else SpecularSource.LOWERED)
    assert level == pytest.approx(described["value"], rel=1e-6) == pytest.approx(written, rel=1e-6)


def stronger(d: Decomposition, factor: float) -> Decomposition:
    """The fitted lobe with a level that the photo does not bear out."""
    assert d.brdf is not None
    lights = tuple(
        replace(light, strength_light=factor * light.strength_light) for light in d.brdf.lights
    )
    return replace(d, brdf=replace(d.brdf, lights=lights))
