"""Simulated trials: the error that a gripper makes, what every method is told of it, and what is written down."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pandas as pd
import pytest
import trimesh
from physics_params import ATTEMPT, GRIPPER, PHYSICS
from scipy import stats

from graspfn.evaluation.bench import Bench, Scene
from graspfn.evaluation.cases import TOP_CLASS
from graspfn.evaluation.ceiling import ceilings
from graspfn.evaluation.expected import Attempts, expected_success
from graspfn.evaluation.planner import TRUE, UNTRAINED, GraspFunction, Planner, promises_of, true_function
from graspfn.evaluation.trials import trials_of_object
from graspfn.geometry import grid
from graspfn.geometry.transforms import T_world_scene, move_pose, translation, unmove_pose
from graspfn.imaging.camera import Camera
from graspfn.imaging.height_map import HeightMap, height_map
from graspfn.imaging.render import render_depth
from graspfn.imaging.warp import sample_function
from graspfn.learning.targets import CLASSES
from graspfn.meshes.placed import Resting
from graspfn.params import Plan
from graspfn.physics.attempt import Outcome, Result
from graspfn.physics.world import Rig
from graspfn.planning.centroid import centroid_grasp
from graspfn.planning.methods import BEST, LIKELIEST, METHODS, ROBUST
from graspfn.planning.robust import RobustFunction
from graspfn.planning.uncertainty import PoseUncertainty

CAMERA = Camera.of_the_paper(640, 480, 570.0)
SHIFT, THETA = np.array([0.03, -0.02]), 0.6
COARSE = Plan(1, 1)
CELLS = [(5.0, 10.0), (12.5, 10.0), (5.0, 40.0)]
ERRORS = np.random.default_rng(9).standard_normal((2, 3))
REACHED = ["reached_u_m", "reached_v_m", "reached_theta_rad"]


def brick() -> HeightMap:
    """Something off the middle, longer than wide."""
    heights = np.zeros((132, 176), np.float32)
    heights[30:48, 60:110] = 0.03
    return HeightMap(heights, np.ones_like(heights, dtype=bool))


def peaked(*peaks: tuple[int, int, int]) -> np.ndarray:
    """A grasp function (33, 44, 6) of 1 at these cells and less everywhere else."""
    f = np.random.default_rng(0).random(grid.SHAPE) / 4
    f[tuple(np.transpose(peaks))] = 1.0
    return f


@dataclass
class Recorder:
    """Stands in for a Bench: remembers what it is asked for, and every other grasp of it holds."""

    asked: list[np.ndarray] = field(default_factory=list)

    def grasp(self, q: np.ndarray) -> Result:
        self.asked.append(q.copy())
        return Result((Outcome.HELD, Outcome.LEFT)[len(self.asked) % 2])


def scene(name: str = "cup") -> Scene:
    return Scene(name, brick(), SHIFT, THETA)


def networks(**functions: np.ndarray) -> list[GraspFunction]:
    return [GraspFunction(name, 0, f) for name, f in functions.items()]


def trials(bench=None, functions=None, cells=CELLS, errors=ERRORS, attempts=None) -> pd.DataFrame:
    default = networks(alexnet=peaked((10, 20, 2)), fcn=peaked((25, 30, 5)))
    functions = default if functions is None else functions
    bench = Recorder() if bench is None else bench
    return pd.DataFrame(trials_of_object(scene(), bench, Planner(COARSE, 0), functions, cells, errors, attempts))


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
    q, sigma = np.array([0.1, -0.05, theta]), PoseUncertainty.of(5.0, 10.0)
    reached = sigma.reached(q, np.random.default_rng(0).standard_normal((4000, 3)))
    assert np.all((reached[:, 2] >= 0) & (reached[:, 2] < np.pi))
    missed = np.column_stack([reached[:, :2] - q[:2], grid.angle_difference(reached[:, 2], theta)])
    assert_normal(missed, np.array([0.005, 0.005, np.pi / 18]))
    np.testing.assert_allclose(sigma.covariance_at(q), np.diag([25e-6, 25e-6, (np.pi / 18) ** 2]))


def test_without_uncertainty_the_gripper_gets_there():
    q = np.array([0.1, -0.05, 3.5])
    np.testing.assert_allclose(PoseUncertainty((0.0, 0.0)).reached(q, ERRORS), [[0.1, -0.05, 3.5 - np.pi]] * 2)
    assert q[2] == 3.5


def test_each_method_uncertainty_and_error_is_tried_once():
    rows = trials()
    planned = [("Centroid", "", UNTRAINED), *((m, n, 0) for m in (BEST, ROBUST) for n in ("alexnet", "fcn"))]
    keys = ["sigma_uv_mm", "sigma_theta_deg", "method", "network", "training_seed", "error"]
    found = rows[keys].itertuples(index=False, name=None)
    assert sorted(found) == sorted((*c, *one, i) for c in CELLS for one in planned for i in range(len(ERRORS)))
    assert set(rows["id"]) == {"cup"}
    assert set(rows["method"]) | {LIKELIEST} == set(METHODS)  # the names that tables and recordings go by


def test_all_methods_and_cells_share_the_grippers_errors_each_scaled_by_its_uncertainty():
    rows = trials()
    for (uv, theta, i), group in rows.groupby(["sigma_uv_mm", "sigma_theta_deg", "error"]):
        assert group[["u_m", "v_m"]].drop_duplicates().shape[0] > 2  # sent to different places
        expected = ERRORS[i] * [uv / 1e3, uv / 1e3, np.radians(theta)]
        expected[2] = grid.angle_difference(expected[2], 0.0)
        np.testing.assert_allclose(errors(group), np.tile(expected, (len(group), 1)), atol=1e-12)


def test_what_is_written_down_is_what_was_tried_and_came_of_it():
    bench = Recorder()
    rows = trials(bench=bench)
    np.testing.assert_array_equal(rows[REACHED], np.array(bench.asked))
    assert rows["success"].tolist() == [i % 2 == 1 for i in range(len(rows))]
    assert (rows["outcome"] == np.where(rows["success"], "held", "left")).all()


def test_every_method_is_sent_where_it_plans():
    """Which for Robust Best Grasp under next to no uncertainty is Best Grasp's pose."""
    f = networks(alexnet=peaked((10, 20, 2)), fcn=peaked((25, 30, 5)))
    rows = trials(functions=f, cells=[(0.01, 0.01)], errors=ERRORS[:1]).set_index(["method", "network"])
    rows = rows[["u_m", "v_m", "theta_rad"]]
    np.testing.assert_array_equal(rows.loc[("Centroid", "")], centroid_grasp(brick()))
    for method in (BEST, ROBUST):
        np.testing.assert_allclose(rows.loc[(method, "alexnet")], grid.from_index([10, 20, 2]), atol=1e-12)
        np.testing.assert_allclose(rows.loc[(method, "fcn")], grid.from_index([25, 30, 5]), atol=1e-12)


