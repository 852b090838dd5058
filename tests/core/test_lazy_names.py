"""Modules that are imported without numerical libraries, and lazy exports of packages."""

import importlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from isc_core.lazy import exports
from tests.core.ball_scene import ball

ROOT = Path(__file__).resolve().parents[2]
LAZY_PACKAGES = (
    "isc_core.decomposition",
    "isc_core.lobe_fitting",
    "isc_core.photo",
    "isc_core.shading",
)
NUMERICAL = ("numpy", "scipy", "numba", "cv2", "OpenEXR", "PIL", "trimesh", "networkx")


def imported(code: str) -> set[str]:
    """The modules in memory after `code` ran in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys; print(*sys.modules)"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return set(done.stdout.splitlines()[-1].split())


@pytest.mark.parametrize(
    "names",
    [
        "isc_core.separation import BEST, IMPROVED, METHODS, PUBLISHED",
        "isc_core.photo import TRANSFERS",
        "isc_core.baselines import METHODS",
        "isc_core.cli.interface.options import add_triangles",
        "isc_core.decomposition import Settings",
        "isc_core.decomposition.settings import MODELS, Settings",
        "isc_core.io.limits import DEFAULT_LIMITS, Limits",
    ],
)
def test_the_names_that_options_show_need_no_numerical_library(names: str) -> None:
    assert not imported(f"from {names}") & set(NUMERICAL)


@pytest.mark.parametrize("package", LAZY_PACKAGES)
def test_a_lazy_package_offers_every_name_that_it_lists(package: str) -> None:
    module = importlib.import_module(package)
    for name in module.__all__:
        assert getattr(module, name).__class__ is not type(module), name


def test_a_missing_name_is_an_error_of_attributes_as_in_any_module() -> None:
    lookup = exports("isc_core.photo", {"TRANSFERS": ".names"})
    assert lookup("TRANSFERS") == ("auto", "srgb", "linear")
    with pytest.raises(AttributeError, match="module 'isc_core.photo' has no attribute 'nonsense'"):
        lookup("nonsense")


@pytest.mark.slow
def test_a_decomposition_imports_only_what_it_uses(tmp_path: Path) -> None:
    """Some libraries take a tenth of a second; a photo without highlights needs none of them."""
    light = np.where(ball((40, 50), 15.0, (20, 25)).mask, np.linspace(0.2, 0.6, 50), 0)
    codes = np.rint(255 * light[..., None] * [1.0, 0.7, 0.4]).astype(np.uint8)
    Image.fromarray(codes).save(tmp_path / "photo.png")
    command = ["decompose", str(tmp_path / "photo.png"), "-o", str(tmp_path / "result")]
    used = imported(f"from isc_core.cli.main import main; assert main({command}) == 0")
    assert (tmp_path / "result" / "mesh.glb").is_file()
    assert {"numpy", "OpenEXR", "PIL"} <= used
    assert not used & {"trimesh", "networkx", "scipy"}
    assert not used & {"isc_core.batch", "isc_core.lobe_fitting.fit", "isc_core.refinement"}
    assert not used & {"isc_core.inpainting.patch_fill", "isc_core.result_files.exports"}
