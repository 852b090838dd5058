"""Fixtures of the add-on's tests: an empty Blender, and results to build."""

import importlib.util
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture
def blender() -> Any:
    """The bpy module with an empty file; skipped where it is not installed."""
    if importlib.util.find_spec("bpy") is None:
        pytest.skip("needs the extra `blender` (Python 3.11 or 3.13)")
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    return bpy


@pytest.fixture
def addon(blender: Any) -> Iterator[Any]:
    """Blender with the add-on registered; no run is left behind."""
    import blender_addon
    from blender_addon.runs.active_run import cancel_active_run

    blender_addon.register()
    yield blender
    cancel_active_run()
    blender_addon.unregister()


@pytest.fixture(scope="session")
def bump_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A result folder of the bump, see `scene_fixture`."""
    from tests.addon.scene_fixture import write_result

    return write_result(tmp_path_factory.mktemp("scene") / "bump")
