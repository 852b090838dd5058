"""All kinds of files that are damaged."""

from .case import Target
from .data_files import DATA_FILES
from .mesh_files import MESHES
from .pictures import PICTURES

TARGETS: dict[str, Target] = {target.name: target for target in (*PICTURES, *DATA_FILES, *MESHES)}
