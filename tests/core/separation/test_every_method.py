"""For any photo, every method returns valid layers or a one-line error, with the required
invariances.
"""

from typing import Any

import numpy as np
import pytest

from isc_core import separation
from isc_core.errors import InputError
from isc_core.progress import Monitor
from isc_core.scene.decomposition import Separation
from isc_core.separation import METHODS, variants

# Those that do not judge by colour, and so have an answer for grey photos; the others refuse.
WITHOUT_COLOUR = {
    ("none", "improved"),
    ("chaotic_segmentation", "paper"),
    ("network", "improved"),
    ("isc", "improved"),
}
EVERY = [(method, variant) for method in METHODS for variant in variants(method)]
OURS = [(method, variant) for method, variant in EVERY if variant != "sihr"]

every = pytest.mark.parametrize(("method", "variant"), EVERY)
ours = pytest.mark.parametrize(("method", "variant"), OURS)


# What would take its time also on a small photo.
SHORTER: dict[str, dict[str, object]] = {"akashi_2016": {"iterations": 60, "starts": 1}}


def separate(
    method: str,
    image: np.ndarray,
    mask: np.ndarray,
    clipped: np.ndarray | None = None,
    **options: Any,
) -> Separation:
    return separation.separate(method, image, mask, clipped, changes=SHORTER.get(method), **options)


def scene(height: int = 44, width: int = 52) -> tuple[np.ndarray, np.ndarray]:
    """Image in [0, 1), float64, and mask: a slightly noisy disc, two albedos, two highlights."""
    rng = np.random.default_rng(3)
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    mask = x**2 + y**2 < 0.9
    shading = 0.3 + 0.6 * np.sqrt(np.clip(1 - x**2 - y**2, 0, 1))
    specular = 0.4 * np.exp(-((x - 0.4) ** 2 + (y + 0.2) ** 2) / 0.02) + 0.2 * np.exp(
        -((x + 0.5) ** 2 + (y - 0.1) ** 2) / 0.05
    )
    albedo = np.where((x > 0.1 * np.sin(9 * y))[..., None], [0.6, 0.25, 0.12], [0.15, 0.3, 0.5])
    noise = 0.004 * rng.random((height, width, 3))
    return (albedo * shading[..., None] + specular[..., None] + noise) * mask[..., None], mask


def assert_sound(
    split: Separation, image: np.ndarray, mask: np.ndarray, clipped: np.ndarray | None = None
) -> None:
    peak = max(float(image[mask].max()), 1e-30)
    for layer in (split.diffuse, split.specular, split.residual, split.confidence):
        assert layer.dtype == np.float32 and layer.shape[:2] == mask.shape
        assert np.isfinite(layer).all() and not layer[~mask].any()
    total = split.diffuse.astype(float) + split.specular + split.residual
    assert np.abs(total - image)[mask].max() <= 1e-5 * peak
    assert (split.diffuse[mask] >= 0).all() and (
        split.diffuse[mask] <= image[mask] + 1e-6 * peak
    ).all()
    assert (
        (split.specular >= 0).all() and split.confidence.min() >= 0 and split.confidence.max() <= 1
    )
    assert (
        np.abs(split.residual[mask if clipped is None else mask & ~clipped]).max(initial=0)
        <= 1e-6 * peak
    )


def same(a: Separation, b: Separation, tolerance: float) -> None:
    for name in ("diffuse", "specular", "residual", "confidence"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), atol=tolerance, err_msg=name)


@every
def test_an_ordinary_photo(method: str, variant: str) -> None:
    image, mask = scene()
    before = image.copy()
    told: list[float] = []
    split = separate(
        method,
        image,
        mask,
        variant=variant,
        monitor=Monitor(lambda event: told.append(event.fraction)),
    )
    assert_sound(split, image, mask)
    # To the network the highlights of this small scene do not stand out.
    assert split.specular.any() == (method not in ("none", "network"))
    assert np.array_equal(image, before)
    assert told == sorted(told) and all(0 <= fraction <= 1 for fraction in told)


