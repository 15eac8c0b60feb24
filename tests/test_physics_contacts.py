"""Contacts that are found twice: reported once, and as deep as the deeper."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from physics_params import GRIPPER, PHYSICS

from graspfn.geometry.transforms import translation
from graspfn.meshes.placed import Resting
from graspfn.physics.contacts import DEPTH, NORMAL, POSITION, SAME_COS, SAME_M, SIZE, distinct
from graspfn.physics.world import GraspWorld


def same(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(n, m) bool: which contacts (n, 12) and (m, 12) are the same."""
    positions, normals = (slice(start, start + 3) for start in (POSITION, NORMAL))
    apart = np.linalg.norm(one[:, None, positions] - other[None, :, positions], axis=-1)
    return (apart < SAME_M) & (one[:, normals] @ other[:, normals].T > SAME_COS)


@pytest.mark.parametrize("count", [0, 1, 2, 40])
def test_distinct_contacts_stand_for_all(count: int) -> None:
    """None is the same as another, each of all is the same as one of them, none is deeper than what it stands for."""
    rng = np.random.default_rng(count)
    contacts = rng.random((count, SIZE))
    contacts[:, POSITION : POSITION + 3] *= 2e-3
    normals = np.array([0, 0, 1]) + rng.normal(0, 0.03, (count, 3))
    contacts[:, NORMAL : NORMAL + 3] = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    kept = contacts.copy()
    kept = kept[: distinct(kept)]
    assert not (same(kept, kept) & ~np.eye(len(kept), dtype=bool)).any()
    stands_for = same(kept, contacts)
    assert stands_for.any(axis=0).all() and (len(kept) < 0.8 * count or count < 3)
    for contact, whom in zip(kept, stands_for, strict=True):
        assert contact[DEPTH] in contacts[whom, DEPTH]
    assert np.isin(kept[:, [*range(DEPTH), *range(DEPTH + 1, SIZE)]], contacts).all()


def test_a_finger_meets_a_fine_mesh_in_few_contacts() -> None:
    """No two of a step are the same, though all triangles of a finely meshed side meet the finger."""
    block = trimesh.creation.box([0.04, 0.1, 0.04]).subdivide().subdivide().subdivide().subdivide()
    world = GraspWorld(Resting(block, block, translation(0, 0, 0.02)), PHYSICS, GRIPPER)
    world.place_object(world_object := translation(0, 0, 0.02))
    world.place_hand(np.zeros(3))
    met = 0
    for _ in range(60):
        world.drive(0.0, 5)
        contacts = np.zeros((0, SIZE))
        for contact in world.world.getLastCollisionResult().getContacts():
            if contact.point[2] > 1e-3:  # not the table's
                row = np.zeros((1, SIZE))
                row[0, POSITION : POSITION + 3], row[0, NORMAL : NORMAL + 3] = contact.point, contact.normal
                contacts = np.concatenate([contacts, row])
        assert not (same(contacts, contacts) & ~np.eye(len(contacts), dtype=bool)).any()
        met = max(met, len(contacts))
    assert met >= 4
    assert world.object_pose() == pytest.approx(world_object, abs=2e-3)
