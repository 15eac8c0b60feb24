"""The projector's shadow against a ray cast."""

from __future__ import annotations

import numpy as np

from graspfn.imaging.camera import Camera
from graspfn.robot.depth_holes import BASELINE_M, hole_mask, projector_shadow

CAMERA = Camera.of_the_paper(640, 480, 570.0)


def slab(height: float, columns: slice, rows: slice = slice(150, 330)) -> np.ndarray:
    depth = np.full((480, 640), CAMERA.table_depth, np.float32)
    depth[rows, columns] -= height
    return depth


def test_an_empty_table_is_lit_everywhere():
    assert not projector_shadow(slab(0, slice(0, 0)), CAMERA).any()


def test_a_raised_slab_casts_the_shadow_of_similar_triangles():
    """To the left, away from the projector, in the slab's rows only: b h / (z - h) on the table, less what it hides."""
    height = 0.06
    shadow = projector_shadow(slab(height, slice(280, 380)), CAMERA)
    assert not shadow[:150].any() and not shadow[330:].any()
    row = np.flatnonzero(shadow[200])
    z = CAMERA.table_depth
    width = CAMERA.K[0] * BASELINE_M * (1 / (z - height) - 1 / z)
    assert row.max() == 279
    assert abs(len(row) - width) <= 1


def test_shadows_agree_with_rays_from_the_projector():
    """A smooth hill with a step, row by row: march from the point to the projector over the surface of the row."""
    x = np.arange(640)
    hill = 0.15 * np.exp(-(((x - 330) / 30) ** 2)) + 0.05 * ((x > 460) & (x < 500))
    depth = CAMERA.table_depth - np.tile(hill, (480, 1))
    shadow = projector_shadow(depth, CAMERA)[240]
    z = depth[240]
    across = (x - CAMERA.centre[0]) / CAMERA.K[0] * z  # metres along the image's +x
    lit = np.ones(640, dtype=bool)
    along = np.linspace(0.001, 0.999, 4000)
    for i in range(100, 600):
        ray_x, ray_z = across[i] + along * (BASELINE_M - across[i]), z[i] * (1 - along)
        column = ray_x / ray_z * CAMERA.K[0] + CAMERA.centre[0]
        inside = (column > i + 1) & (column < 639)
        lit[i] = not np.any(ray_z[inside] > np.interp(column[inside], x, z) + 1e-4)
    dark = ~lit[100:600]
    assert dark[:300].sum() > 10 and dark[300:].sum() > 10  # behind the hill and behind the step
    assert np.sum(shadow[100:600] & dark) > 0.9 * np.sum(shadow[100:600] | dark)


def test_dropouts_are_few_and_repeatable():
    depth = slab(0.05, slice(300, 340))
    masks = [hole_mask(depth, CAMERA, np.random.default_rng(seed)) for seed in (0, 0, 1)]
    np.testing.assert_array_equal(masks[0], masks[1])
    assert np.any(masks[0] != masks[2])
    lost = masks[0] & ~projector_shadow(depth, CAMERA)
    assert 0.001 < lost.mean() < 0.003
    assert np.all(masks[0][projector_shadow(depth, CAMERA)])
