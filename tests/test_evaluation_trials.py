"""Simulated trials: the error that a gripper makes, what every method is told of it, and what is written down."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pandas as pd
import pytest
import trimesh
from physics_params import ATTEMPT, GRIPPER, PHYSICS
from scipy import stats

from graspfn.evaluation.trials import Bench, Sigma, plan_all, trials_of_object
from graspfn.geometry import grid
from graspfn.geometry.transforms import T_world_scene, move_pose, translation
from graspfn.imaging.camera import Intrinsics
from graspfn.imaging.render import render_depth
from graspfn.meshes.placed import Resting
from graspfn.params import Plan
from graspfn.physics.attempt import Outcome, Result
from graspfn.physics.world import Rig
from graspfn.planning.centroid import centroid_grasp
from graspfn.planning.methods import METHODS

SMALL, CAMERA = Intrinsics(48, 36, 570.0), Intrinsics(640, 480, 570.0)
SHIFT, THETA = np.array([0.03, -0.02]), 0.6
COARSE = Plan(1, 1)
CELLS = [Sigma(5.0, 10.0), Sigma(12.5, 10.0), Sigma(5.0, 40.0)]
REACHED = ["reached_u_m", "reached_v_m", "reached_theta_rad"]


def brick() -> np.ndarray:
    """Depth image (36, 48) of something off the middle, longer than wide."""
    depth = np.full((SMALL.height, SMALL.width), SMALL.table_depth)
    depth[10:18, 16:40] -= 0.03
    return depth


def peaked(*peaks: tuple[int, int, int]) -> np.ndarray:
    """A grasp function (33, 44, 6) of 1 at these cells and less everywhere else."""
    f = np.random.default_rng(0).random(grid.SHAPE) / 4
    f[tuple(np.transpose(peaks))] = 1.0
    return f


@dataclass
class Recorder:
    """Stands in for a Bench: remembers what it is asked for, and every other grasp of it holds."""

    asked: list[tuple[np.ndarray, np.ndarray, float]] = field(default_factory=list)

    def grasp(self, q: np.ndarray, shift_uv: np.ndarray, theta: float) -> Result:
        self.asked.append((q.copy(), shift_uv, theta))
        return Result((Outcome.HELD, Outcome.LEFT)[len(self.asked) % 2])


def trials(name="cup", bench=None, functions=None, sigmas=CELLS, seed=0) -> pd.DataFrame:
    functions = {"alexnet": peaked((10, 20, 2)), "fcn": peaked((25, 30, 5))} if functions is None else functions
    bench = Recorder() if bench is None else bench
    rows = trials_of_object(name, bench, brick(), SHIFT, THETA, functions, sigmas, COARSE, SMALL, seed)
    return pd.DataFrame(rows)


def errors(rows: pd.DataFrame) -> np.ndarray:
    """(n, 3) reached less commanded."""
    uv = rows[REACHED[:2]].to_numpy() - rows[["u_m", "v_m"]].to_numpy()
    return np.column_stack([uv, grid.angle_difference(rows["reached_theta_rad"], rows["theta_rad"])])


def assert_normal(draws: np.ndarray, sigma: np.ndarray) -> None:
    """draws (n, 3) come from N(0, diag(sigma^2)): means, spreads, shape and independence, each at five sigmas."""
    z = draws / sigma
    n = len(z)
    assert np.all(abs(z.mean(axis=0)) < 5 / np.sqrt(n))
    assert np.all(abs(z.std(axis=0) - 1) < 5 / np.sqrt(2 * n))
    assert np.all(abs(np.corrcoef(z.T) - np.eye(3)) < 5 / np.sqrt(n))
    assert all(stats.kstest(axis, "norm").pvalue > 1e-6 for axis in z.T)


@pytest.mark.parametrize("theta", [0.01, 1.7, 3.13])
def test_the_gripper_misses_by_millimetres_and_degrees(theta):
    """5 mm and 10 degrees, whatever angle it is sent to: near the wrap of theta as anywhere."""
    q, rng = np.array([0.1, -0.05, theta]), np.random.default_rng(0)
    reached = np.array([Sigma(5.0, 10.0).reached(q, rng) for _ in range(4000)])
    assert np.all((reached[:, 2] >= 0) & (reached[:, 2] < np.pi))
    missed = np.column_stack([reached[:, :2] - q[:2], grid.angle_difference(reached[:, 2], theta)])
    assert_normal(missed, np.array([0.005, 0.005, np.pi / 18]))


def test_without_uncertainty_the_gripper_gets_there():
    q = np.array([0.1, -0.05, 3.5])
    np.testing.assert_allclose(Sigma(0.0, 0.0).reached(q, np.random.default_rng(0)), [0.1, -0.05, 3.5 - np.pi])
    assert q[2] == 3.5


def test_each_method_and_uncertainty_is_tried_once():
    rows = trials()
    planned = [("Centroid", ""), *((m, n) for m in ("Best Grasp", "Robust Best Grasp") for n in ("alexnet", "fcn"))]
    found = rows[["sigma_uv_mm", "sigma_theta_deg", "method", "network"]].itertuples(index=False, name=None)
    assert sorted(found) == sorted((c.uv_mm, c.theta_deg, *one) for c in CELLS for one in planned)
    assert set(rows["id"]) == {"cup"}
    assert tuple(dict.fromkeys(rows["method"])) == METHODS  # the names that tables and recordings go by


def test_methods_of_a_cell_share_the_grippers_error():
    for _, cell in trials().groupby(["sigma_uv_mm", "sigma_theta_deg"]):
        assert cell[["u_m", "v_m"]].drop_duplicates().shape[0] > 2  # sent to different places
        np.testing.assert_allclose(errors(cell), errors(cell)[:1].repeat(len(cell), axis=0), atol=1e-12)


def test_cells_objects_and_seeds_have_errors_of_their_own():
    """Not the same draw at another scale, either."""
    drawn = []
    for rows in (trials(), trials(name="jug"), trials(seed=1)):
        scale = np.column_stack([rows["sigma_uv_mm"] / 1e3, rows["sigma_uv_mm"] / 1e3, rows["sigma_theta_deg"]])
        drawn.append((errors(rows) / scale)[rows["method"] == "Centroid"])
    drawn = np.concatenate(drawn)
    assert len(drawn) == 9
    for axis in drawn.T:
        assert np.diff(np.sort(axis)).min() > 1e-9


def test_over_objects_the_errors_of_a_cell_have_its_sigma():
    rows = pd.concat([trials(name=f"cup-{i}", functions={}, sigmas=CELLS[:2]) for i in range(500)])
    for uv_mm, cell in rows.groupby("sigma_uv_mm"):
        assert_normal(errors(cell), np.array([uv_mm / 1e3, uv_mm / 1e3, np.radians(10)]))


def test_what_is_written_down_is_what_was_tried_and_came_of_it():
    bench = Recorder()
    rows = trials(bench=bench)
    asked, shifts, thetas = zip(*bench.asked, strict=True)
    np.testing.assert_array_equal(rows[REACHED], np.array(asked))
    assert all(shift is SHIFT for shift in shifts) and set(thetas) == {THETA}
    assert rows["success"].tolist() == [i % 2 == 1 for i in range(len(rows))]
    assert (rows["outcome"] == np.where(rows["success"], "held", "left")).all()


def test_every_method_is_sent_where_it_plans():
    """Which for Robust Best Grasp under next to no uncertainty is Best Grasp's pose."""
    f = {"alexnet": peaked((10, 20, 2)), "fcn": peaked((25, 30, 5))}
    rows = trials(functions=f, sigmas=[Sigma(0.01, 0.01)]).set_index(["method", "network"])[["u_m", "v_m", "theta_rad"]]
    np.testing.assert_array_equal(rows.loc[("Centroid", "")], centroid_grasp(brick(), SMALL))
    for method in ("Best Grasp", "Robust Best Grasp"):
        np.testing.assert_allclose(rows.loc[(method, "alexnet")], grid.from_index([10, 20, 2]), atol=1e-12)
        np.testing.assert_allclose(rows.loc[(method, "fcn")], grid.from_index([25, 30, 5]), atol=1e-12)


