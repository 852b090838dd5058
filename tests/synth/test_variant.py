"""Which of Mitsuba's variants is chosen, and what a user without Mitsuba reads."""

import sys

import pytest

from isc_core.errors import InputError
from synth.variant import llvm_is_usable, load_mitsuba


@pytest.mark.parametrize(("major", "usable"), [(-1, False), (14, False), (15, False), (18, False), (19, True), (21, True)])
def test_only_a_recent_llvm_is_trusted(major: int, usable: bool) -> None:
    assert llvm_is_usable(major) is usable


def test_the_variant_fits_the_machine() -> None:
    pytest.importorskip("mitsuba", reason="needs the extra `synth`")
    import drjit

    expected = "llvm_ad_rgb" if drjit.detail.llvm_version()[0] >= 19 else "scalar_rgb"
    assert load_mitsuba().variant() == expected


def test_without_mitsuba_the_message_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    with pytest.raises(InputError, match=r"isc3d\[synth\]"):
        load_mitsuba()
