"""The functions of the library that ctypes calls, in C.

Each takes arrays as objects and numbers as numbers, compares the types of the arrays, and calls the
kernel's body with what Numba's calling convention wants: a place for the result, one for an error,
and for each array seven things, most of which kernels do not use.
"""

from isc_core.numerics.kernel_types import Array, Scalar

from .portable_code import Version

C_TYPES = {"i8": "int64_t", "f4": "float", "f8": "double", "b1": "uint8_t"}


def entries(chosen: list[Version]) -> str:
    """Write the functions.

    Parameters
    ----------
    chosen : list of Version

    Returns
    -------
    str
        C that comes after `runtime.c`.
    """
    return "\n".join(_entry(version) for version in chosen)


def _entry(version: Version) -> str:
    types = version.signature.flat
    result = C_TYPES[version.signature.result.code] if version.signature.result else "void"
    taken = ", ".join(
        f"const array *a{k}" if isinstance(one, Array) else f"{C_TYPES[one.code]} a{k}"
        for k, one in enumerate(types)
    )
    bodys = ", ".join(_parameters(one) for one in types)
    passed = ", ".join(_passed(one, f"a{k}") for k, one in enumerate(types))
    checks = "".join(
        f"    if (!fits(a{k}, '{one.code[0]}', {one.code[1]}, {one.axes}, {one.contiguous:d}))\n"
        "        return MISFIT;\n"
        for k, one in enumerate(types)
        if isinstance(one, Array)
    )
    # Without a result, the body may still write a pointer there.
    unused = "" if version.signature.result else "    void *unused = 0;\n"
    place = "result" if version.signature.result else "&unused"
    return (
        f"int32_t {version.symbol}_body(void *, void **, {bodys});\n"
        f"EXPORT int {version.symbol}({result} *result, {taken})\n"
        "{\n"
        f"{checks}{unused}"
        "    void *error = 0;\n"
        f"    return {version.symbol}_body({place}, &error, {passed});\n"
        "}\n"
    )


def _parameters(one: Scalar | Array) -> str:
    if isinstance(one, Scalar):
        return C_TYPES[one.code]
    return ", ".join(["void *, void *, int64_t, int64_t, void *", *["int64_t"] * (2 * one.axes)])


def _passed(one: Scalar | Array, name: str) -> str:
    if isinstance(one, Scalar):
        return name
    places = [f"{name}->{field}[{k}]" for field in ("shape", "strides") for k in range(one.axes)]
    return ", ".join([f"0, 0, count({name}), {one.code[1]}, {name}->data", *places])
