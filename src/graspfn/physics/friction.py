"""Friction between two fingers, bounded by the normal forces of contacts that stick (docs/physics.md).

DART's Dantzig solver bounds the friction of a step by the normal forces that there would be in it without friction.
What would slip or turn between the fingers without friction leaves contacts then, which have none to give. So the
bounds are those with which all contacts would stick; where what comes out breaks Coulomb's law, it is DART's.
"""

from __future__ import annotations

import ctypes
import functools
from typing import Any

import dartpy as dart
import numba
import numpy as np

from graspfn.physics.native import POINTER, address, function

SOLVE = "_ZN4dart10constraint21DantzigBoxedLcpSolver5solveEiPdS2_S2_iS2_S2_Pib"
TABLE = "_ZTVN4dart10constraint21DantzigBoxedLcpSolverE"
WORDS, POINTED, SOLVES = 6, 2, 5  # of that table: how many, to which objects point, and which is `solve`
WORD = ctypes.sizeof(POINTER)
UNKNOWN = f"{dart.__file__} lays its contact solver out in another way: it takes dartpy 6.20"
EXCESS = 0.05  # share of all bounds together by which frictions, all together, may exceed their own


def tables(solver: dart.constraint.DantzigBoxedLcpSolver) -> np.ndarray:
    """(2,) addresses that the object at `address(solver)` may begin with: it solves as DART does, and by sticking.

    dartpy has no way to make a solver of one's own. C++ looks for `solve` in a table that the object points to.
    Raises ImportError where DART's own table, or what points to it, is not as this module takes it.
    """
    original = _location(TABLE) + POINTED * WORD
    if POINTER.from_address(address(solver)).value != original:
        raise ImportError(UNKNOWN)
    return np.array([original, _table()], dtype=np.uintp)


@functools.cache
def _table() -> int:
    """Where objects point to in a copy of DART's table with our `solve`."""
    words = POINTER * WORDS
    table = words(*words.from_address(_location(TABLE)))
    if table[SOLVES] != _location(SOLVE):
        raise ImportError(UNKNOWN)
    table[SOLVES] = _solve().address
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(table))  # solvers may outlive this module
    return ctypes.addressof(table) + POINTED * WORD


def _location(name: str) -> int:
    where = ctypes.cast(function(name, None), ctypes.c_void_p).value
    assert where is not None
    return where


@functools.cache
def _solve() -> Any:
    array: Any = numba.carray  # type: ignore[attr-defined]
    pointer, integer, boolean = ctypes.c_void_p, ctypes.c_int, ctypes.c_uint8
    dantzig = function(SOLVE, boolean, pointer, integer, *[pointer] * 3, integer, *[pointer] * 3, boolean)

    @numba.njit
    def found(solver, n, A, x, b, free, low, high, early):  # type: ignore[no-untyped-def]
        """Whether Dantzig's method finds x between bounds that are numbers; it works on copies."""
        A, b, low, high, none = A.copy(), b.copy(), low.copy(), high.copy(), np.full(n, -1, np.int32)
        return dantzig(solver, n, A.ctypes, x.ctypes, b.ctypes, free, low.ctypes, high.ctypes, none.ctypes, early)

    @numba.njit
    def exceeded(x, friction, normal, share):  # type: ignore[no-untyped-def]
        """Whether frictions exceed by too much what Coulomb's law allows with these normal forces."""
        over = allowed = 0.0
        for i in friction:
            bound = share[i] * max(x[normal[i]], 0.0)
            over, allowed = over + max(abs(x[i]) - bound, 0.0), allowed + bound
        return not over <= EXCESS * allowed  # NaN does too

    @numba.cfunc("uint8(voidptr, int32, voidptr, voidptr, voidptr, int32, voidptr, voidptr, voidptr, uint8)")
    def solve(solver, n, A_, x_, b_, free, low_, high_, normal_, early):  # type: ignore[no-untyped-def]
        # A x = b + velocities; `high` of a friction is its share of the x that `normal` names, which is -1 elsewhere.
        row = n if n <= 1 else ((n - 1) | 3) + 1
        A, x, b = array(A_, n * row, np.float64), array(x_, n, np.float64), array(b_, n, np.float64)
        low, high, normal = array(low_, n, np.float64), array(high_, n, np.float64), array(normal_, n, np.int32)
        lowest, highest = low.copy(), high.copy()
        friction = np.flatnonzero(normal >= 0)
        lowest[friction], highest[friction] = -np.inf, np.inf
        if len(friction) and found(solver, n, A, x, b, free, lowest, highest, early):
            slips = False
            for i in friction:
                highest[i] = high[i] * max(x[normal[i]], 0.0)
                lowest[i] = -highest[i]
                slips = slips or not abs(x[i]) <= highest[i]  # NaN does too
            if not slips:
                return 1
            if found(solver, n, A, x, b, free, lowest, highest, early) and not exceeded(x, friction, normal, high):
                return 1
        return dantzig(solver, n, A_, x_, b_, free, low_, high_, normal_, early)

    return solve
