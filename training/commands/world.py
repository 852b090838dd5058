"""`isc world build` and `isc world pack`: the training objects of the networks."""

import argparse
from pathlib import Path

from isc_core.cli.interface.parser import describe, hints
from isc_core.cli.interface.values import count, positive
from isc_core.errors import InputError
from isc_core.progress import Monitor

from ..world.bodies.sources import BodyFolders
from ..world.build import build_world
from ..world.files import WorldSettings
from ..world.pack import all_views, pack_worlds

SUMMARY = "ray trace objects from random sides"

_EXAMPLES = """  isc world build -o WORLD --count 50
  isc world build -o WORLD --furniture SH3F --urdfs URDFS --scans PLY --built 1200 --families 400

An interrupted build continues in the same folder. Each object is traced once: where its surface is,
and which of 64 directions see past it. Training lights it anew for every photo."""


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
        "Bodies that networks learn from: traced once, lit anew for every photo.",
        examples=_EXAMPLES,
    )
    jobs = parser.add_subparsers(title="jobs", metavar="JOB", required=True)
    _declare_pack(jobs.add_parser("pack", help="put a part of a world into one small file"))
    build = jobs.add_parser("build", help=SUMMARY)
    describe(build, run, "Ray trace objects from random sides, to train on.", examples=_EXAMPLES)
    add = build.add_argument
    add("-o", "--output", type=Path, required=True, metavar="DIR", help="folder of the world")
    add("--count", type=count, metavar="N", help="stop after N entries of the list of objects")
    add("--furniture", type=Path, metavar="DIR", help="folder of Sweet Home 3D catalogues (.sh3f)")
    add("--urdfs", type=Path, metavar="DIR", help="folder random_urdfs of pybullet_data")
    add("--scans", type=Path, metavar="DIR", help="folder of scanned objects (.ply)")
    for name, default, what in (
        ("built", 600, "objects built with Blender or by formula"),
        ("families", 300, "objects of the shape families of isc synth"),
        ("views", 2, "sides of each object"),
        ("seed", 0, "seed of the order, the sides and the lights"),
        ("workers", 2, "processes"),
    ):
        add(
            f"--{name}",
            type=count,
            default=default,
            metavar="N",
            help=f"{what} (default: %(default)s)",
        )


def _declare_pack(parser: argparse.ArgumentParser) -> None:
    describe(
        parser,
        run_pack,
        "Put views, panoramas and patterns into one file, to fit on another machine.",
        examples="  isc world pack WORLD --panoramas HDRI -o world.isw --megabytes 50",
    )
    add = parser.add_argument
    add("worlds", type=Path, nargs="+", metavar="WORLD", help="folders of isc world build")
    add("--panoramas", type=Path, required=True, metavar="DIR", help="panoramas, .exr or .hdr")
    add("-o", "--output", type=Path, required=True, metavar="FILE", help="the pack")
    add("--without", type=Path, nargs="+", default=[], metavar="PACK", help="leave out their views")
    add("--megabytes", type=positive, default=50.0, metavar="N", help="default: %(default)g")
    add("--seed", type=count, default=0, metavar="N", help="default: %(default)s")


def run_pack(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Run `isc world pack`.

    Parameters
    ----------
    options : argparse.Namespace
        The parsed options.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    list of str
        Lines for the user.

    Raises
    ------
    InputError
        For invalid input.
    """
    monitor.report("packing", 0)
    most = int(1e6 * options.megabytes)
    lines = pack_worlds(
        options.worlds,
        options.panoramas,
        options.output,
        most,
        options.seed,
        [view for path in options.without for view in all_views(path)],
    )
    return hints(options, *lines)


def run(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Run `isc world build`.

    Parameters
    ----------
    options : argparse.Namespace
        The parsed options.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    list of str
        Lines for the user.

    Raises
    ------
    InputError
        For invalid input.
    """
    if not options.views or not options.workers:
        raise InputError("--views and --workers must be at least 1")
    settings = WorldSettings(options.seed, options.views, options.built, options.families)
    folders = BodyFolders(options.furniture, options.urdfs, options.scans)
    lines = build_world(options.output, folders, settings, options.count, options.workers, monitor)
    program = "python -m training.networks.scene_network"
    return hints(options, *lines, f"next: {program} {options.output} --panoramas DIR -o SCENE.npz")
