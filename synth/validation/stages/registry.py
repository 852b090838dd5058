"""The stages that a validation runs, in the order of the chain."""

from isc_core.errors import InputError

from .lobe import LOBE
from .refinement import REFINEMENT
from .separation import SEPARATION
from .sirfs import SIRFS
from .types import AnyStage

_STAGES: tuple[AnyStage, ...] = (SEPARATION, SIRFS, LOBE)
_BY_NAME_ONLY: tuple[AnyStage, ...] = (REFINEMENT,)


def all_stages() -> tuple[AnyStage, ...]:
    """Return every stage of a default run, in the order of the chain."""
    return _STAGES


def find_stages(names: tuple[str, ...] | None) -> tuple[AnyStage, ...]:
    """Return stages by name, in the order of the chain.

    Parameters
    ----------
    names : tuple of str or None
        The stages; None for those of a default run.

    Returns
    -------
    tuple of Stage
        The stages.

    Raises
    ------
    InputError
        For an unknown name.
    """
    stages = _STAGES if names is None else _STAGES + _BY_NAME_ONLY
    known = [stage.name for stage in stages]
    if unknown := [name for name in names or () if name not in known]:
        raise InputError(f"unknown stage {unknown[0]!r}: choose {', '.join(known)}")
    return tuple(stage for stage in stages if names is None or stage.name in names)