def test_the_true_function_plans_about_the_object_and_is_sent_to_where_that_lies_in_the_image():
    f = peaked((14, 25, 1))
    rows = trials(functions=[GraspFunction(TRUE, UNTRAINED, f)], cells=[(0.01, 0.01)], errors=ERRORS[:1])
    rows = rows.set_index("method")[["u_m", "v_m", "theta_rad"]]
    for method in (BEST, ROBUST):
        expected = move_pose(grid.from_index([14, 25, 1]), SHIFT, THETA)
        np.testing.assert_allclose(rows.loc[method], expected, atol=1e-12)


def test_the_highest_class_of_a_network_has_score_one():
    assert TOP_CLASS == CLASSES - 1


def test_the_likeliest_class_plans_by_its_own_scores():
    function = GraspFunction("fcn", 0, peaked((10, 20, 2)), likeliest=peaked((25, 30, 5)))
    rows = trials(functions=[function], cells=CELLS[:1]).drop_duplicates("method").set_index("method")
    np.testing.assert_allclose(rows.loc[LIKELIEST, "u_m"], grid.from_index([25, 30, 5])[0])
    np.testing.assert_allclose(rows.loc[BEST, "u_m"], grid.from_index([10, 20, 2])[0])


def test_promises_are_the_robust_scores_of_the_poses_and_robust_planning_has_the_highest():
    f = np.random.default_rng(1).random(grid.SHAPE)
    rows = trials(functions=networks(fcn=f)).drop_duplicates(["method", "sigma_uv_mm", "sigma_theta_deg"])
    assert rows.loc[rows["method"] == "Centroid", "promise"].isna().all()
    for cell, group in rows.groupby(["sigma_uv_mm", "sigma_theta_deg"]):
        by = group.set_index("method")
        assert by.loc[ROBUST, "promise"] >= by.loc[BEST, "promise"]
        sigma, q = PoseUncertainty.of(*cell), by.loc[BEST, ["u_m", "v_m", "theta_rad"]].to_numpy(dtype=float)
        draws = sigma.reached(q, np.random.default_rng(2).standard_normal((200_000, 3)))
        assert by.loc[BEST, "promise"] == pytest.approx(sample_function(f, draws).mean(), abs=5e-3)
        assert promises_of(RobustFunction(f, sigma), [q, None]) == pytest.approx(
            [by.loc[BEST, "promise"], np.nan], nan_ok=True
        )


