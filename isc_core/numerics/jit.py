"""Machine code for loops over pixels that NumPy cannot express.

It is taken from a library of kernels compiled ahead of time (`kernel_library`) if there is one for
this machine and these sources; otherwise Numba compiles it, if installed. Without either, the same
functions run as plain Python: slower, with equal results.

Code compiled by Numba is cached between runs: beside the source if that folder is writable,
otherwise in the user's cache folder, or in NUMBA_CACHE_DIR. If none of these is writable, a
temporary folder is used until the process ends.

Numba is imported, and a function compiled, at the first call: the import takes longer than many
commands.

Determinism: the compiler fixes the order of a sum regardless of the number of threads, because each
call runs on a single thread. `REASSOCIATED` lets the compiler choose that order once, so the sum
may use vector instructions; it stays the same for every call of the same machine code.
"""

import atexit
import contextlib
import shutil
import tempfile
from collections.abc import Callable
from functools import cache, cached_property
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar, cast, overload

from .kernel_library import shipped_library
from .kernel_types import Signature, signatures

Loop = TypeVar("Loop", bound=Callable[..., object])

EXACT: frozenset[str] = frozenset()
"""IEEE arithmetic in the order of the source."""
IN_ORDER = frozenset({"contract", "nsz"})
"""Sums and differences in the order of the source; a product and a sum may round once."""
ACCUMULATED = frozenset({"reassoc", "contract", "nsz"})
"""Sums may be reordered, which vectorised inner products require."""
REASSOCIATED = ACCUMULATED | {"arcp", "afn"}
"""As `ACCUMULATED`; also reciprocals for divisions, and faster approximate functions."""


@overload
def jit(loop: Loop, /) -> Loop:
    """Compile `loop` exactly."""


@overload
def jit(
    *, types: str = "", math: frozenset[str] = EXACT, inline: bool = False
) -> Callable[[Loop], Loop]:
    """Return a decorator.

    Parameters
    ----------
    types : str
        Types of the arguments, see `kernel_types`; "" for functions that only other kernels call.
    math : frozenset of str
        Floating-point freedom of the compiler, see the constants of this module.
    inline : bool
        Whether to inline the function where compiled code calls it.

    Returns
    -------
    callable
        Compiles the function it decorates.
    """


def jit(
    loop: Loop | None = None,
    /,
    *,
    types: str = "",
    math: frozenset[str] = EXACT,
    inline: bool = False,
) -> Loop | Callable[[Loop], Loop]:
    """Compile a function of numbers and arrays.

    The compiled function releases the interpreter lock, and divides by zero as NumPy does. Use as
    ``@jit`` or ``@jit(types="i8 f4[2]", math=IN_ORDER)``.

    Parameters
    ----------
    loop : callable, optional
        The function, when used without arguments.
    types : str
        Types of the arguments for which the function is compiled ahead of time, see `kernel_types`;
        "" for functions that only other kernels call.
    math : frozenset of str
        Floating-point freedom of the compiler: `EXACT`, `IN_ORDER`, `ACCUMULATED` or
        `REASSOCIATED`.
    inline : bool
        Inline the function in each kernel that calls it. A called function must be inlined if
        results must be equal to the byte: linked separately, it would round differently in the
        process that compiles it than in one that reads it from the cache, because the two link
        different copies.

    Returns
    -------
    callable
        The compiled function, or `loop` itself without a compiler.
    """

    def decorate(function: Loop) -> Loop:
        return cast(Loop, Kernel(function, types, math, inline))

    return decorate if loop is None else decorate(loop)