# A lone pose that scores 1 is left for a plateau of 0.8 elsewhere. Between poses f is trilinear, so that along one axis
# an error of sigma cells costs the lone pose E|error| = sqrt(2 / pi) sigma, as long as few errors exceed a cell.
@pytest.mark.parametrize("axis", ["uv", "theta"])
@pytest.mark.parametrize(("part", "kept"), [(0.9, True), (1.1, False)])
def test_robust_planning_gives_a_pose_up_when_errors_cost_it_its_lead(axis, part, kept):
    f = np.zeros(grid.SHAPE)
    if axis == "theta":  # a ridge in (u, v): only a wrong angle costs
        f[5:12, 5:12, 2] = 1.0
        cells = 0.2 / np.sqrt(2 / np.pi)
        sigma = Sigma(1e-3, part * cells * 30)
    else:  # any angle will do; u and v both cost: (1 - sqrt(2 / pi) sigma)^2
        f[8, 8, :] = 1.0
        cells = (1 - np.sqrt(0.8)) / np.sqrt(2 / np.pi)
        sigma = Sigma(part * cells * 10, 1e-3)
    f[20:31, 20:40, :] = 0.8
    plans = plan_all(brick(), {"fcn": f}, [sigma], COARSE, SMALL, 0, "cup")
    (q,) = (planned.q for _, planned in plans if planned.method == "Robust Best Grasp")
    assert (q[0] < 0) == kept
    (best,) = (planned.q for _, planned in plans if planned.method == "Best Grasp")
    assert best[0] < 0


