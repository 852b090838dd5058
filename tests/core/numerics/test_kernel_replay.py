"""Libraries for other systems, run by emulators, give what the library of this one gives."""

import importlib.util
import re
import shutil
import sys
from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from blender_addon.packaging.kernels.build import (
    MACHINES,
    libraries,
    libraries_for,
    library,
    sources_of,
)
from blender_addon.packaging.kernels.calls import Call, recorded_calls, strided_copy
from blender_addon.packaging.kernels.portable_code import source_names, versions
from blender_addon.packaging.kernels.replay import EMULATORS, HERE, machines_of, replay
from isc_core.numerics import kernel_check
from isc_core.numerics.jit import Kernel
from isc_core.numerics.kernel_library import open_library, source_digest
from isc_core.separation.published import yang_2010, yoon_2006
from tests.core.numerics.kept_kernels import KEPT

pytestmark = pytest.mark.skipif(
    sys.platform != "linux"
    or importlib.util.find_spec("numba") is None
    or importlib.util.find_spec("ziglang") is None,
    reason="needs Linux, numba and ziglang",
)
OLDEST = MACHINES[HERE][0]


def calls_of(kernel, *values):
    """A call with its outcome by plain Python."""
    (version,) = (one for one in versions() if one.kernel is kernel)
    before = [strided_copy(one) for one in values]
    after = [strided_copy(one) for one in values]
    return Call(version, before, after, kernel.function(*after))


def test_a_replayed_call_has_the_outcome_of_python_and_a_wrong_one_is_seen(tmp_path):
    parents = np.array([0, 0, 1, 2, 3])
    cells = np.random.default_rng(4).random((4, 4, 4))
    places = np.array([[0.5, 0.0, 0.25], [1.0, 0.5, 0.5], [2.5, 1.5, 0.75]])
    calls = [
        calls_of(yoon_2006._flatten, parents),
        calls_of(yang_2010._interpolate, cells, places, np.zeros(3)),
    ]
    sources = sources_of([one.version for one in calls])
    made = library(OLDEST, *sources, tmp_path)
    assert all(one.agrees for one in replay(made, OLDEST, (), calls))
    wrong = replace(calls[0], after=[strided_copy(parents)])
    assert [one.agrees for one in replay(made, OLDEST, (), [wrong, calls[1]])] == [False, True]


def test_a_library_of_other_sources_is_never_used(tmp_path):
    code, declared = sources_of([one for one in versions() if one.kernel is kernel_check.mix])
    opened = open_library(library(OLDEST, code, declared, tmp_path / "same"))
    assert opened is not None and kernel_check.passes(opened)
    inside, outside = cast(Kernel, kernel_check.mix), cast(Kernel, yoon_2006._flatten)
    assert inside.function in opened and outside.function not in opened
    digest = source_digest(source_names())
    assert declared.count(digest) == 1
    other = declared.replace(digest, "0" * 64)
    assert open_library(library(OLDEST, code, other, tmp_path / "other")) is None


def test_a_library_that_computes_something_else_is_never_used():
    class Other:
        def kernel(self, function, signatures):
            return lambda *values: function(*values[:-1], values[-1] + 1)

    assert not kernel_check.passes(Other())


@pytest.fixture(scope="module")
def calls():
    *_, opened = filter(None, map(open_library, libraries_for(HERE, KEPT)))
    return recorded_calls(opened, versions())


@pytest.mark.slow
@pytest.mark.parametrize("platform", EMULATORS)
def test_every_kernel_of_every_platform_agrees(platform, calls):
    emulator = EMULATORS[platform]
    if emulator and shutil.which(emulator[0]) is None:
        pytest.skip(f"{emulator[0]} is not installed")
    machines = machines_of(platform)
    for path, machine in zip(libraries(machines, KEPT), machines, strict=True):
        differences = replay(path, machine, emulator, calls)
        assert len(differences) == len(versions())
        assert [one for one in differences if not one.agrees] == []


@pytest.mark.slow
def test_libraries_for_windows_need_what_windows_has_alone():
    """Of the libraries, that for the oldest processors: it calls what others compute themselves."""
    (path,) = libraries(MACHINES["windows-x64"][:1], KEPT)
    names = {one.decode() for one in re.findall(rb"[\w.-]+\.dll", path.read_bytes(), re.I)}
    needed = {one for one in names - {path.name} if not one.startswith("api-ms-win-crt-")}
    assert needed == {"KERNEL32.dll"}
