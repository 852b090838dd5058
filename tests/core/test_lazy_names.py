"""Names that start without numerical libraries, and packages that import a module when a name of it
is first used.
"""

import importlib
import subprocess
import sys
from pathlib import Path

import pytest

from isc_core.lazy import exports

ROOT = Path(__file__).resolve().parents[2]
LAZY_PACKAGES = ("isc_core.decomposition", "isc_core.lobe_fitting", "isc_core.photo")
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
        "isc_core.decomposition import Settings",
        "isc_core.decomposition.settings import MODELS, Settings",
        "isc_core.io.limits import USUAL, Limits",
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