def poses(name="cup", seed=0, sigmas=CELLS, **functions) -> dict[tuple[Sigma, str, str], tuple[float, ...]]:
    plans = plan_all(brick(), functions, sigmas, COARSE, SMALL, seed, name)
    return {(sigma, p.method, p.network): tuple(p.q) for sigma, p in plans}


def test_ties_are_drawn_by_seed_object_and_network_alone():
    """The same for any number of uncertainties and other networks; else another draw, all poses equally likely."""
    f = peaked((10, 10, 3), (22, 33, 0))  # images of each other by half a turn
    f[:] = np.where(f == 1, f, 0)
    one = poses(a=f, b=f)
    alone = poses(sigmas=CELLS[1:2], b=f)
    assert alone.items() <= one.items()
    assert len({q for (_, method, network), q in one.items() if (method, network) == ("Best Grasp", "a")}) == 1
    for method in ("Best Grasp", "Robust Best Grasp"):
        key = CELLS[0], method, "a"
        by_name = [poses(name=f"cup-{i}", sigmas=CELLS[:1], a=f)[key] for i in range(60)]
        by_seed = [poses(seed=i, sigmas=CELLS[:1], a=f)[key] for i in range(60)]
        many = poses(sigmas=CELLS[:1], **{f"net-{i}": f for i in range(60)})
        by_network = [q for (_, m, network), q in many.items() if m == method]
        for drawn in (by_name, by_seed, by_network):
            left = sum(q[0] < 0 for q in drawn)
            assert 10 < left < 50 and len(set(drawn)) == 2


def test_a_bench_grasps_a_moved_object_where_the_camera_sees_it():
    """In DART: a box that is turned and shifted, seen from above, held across its middle and missed beside it."""
    box = trimesh.creation.box([0.11, 0.04, 0.05])
    resting = Resting(box, box, translation(0, 0, 0.025))
    bench, shift, theta = Bench(resting, Rig(PHYSICS, GRIPPER, ATTEMPT)), np.array([0.08, -0.05]), 1.1
    depth = render_depth(box, T_world_scene(shift, theta) @ resting.T_world_object, CAMERA)
    good = np.round(grid.to_index(move_pose(np.array([0, 0, np.pi / 2]), shift, theta))).astype(int)
    f = {"good": peaked(tuple(good)), "poor": peaked((25, 5, 0))}
    rows = trials_of_object("box", bench, depth, shift, theta, f, [Sigma(0.1, 0.1)], COARSE, CAMERA, 0)
    outcomes = {(row["method"], row["network"]): (row["success"], row["outcome"]) for row in rows}
    assert outcomes == {
        ("Centroid", ""): (True, "held"),
        ("Best Grasp", "good"): (True, "held"),
        ("Robust Best Grasp", "good"): (True, "held"),
        ("Best Grasp", "poor"): (False, "untouched"),
        ("Robust Best Grasp", "poor"): (False, "untouched"),
    }
    q = np.array([rows[0]["u_m"], rows[0]["v_m"], rows[0]["theta_rad"]])
    assert len(bench.grasp(q, shift, theta, film=True).frames) > 10
    assert not bench.grasp(q, shift, theta).frames
