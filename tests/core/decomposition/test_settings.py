"""Names of the settings' values: present ones, and those of earlier versions."""

from typing import Any

import numpy as np
import pytest

from isc_core.cli.commands import build_parser
from isc_core.decomposition import Settings
from isc_core.decomposition.settings import LightPrior, ShapePrior, renamed_value
from isc_core.errors import InputError


@pytest.mark.parametrize(
    ("option", "old", "new"),
    [
        ("light_prior", "seen", LightPrior.PREDICTED),
        ("light_prior", "usual", LightPrior.DATASET),
        ("shape_prior", "seen", ShapePrior.PREDICTED),
        ("shape_prior", "outline", ShapePrior.SILHOUETTE),
    ],
)
def test_old_names_are_read_and_the_new_one_is_named(
    option: str, old: str, new: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert renamed_value(option, old) == new and renamed_value(option, new) is None
    assert getattr(Settings(**{option: old}), option) == new  # type: ignore[arg-type]
    words = f"--{option.replace('_', '-')}"
    for command in (
        ["decompose", "a.png", "-o", "b"],
        ["evaluate", "a", "--dataset", "mit-berkeley"],
    ):
        found = build_parser().parse_args([*command, words, old])
        assert getattr(found, option) == new
        assert f"{words} {old} is now called {new}" in capsys.readouterr().err
        assert getattr(build_parser().parse_args([*command, words, new]), option) == new
        assert capsys.readouterr().err == ""


def test_unknown_names_are_refused() -> None:
    for changes in ({"light_prior": "bright"}, {"shape_prior": "usual"}, {"illumination": "dusk"}):
        with pytest.raises(InputError, match="unknown"):
            Settings(**changes).check()  # type: ignore[arg-type]


def test_numbers_are_given_as_text() -> None:
    for colour in ((1, 1, 0.9), [1, 1, 0.9]):
        with pytest.raises(InputError, match="a text such as '1,1,0.9', not .1, 1, 0.9"):
            Settings(light_colour=colour).check()  # type: ignore[arg-type]
    with pytest.raises(InputError, match="a text such as '35', not 35"):
        Settings(camera=35).check()  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"full_size": "no"}, "full_size must be True or False, not 'no'"),
        ({"max_size": "64"}, "max_size must be a whole number, not '64'"),
        ({"max_size": True}, "max_size must be a whole number, not True"),
        ({"detail": None}, "detail must be a whole number, not None"),
        ({"threads": 1.5}, "threads must be a whole number, not 1.5"),
        ({"seed": "a"}, "seed must be a whole number, not 'a'"),
        ({"highlight_odds": "4"}, "highlight_odds must be a number, not '4'"),
    ],
)
def test_a_value_of_another_type_is_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as refusal:
        Settings(**values).check()
    assert message in str(refusal.value)


def test_numbers_of_numpy_are_numbers() -> None:
    Settings(max_size=np.int64(64), full_size=np.bool_(True)).check()  # type: ignore[arg-type]
