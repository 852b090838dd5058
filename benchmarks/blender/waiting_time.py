"""How long does an artist wait in Blender for a photo, and against another version?

  python -m benchmarks.blender.waiting_time PHOTOS [--against CHECKOUT] [--rounds N]
  [--threads N] [--json FILE]

Every photo of the folder PHOTOS is decomposed as the add-on does, with the arrays that it reads,
and the object is built from them, by this checkout and by the other one in turn. The table has the
median over rounds of the worker's wall-clock seconds, of those in Blender from reading the arrays
to the object in the scene, and of their sum; below are the geometric means over photos, and those
of the ratios. As in `benchmarks.decomposition.command_time`, a first round is not counted.

Limits: the Python module `bpy` stands for Blender; its start, and drawing, are not included.
"""

from pathlib import Path

from ..decomposition.command_time import Checkout, run

COLUMNS = ("worker", "Blender", "both")
_BUILD = """
import sys, time
import bpy
from blender_addon.files.result_arrays import read_result
from blender_addon.scene.build import BuildOptions, build_object
start = time.perf_counter()
build_object(read_result(sys.argv[1]), BuildOptions(back="rounded"))
print(time.perf_counter() - start)
"""


class AddOn(Checkout):
    """A version of the add-on to measure."""

    def run(self, photo: Path, output: Path, *options: str) -> tuple[float, ...]:
        """Decompose a photo, and build its object.

        Parameters
        ----------
        photo, output : Path
        *options : str
            Further options of the command.

        Returns
        -------
        tuple of float
            In the order of `COLUMNS`.
        """
        worker = super().run(photo, output, "--arrays", *options)[0]
        blender = float(self.python(output.parent, "-c", _BUILD, str(output)).split()[-1])
        return worker, blender, worker + blender


if __name__ == "__main__":
    run(__doc__, AddOn, COLUMNS)
