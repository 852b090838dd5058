"""Batches: dataclasses of tensors or of such batches, and a pool that batches are drawn from.

Rows of a pool are drawn several times.

Limits: the tensors of a batch have equal first axes, unless a subclass says otherwise.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Generic, Self, TypeVar

import numpy as np
import torch


@dataclass(frozen=True)
class TensorBatch:
    """Base of dataclasses whose attributes are tensors, batches themselves, or None."""

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        # between processes, many small tensors travel slowly: each is a file of shared memory
        parts = [getattr(self, one.name) for one in fields(self)]
        arrays = [part.numpy() if isinstance(part, torch.Tensor) else part for part in parts]
        return _from_arrays, (type(self), arrays)

    def __len__(self) -> int:
        return len(getattr(self, fields(self)[0].name))

    def to(self, device: str | torch.device) -> Self:
        """Return the batch on a device.

        Parameters
        ----------
        device : str or torch.device

        Returns
        -------
        TensorBatch
            Of the same class.
        """
        parts = {one.name: getattr(self, one.name) for one in fields(self)}
        moved = {name: part.to(device) for name, part in parts.items() if part is not None}
        return replace(self, **moved)

    def chosen(self, which: torch.Tensor) -> Self:
        """Return some rows of the batch.

        Parameters
        ----------
        which : (b,) int64 tensor

        Returns
        -------
        TensorBatch
            Of the same class.
        """
        return replace(self, **{one.name: getattr(self, one.name)[which] for one in fields(self)})

    @classmethod
    def of(cls, arrays: dict[str, np.ndarray]) -> Self:
        """Make a batch of arrays: floats as float32, whole numbers as int64.

        Parameters
        ----------
        arrays : dict of str to ndarray
            By the names of the attributes.

        Returns
        -------
        TensorBatch
            On the CPU.
        """
        parts = {name: torch.from_numpy(np.ascontiguousarray(one)) for name, one in arrays.items()}
        return cls(
            **{name: one.float() if one.is_floating_point() else one for name, one in parts.items()}
        )

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Concatenate batches.

        Parameters
        ----------
        parts : sequence of TensorBatch
            Not empty.

        Returns
        -------
        TensorBatch
            Of the same class.
        """
        names = [one.name for one in fields(cls)]
        return cls(**{name: torch.cat([getattr(part, name) for part in parts]) for name in names})


def _from_arrays(kind: type[TensorBatch], arrays: list[Any]) -> TensorBatch:
    return kind(*(torch.from_numpy(a) if isinstance(a, np.ndarray) else a for a in arrays))


def chosen(shares: torch.Tensor, number: int) -> torch.Tensor:
    """Return which of a number of rows shares of that number mean.

    Parameters
    ----------
    shares : (b,) tensor
        In [0, 1].
    number : int

    Returns
    -------
    (b,) int64 tensor
    """
    return (shares * number).long().clamp(max=number - 1)


Batch = TypeVar("Batch", bound=TensorBatch)


class Pool(Generic[Batch]):
    """Rows of batches, the oldest of which make room for new ones.

    Parameters
    ----------
    size : int
        Most rows.
    """

    def __init__(self, size: int) -> None:
        self._size, self._next = size, 0
        self._rows: Batch | None = None

    def exchange(self, fresh: Batch) -> None:
        """Add rows; once the pool is full, in place of the oldest.

        Parameters
        ----------
        fresh : TensorBatch
            At most as many rows as the pool holds.
        """
        if self._rows is None:
            self._rows = fresh
        elif len(self._rows) + len(fresh) <= self._size:
            self._rows = type(fresh).joined([self._rows, fresh])
        else:
            count = len(self._rows)
            place = (torch.arange(len(fresh)) + self._next) % count
            for one in fields(fresh):
                getattr(self._rows, one.name)[place] = getattr(fresh, one.name)
            self._next = (self._next + len(fresh)) % count

    def picked(self, shares: torch.Tensor) -> Batch:
        """Return rows of the pool.

        Parameters
        ----------
        shares : (b,) tensor
            Places in the pool, as shares of its length, in [0, 1).

        Returns
        -------
        TensorBatch

        Raises
        ------
        ValueError
            If the pool is empty.
        """
        if self._rows is None:
            raise ValueError("the pool is empty")
        return self._rows.chosen(chosen(shares, len(self._rows)))
