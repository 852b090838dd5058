"""The kernels as LLVM's intermediate code, for every processor.

Numba translates a kernel to this code, optimises it for the processor at hand, and compiles it.
Here it stops after the first of its optimisations, which inlines and removes the counting of
references; what depends on a processor, above all the vector instructions, is left to the compiler
of each platform. The math flags of a kernel are part of the code.

Limits: `_Plain` overrides a method that Numba documents as internal, hence the pinned version. The
code is for 64-bit processors with little-endian numbers.
"""

import ast
import importlib
import importlib.util
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np

from isc_core.numerics.jit import Kernel
from isc_core.numerics.kernel_library import symbol
from isc_core.numerics.kernel_types import Array, Group, Scalar, Signature

ROOT = Path(__file__).resolve().parents[3]

# Counts of references of arrays that a kernel makes for itself, hence of one thread; the arrays
# that it is given have none.
_COUNTS = """
define internal void @NRT_incref(ptr %block) alwaysinline {
  %none = icmp eq ptr %block, null
  br i1 %none, label %end, label %count
count:
  %before = load i64, ptr %block, align 8
  %after = add i64 %before, 1
  store i64 %after, ptr %block, align 8
  br label %end
end:
  ret void
}
define internal void @NRT_decref(ptr %block) alwaysinline {
  %none = icmp eq ptr %block, null
  br i1 %none, label %end, label %count
count:
  %before = load i64, ptr %block, align 8
  %after = sub i64 %before, 1
  store i64 %after, ptr %block, align 8
  %used = icmp ne i64 %after, 0
  br i1 %used, label %end, label %last
last:
  call void @NRT_MemInfo_call_dtor(ptr %block)
  br label %end
end:
  ret void
}
"""


@dataclass(frozen=True)
class Version:
    """One version of a kernel.

    Attributes
    ----------
    kernel : Kernel
    signature : Signature
    symbol : str
        Name of its function in the library.
    """

    kernel: Kernel
    signature: Signature
    symbol: str


def kernels() -> list[Kernel]:
    """Return all kernels of `isc_core`, in the order of their modules and lines."""
    found: dict[int, Kernel] = {}
    for path in sorted((ROOT / "isc_core").rglob("*.py")):
        if "jit import" in path.read_text(encoding="utf-8"):
            name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            module = importlib.import_module(name)
            found |= {id(one): one for one in vars(module).values() if isinstance(one, Kernel)}
    return list(found.values())


def versions() -> list[Version]:
    """Return all declared versions of all kernels."""
    return [
        Version(kernel, signature, symbol(kernel.function, number))
        for kernel in kernels()
        for number, signature in enumerate(kernel.signatures)
    ]


def source_names() -> list[str]:
    """Return the files that decide what kernels compute: theirs, those of constants that they
    import, and that of the freedom of their arithmetic.

    Returns
    -------
    list of str
        Paths inside `isc_core`, with forward slashes, sorted.
    """
    modules = {Kernel.__module__} | {one.function.__module__ for one in kernels()}
    for one in kernels():
        function = one.function
        for node in ast.parse(_path(function.__module__).read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ImportFrom) and node.level:
                used = {alias.name for alias in node.names} & {*function.__code__.co_names}
                name = "." * node.level + (node.module or "")
                if used:
                    modules.add(importlib.util.resolve_name(name, _package(function.__module__)))
    return sorted(_path(name).relative_to(ROOT / "isc_core").as_posix() for name in modules)


def _package(module: str) -> str:
    return module.rpartition(".")[0]


def _path(module: str) -> Path:
    return ROOT.joinpath(*module.split(".")).with_suffix(".py")


def portable_code(chosen: list[Version]) -> str:
    """Compile versions of kernels as far as no processor matters.

    Parameters
    ----------
    chosen : list of Version

    Returns
    -------
    str
        A module in LLVM's notation with a function for each, called as the version's `symbol` with
        `_body` appended.
    """
    dispatchers: dict[int, Any] = {}

    def dispatcher(kernel: Kernel) -> Any:
        if id(kernel) not in dispatchers:
            dispatchers[id(kernel)] = kernel.dispatcher(dispatcher)
        return dispatchers[id(kernel)]

    with _unoptimised():
        modules = [_compiled(dispatcher(one.kernel), one) for one in chosen]
    whole = modules[0]
    for module in modules[1:]:
        whole.link_in(module)
    return _without_host(whole)


@contextmanager
def _unoptimised() -> Iterator[None]:
    """Have Numba leave out the optimisations for the processor at hand."""
    from numba.core.codegen import JITCodeLibrary
    from numba.core.registry import cpu_target

    class Plain(JITCodeLibrary):
        def _optimize_final_module(self) -> None:
            passes, builder = self._codegen._module_pass_manager(
                loop_vectorize=False, slp_vectorize=False, opt=0, cost="cheap"
            )
            passes.run(self._final_module, builder)

    generator = cpu_target.target_context.codegen()
    usual, generator._library_class = generator._library_class, Plain
    try:
        yield
    finally:
        generator._library_class = usual


def _compiled(dispatcher: Any, version: Version) -> Any:
    """The module of one version, with its function under the name of the version."""
    arguments = tuple(
        _numba_type(one, version.kernel.function.__globals__) for one in version.signature.arguments
    )
    dispatcher.compile(arguments)
    compiled = dispatcher.overloads[arguments]
    result = version.signature.result
    returned = _RESULTS[result.code if result else None]
    if str(compiled.signature.return_type) != returned:
        raise TypeError(f"{version.symbol} returns {compiled.signature.return_type}")
    module = compiled.library._final_module.clone()
    function = module.get_function(compiled.fndesc.llvm_func_name)
    function.name = f"{version.symbol}_body"
    return module


_RESULTS = {None: "none", "i8": "int64", "f8": "float64"}


def _numba_type(declared: Scalar | Array | Group, names: dict[str, Any]) -> Any:
    from numba import from_dtype, types

    if isinstance(declared, Group):
        fields = [_numba_type(one, names) for one in declared.fields]
        if not declared.name:
            return types.Tuple(fields)
        first, *rest = declared.name.split(".")
        return types.NamedTuple(fields, reduce(getattr, rest, names[first]))
    element = from_dtype(np.dtype(declared.code))
    if isinstance(declared, Scalar):
        return element
    return types.Array(element, declared.axes, "C" if declared.contiguous else "A")


def _without_host(module: Any) -> str:
    """The text of a module without the names of this system, exporting what it is for alone."""
    for one in (*module.functions, *module.global_variables):
        if not one.is_declaration:
            exported = one.name.endswith("_body")
            one.linkage = "external" if exported else "internal"
            one.visibility = "hidden" if exported else "default"
    text = re.sub(r"^target (triple|datalayout) = .*\n", "", str(module), flags=re.MULTILINE)
    text = re.sub(r"^source_filename = .*\n", "", text, flags=re.MULTILINE)
    counts = re.compile(r"^define [^\n]*@NRT_(?:incref|decref)\(.*?^}\n", re.MULTILINE | re.DOTALL)
    return counts.sub("", text) + _COUNTS
