"""Properties of every separation method and variant.

Inside the mask: image = diffuse + specular + residual; 0 <= diffuse <= image; specular >= 0;
residual = 0 except at clipped pixels.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import strategies as st

from isc_core.scene.decomposition import Separation
from isc_core.separation import METHODS, separate, variants
from tests.properties.laws import at_most, between, finite, law, threads
from tests.properties.photos import MadePhoto, ordinary, photos

# The full number of iterations would take minutes even on a small photo.
FASTER: dict[str, dict[str, object]] = {"akashi_2016": {"iterations": 40, "starts": 1}}
EVERY = tuple((method, variant) for method in METHODS for variant in variants(method))
IMPROVED = tuple((method, "improved") for method in METHODS)
MOVES: dict[str, Callable[[np.ndarray], np.ndarray]] = {"flip": np.fliplr, "turn": np.rot90}
LAYERS = ("diffuse", "specular", "residual", "confidence")
# Fraction of the mean radiance that may move to the other layer: the measured maxima
# (docs/robustness.md) with a margin.
TURN_BOUNDS = dict.fromkeys(METHODS, 0.05) | {"network": 0.2}
SCALE_BOUND = 0.01


@dataclass(frozen=True)
class SeparationCase:
    """A photo, and the method and variant that separate it."""

    made: MadePhoto
    method: str
    variant: str

    def split(
        self, image: np.ndarray, mask: np.ndarray, clipped: np.ndarray | None = None
    ) -> Separation:
        """Separate an image by this case's method."""
        changes = FASTER.get(self.method)
        return separate(self.method, image, mask, clipped, variant=self.variant, changes=changes)


def cases(
    drawn: st.SearchStrategy[MadePhoto], methods: tuple[tuple[str, str], ...] = IMPROVED
) -> st.SearchStrategy[SeparationCase]:
    """Photos with one of the (method, variant) pairs."""
    return st.builds(
        lambda made, pair: SeparationCase(made, *pair), drawn, st.sampled_from(methods)
    )


def assert_sound(
    split: Separation, image: np.ndarray, mask: np.ndarray, clipped: np.ndarray | None = None
) -> None:
    """Assert the identities and ranges of a separation of `image` inside `mask`."""
    peak = max(float(image[mask].max()), 1e-30)
    finite(**{name: getattr(split, name) for name in LAYERS})
    for name in LAYERS:
        layer = getattr(split, name)
        assert layer.dtype == np.float32 and layer.shape[:2] == mask.shape, name
        assert not layer[~mask].any(), f"{name} outside the mask"
    total = split.diffuse.astype(float) + split.specular + split.residual
    assert np.abs(total - image)[mask].max() <= 1e-5 * peak, "the layers do not add up"
    assert (split.diffuse >= 0).all(), "negative diffuse light"
    assert (split.diffuse[mask] <= image[mask] + 1e-6 * peak).all(), "diffuse exceeds the image"
    assert (split.specular >= 0).all(), "negative specular light"
    between(0, 1, confidence=split.confidence)
    explained = mask if clipped is None else mask & ~clipped
    residual = np.abs(split.residual[explained]).max(initial=0)
    assert residual <= 1e-6 * peak, "a residual at pixels that are not clipped"


def moved_light(one: np.ndarray, other: np.ndarray, image: np.ndarray, mask: np.ndarray) -> float:
    """Mean difference of two diffuse layers over the mean radiance."""
    return float(np.abs(one - other)[mask].mean()) / float(image[mask].mean())


@law(cases(photos(), EVERY), seconds=0.03)
def test_layers_are_sound(case: SeparationCase) -> None:
    image, mask = case.made.light(), case.made.inside()
    clipped = case.made.clipped() if case.made.clips else None
    before = image.copy()
    assert_sound(case.split(image, mask, clipped), image, mask, clipped)
    assert np.array_equal(image, before), "the input was changed"


@law(cases(photos(8, 40)), seconds=0.06)
def test_number_of_threads_does_not_matter(case: SeparationCase) -> None:
    image, mask = case.made.light(), case.made.inside()
    splits = []
    for count in (1, 2):
        with threads(count):
            splits.append(case.split(image, mask))
    for name in LAYERS:
        assert np.array_equal(*(getattr(split, name) for split in splits)), name


@law(cases(photos(4, 36)), seconds=0.06)
def test_frame_around_the_object_does_not_matter(case: SeparationCase) -> None:
    made = case.made
    image, mask = made.light(), made.inside()
    plain = case.split(image, mask)
    sides = [(made.seed % 5, 3), (2, made.seed % 7)]
    wide = case.split(np.pad(image, [*sides, (0, 0)], constant_values=0.7), np.pad(mask, sides))
    (top, _), (left, _) = sides
    inner = wide.diffuse[top : top + made.rows, left : left + made.columns]
    peak = max(float(image[mask].max()), 1e-30)
    at_most(1e-5, np.abs(inner - plain.diffuse).max() / peak, f"padding {case.method}")


@pytest.mark.slow
@law(cases(ordinary()), seconds=0.1)
def test_flips_and_turns_change_little(case: SeparationCase) -> None:
    image, mask = case.made.light(), case.made.inside()
    plain = case.split(image, mask).diffuse
    for name, move in MOVES.items():
        turned_image, turned_mask = (np.ascontiguousarray(move(a)) for a in (image, mask))
        turned = case.split(turned_image, turned_mask).diffuse
        change = moved_light(turned, move(plain), turned_image, turned_mask)
        at_most(TURN_BOUNDS[case.method], change, f"{name} {case.method}")


@pytest.mark.slow
@law(cases(ordinary()), seconds=0.12)
def test_exposure_changes_little(case: SeparationCase) -> None:
    image, mask = case.made.light(), case.made.inside()
    plain = case.split(image, mask).diffuse
    for factor in (2.0, 3.7, 0.01):
        other = case.split((np.float32(factor) * image).astype(np.float32), mask).diffuse / factor
        change = moved_light(other, plain, image, mask)
        at_most(SCALE_BOUND, change, f"x {factor:g} {case.method}")


@pytest.mark.slow
def test_network_gives_the_same_bytes_on_any_number_of_threads() -> None:
    """BLAS splits matrix products by threads, and rounds them differently."""
    pytest.importorskip("threadpoolctl")
    made = MadePhoto("glossy", "disc", 96, 96, seed=0)
    splits = []
    for count in (1, 2, 3):
        with threads(count):
            splits.append(separate("network", made.light(), made.inside()).diffuse)
    assert np.array_equal(splits[0], splits[1]) and np.array_equal(splits[0], splits[2])
