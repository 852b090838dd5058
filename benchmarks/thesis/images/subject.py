"""One test image with its known layers and ground truth, and its reduction to a smaller size."""

from dataclasses import dataclass, replace

import numpy as np

from isc_core.datasets.mit_berkeley import MitBerkeleyObject

QUICK_SIZE = 96  # longest side in a quick run, pixels


@dataclass(frozen=True, eq=False)
class Subject:
    """One image and what is known of it.

    Attributes
    ----------
    name : str
        Name of the object or photo.
    kind : str
        One of `library.KINDS`, or "photo" where no truth is known.
    image : (H, W, 3) ndarray
        float32, linear, >= 0.
    mask : (H, W) ndarray
        Boolean mask of the object.
    diffuse, specular : (H, W, 3) ndarray or None
        float32; their sum is the image. None where unknown.
    truth : MitBerkeleyObject or None
        Height, light, shading and reflectance on the same pixels. None where unknown.
    """

    name: str
    kind: str
    image: np.ndarray
    mask: np.ndarray
    diffuse: np.ndarray | None = None
    specular: np.ndarray | None = None
    truth: MitBerkeleyObject | None = None


def downsample_subject(subject: Subject, longest: int) -> Subject:
    """Reduce a subject until its longest side has at most `longest` pixels.

    Pixels are means over blocks of the object's own pixels; heights shrink by the same factor.

    Parameters
    ----------
    subject : Subject
        Returned as it is if it is small enough.
    longest : int
        Longest side, pixels.

    Returns
    -------
    Subject
        The reduced subject, with its ground truth.
    """
    side = max(subject.mask.shape)
    factor = -(-side // longest)
    if factor <= 1:
        return subject
    mask = _blocks(subject.mask.astype(float), None, factor) >= 0.5

    def less(values: np.ndarray | None) -> np.ndarray | None:
        return (
            None if values is None else _blocks(values, subject.mask, factor).astype(values.dtype)
        )

    image, diffuse, specular = (
        less(values) for values in (subject.image, subject.diffuse, subject.specular)
    )
    assert image is not None
    truth = (
        None if subject.truth is None else _shrunk_truth(subject.truth, subject.mask, mask, factor)
    )
    return Subject(subject.name, subject.kind, image, mask, diffuse, specular, truth)


def _shrunk_truth(
    truth: MitBerkeleyObject, mask: np.ndarray, less: np.ndarray, factor: int
) -> MitBerkeleyObject:
    image, shading, reflectance = (
        _blocks(values, mask, factor) for values in (truth.image, truth.shading, truth.reflectance)
    )
    known = np.isfinite(truth.height)
    height = _blocks(np.where(known, truth.height, 0), known, factor) / factor
    height[~less | (_blocks(known.astype(float), None, factor) < 0.5)] = np.nan
    return replace(
        truth,
        image=image,
        shading=shading,
        reflectance=reflectance,
        height=height,
        mask=less,
        valid=less & (image > 0).all(-1),
    )


def _blocks(values: np.ndarray, weight: np.ndarray | None, factor: int) -> np.ndarray:
    """Average blocks over the pixels marked by `weight`; drop partial blocks."""
    rows, columns = (size // factor for size in values.shape[:2])
    marked = np.ones(values.shape[:2]) if weight is None else weight.astype(float)
    marked = marked.reshape(marked.shape + (1,) * (values.ndim - 2))

    def total(image: np.ndarray) -> np.ndarray:
        cut = image[: rows * factor, : columns * factor]
        return cut.reshape(rows, factor, columns, factor, *image.shape[2:]).sum((1, 3))

    return total(values * marked) / np.maximum(total(marked), 1e-12)
