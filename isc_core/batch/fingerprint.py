"""Whether a result is there already: what it was made of stands in it.

A result's `scene.decomposition.json` holds, in `input.fingerprint`, a hash of everything that it depends
on: the content of photo and mask, the settings, the coding, the priors, the version. How many
threads worked on it, where its files lay and when it was made do not count.
"""

import hashlib
import json
from dataclasses import asdict
from pathlib import Path

from ..errors import InputError
from ..io.json_files import read_json
from ..result_files.arrays_file import ARRAYS
from ..result_files.result_folder import DECOMPOSITION_FILES
from .item import Job


def fingerprint(job: Job, photo_sha256: str, mask_sha256: str) -> str:
    """The hash, in hexadecimal; `mask_sha256`: "" where no mask is given."""
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
    ]
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def is_finished(folder: Path, wanted: str, arrays: bool) -> bool:
    """Whether `folder` holds the whole result of this fingerprint."""
    for name in (*DECOMPOSITION_FILES, *((ARRAYS,) if arrays else ())):
        path = folder / name
        if not path.is_file() or path.stat().st_size == 0:
            return False
    try:
        description = read_json(folder / "decomposition.json")
    except InputError:
        return False
    found = description.get("input") if isinstance(description, dict) else None
    return isinstance(found, dict) and found.get("fingerprint") == wanted
