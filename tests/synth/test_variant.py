"""The choice of Mitsuba's variant, and the message without Mitsuba."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from isc_core.errors import InputError
from synth.scene import variant
from synth.scene.variant import (
    CHOICE,
    chosen_variant,
    cuda_is_usable,
    llvm_is_usable,
    load_mitsuba,
    slower_without,
    usable_variants,
)

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

    card = drjit.has_backend(drjit.JitBackend.CUDA)
    fast = "llvm_ad_rgb" if drjit.detail.llvm_version()[0] >= 19 else "scalar_rgb"
    assert load_mitsuba().variant() in ({"cuda_ad_rgb", fast} if card else {fast})


@pytest.mark.parametrize(
    ("card", "llvm", "expected"),
    [
        (True, 19, ("cuda_ad_rgb", "llvm_ad_rgb", "scalar_rgb")),
        (True, -1, ("cuda_ad_rgb", "scalar_rgb")),
        (False, 19, ("llvm_ad_rgb", "scalar_rgb")),
        (False, 15, ("scalar_rgb",)),
    ],
)
def test_a_card_comes_first_then_llvm_unless_another_is_named(
    card: bool, llvm: int, expected: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("mitsuba", reason="needs the extra `synth`")
    monkeypatch.setattr(variant, "cuda_is_usable", lambda: card)
    monkeypatch.setattr(variant, "newest_llvm", lambda: llvm)
    monkeypatch.delenv(CHOICE, raising=False)
    assert usable_variants() == expected
    assert chosen_variant() == expected[0]
    for name in expected:
        monkeypatch.setenv(CHOICE, name)
        assert chosen_variant() == name


@pytest.mark.parametrize("named", ["cuda_ad_rgb", "llvm", "scalar_spectral"])
def test_a_variant_that_does_not_run_here_is_refused(
    named: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("mitsuba", reason="needs the extra `synth`")
    monkeypatch.setattr(variant, "cuda_is_usable", lambda: False)
    monkeypatch.setenv(CHOICE, named)
    with pytest.raises(InputError, match=f"{CHOICE}={named}: this machine runs .*scalar_rgb;"):
        chosen_variant()


def test_a_card_without_optix_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    drjit = pytest.importorskip("drjit", reason="needs the extra `synth`")
    monkeypatch.setattr(drjit, "has_backend", lambda backend: backend == drjit.JitBackend.CUDA)
    monkeypatch.delenv("DRJIT_LIBOPTIX_PATH", raising=False)
    monkeypatch.setattr(variant, "OPTIX", "libno-such-library.so.1")
    assert not cuda_is_usable()
    monkeypatch.setattr(variant, "OPTIX", None)  # the process itself, which can be opened
    assert cuda_is_usable()
    monkeypatch.setattr(drjit, "has_backend", lambda backend: False)
    assert not cuda_is_usable()


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
        "variant.cuda_is_usable = lambda: False\n"
        "from synth.shapes.gourd import gourd\n"
        "from synth.scene.tracing import Tracer\n"
        "hits = Tracer(gourd(40, 41)).hits(np.array([[0., 0, 9]]), np.array([[0., 0, -1]]))\n"
        "assert hits.valid.all() and variant.load_mitsuba().variant() == 'scalar_rgb'\n"
        "print(variant.slower_without())\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={name: value for name, value in os.environ.items() if name != CHOICE},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("\n") == 1
    assert "libllvm19" in done.stdout


def test_there_is_no_advice_on_a_fast_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(variant, "is_vectorised", lambda: True)
    assert slower_without() == ""
