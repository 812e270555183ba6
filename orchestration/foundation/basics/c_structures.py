"""C that Python calls: libraries, compiled once, and the structures and constants that both share, from its text."""

import ctypes
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from fmu_kit.bundle import PackagingError
from fmu_kit.compiler.pack.c_compiler import OPTIONS, Mathematics, compiled_here
from fmu_kit.libraries import cached_library
from orchestration.foundation.basics.errors import QuadcosimError

if TYPE_CHECKING:
    import numpy.typing as npt

_SCALARS: Mapping[str, Any] = {
    "int": ctypes.c_int, "int32_t": ctypes.c_int32, "int64_t": ctypes.c_int64, "uint64_t": ctypes.c_uint64,
    "size_t": ctypes.c_size_t, "double": ctypes.c_double, "Lanes": ctypes.c_uint64, "void": None,
}  # fmt: skip
_STRUCTURE = re.compile(r"typedef struct \{(.*?)\} (\w+);", re.DOTALL)
_CONSTANTS = re.compile(r"enum \{(.*?)\};", re.DOTALL)
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_FUNCTION = re.compile(r"(\w+) \(\*(\w+)\)\((.*)\)")
_FIELDS = re.compile(r"(?:const )?(\w+) (.*)", re.DOTALL)
_FIELD = re.compile(r"(\**)(\w+)(?:\[(.*)\])?")


@contextmanager
def compiler_errors() -> Iterator[None]:
    """Errors of a compiler, or of the cache of what it makes, as `QuadcosimError`."""
    try:
        yield
    except (PackagingError, OSError) as error:
        raise QuadcosimError(str(error)) from error


def compiled_library(
    name: str, sources: Mapping[str, bytes], *, mathematics: Mathematics = "own", options: Sequence[str] = ()
) -> Any:
    """The library that is compiled from NAME.c among the sources, once; raises `QuadcosimError` with the reason."""
    with compiler_errors():
        compiled = lambda: compiled_here(sources, f"{name}.c", mathematics=mathematics, options=options)  # noqa: E731
        return ctypes.CDLL(str(cached_library(name, sources, (*OPTIONS, *options), compiled)))


def address(array: "npt.NDArray[Any]") -> int:
    """The address of the values of a contiguous array; the caller keeps the array alive."""
    return int(array.ctypes.data)


def constants(text: str) -> dict[str, int]:
    """The constants of the enumerations in a text of C, by name."""
    numbers: dict[str, int] = {}
    for enumeration in _CONSTANTS.findall(_COMMENT.sub("", text)):
        number = 0
        for each in enumeration.split(","):
            name, _, value = each.partition("=")
            number = int(value) if value else number
            numbers[name.strip()] = number
            number += 1
    return numbers


def declared(text: str, lanes: int = 1) -> dict[str, Any]:
    """The structures in a text of C, by name; a structure must be declared before it is used in another."""
    types: dict[str, Any] = {}
    for body, name in _STRUCTURE.findall(_COMMENT.sub("", text)):
        declarations = [part.strip() for part in body.split(";") if part.strip()]
        fields = [field for declaration in declarations for field in _fields(declaration, types, lanes)]
        types[name] = type(name, (ctypes.Structure,), {"_fields_": fields})
    return types


def _fields(declaration: str, known: Mapping[str, Any], lanes: int) -> Iterator[tuple[str, Any]]:
    """Names and types of the fields of a declaration; any pointer is an address."""
    types = {**_SCALARS, **known}
    if function := _FUNCTION.fullmatch(declaration):
        result, name, arguments = function.groups()
        yield name, ctypes.CFUNCTYPE(types[result], *(types[each.strip()] for each in arguments.split(",")))
        return
    declarators = _FIELDS.fullmatch(declaration)
    assert declarators is not None, declaration
    for each in declarators[2].split(","):
        field = _FIELD.fullmatch(each.strip())
        assert field is not None, declaration
        stars, name, count = field.groups()
        kind = ctypes.c_void_p if stars else types[declarators[1]]
        sizes = [lanes if size == "L" else int(size) for size in count.split(" * ")] if count else []
        yield name, kind * math.prod(sizes) if sizes else kind


def expect_same_sizes(library: ctypes.CDLL, types: Mapping[str, Any]) -> None:
    """Raise `QuadcosimError` naming the first of `types` that is missing in a library or has another size there."""
    size = types["Size"]
    sizes, place = {}, ctypes.addressof(size.in_dll(library, "sizes"))
    while (each := size.from_address(place)).name:
        sizes[ctypes.string_at(each.name).decode()] = each.size
        place += ctypes.sizeof(size)
    for name, structure in types.items():
        if sizes.get(name) != ctypes.sizeof(structure):
            raise QuadcosimError(
                f"structure {name} has {sizes.get(name, 'no')} bytes in C: expected {ctypes.sizeof(structure)}, as in "
                "Python"
            )
