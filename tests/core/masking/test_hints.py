"""Invalid hints are refused in one line."""

import pytest

from isc_core.errors import InputError
from isc_core.masking.hints import Hints


@pytest.mark.parametrize(
    ("hints", "words"),
    [
        (Hints(points=((64, 3),)), "--point 64,3: lies outside of the photo of 64 x 48 pixels"),
        (Hints(points=((-1, 3),)), "--point -1,3: lies outside"),
        (Hints(background=((3, 48),)), "--not 3,48: lies outside"),
        (Hints(((5, 5),), ((5, 5),)), "--point 5,5 and --not 5,5 contradict each other"),
        (Hints(((1, 1),), (), (10, 10, 20, 20)), "--point 1,1: lies outside of --box 10,10,20,20"),
        (Hints(box=(50, 10, 20, 20)), "extends beyond the image"),
        (Hints(box=(5, 5, 4, 20)), "sides of at least 8"),
    ],
)
def test_invalid_hints_are_refused(hints: Hints, words: str) -> None:
    with pytest.raises(InputError) as error:
        hints.check(64, 48)
    assert words in str(error.value) and "\n" not in str(error.value)


def test_valid_hints_are_accepted() -> None:
    Hints(((12, 12), (20, 20)), ((1, 1),), (10, 10, 20, 20)).check(64, 48)
    assert not Hints() and Hints(background=((1, 1),))
