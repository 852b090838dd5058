"""Names of the settings' values: present ones, and those of earlier versions."""

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
