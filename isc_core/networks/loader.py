"""The loader of all networks from archives of weights.

An archive (.npz) contains float16 or float32 arrays: `weight00`, `bias00`, `weight01`, ... are the
convolutions in order of execution; all other arrays are specific to the network.
"""

import importlib.resources
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Self, TypeVar

import numpy as np

from ..errors import InputError
from ..io.npy import read_arrays
from ..numerics.thread_pool import computed_once
from .layers import weights_in

AnyNetwork = TypeVar("AnyNetwork", bound="Network")


@dataclass(frozen=True, eq=False)
class Parameters:
    """The content of an archive.

    Attributes
    ----------
    weights : tuple of (9, inputs, outputs) ndarray
        Of the convolutions, as they are stored; kernels in row-major order.
    biases : tuple of (outputs,) float32 ndarray
    others : mapping of str to float64 ndarray
    """

    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]
    others: Mapping[str, np.ndarray]


class Network:
    """Base class of the networks, with their loader.

    Attributes
    ----------
    title : str
        Name for error messages.
    file : str
        Name of the archive that ships with the package.
    """

    title: ClassVar[str]
    file: ClassVar[str]

    @classmethod
    def from_parameters(cls, parameters: Parameters) -> Self:
        """Build the network.

        Parameters
        ----------
        parameters : Parameters
            The content of its archive.

        Returns
        -------
        Network
            Of the class on which it is called.

        Raises
        ------
        InputError, KeyError
            If the parameters do not match.
        """
        raise NotImplementedError

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read the network from an archive.

        Parameters
        ----------
        path : Path

        Returns
        -------
        Self

        Raises
        ------
        InputError
            If the file is missing or does not contain such a network.
        """
        try:
            return cls.from_parameters(_parameters(read_arrays(path)))
        except (ValueError, KeyError) as error:
            raise InputError(f"{path} is not a {cls.title}: {error}") from error

    @classmethod
    def shipped(cls) -> Self:
        """Return the network that ships with the package, read once."""
        return _shipped(cls)  # type: ignore[arg-type]  # mypy: types are hashable


@computed_once
def _shipped(kind: type[AnyNetwork]) -> AnyNetwork:
    resource = importlib.resources.files(__package__) / "data" / kind.file
    with importlib.resources.as_file(resource) as path:
        return kind.read(path)


def _parameters(arrays: Mapping[str, np.ndarray]) -> Parameters:
    convolutions = {name: values for name, values in arrays.items() if name[-2:].isdigit()}
    others = {
        name: values.astype(np.float32).astype(float)
        for name, values in arrays.items()
        if name not in convolutions
    }
    if not all(np.isfinite(values).all() for values in others.values()):
        raise ValueError("some of its values are not finite")
    return Parameters(*weights_in(convolutions), others)
