"""Contacts as DART's solver needs them: none pushed out to nothing, none twice (docs/physics.md).

Both hold for the whole process.
"""

from __future__ import annotations

import ctypes
import functools
from typing import Any

import numba
import numpy as np

from graspfn.physics.native import function

SLOP_M = 1e-4  # contacts as deep as this are left so: pushed out to the surface, they would come and go
# ODE clips each triangle against a box on its own, and neighbours tell of one contact twice. Rows of the solver's
# problem that nearly repeat each other make it fail, and take three times as long.
SAME_M, SAME_COS = 5e-4, np.cos(np.radians(3)).item()

SET_ALLOWANCE = "_ZN4dart10constraint17ContactConstraint17setErrorAllowanceEd"
COLLIDE_MESH_AND_BOX = "_Z11dCollideBTLP6dxGeomS0_iP12dContactGeomi"
BOX, MESH = 1, 8  # classes of ODE's
# ODE's dContactGeom in doubles: position and normal (padded to four), depth, two geometries, two sides.
POSITION, NORMAL, DEPTH, SIZE = 0, 4, 8, 12


@functools.cache
def leave_slop() -> None:
    """Leave SLOP_M in all contacts."""
    function(SET_ALLOWANCE, None, ctypes.c_double)(SLOP_M)


def thin_out() -> None:
    """Have ODE report one contact where a mesh and a box meet in several that are the same.

    Takes a living detector of ODE's: with the last of them, ODE forgets.
    """
    override = function("dSetColliderOverride", None, ctypes.c_int, ctypes.c_int, ctypes.c_void_p)
    override(MESH, BOX, _collide_thinned().address)


@functools.cache
def _collide_thinned() -> Any:
    """ODE's collision of a mesh and a box, and `distinct` of what it finds."""
    pointer, integer = ctypes.c_void_p, ctypes.c_int
    collide = function(COLLIDE_MESH_AND_BOX, integer, pointer, pointer, integer, pointer, integer)

    @numba.cfunc("int32(voidptr, voidptr, int32, voidptr, int32)")
    def thinned(mesh, box, flags, contacts, stride):  # type: ignore[no-untyped-def]
        found = collide(mesh, box, flags, contacts, stride)
        return distinct(numba.carray(contacts, (found, SIZE), np.float64))  # type: ignore[attr-defined]

    return thinned


@numba.njit
def distinct(contacts: np.ndarray) -> int:
    """Move the contacts that no earlier one equals to the front, as deep as the deepest that equals them; how many.

    contacts: (n, 12) float64, of ODE's dContactGeom, changed in place.
    """
    kept = 0
    for i in range(len(contacts)):
        for j in range(kept):
            if _same(contacts, i, j):
                contacts[j, DEPTH] = max(contacts[j, DEPTH], contacts[i, DEPTH])
                break
        else:
            for k in range(SIZE):
                contacts[kept, k] = contacts[i, k]
            kept += 1
    return kept


@numba.njit
def _same(contacts: np.ndarray, i: int, j: int) -> bool:
    apart = cos = 0.0
    for k in range(3):
        apart += (contacts[i, POSITION + k] - contacts[j, POSITION + k]) ** 2
        cos += contacts[i, NORMAL + k] * contacts[j, NORMAL + k]
    return apart < SAME_M**2 and cos > SAME_COS
