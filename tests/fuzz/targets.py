"""All kinds of files that are damaged."""

from tests.fuzz.case import Target
from tests.fuzz.data_files import DATA_FILES
from tests.fuzz.mesh_files import MESHES
from tests.fuzz.pictures import PICTURES

TARGETS: dict[str, Target] = {target.name: target for target in (*PICTURES, *DATA_FILES, *MESHES)}