@every
def test_the_same_twice(method: str, variant: str) -> None:
    image, mask = scene()
    first, second = (separate(method, image, mask, variant=variant) for _ in range(2))
    same(first, second, 0)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("factor", [2.0, 0.5, 2.0**-23, 2.0**23])
def test_exposure_does_not_matter(method: str, factor: float) -> None:
    """Powers of two, so that not even rounding differs; renderings may have any.

    The papers' guards are absolute: this holds for the recommended variant.
    """
    image, mask = scene()
    split, other = (separate(method, gain * image, mask) for gain in (1.0, factor))
    assert np.abs(other.diffuse / factor - split.diffuse).max() <= 2e-5
    assert np.abs(other.confidence - split.confidence).max() <= 1e-4


@ours
def test_what_is_around_does_not_matter(method: str, variant: str) -> None:
    image, mask = scene()
    split = separate(method, image, mask, variant=variant)
    wild = np.where(mask[..., None], image, 0.9)
    wild[0, 0], wild[-1, 0] = np.nan, -5.0
    padded = np.pad(wild, [(9, 4), (0, 13), (0, 0)], constant_values=np.inf)
    wide = separate(method, padded, np.pad(mask, [(9, 4), (0, 13)]), variant=variant)
    inside = np.s_[9:-4, :-13]
    same(
        split,
        Separation(
            *(
                layer[inside]
                for layer in (wide.diffuse, wide.specular, wide.residual, wide.confidence)
            )
        ),
        1e-6,
    )


@every
@pytest.mark.parametrize("bad", [np.nan, np.inf, -0.1])
def test_a_broken_pixel_inside_is_refused(method: str, variant: str, bad: float) -> None:
    image, mask = scene()
    image[20, 20, 1] = bad
    with pytest.raises(InputError, match="negative or non-finite values inside the mask"):
        separate(method, image, mask, variant=variant)


@every
@pytest.mark.parametrize("kind", ["ramp", "two greys", "nearly grey"])
def test_a_photo_without_colour(method: str, variant: str, kind: str) -> None:
    image, mask = scene()
    grey = np.repeat(image.mean(axis=2, keepdims=True), 3, axis=2)
    if kind == "two greys":
        grey = np.where(grey > 0.3, 0.6, 0.2) * mask[..., None]
    elif kind == "nearly grey":
        grey = grey * (1 + 2e-5 * np.array([1.0, 0.0, -1.0]))
    if (method, variant) in WITHOUT_COLOUR:
        assert_sound(separate(method, grey, mask, variant=variant), grey, mask)
    else:
        with pytest.raises(InputError, match=f"the photo has no colour, which {method}") as raised:
            separate(method, grey, mask, variant=variant)
        assert "\n" not in str(raised.value)


@every
def test_highlights_of_a_rendering_do_not_make_it_colourless(method: str, variant: str) -> None:
    """They may be ten thousand times as bright as the coloured reflectance around."""
    image, mask = scene()
    image[20:23, 30:33] += 2e4
    assert_sound(separate(method, image, mask, variant=variant), image, mask)


@every
def test_a_hint_of_colour_is_no_trap(method: str, variant: str) -> None:
    """Three parts in a thousand of colour, and 8 bits: hues are noise, but nothing breaks."""
    image, mask = scene()
    grey = image.mean(axis=2, keepdims=True) * np.array([1.003, 1.0, 0.997])
    coded = np.rint(255 * grey) / 255
    coded[22, 26] += np.array([0.02, 0, 0])
    assert_sound(separate(method, coded, mask, variant=variant), coded, mask)


@every
def test_clipped_highlights(method: str, variant: str) -> None:
    scene_image, mask = scene()
    image = np.minimum(scene_image, 0.55)
    clipped = (scene_image >= 0.55).any(axis=2) & mask
    assert 20 < clipped.sum() < mask.sum() / 2
    split = separate(method, image, mask, clipped, variant=variant)
    assert_sound(split, image, mask, clipped)
    assert variant == "sihr" or not split.confidence[clipped].any()


