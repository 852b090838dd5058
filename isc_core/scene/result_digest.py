"""A digest of all of a result that later work depends on.

Equation: SHA-256 of the types, shapes and bytes of its maps and of the repr of its other values.
Its origin is left out, but for its settings: dates, timings and names change nothing. So is the
coverage of the photo's pixels, which only meshes and textures depend on.

Citation: FIPS 180-4, Secure Hash Standard, 2015.

Limits: none known.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from .decomposition import Decomposition


def result_digest(d: Decomposition) -> np.ndarray:
    """Return the digest of a result.

    Parameters
    ----------
    d : Decomposition

    Returns
    -------
    (32,) ndarray of uint8
    """
    digest = hashlib.sha256()
    for field in fields(d):
        if field.name == "cover":
            continue
        _add(digest, field.name)
        value = getattr(d, field.name)
        _add(digest, value.settings if field.name == "provenance" else value)
    return np.frombuffer(digest.digest(), np.uint8)


def _add(digest: "hashlib._Hash", value: Any) -> None:
    if isinstance(value, np.ndarray):
        digest.update(repr((value.dtype.str, value.shape)).encode())
        digest.update(np.ascontiguousarray(value).data)
    elif isinstance(value, Mapping):
        _add(digest, sorted(value.items()))
    elif isinstance(value, list | tuple):
        digest.update(repr((type(value).__name__, len(value))).encode())
        for part in value:
            _add(digest, part)
    elif is_dataclass(value):
        _add(digest, [(field.name, getattr(value, field.name)) for field in fields(value)])
    else:
        digest.update(repr(value).encode())
