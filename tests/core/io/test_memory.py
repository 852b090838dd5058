"""The memory allocator of the C library."""

import platform
import subprocess
import sys

import pytest

from isc_core.io.memory import release_memory, reuse_memory
from tests.core.command_line import ROOT

_IN_TURN = """
import resource, sys, threading
import numpy as np
from isc_core.io.memory import reuse_memory
if len(sys.argv) > 1:
    reuse_memory()
def work():
    [np.ones(1 << 18) for _ in range(8)]
def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt
work()
before = faults()
for _ in range(4):
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
print(faults() - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="needs glibc")
def test_threads_reuse_memory_that_others_have_freed() -> None:
    new, reused = (
        int(subprocess.check_output([sys.executable, "-c", _IN_TURN, *given], cwd=ROOT))
        for given in ((), ("reuse",))
    )
    assert reused < 0.1 * new


def test_systems_without_glibc_have_no_such_options(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "win32")
    monkeypatch.setattr("ctypes.CDLL", None)
    reuse_memory()
    release_memory()
