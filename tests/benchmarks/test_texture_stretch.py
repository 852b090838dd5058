"""The stretch of textures: that of a sphere is known."""

import numpy as np
import pytest

pytest.importorskip("bpy", reason="needs the extra `blender`")

from benchmarks.blender.texture_stretch import stretched
from isc_core.result_files.solids.back import Back
from isc_core.result_files.solids.rim import Rim
from isc_core.result_files.solids.solid_mesh import make_solid_mesh


@pytest.mark.slow
def test_the_stretch_of_a_sphere() -> None:
    """Its front has the stretch 1 / z, z uniform in the area: median 2, a quarter above 4."""
    row, column = np.indices((170, 170)) - 85 + 0.3
    square = 80.0**2 - row**2 - column**2
    height, mask = np.sqrt(np.maximum(square, 0)), square > 0
    found = {
        back: stretched(make_solid_mesh(height, height / 80, mask, Rim(mask), back, 0))
        for back in (Back.ROUNDED, Back.MIRRORED)
    }
    for body in found.values():
        assert body["front"][0] == pytest.approx(2, rel=0.05)
    mirrored, rounded = (found[back]["front"] for back in (Back.MIRRORED, Back.ROUNDED))
    assert mirrored[2] == pytest.approx(0.25, abs=0.04) and mirrored[1] > 7
    # On the last strip the texture runs back to where the sides begin: less of it is stretched.
    assert rounded[1:] < mirrored[1:] and rounded[2] < 0.22
    assert found[Back.MIRRORED]["back"][2] > 0.2
    assert found[Back.ROUNDED]["back"][2] < 0.1
