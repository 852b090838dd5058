"""The mean of the weights of networks.

  python -m training.mean_weights NPZ NPZ ... -o MEAN.npz

Problem: a short run on new data gains on photos like them, and loses elsewhere.

Equation: the mean of each array over the archives. Networks of which one was fitted from the other
are in one basin of the loss, where the mean is often better than either.

Citation: M. Wortsman et al. 2022, "Model soups", arXiv:2203.05482.

Limits: the calibrations are averaged, too; fit them anew afterwards.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from isc_core.errors import InputError
from isc_core.io.atomic import new_file
from isc_core.io.npy import read_arrays


def mean_weights(paths: Sequence[Path]) -> dict[str, np.ndarray]:
    """Return the mean of archives.

    Parameters
    ----------
    paths : sequence of Path
        At least one.

    Returns
    -------
    dict of str to ndarray
        Of the types of the first archive.

    Raises
    ------
    InputError
        If an archive cannot be read, or its arrays do not match those of the first.
    """
    archives = [read_arrays(path) for path in paths]
    shapes = [{name: one[name].shape for name in one} for one in archives]
    for path, own in zip(paths, shapes, strict=True):
        if own != shapes[0]:
            raise InputError(f"{path}: a network of another kind than {paths[0]}")
    return {
        name: np.mean([one[name] for one in archives], axis=0, dtype=float).astype(values.dtype)
        for name, values in archives[0].items()
    }


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("archives", type=Path, nargs="+", metavar="NPZ", help="archives of one kind of network")
    add("-o", "--output", type=Path, required=True, metavar="NPZ", help="where to write the mean")
    given = parser.parse_args()
    try:
        mean = mean_weights(given.archives)
    except InputError as error:
        parser.error(str(error))
    with new_file(given.output) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **mean)


if __name__ == "__main__":
    main()