def test_expected_success_is_of_the_pose_about_the_object_and_of_the_true_function_that_of_the_ceiling():
    drawn = grid.sample_cells(3, np.random.default_rng(3))
    attempts = Attempts(drawn, (np.abs(drawn[..., :2]) < 0.03).all(axis=-1))
    functions = [*networks(fcn=peaked((25, 30, 5))), true_function(attempts)]
    rows = trials(functions=functions, attempts=attempts).drop_duplicates(
        ["method", "network", "sigma_uv_mm", "sigma_theta_deg"]
    )
    uncertainties = [PoseUncertainty.of(*cell) for cell in CELLS]
    for cell, known in zip(CELLS, ceilings(scene(), Planner(COARSE, 0), uncertainties, attempts), strict=True):
        of_cell = (rows["sigma_uv_mm"] == cell[0]) & (rows["sigma_theta_deg"] == cell[1])
        own = rows[of_cell & (rows["network"] == TRUE)]
        assert own.set_index("method")["expected"].to_dict() == {m: one.value for m, one in known.items()}
        assert set(known) == {BEST, ROBUST}
    for row in rows[rows["network"] != TRUE].to_dict("records"):
        sigma = PoseUncertainty.of(row["sigma_uv_mm"], row["sigma_theta_deg"])
        q = unmove_pose(np.array([row["u_m"], row["v_m"], row["theta_rad"]]), SHIFT, THETA)
        expected = expected_success(q, *sigma.sigmas[1:], attempts)
        np.testing.assert_allclose(row["expected"], expected.value)
        np.testing.assert_allclose(row["effective"], expected.effective)
    assert trials(cells=[(0.0, 10.0)], attempts=attempts)["expected"].isna().all()  # no density


# A lone pose that scores 1 is left for a plateau of 0.8 elsewhere. Between poses f is trilinear, so that along one axis
# an error of sigma cells costs the lone pose E|error| = sqrt(2 / pi) sigma, as long as few errors exceed a cell.
@pytest.mark.parametrize("axis", ["uv", "theta"])
@pytest.mark.parametrize(("part", "kept"), [(0.9, True), (1.1, False)])
def test_robust_planning_gives_a_pose_up_when_errors_cost_it_its_lead(axis, part, kept):
    f = np.zeros(grid.SHAPE)
    if axis == "theta":  # a ridge in (u, v): only a wrong angle costs
        f[5:12, 5:12, 2] = 1.0
        cells = 0.2 / np.sqrt(2 / np.pi)
        sigma = PoseUncertainty.of(1e-3, part * cells * 30)
    else:  # any angle will do; u and v both cost: (1 - sqrt(2 / pi) sigma)^2
        f[8, 8, :] = 1.0
        cells = (1 - np.sqrt(0.8)) / np.sqrt(2 / np.pi)
        sigma = PoseUncertainty.of(part * cells * 10, 1e-3)
    f[20:31, 20:40, :] = 0.8
    (plans,) = Planner(COARSE, 0).plans(scene(), networks(fcn=f), [sigma])
    (q,) = (planned.q for planned in plans if planned.method == ROBUST)
    assert (q[0] < 0) == kept
    (best,) = (planned.q for planned in plans if planned.method == BEST)
    assert best[0] < 0


