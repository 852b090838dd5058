"""Specular-free images of the code, and the share of a highlight that remains in each.

Equation: with P(I) an image made of the photo I and P(D) the same made of its diffuse layer,

    residual = sum |P(I) - P(D) - m| / sum |I - D|   over the mask and the channels,

where m is the median of P(I) - P(D), since an offset common to all pixels shows no highlight: 0 if
the image contains no specular light, 1 if it contains all of it.

Limits: images with a unit of their own (chromaticities, angles) have no such share and are not
listed.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from isc_core.imaging.channels import smallest
from isc_core.separation.support import specular_free

from ..images.subject import Subject

Images = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class SpecularFreeImage:
    """A kind of specular-free image.

    Attributes
    ----------
    name : str
        Name in tables.
    formula : str
        Its formula.
    citation : str
        Source with DOI.
    function : str
        Full name of the function.
    methods : str
        Separation methods that use it.
    make : callable
        `make(image, mask)` returns the image, (H, W, 3).
    """

    name: str
    formula: str
    citation: str
    function: str
    methods: str
    make: Images


def _dark(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    dark = np.where(mask, specular_free.dark_channel(smallest(image), mask, 7), 0)
    return np.repeat(dark[..., None], 3, axis=2)


_MODULE = "isc_core.separation.support.specular_free"
KINDS = (
    SpecularFreeImage(
        "fixed chromaticity (SF1)",
        "I − w, w = (max I − c ΣI) / (1 − 3c), c = .6",
        "Tan & Ikeuchi 2005, doi:10.1109/TPAMI.2005.36",
        f"{_MODULE}.fixed_chromaticity",
        "tan_2005, sparse_coding",
        lambda image, mask: specular_free.fixed_chromaticity(image),
    ),
    SpecularFreeImage(
        "two-band (SF2)",
        "I − min I",
        "Yoon, Choi & Kweon 2006, doi:10.1109/ICIP.2006.312650",
        f"{_MODULE}.two_band",
        "yoon_2006, sparse_coding, chaotic_segmentation",
        lambda image, mask: specular_free.two_band(image),
    ),
    SpecularFreeImage(
        "lifted two-band",
        "I − min I + u, u = mean of min I",
        "Shen & Zheng 2013, doi:10.1364/AO.52.004483",
        f"{_MODULE}.lifted_two_band",
        "shen_2013",
        specular_free.lifted_two_band,
    ),
    SpecularFreeImage(
        "modified",
        "I − max(min I − T, 0), T = mean + ½ deviation of min I",
        "Shen & Cai 2009, doi:10.1364/AO.48.002711",
        f"{_MODULE}.modified",
        "shen_2009",
        specular_free.modified,
    ),
    SpecularFreeImage(
        "less the dark channel",
        "I − min of all channels in 7 × 7 pixels",
        "Kim, Jin, Hadap & Kweon 2013, doi:10.1109/CVPR.2013.192",
        f"{_MODULE}.less_dark_channel",
        "kim_2013",
        specular_free.less_dark_channel,
    ),
)
PHOTO = SpecularFreeImage("photo", "I", "", "", "none", lambda image, mask: image)
DARK = SpecularFreeImage(
    "dark channel",
    "min of all channels in 7 × 7 pixels",
    KINDS[-1].citation,
    f"{_MODULE}.dark_channel",
    "kim_2013",
    _dark,
)


def residual_highlight(kind: SpecularFreeImage, subject: Subject) -> float:
    """Compute the share of the specular light that remains in an image.

    Parameters
    ----------
    kind : SpecularFreeImage
        The image.
    subject : Subject
        A subject with a known diffuse layer and highlights.

    Returns
    -------
    float
        Share, 0 for a specular-free image.
    """
    assert subject.diffuse is not None
    made, bare = (
        kind.make(np.where(subject.mask[..., None], of, 0).astype(float), subject.mask)
        for of in (subject.image, subject.diffuse)
    )
    light = np.abs(subject.image - subject.diffuse)[subject.mask].sum(dtype=float)
    change = (made - bare)[subject.mask]
    return float(np.abs(change - np.median(change, axis=0)).sum() / light)


def subjects_with_highlights(subjects: Sequence[Subject]) -> list[Subject]:
    """Select the subjects whose known diffuse layer differs from the image.

    Parameters
    ----------
    subjects : sequence of Subject

    Returns
    -------
    list of Subject
        In the same order.
    """
    return [
        one
        for one in subjects
        if one.diffuse is not None and np.abs(one.image - one.diffuse)[one.mask].sum() > 0
    ]


def subject_title(subject: Subject) -> str:
    """Return the name and the kind of a subject, as kinds share objects.

    Parameters
    ----------
    subject : Subject

    Returns
    -------
    str
    """
    return f"{subject.name} ({subject.kind})"
