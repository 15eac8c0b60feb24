"""Functions of DART and ODE, called in dartpy's own library: what dartpy does not bind, and what every step calls.

numba compiles calls of them. A call through dartpy costs about 1 µs in a step, whose own work has emptied the caches,
and a step would take ten.
"""

from __future__ import annotations

import ctypes
from typing import Any

import dartpy as dart

POINTER = ctypes.c_size_t  # what numba takes for the address of a C++ object


def function(name: str, result: type | None, *arguments: type) -> Any:
    """The function of that (mangled) name in dartpy's library, or in those that it is linked to, ODE among them."""
    library = ctypes.CDLL(dart.__file__)
    try:
        found = library[name]
    except AttributeError:
        raise ImportError(f"{dart.__file__} has no {name}: it takes dartpy 6.20 for Linux or macOS") from None
    found.restype, found.argtypes = result, arguments
    return found


def address(bound: object) -> int:
    """Where the C++ object of a dartpy object lies, as long as that lives.

    pybind11 keeps it right behind the header of the Python object.
    """
    where = ctypes.c_void_p.from_address(id(bound) + object.__basicsize__).value
    assert where is not None
    return where
