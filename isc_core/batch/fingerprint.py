"""Fingerprints of inputs and settings, by which existing results are recognised.

A result's `decomposition.json` has, in `input.fingerprint`, a hash of all that it depends on: the
content of photo and mask, the settings, the transfer curve, the priors, the version. The number of
threads, the location of the files and the date are not included.
"""

import hashlib
import json
from dataclasses import asdict
from pathlib import Path

from ..errors import InputError
from ..io.json_files import read_json
from ..result_files.arrays_file import ARRAYS
from ..result_files.result_folder import DECOMPOSITION_FILES
from .item import ImageJob


def fingerprint(job: ImageJob, photo_sha256: str, mask_sha256: str) -> str:
    """Return the fingerprint of a job in hexadecimal.

    Parameters
    ----------
    job : ImageJob
    photo_sha256, mask_sha256 : str
        "" for no mask.

    Returns
    -------
    str
    """
    settings = asdict(job.recipe.settings)
    del settings["threads"]
    plan = job.plan
    parts = [
        photo_sha256,
        mask_sha256,
        settings,
        job.recipe.transfer,
        plan.arrays,
        plan.priors_sha256,
        plan.version,
        *((job.object_number,) if job.object_number else ()),
    ]
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def is_finished(folder: Path, expected: str, arrays: bool) -> bool:
    """Return whether `folder` has the complete result of a fingerprint.

    Parameters
    ----------
    folder : Path
    expected : str
        The fingerprint.
    arrays : bool
        Whether `arrays.npz` is required.

    Returns
    -------
    bool
    """
    for name in (*DECOMPOSITION_FILES, *((ARRAYS,) if arrays else ())):
        path = folder / name
        if not path.is_file() or path.stat().st_size == 0:
            return False
    return recorded_input(folder).get("fingerprint") == expected


def recorded_input(folder: Path) -> dict[str, object]:
    """Return the record of a result's input.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    dict
        Empty without a result.
    """
    try:
        description = read_json(folder / "decomposition.json")
    except InputError:
        return {}
    recorded = description.get("input") if isinstance(description, dict) else None
    return recorded if isinstance(recorded, dict) else {}
