"""The library of compiled kernels: `isc_core`'s kernels as machine code for one platform.

`portable_code` has Numba compile every declared version of every kernel as far as no processor
matters, `entries` writes the functions in C that ctypes calls, and `build` has the C compiler of
Zig make a library of both and of `runtime.c`, for a platform on any other.
"""
