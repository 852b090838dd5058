"""An atlas of patterns is of many kinds, sharp where it is printed, and the same again."""

import numpy as np
import pytest

from isc_core.errors import InputError

pytest.importorskip("matplotlib")

from training.world.patterns import PatternKind, make_atlas
from training.world.patterns.canvas import filtered_noise
from training.world.patterns.fields import gradient, marble, noise
from training.world.patterns.geometric import checks, dots, stripes
from training.world.patterns.lettering import draw_hand, fitted, line
from training.world.patterns.patches import patches
from training.world.patterns.text import text
from training.world.patterns.typefaces import Script, has_sign, typefaces


@pytest.mark.slow
def test_an_atlas_has_every_kind_and_no_empty_map() -> None:
    atlas = make_atlas(0, 150, 48)
    assert atlas.maps.shape == (150, 48, 48) and atlas.maps.dtype == np.uint8
    assert set(atlas.kinds.tolist()) == set(PatternKind)
    assert atlas.maps.std((1, 2)).min() > 5
    assert 0.1 < atlas.tileable.mean() < 0.9
    assert len({one.tobytes() for one in atlas.maps}) == 150


@pytest.mark.slow
def test_a_longer_atlas_begins_with_the_shorter_one() -> None:
    short, long = make_atlas(5, 6, 32), make_atlas(5, 10, 32)
    np.testing.assert_array_equal(short.maps, long.maps[:6])
    np.testing.assert_array_equal(short.kinds, long.kinds[:6])
    assert (make_atlas(6, 6, 32).maps != short.maps).any()


@pytest.mark.parametrize(("count", "side"), [(0, 64), (3, 8)])
def test_an_atlas_of_nothing_is_refused(count: int, side: int) -> None:
    with pytest.raises(InputError, match="ask for one or more"):
        make_atlas(0, count, side)


@pytest.mark.parametrize("paint", [stripes, checks, dots, noise, marble, patches, gradient])
def test_maps_that_tile_have_no_seam(paint) -> None:
    """Steps from the last row or column to the first are not larger than those within."""
    excess = []
    for seed in range(12):
        values, tileable = paint(np.random.default_rng(seed), 48)
        assert values.shape == (48, 48) and values.min() >= -1e-9 and values.max() <= 1 + 1e-9
        if tileable:
            for axis in (0, 1):
                within = np.abs(np.diff(values, axis=axis)).mean(1 - axis)
                seam = np.abs(values.take(0, axis) - values.take(-1, axis)).mean()
                excess.append(seam - within.max())
    assert max(excess, default=0) < 0.1


def test_print_is_sharp_and_covers_a_part() -> None:
    covered = []
    for seed in range(12):
        values = text(np.random.default_rng(seed), 64).values
        covered.append(values.mean())
        if values.std() > 0.2:  # an edge takes a pixel or two, not more
            assert np.abs(np.diff(values)).max() > 0.5
    assert 0.02 < np.median(covered) < 0.6


def test_the_fonts_write_more_than_latin() -> None:
    faces = typefaces()
    assert len({face.family for face in faces if Script.LATIN in face.scripts}) >= 4
    assert len(frozenset().union(*(face.scripts for face in faces))) >= 3
    assert faces == typefaces()


def test_letters_that_a_font_does_not_have_are_left_out() -> None:
    face = next(face for face in typefaces() if Script.HAN not in face.scripts)
    rng = np.random.default_rng(0)
    hand = draw_hand(rng, Script.LATIN)
    assert not has_sign(face.path, "食") and has_sign(face.path, " ")
    if Script.HAN not in hand.face.scripts:
        np.testing.assert_array_equal(line("a食b", hand, 30), line("ab", hand, 30))


def test_a_fitted_line_is_as_wide_as_asked() -> None:
    for seed in range(10):
        hand = draw_hand(np.random.default_rng(seed), Script.LATIN)
        assert fitted("Kitchen", hand, 200, 500).width == pytest.approx(200, rel=0.15)


def test_noise_has_the_spectrum_asked_for() -> None:
    values = filtered_noise(np.random.default_rng(0), 256, 3)
    assert values.mean() == pytest.approx(0, abs=1e-9) and values.std() == pytest.approx(1)
    power = np.abs(np.fft.fft2(values)) ** 2
    frequency = np.hypot(*np.meshgrid(*[np.fft.fftfreq(256, 1 / 256)] * 2))
    bands = [(4, 8), (32, 64)]
    low, high = (power[(frequency >= a) & (frequency < b)].mean() for a, b in bands)
    assert np.log2(low / high) / 3 == pytest.approx(3, abs=0.4)
