"""What the benchmarks on MIT-Berkeley share."""

import numpy as np

from benchmarks.sirfs.mit_berkeley import greyed
from isc_core.datasets.mit_berkeley import MitBerkeleyObject


def test_a_grey_photo_is_still_paint_times_shading_and_has_equal_channels() -> None:
    rng = np.random.default_rng(1)
    shading, paint = rng.uniform(0.2, 1.2, (5, 6, 3)), rng.uniform(0.1, 0.9, (5, 6, 3))
    shading[0] = 0
    image = shading * paint
    photo = MitBerkeleyObject(
        "ball",
        "natural",
        image,
        (image > 0).all(-1),
        np.ones((5, 6), bool),
        np.zeros((5, 6)),
        shading,
        paint,
        np.ones((9, 3)),
    )
    grey = greyed(photo)
    for part in (grey.image, grey.shading, grey.reflectance, grey.light):
        assert part.shape[-1] == 3 and np.ptp(part, axis=-1).max() == 0
    np.testing.assert_allclose(grey.image, grey.reflectance * grey.shading, atol=1e-12)
    np.testing.assert_allclose(grey.image[..., 0], image.mean(-1))
    assert not grey.valid[0].any() and grey.valid[1:].all()
    assert np.isfinite(grey.reflectance).all()
