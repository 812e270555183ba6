"""The heap of the process in which an FMU is checked, by glibc: what is in use, and contents of fresh memory."""

import ctypes
import functools
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_PERTURB = -6
"""M_PERTURB of mallopt: each byte of fresh memory becomes the inverse of its argument"""
_UNLIKE_ZERO = 0xBE
"""Its inverse, which makes a double 2261634.5: none that vanishes in a sum"""
_KEPT, _SIZES = 7, range(24, 1033, 16)
"""Blocks of each size that malloc keeps and hands out as they are"""


class _Usage(ctypes.Structure):
    _fields_ = [(f"field{i}", ctypes.c_size_t) for i in range(10)]


@functools.cache
def _libc() -> Any:
    """The C library; None: it is not glibc, or an old one."""
    found = ctypes.CDLL(None)
    if not hasattr(found, "mallinfo2") or not hasattr(found, "mallopt"):
        return None
    found.mallinfo2.restype = _Usage
    found.malloc.restype, found.malloc.argtypes = ctypes.c_void_p, (ctypes.c_size_t,)
    found.free.restype, found.free.argtypes = None, (ctypes.c_void_p,)
    return found


def in_use() -> int:
    """The bytes that are allocated; 0 where that is not known."""
    if _libc() is None:
        return 0
    usage = _libc().mallinfo2()
    return int(usage.field4 + usage.field7)  # mapped, and of the heap


@contextmanager
def other_contents() -> Iterator[None]:
    """Fresh memory has other contents inside of the block, where the C library can do that."""
    libc = _libc()
    if libc is None:
        yield
        return
    taken = [libc.malloc(size) for size in _SIZES for _ in range(_KEPT)]
    libc.mallopt(_PERTURB, _UNLIKE_ZERO)
    try:
        yield
    finally:
        libc.mallopt(_PERTURB, 0)
        for each in taken:
            libc.free(each)
