"""Reading JSON files that may be absent, damaged or somebody else's."""

import json
from pathlib import Path
from typing import Any

from .errors import InputError


def read_json(path: Path) -> Any:
    """What the file holds; the caller looks at whether that is what it expects. Raises `InputError` where it is not readable JSON."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
    except ValueError as error:  # not JSON, or not UTF-8
        raise InputError(f"{path} is damaged: {error}") from error
