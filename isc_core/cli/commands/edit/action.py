"""The interface of the actions of `isc edit`."""

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from ....editing.clusters import Clusters
from ....editing.edited import Edited
from ....result_files.panels import Panel
from ....scene.part_of_result import ResultPart


@dataclass(frozen=True)
class ActionResult:
    """The result of an action.

    Attributes
    ----------
    edit : Edited
        The edited layers.
    measured : mapping
        Measurements, ready for JSON.
    panels : tuple of Panel
        Panels for the contact sheet.
    clusters : Clusters or None
        The clusters of reflectance, if the action computed them.
    lines : tuple of str
        Lines to print.
    layers : bool
        Whether the contact sheet shows the layers.
    """

    edit: Edited
    measured: Mapping[str, object]
    panels: tuple[Panel, ...] = ()
    clusters: Clusters | None = None
    lines: tuple[str, ...] = ()
    layers: bool = True


@dataclass(frozen=True)
class EditAction:
    """One action of `isc edit`.

    Attributes
    ----------
    name : str
        As typed on the command line.
    summary : str
        One line of help.
    act : callable
        Does the work, on the object's part of a result.
    add_options : callable
        Adds the action's options to its parser.
    """

    name: str
    summary: str
    act: Callable[[ResultPart, argparse.Namespace], ActionResult]
    add_options: Callable[[argparse.ArgumentParser], None]
