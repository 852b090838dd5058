"""OpenBLAS uses the instructions of the processor."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from isc_core.numerics.blas import openblas_core_type

AVX512 = "avx512f avx512cd avx512dq avx512bw avx512vl"


@pytest.mark.parametrize(
    ("flags", "kind"),
    [
        (f"sse3 avx avx2 fma {AVX512}", "SkylakeX"),
        ("sse3 avx avx2 fma avx512f avx512cd", "Haswell"),  # without those for bytes and words
        ("sse3 avx avx2 fma", "Haswell"),
        ("sse3 avx fma4", None),
        ("sse3 xavx2 fmaddsub", None),
        ("", None),
    ],
)
def test_the_choice_needs_all_instructions(tmp_path: Path, flags: str, kind: str | None) -> None:
    described = tmp_path / "cpuinfo"
    described.write_text(
        f"processor\t: 0\nmodel\t\t: 207\nflags\t\t: {flags}\nbugs\t\t: avx2 fma\n"
    )
    assert openblas_core_type(described) == kind


def test_other_systems_leave_the_choice_to_openblas(tmp_path: Path) -> None:
    assert openblas_core_type(tmp_path / "missing") is None
    described = tmp_path / "arm"
    described.write_text("processor\t: 0\nFeatures\t: fp asimd\n")
    assert openblas_core_type(described) is None


def test_numpy_is_not_imported_before_the_choice() -> None:
    code = "import sys, isc_core.numerics.blas; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_chosen_kernels_are_used() -> None:
    """A spelling that OpenBLAS does not know would have no effect."""
    kind = openblas_core_type()
    if kind is None:
        pytest.skip("OpenBLAS chooses on this machine")
    code = (
        "from isc_core.__main__ import _choose_blas; _choose_blas()\n"
        "import numpy\n"
        "from threadpoolctl import threadpool_info\n"
        "print(*(one['architecture'] for one in threadpool_info()"
        " if one['internal_api'] == 'openblas'))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, env=_plain()
    )
    assert set(done.stdout.split()) <= {kind}


def _plain() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name != "OPENBLAS_CORETYPE"}
