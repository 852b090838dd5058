"""The zip is installed as a user does it, into a user folder of its own: what the extension does
there, and that nothing is left.

The whole of it, with wheels and whole runs, is `python -m blender_addon.packaging.try_out`.
"""

import dataclasses
import importlib.util
import json
import sys
from pathlib import Path

import pytest

from blender_addon.packaging.__main__ import build
from blender_addon.packaging.targets import chosen
from blender_addon.packaging.try_out import try_out
from isc_core.errors import InputError
from tests.addon.scene_fixture import bump, write_result

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("bpy") is None,
    reason="needs the extra `blender` (Python 3.11 or 3.13)",
)


def result_of_photo(folder: Path) -> Path:
    known = bump()
    about = known.provenance.input | {"name": "photo.png"}
    return write_result(
        folder,
        dataclasses.replace(known, provenance=dataclasses.replace(known.provenance, input=about)),
    )


@pytest.mark.slow
def test_the_zip_installs_works_and_uninstalls_completely(tmp_path: Path) -> None:
    """Without wheels, as this environment has the packages: so no network is needed."""
    try:
        (target,) = chosen("here")
    except InputError as error:
        pytest.skip(str(error))
    done = try_out(
        build(target, tmp_path, None), Path(sys.executable), result_of_photo(tmp_path / "result")
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    report = json.loads(
        next(line for line in done.stdout.splitlines() if line.startswith("REPORT ")).removeprefix(
            "REPORT "
        )
    )
    assert report["killed"].startswith(("the worker was killed", "not tested"))
