"""The folders of results of several objects in one photo.

Without numerical libraries, for programs that only show results.
"""

from pathlib import Path

_RESULT = "decomposition.json"


def object_folders(folder: Path) -> list[Path]:
    """Return the results of the objects of a photo, from left to right.

    Parameters
    ----------
    folder : Path
        Folder that `isc decompose --each` has written.

    Returns
    -------
    list of Path
        The existing folders of 1, 2 and so on.
    """
    found = (path.parent for path in folder.glob(f"*/{_RESULT}"))
    return sorted((one for one in found if one.name.isdecimal()), key=lambda one: int(one.name))


def holds_result(folder: Path) -> bool:
    """Return whether a folder is itself a result, rather than one of several results.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    bool
    """
    return (folder / _RESULT).is_file()
