"""Reading JSON files that may be absent, damaged or foreign."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from .regular_files import read_regular

MOST_BYTES = 1 << 28


def read_json(path: Path, remedy: str = "write it again") -> Any:
    """Read a JSON file; the caller checks its content.

    Parameters
    ----------
    path : Path
    remedy : str
        End of the error message.

    Returns
    -------
    object

    Raises
    ------
    InputError
        If it is not readable JSON or is larger than 256 MB.
    """
    try:
        if (size := path.stat().st_size) > MOST_BYTES:
            raise InputError(
                f"{path} has {size / 1e6:.0f} MB; the limit for JSON is {MOST_BYTES / 1e6:.0f} MB: "
                "is it the right file?"
            )
        return json.loads(read_regular(path, None, "use a JSON file").decode("utf-8"))
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
    except InputError:
        raise
    except (ValueError, RecursionError) as error:  # not JSON, not UTF-8, or nested too deeply
        raise InputError(f"{path} is damaged or not JSON ({str(error)[:200]}): {remedy}") from error


def numbers(value: Any, shape: tuple[int, ...]) -> np.ndarray | None:
    """Convert part of a JSON document to an array.

    Parameters
    ----------
    value : object
    shape : tuple of int

    Returns
    -------
    ndarray of float64 or None
        None unless it is finite numbers of this shape.
    """
    try:
        raw = np.array(value)
        array = raw.astype(np.float64)
    except (TypeError, ValueError, OverflowError):  # JSON integers have any length
        return None
    # Strings would be converted: "iuf" are numbers, "O" are integers too large for these.
    return (
        array
        if raw.dtype.kind in "iufO" and array.shape == shape and np.isfinite(array).all()
        else None
    )
