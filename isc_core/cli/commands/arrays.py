"""`isc arrays`: a result as plain NumPy arrays, for programs that read neither OpenEXR
nor glTF.
"""

import argparse
from pathlib import Path

from ...io.atomic import new_file, require_writable_file
from ...progress import Monitor
from ...result_files.arrays_file import ARRAYS, mesh_of, write_arrays
from ...result_files.mesh.object_cover import object_cover, read_cover
from ...result_files.mesh.options import MeshOptions
from ...result_files.result_folder import MASK, load_part
from ..interface.options import add_triangles
from ..interface.parser import describe, hints

_EXAMPLES = """  isc arrays cup"""


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    """
    describe(
        parser,
        run,
        f"Add {ARRAYS} to the folder of a result: maps, mesh, light and gloss as plain arrays, "
        "for programs that have only NumPy. "
        "isc decompose --arrays writes it directly.",
        examples=_EXAMPLES,
    )
    parser.add_argument(
        "result", type=Path, metavar="RESULT", help="a folder written by isc decompose"
    )
    add_triangles(parser)


def run(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Run the command; inputs are checked before the work begins.

    Parameters
    ----------
    options : argparse.Namespace
    monitor : Monitor

    Returns
    -------
    list of str
        Lines to print.
    """
    monitor.report("reading", 0.0)
    stored, path = load_part(options.result), options.result / ARRAYS
    seen = read_cover(options.result / MASK, stored.result.provenance.input)
    cover = object_cover(stored, seen)
    require_writable_file(path)
    monitor.report("writing arrays", 0.3)
    with new_file(path) as partial:
        built = mesh_of(stored, MeshOptions(triangles=options.triangles))
        write_arrays(stored, partial, built, cover=cover)
        monitor.report("writing arrays", 1.0)
    return hints(options, f"wrote {path}")
