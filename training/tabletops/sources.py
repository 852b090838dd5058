"""What tabletop scenes are made of: objects, panoramas and patterns."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from isc_core.errors import InputError

from ..world.backgrounds import panoramas_in
from ..world.bodies.sources import BodyFolders, BodyReference, body_names
from ..world.files import Split, read_patterns, split_of
from ..world.patterns import Atlas


@dataclass(frozen=True, eq=False)
class TabletopSources:
    """Objects, panoramas and patterns.

    Attributes
    ----------
    references : sequence of BodyReference
        Objects; those that cannot be loaded or pass no screening are skipped.
    panoramas : sequence of (rows, 2 rows, 3) ndarray
        Linear.
    atlas : Atlas
        Patterns.
    """

    references: Sequence[BodyReference]
    panoramas: Sequence[np.ndarray]
    atlas: Atlas

    @classmethod
    def read(
        cls,
        world: Path,
        panoramas: Path,
        built: int,
        furniture: Path | None = None,
        seed: int = 0,
        held_out: bool = False,
    ) -> "TabletopSources":
        """List the objects of one side of the split, and read panoramas and patterns.

        Parameters
        ----------
        world : Path
            Folder of `isc world build`, with the patterns.
        panoramas : Path
            Folder.
        built : int
            Number of built objects on both sides of the split.
        furniture : Path, optional
            Folder of Sweet Home 3D catalogues.
        seed : int
            Of the built objects.
        held_out : bool
            Whether to take what no network learns from, or the rest.

        Returns
        -------
        TabletopSources

        Raises
        ------
        InputError
            If a folder cannot be used, or no object is left.
        """
        wanted = Split.UNSEEN_BODY if held_out else Split.TRAIN
        listed = body_names(BodyFolders(furniture, None, None), seed, built, 0)
        references = [one for one in listed if split_of(one.name) == wanted]
        if not references:
            raise InputError("no object is left: raise --built")
        found = list(panoramas_in(panoramas, held_out))
        return cls(references, found, read_patterns(world))
