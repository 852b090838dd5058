"""Names of files and folders from names of objects."""


def file_stem(name: str) -> str:
    """Return the name of a file or a folder, without a suffix.

    Parameters
    ----------
    name : str
        Name of an object.

    Returns
    -------
    str
        Letters of any script, digits, spaces, "-", "_" and "." stay, others become "_"; never empty
        or hidden.
    """
    letters = (letter if letter.isalnum() or letter in " -_." else "_" for letter in name)
    return "".join(letters).strip(" .") or "object"
