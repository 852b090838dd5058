"""The choice of Mitsuba's variant, and the message without Mitsuba."""

import subprocess
import sys
from pathlib import Path

import pytest

from isc_core.errors import InputError
from synth.scene import variant
from synth.scene.variant import llvm_is_usable, load_mitsuba, slower_without

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("major", "usable"),
    [(-1, False), (14, False), (15, False), (18, False), (19, True), (21, True)],
)
def test_only_a_recent_llvm_is_trusted(major: int, usable: bool) -> None:
    assert llvm_is_usable(major) is usable


def test_the_variant_fits_the_machine() -> None:
    pytest.importorskip("mitsuba", reason="needs the extra `synth`")
    import drjit

    expected = "llvm_ad_rgb" if drjit.detail.llvm_version()[0] >= 19 else "scalar_rgb"
    assert load_mitsuba().variant() == expected


def test_without_mitsuba_the_message_names_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    with pytest.raises(InputError, match="`pip install 'mitsuba>=.* 'drjit>="):
        load_mitsuba()


@pytest.mark.slow
@pytest.mark.parametrize("found", [-1, 15])
def test_without_a_recent_llvm_scalar_kernels_run_and_one_line_names_the_package(
    found: int,
) -> None:
    """In a separate process: a variant cannot be changed once set."""
    pytest.importorskip("mitsuba", reason="needs the extra `synth`")
    code = (
        "import numpy as np\n"
        "from synth.scene import variant\n"
        f"variant.newest_llvm = lambda: {found}\n"
        "from synth.shapes.gourd import gourd\n"
        "from synth.scene.tracing import Tracer\n"
        "hits = Tracer(gourd(40, 41)).hits(np.array([[0., 0, 9]]), np.array([[0., 0, -1]]))\n"
        "assert hits.valid.all() and variant.load_mitsuba().variant() == 'scalar_rgb'\n"
        "print(variant.slower_without())\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("\n") == 1
    assert "libllvm19" in done.stdout


def test_there_is_no_advice_on_a_fast_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(variant, "has_llvm", lambda: True)
    assert slower_without() == ""