def poses(
    name="cup", seed=0, cells=CELLS, **functions
) -> dict[tuple[tuple[float, float], str, str], tuple[float, ...]]:
    uncertainties = [PoseUncertainty.of(*cell) for cell in cells]
    plans = Planner(COARSE, seed).plans(scene(name), networks(**functions), uncertainties)
    return {
        (cell, p.method, p.network): tuple(p.q) for cell, planned in zip(cells, plans, strict=True) for p in planned
    }


def test_ties_are_drawn_by_seed_object_and_network_alone():
    """The same for any number of uncertainties and other networks; else another draw, all poses equally likely."""
    f = peaked((10, 10, 3), (22, 33, 0))  # images of each other by half a turn
    f[:] = np.where(f == 1, f, 0)
    one = poses(a=f, b=f)
    alone = poses(cells=CELLS[1:2], b=f)
    assert alone.items() <= one.items()
    assert len({q for (_, method, network), q in one.items() if (method, network) == ("Best Grasp", "a")}) == 1
    for method in ("Best Grasp", "Robust Best Grasp"):
        key = CELLS[0], method, "a"
        by_name = [poses(name=f"cup-{i}", cells=CELLS[:1], a=f)[key] for i in range(60)]
        by_seed = [poses(seed=i, cells=CELLS[:1], a=f)[key] for i in range(60)]
        many = poses(cells=CELLS[:1], **{f"net-{i}": f for i in range(60)})
        by_network = [q for (_, m, network), q in many.items() if m == method]
        for drawn in (by_name, by_seed, by_network):
            left = sum(q[0] < 0 for q in drawn)
            assert 10 < left < 50 and len(set(drawn)) == 2


def test_a_bench_grasps_a_moved_object_where_the_camera_sees_it():
    """In DART: a box that is turned and shifted, seen from above, held across its middle and missed beside it."""
    box = trimesh.creation.box([0.11, 0.04, 0.05])
    resting = Resting(box, box, translation(0, 0, 0.025))
    shift, theta = np.array([0.08, -0.05]), 1.1
    depth = render_depth(box, T_world_scene(shift, theta) @ resting.T_world_object, CAMERA)
    seen = Scene("box", height_map(depth, CAMERA), shift, theta)
    bench = Bench(resting, Rig(PHYSICS, GRIPPER, ATTEMPT), seen)
    good = np.round(grid.to_index(move_pose(np.array([0, 0, np.pi / 2]), shift, theta))).astype(int)
    f = networks(good=peaked(tuple(good)), poor=peaked((25, 5, 0)))
    rows = trials_of_object(seen, bench, Planner(COARSE, 0), f, [(0.1, 0.1)], ERRORS[:1], None)
    outcomes = {(row.method, row.network): (row.success, row.outcome) for row in rows}
    assert outcomes == {
        ("Centroid", ""): (True, "held"),
        ("Best Grasp", "good"): (True, "held"),
        ("Robust Best Grasp", "good"): (True, "held"),
        ("Best Grasp", "poor"): (False, "untouched"),
        ("Robust Best Grasp", "poor"): (False, "untouched"),
    }
    q = np.array([rows[0].u_m, rows[0].v_m, rows[0].theta_rad])
    assert len(bench.grasp(q, film=True).frames) > 10
    assert not bench.grasp(q).frames
