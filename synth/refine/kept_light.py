"""Results of the stages of a refinement, kept for the same refinement after an interruption.

Problem: shadows are traced for minutes where the object has millions of pixels.

Equation: a stage is kept under its name and all that it depends on, see `isc_core.io.stage_cache`:
the digest of the result, the options, the version and the variant of Mitsuba, and the stamp of the
source files of this package.

Citation: FIPS 180-4, Secure Hash Standard, 2015.

Limits: those of `isc_core.io.stage_cache`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from isc_core.io.source_stamp import source_stamp
from isc_core.io.stage_cache import Arrays, KeptStages
from isc_core.scene.decomposition import Decomposition
from isc_core.scene.result_digest import result_digest

from ..scene.variant import load_mitsuba

_PACKAGE = Path(__file__).resolve().parents[1]


@dataclass(frozen=True, eq=False)
class KeptLight:
    """Results of the stages of a refinement.

    Attributes
    ----------
    kept : KeptStages or None
        Where they are kept.
    inputs : tuple of ndarray
        All that they depend on, besides `isc_core`.
    """

    kept: KeptStages | None = None
    inputs: tuple[np.ndarray, ...] = ()

    @staticmethod
    def of(d: Decomposition, how: object, kept: KeptStages | None) -> "KeptLight":
        """Return the stages of the refinement of a result.

        Parameters
        ----------
        d : Decomposition
        how : object
            Options, by their repr.
        kept : KeptStages or None

        Returns
        -------
        KeptLight
        """
        if kept is None:
            return KeptLight()
        mitsuba = load_mitsuba()
        program = repr((mitsuba.__version__, mitsuba.variant(), how)).encode()
        program += source_stamp(_PACKAGE)
        return KeptLight(kept, (result_digest(d), np.frombuffer(program, np.uint8)))

    def __call__(self, stage: str, compute: Callable[[], Arrays]) -> Arrays:
        """Return the result of a stage, computed unless it is kept.

        Parameters
        ----------
        stage : str
        compute : callable

        Returns
        -------
        mapping of str to ndarray
        """
        if self.kept is None:
            return compute()
        return self.kept.arrays(f"light: {stage}", self.inputs, compute)