class Kernel:
    """A function that is compiled, or loaded, when it is first called.

    Parameters
    ----------
    function : callable
    types : str
    math : frozenset of str
    inline : bool
        See `jit`.

    Attributes
    ----------
    function : callable
        The Python function.
    types : str
    inline : bool
    """

    def __init__(
        self, function: Callable[..., Any], types: str, math: frozenset[str], inline: bool
    ) -> None:
        self.function, self.types, self.inline, self._math = function, types, inline, math
        self.__doc__, self.__module__ = function.__doc__, function.__module__

    def __call__(self, *values: Any) -> Any:
        """Call the compiled function."""
        return self.compiled(*values)

    @property
    def signatures(self) -> tuple[Signature, ...]:
        """Signatures for which the function is compiled ahead of time."""
        return signatures(self.types)

    @cached_property
    def compiled(self) -> Callable[..., Any]:
        """The implementation: shipped code, Numba's dispatcher, or the Python function."""
        library = shipped_library()
        if library is not None and self.function in library:
            return library.kernel(self.function, self.signatures)
        return self._dispatcher if numba_available() else self.function

    @cached_property
    def _dispatcher(self) -> Any:
        """Numba's dispatcher, which caches compiled code."""
        ensure_cache_folder()
        dispatcher = self.dispatcher(lambda kernel: kernel._dispatcher, cache=True)
        drop_broken(Path(str(dispatcher.stats.cache_path)))
        _load_alone(dispatcher)
        return dispatcher

    def dispatcher(self, of_called: "Callable[[Kernel], Any]", *, cache: bool = False) -> Any:
        """Return a new dispatcher of Numba for the function.

        Parameters
        ----------
        of_called : callable
            Returns the dispatcher of a kernel that the function calls; compiled code can call only
            dispatchers.
        cache : bool, optional
            Whether to cache compiled code on disk.

        Returns
        -------
        numba.core.dispatcher.Dispatcher
        """
        import numba

        function = cast(FunctionType, self.function)
        names = {
            name: of_called(value) if isinstance(value, Kernel) else value
            for name, value in function.__globals__.items()
            if name in function.__code__.co_names or name.startswith("__")
        }
        return numba.njit(
            cache=cache,
            nogil=True,
            error_model="numpy",
            fastmath=set(self._math),
            forceinline=self.inline,
        )(FunctionType(function.__code__, names, function.__name__))


def _load_alone(dispatcher: Any) -> None:
    """Let a dispatcher load compiled code without importing the compiler.

    Before Numba reads its cache, it imports everything that it can compile (a fifth of a second,
    with `scipy.linalg`); compilation does so anyway. Compiled code needs only Numba's runtime.
    """
    try:
        from numba.core.caching import FunctionCache
        from numba.core.runtime.nrt import rtsys
    except ImportError:  # a version with another layout: Numba's own cache
        return

    class LoadingCache(FunctionCache):
        def load_overload(self, sig: Any, target_context: Any) -> Any:
            rtsys.initialize(target_context)
            with self._guard_against_spurious_io_errors():
                return self._load_overload(sig, target_context)
            return None

    dispatcher._cache = LoadingCache(dispatcher.py_func)


def compiled_available() -> bool:
    """Return whether kernels run as machine code: shipped, or compiled by Numba."""
    return shipped_library() is not None or numba_available()


def numba_available() -> bool:
    """Return whether Numba can be imported."""
    try:
        import numba  # noqa: F401
    except ImportError:
        return False
    return True


@cache
def drop_broken(folder: Path) -> None:
    """Remove truncated files of compiled code, on which Numba would fail at every start.

    A power failure or a full disk leaves them behind.

    Parameters
    ----------
    folder : Path
        Cache folder; each is checked once per process.
    """
    for kept in folder.glob("*.nb[ic]"):
        with contextlib.suppress(OSError):  # another process replaced it, or it cannot be removed
            if not kept.read_bytes().endswith(b"."):  # the last byte of every pickle
                kept.unlink()


@cache
def ensure_cache_folder() -> None:
    """Give Numba a temporary cache folder if no other is writable; otherwise Numba would fail."""
    try:
        import numba
    except ImportError:
        return
    try:
        numba.njit(cache=True)(_probe)
    except RuntimeError:
        folder = tempfile.mkdtemp(prefix="isc-kernels-")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        setattr(numba.config, "CACHE_DIR", folder)  # noqa: B010 (declared dynamically there)


def _probe() -> None:
    """Numba looks for a writable cache folder for this function, hence for this package."""