@every
def test_everything_clipped(method: str, variant: str) -> None:
    """White all over: no method can know anything, and none may break."""
    mask = scene()[1]
    image = np.where(mask[..., None], [1.0, 1.0, 0.9], 0.0)
    assert_sound(separate(method, image, mask, mask.copy(), variant=variant), image, mask, mask)


@every
def test_masks_with_holes_and_specks(method: str, variant: str) -> None:
    image, mask = scene()
    holed = mask & (np.random.default_rng(4).random(mask.shape) > 0.3)
    holed[10:14, 10:30] = False
    holed[0, 0] = True
    image[0, 0] = [0.2, 0.5, 0.3]
    wild = np.where(holed[..., None], image, 7.0) if variant != "sihr" else image
    assert_sound(separate(method, wild, holed, variant=variant), wild, holed)


@every
@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (1, 40), (40, 1), (2, 2), (3, 5)])
def test_tiny_regions(method: str, variant: str, shape: tuple[int, int]) -> None:
    image, _ = scene()
    mask = np.zeros(image.shape[:2], bool)
    mask[2 : 2 + shape[0], 6 : 6 + shape[1]] = True
    image = image + 0.01 * np.array([3, 2, 1])
    assert_sound(separate(method, image, mask, variant=variant), image, mask)


@every
def test_noise_of_eight_bits(method: str, variant: str) -> None:
    image = np.random.default_rng(5).integers(0, 256, (30, 34, 3)) / 255
    mask = np.ones((30, 34), bool)
    assert_sound(separate(method, image, mask, variant=variant), image, mask)


@every
@pytest.mark.parametrize("colour", [(0.5, 0.3, 0.1), (0.5, 0.0, 0.0), (0.3, 0.3, 0.0)])
def test_one_colour_all_over(method: str, variant: str, colour: tuple[float, float, float]) -> None:
    mask = scene()[1]
    image = np.where(mask[..., None], colour, 0.0)
    assert_sound(separate(method, image, mask, variant=variant), image, mask)


@every
def test_black_pixels_inside(method: str, variant: str) -> None:
    image, mask = scene()
    image[15:30, 15:25] = 0
    image[30:34, 30:36, 1:] = 0
    assert_sound(separate(method, image, mask, variant=variant), image, mask)


@pytest.mark.parametrize(
    ("method", "option", "value"),
    [
        ("mallick_2006", "smoothing", 1e300),
        ("mallick_2006", "smoothing", np.inf),
        ("yang_2010", "spatial_sigma", 1e-12),
        ("kim_2013", "base", np.inf),
        ("kim_2013", "prior", np.inf),
        ("sparse_coding", "blur", 1e-300),
        ("sparse_coding", "blur", 1e300),
        ("network", "log_odds_margin", np.nan),
        ("network", "tint", np.inf),
    ],
)
def test_numbers_that_no_array_or_sum_can_hold_are_refused(
    method: str, option: str, value: float
) -> None:
    image, mask = scene(20, 24)
    with pytest.raises(InputError, match=option) as raised:
        separation.separate(method, image, mask, changes={option: value})
    assert "\n" not in str(raised.value)


@every
@pytest.mark.parametrize("scale", [1e-6, 1e5])
def test_extreme_exposures(method: str, variant: str, scale: float) -> None:
    image, mask = scene()
    assert_sound(separate(method, scale * image, mask, variant=variant), scale * image, mask)


@every
def test_arrays_of_any_kind(method: str, variant: str) -> None:
    """Single precision, read-only, and strided arrays are taken as they are."""
    image, mask = scene()
    strided = np.repeat(image.astype(np.float32), 2, axis=1)[:, ::2]
    strided.flags.writeable = False
    assert not strided.flags.c_contiguous
    plain = separate(method, np.ascontiguousarray(strided), mask, variant=variant)
    same(separate(method, strided, mask, variant=variant), plain, 1e-6)
    assert_sound(plain, strided, mask)
