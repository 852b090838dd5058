"""The wheels of a zip: selected, downloaded and verified.

`wheels.sha256` lists every wheel of every target with its hash, in the format of `sha256sum
--check`. pip downloads those missing from the cache folder; with a complete cache no network is
needed.
"""

import hashlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from isc_core.errors import InputError

from .targets import Target

LOCK = Path(__file__).with_name("wheels.sha256")


def locked(lock: Path = LOCK) -> dict[str, str]:
    """Read the list of wheels.

    Parameters
    ----------
    lock : Path, optional
        The list.

    Returns
    -------
    dict of str to str
        SHA-256 by file name.

    Raises
    ------
    InputError
        If a line does not have the form `HASH  NAME.whl`.
    """
    found = {}
    for line in lock.read_text(encoding="utf-8").splitlines():
        digest, _, name = line.partition("  ")
        if len(digest) != 64 or not name.endswith(".whl"):
            raise InputError(
                f"{lock.name} has an invalid line: {line[:80]!r} (expected `HASH  NAME.whl`)"
            )
        found[name] = digest
    return found


def wheels_for(target: Target, cache: Path, *, offline: bool = False) -> list[Path]:
    """Return the verified wheels of a target, downloading those that are missing.

    Parameters
    ----------
    target : Target
        Platform and Python version.
    cache : Path
        Folder of downloaded wheels.
    offline : bool, optional
        Whether to use downloaded wheels only.

    Returns
    -------
    list of Path
        The wheels.

    Raises
    ------
    InputError
        If a wheel is missing or has another hash.
    """
    folder = cache / target.name
    names = {name: digest for name, digest in sorted(locked().items()) if target.runs(name)}
    missing = [name for name in names if not (folder / name).is_file()]
    if missing and offline:
        raise InputError(f"{folder} lacks {', '.join(missing)}: build once without --offline")
    if missing:
        _download(target, {name: names[name] for name in missing}, folder)
    for name, digest in names.items():
        if not (folder / name).is_file() or _sha256(folder / name) != digest:
            raise InputError(
                f"{folder / name} does not have the hash in {LOCK.name}: delete it and build again"
            )
    return [folder / name for name in names]


def _download(target: Target, names: dict[str, str], folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    requirements = folder / "requirements.txt"
    requirements.write_text(
        "".join(f"{_requirement(name)} --hash=sha256:{digest}\n" for name, digest in names.items()),
        encoding="utf-8",
    )
    options = [
        "--quiet",
        "--disable-pip-version-check",
        "--no-deps",
        "--only-binary=:all:",
        "--require-hashes",
    ]
    command = [
        sys.executable,
        "-m",
        "pip",
        "download",
        *options,
        *_tags(target),
        "--dest",
        str(folder),
        "-r",
        str(requirements),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    requirements.unlink()
    if done.returncode:
        reasons = (
            [line for line in done.stderr.splitlines() if line.startswith("ERROR")]
            or done.stderr.splitlines()[-1:]
            or ["pip failed"]
        )
        raise InputError(f"the wheels for {target.name} cannot be downloaded: {reasons[0]}")


def _tags(target: Target) -> Iterator[str]:
    yield from (
        "--implementation",
        "cp",
        "--python-version",
        f"{target.python[0]}.{target.python[1]}",
    )
    for abi in (target.abi, "abi3", "none"):
        yield from ("--abi", abi)
    for name in target.pip_platforms:
        yield from ("--platform", name)


def _requirement(wheel: str) -> str:
    """For example numba==0.68.1 for numba-0.68.1-cp311-cp311-win_amd64.whl."""
    name, version = wheel.split("-")[:2]
    return f"{name}=={version}"


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
