"""A stamp of the source files that compute a result, for caches.

Equation: SHA-256 of the names, sizes and modification dates of all files of a package.

Citation: FIPS 180-4, Secure Hash Standard, 2015.

Limits: not of the files' content, which takes longer to read. Copies of a package have different
stamps if the copy has other dates.
"""

import hashlib
from pathlib import Path


def source_stamp(package: Path) -> bytes:
    """Return the stamp of a package.

    Parameters
    ----------
    package : Path
        Its folder; bytecode in it does not count.

    Returns
    -------
    bytes
        32 bytes.

    Raises
    ------
    OSError
        If a file cannot be examined.
    """
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            status = path.stat()
            entry = (path.relative_to(package).as_posix(), status.st_size, status.st_mtime_ns)
            digest.update(repr(entry).encode())
    return digest.digest()
