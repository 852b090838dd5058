"""The identities of a result: they hold for a sound one, and each violation is found and named."""

from dataclasses import replace

import numpy as np
import pytest

from tests.core.ball_scene import ball


def test_a_sound_result_keeps_every_identity() -> None:
    errors = ball().identity_errors()
    assert errors.broken() == ()
    assert max(errors.image, errors.shading_product, errors.sh, errors.normal_length) < 1e-6


@pytest.mark.parametrize(
    ("name", "factor", "words"),
    [
        ("image", 1.001, ["image"]),
        ("specular", 1.01, ["image"]),
        ("reflectance", 1.001, ["diffuse"]),
        ("normal", 1.001, ["shading", "normals"]),
        ("illumination", 1.001, ["shading"]),
        ("shading", 1.001, ["diffuse", "shading"]),
    ],
)
def test_each_violation_is_named(name: str, factor: float, words: list[str]) -> None:
    d = ball()
    broken = replace(d, **{name: getattr(d, name) * factor}).identity_errors().broken()
    assert [line.split()[0] for line in broken] == words


def test_errors_are_relative_to_the_image() -> None:
    d = ball()
    residual = np.where(d.mask[..., None], 1e-3, 0.0)
    off = replace(d, residual=residual).identity_errors().image
    assert off == pytest.approx(1e-3 / d.image.max(), rel=1e-3)


def test_only_the_inside_counts() -> None:
    d = ball()
    outside = np.where(d.mask[..., None], d.image, 5.0)
    assert replace(d, image=outside).identity_errors() == d.identity_errors()


def test_nan_is_no_success() -> None:
    d = ball()
    shading = d.shading.copy()
    shading[44, 66] = np.nan
    broken = replace(d, shading=shading).identity_errors().broken()
    assert [line.split()[0] for line in broken] == ["diffuse", "shading"]


def test_an_empty_mask_has_nothing_to_check() -> None:
    d = ball()
    with pytest.raises(ValueError, match="empty"):
        replace(d, mask=np.zeros_like(d.mask)).identity_errors()
