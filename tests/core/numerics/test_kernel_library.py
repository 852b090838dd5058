"""Kernels compiled ahead of time: their declarations, and the same results as Numba's."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from blender_addon.packaging.archive import contents
from blender_addon.packaging.kernels.build import libraries_for
from blender_addon.packaging.kernels.portable_code import kernels, versions
from blender_addon.packaging.targets import chosen
from isc_core.numerics import kernel_library
from isc_core.numerics.jit import Kernel
from isc_core.numerics.kernel_library import open_library
from isc_core.numerics.kernel_types import Array, Group, Scalar, signatures
from tests.core.numerics.kept_kernels import KEPT

needs_compilers = pytest.mark.skipif(
    sys.platform != "linux"
    or importlib.util.find_spec("numba") is None
    or importlib.util.find_spec("ziglang") is None,
    reason="needs Linux, numba and ziglang",
)


@pytest.fixture(scope="module")
def library():
    made = libraries_for("linux-x64", KEPT)
    opened = [one for one in map(open_library, made) if one is not None]
    assert opened
    return made, opened[-1]


def test_a_declaration_has_a_version_for_each_real_number():
    single, double = signatures("i8 r[2] Photo(r[3] i8[2:]) (b1 b1) -> f8")
    assert single.arguments == (
        Scalar("i8"),
        Array("f4", 2, True),
        Group("Photo", (Array("f4", 3, True), Array("i8", 2, False))),
        Group("", (Scalar("b1"), Scalar("b1"))),
    )
    assert double.flat[1] == Array("f8", 2, True) and double.result == Scalar("f8")
    with pytest.raises(ValueError, match="q"):
        signatures("i8 q[2]")


def test_every_kernel_declares_its_types_or_is_called_by_kernels_alone():
    called = {
        id(one.function.__globals__.get(name))
        for one in kernels()
        for name in one.function.__code__.co_names
    }
    assert len(kernels()) > 40
    for one in kernels():
        code = one.function.__code__
        assert one.types or id(one) in called, code.co_qualname
        for signature in one.signatures:
            assert len(signature.arguments) == code.co_argcount, code.co_qualname


def _values(signature, rng):
    """Small arguments of the declared types: indices are 0 or 1, sizes equal."""
    size = 6

    def value(kind):
        if isinstance(kind, Group):
            return tuple(value(one) for one in kind.fields)
        if isinstance(kind, Scalar):
            return {"i8": 1, "b1": True}.get(kind.code, 0.5)
        shape = (size,) * kind.axes
        if kind.code[0] in "ib":
            return rng.integers(0, 2, shape).astype(kind.code)
        return rng.uniform(0.1, 0.9, shape).astype(kind.code)

    return [value(one) for one in signature.arguments]


EXACT_KERNELS = {
    "_scatter",
    "_relax",
    "_mark",
    "_refresh",
    "_flatten",
    "_hash",
    "_erode",
}


@needs_compilers
@pytest.mark.slow
def test_shipped_code_agrees_with_numba(library):
    rng = np.random.default_rng(5)
    tested = set()
    for one in versions():
        name = one.kernel.function.__name__
        if name not in EXACT_KERNELS:
            continue
        values = _values(one.signature, rng)
        copies = [one.copy() if isinstance(one, np.ndarray) else one for one in values]
        shipped = library[1].kernel(one.kernel.function, one.kernel.signatures)
        assert shipped(*values) == one.kernel._dispatcher(*copies)
        for have, want in zip(values, copies, strict=True):
            np.testing.assert_allclose(have, want, rtol=1e-6)
        tested.add(name)
    assert tested == EXACT_KERNELS


@needs_compilers
@pytest.mark.slow
def test_arrays_of_another_order_are_copied_and_copied_back(library):
    from isc_core.separation.published import tan_2005

    kernel = tan_2005._refresh
    assert isinstance(kernel, Kernel)
    rng = np.random.default_rng(6)
    values = _values(kernel.signatures[0], rng)
    other = [np.asfortranarray(one) if isinstance(one, np.ndarray) else one for one in values]
    shipped = library[1].kernel(kernel.function, kernel.signatures)
    shipped(*values)
    shipped(*other)
    for have, want in zip(other, values, strict=True):
        np.testing.assert_array_equal(have, want)
    with pytest.raises(TypeError):
        shipped(*[one[0] if isinstance(one, np.ndarray) else one for one in values])


@needs_compilers
@pytest.mark.slow
def test_the_core_of_the_zip_decomposes_without_numba(library, tmp_path):
    (target,) = chosen("linux-x64-cp311")
    for name, content in contents(target, [], library[0]).items():
        if name.startswith("isc_core/"):
            path = tmp_path / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content if isinstance(content, bytes) else content.read_bytes())
    code = (
        "import sys; sys.modules['numba'] = sys.modules['llvmlite'] = None\n"
        "import numpy as np\n"
        "from isc_core.numerics import kernel_library\n"
        "assert kernel_library.shipped_library() is not None\n"
        "def refused(*_): raise AssertionError('arrays were copied for a kernel')\n"
        "kernel_library._Entry.on_copies = refused\n"
        "from isc_core.decomposition.models import DecompositionTask, Settings, solve\n"
        "from isc_core.photo.photo import Photo, PhotoSource\n"
        "y, x = np.mgrid[-1:1:40j, -1:1:40j]\n"
        "inside = np.hypot(x, y) < .9\n"
        "z = np.where(inside, np.sqrt(np.clip(1 - x**2 - y**2, 0, 1)), 0).astype(np.float32)\n"
        "photo = Photo(z[..., None] * np.array([.8, .5, .3], np.float32), inside, 1 / 255,\n"
        "    np.zeros_like(inside), PhotoSource('', (40, 40), 8, 'srgb', 'file'))\n"
        "settings = Settings(model='sirfs', engine='numba', threads=1)\n"
        "solve(DecompositionTask(photo, photo, settings))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env={"PYTHONPATH": str(tmp_path), "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_a_file_that_is_no_library_of_this_machine_is_passed_over(tmp_path: Path):
    other = tmp_path / "kernels-other.so"
    other.write_bytes(b"MZ")
    assert open_library(other) is None


def test_files_for_other_systems_and_processors_are_not_opened(tmp_path, monkeypatch):
    for name in ("arm64.dylib", "arm64.so", "x86-64-v2.dll", "x86-64-v2.so", "x86-64-v3.so"):
        (tmp_path / f"kernels-{name}").touch()
    opened = []
    monkeypatch.setattr(kernel_library, "FOLDER", tmp_path)
    monkeypatch.setattr(kernel_library, "open_library", lambda path: opened.append(path.name))
    for system, machine, names in (
        ("linux", "x86_64", ["kernels-x86-64-v3.so", "kernels-x86-64-v2.so"]),
        ("linux", "riscv64", []),
        ("win32", "AMD64", ["kernels-x86-64-v2.dll"]),
        ("darwin", "arm64", ["kernels-arm64.dylib"]),
    ):
        opened.clear()
        monkeypatch.setattr(sys, "platform", system)
        monkeypatch.setattr("platform.machine", lambda known=machine: known)
        assert kernel_library.shipped_library.__wrapped__() is None
        assert opened == names
