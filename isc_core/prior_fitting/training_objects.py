"""Reads the training objects of the MIT-Berkeley intrinsic images for the fit of the priors.

The laboratory folder has reflectance, height and the valid pixels (its images cover the whole
object); the natural one adds a light.
"""

from collections.abc import Sequence
from pathlib import Path

from ..datasets.mit_berkeley import list_objects, load_object
from ..progress import Monitor
from .statistics import TrainingObject


def read_training_objects(
    root: Path, names: Sequence[str] | None = None, monitor: Monitor | None = None
) -> dict[str, TrainingObject]:
    """Read training objects.

    Parameters
    ----------
    root : Path
        Folder of the data set.
    names : sequence of str, optional
        By default, all objects of `root`.
    monitor : Monitor, optional

    Returns
    -------
    dict of str to TrainingObject

    Raises
    ------
    InputError
        As `datasets.mit_berkeley.load_object`.
    """
    monitor = monitor or Monitor()
    chosen = list(names) if names is not None else list(list_objects(root, "laboratory"))
    objects = {}
    for count, name in enumerate(chosen):
        monitor.report(f"reading {name}", count / len(chosen))
        laboratory, natural = (
            load_object(root, name, light, "diffuse") for light in ("laboratory", "natural")
        )
        objects[name] = TrainingObject(
            name,
            laboratory.reflectance,
            laboratory.valid,
            laboratory.height,
            laboratory.mask,
            natural.light,
            laboratory.light,
        )
    return objects
