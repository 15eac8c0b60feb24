"""The uncertainty of the arm from its recordings."""

from __future__ import annotations

import dataclasses
import tracemalloc

import numpy as np
import pandas as pd
import pytest
from test_robot_recording import CONDITION, TOPICS, trial, write_trial

from graspfn.robot.analyse import analyse, independent_errors, pose_errors, sigma_interval, uncertainty
from graspfn.robot.trial import RecordingError


def draw(n: int, rng: np.random.Generator, uv_mm=6.2, theta_deg=4.7, bias=(0, 0, 0)) -> np.ndarray:
    sigma = np.array([uv_mm / 1000, uv_mm / 1000, np.radians(theta_deg)])
    errors = rng.normal(size=(n, 3)) * sigma + np.array(bias)
    errors[:, 2] = (errors[:, 2] + np.pi / 2) % np.pi - np.pi / 2
    return errors


@pytest.mark.parametrize(("uv_mm", "theta_deg"), [(6.2, 4.7), (20, 15)])
def test_a_known_sigma_is_recovered_whatever_the_bias(uv_mm, theta_deg):
    bias = (0.01, -0.02, np.radians(88))
    found = uncertainty(draw(20_000, np.random.default_rng(0), uv_mm, theta_deg, bias))
    for axis in ("u", "v", "uv"):
        assert found[f"estimated_{axis}_mm"] == pytest.approx(uv_mm, rel=0.02)
    assert found["estimated_theta_deg"] == pytest.approx(theta_deg, rel=0.02)
    assert found["bias_u_mm"] == pytest.approx(10, abs=0.6)
    assert found["bias_v_mm"] == pytest.approx(-20, abs=0.6)
    assert found["bias_theta_deg"] == pytest.approx(88, abs=0.5)


def test_intervals_cover_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(1)
    rows = [uncertainty(draw(30, rng)) for _ in range(1000)]
    for name, truth in (("uv_mm", 6.2), ("theta_deg", 4.7)):
        above = np.mean([r[f"estimated_{name}_low"] > truth for r in rows])
        below = np.mean([r[f"estimated_{name}_high"] < truth for r in rows])
        assert 0.01 < above < 0.04 and 0.01 < below < 0.04
        assert all(r[f"estimated_{name}_low"] < r[f"estimated_{name}"] < r[f"estimated_{name}_high"] for r in rows)


def test_each_axis_has_the_spread_about_its_own_mean_even_of_two_trials():
    errors = np.array([[0.001, 0.010, 0.1], [0.003, 0.004, 0.2]])
    found = uncertainty(errors)
    u, v, theta = errors.std(axis=0, ddof=1) * [1000, 1000, 180 / np.pi]
    assert found["estimated_u_mm"] == pytest.approx(u)
    assert found["estimated_v_mm"] == pytest.approx(v)
    assert found["estimated_uv_mm"] == pytest.approx(np.sqrt((u**2 + v**2) / 2))
    assert found["estimated_theta_deg"] == pytest.approx(theta)
    assert 0 < found["estimated_theta_deg_low"] < theta < found["estimated_theta_deg_high"] < np.inf


def test_one_trial_says_nothing_about_spread():
    value, low, high = sigma_interval(0.0, 0)
    assert np.isnan(value) and (low, high) == (0, np.inf)
    assert np.isnan(uncertainty(np.array([[0.001, 0.002, 0.1]]))["estimated_uv_mm"])


def record(folder, errors, **condition):
    """One recording per error, commanded near the wrap of theta."""
    rng = np.random.default_rng(5)
    small = np.full((4, 6), 0.4, np.float32)
    for i, error in enumerate(errors):
        q = np.array([*rng.uniform(-0.1, 0.1, 2), rng.uniform(3.0, 3.3) % np.pi])
        reached = q + error
        changed = dataclasses.replace(CONDITION, object=f"cup-{i // 5}", placement=str(i % 5), **condition)
        made = trial(condition=changed, depth=small, commanded=q, achieved=reached, success=i % 3 > 0)
        name = "-".join(str(value) for value in dataclasses.astuple(changed)).replace(" ", "_")
        write_trial(folder / f"{name}.mcap", made, TOPICS, "16UC1")


def test_recordings_become_the_two_tables(tmp_path):
    rng = np.random.default_rng(2)
    narrow, wide = draw(25, rng), draw(25, rng, 20, 15)
    record(tmp_path, narrow)
    record(tmp_path, wide, sigma_uv_mm=20.0, sigma_theta_deg=15.0)
    trials, found = analyse(tmp_path.glob("*.mcap"), TOPICS)
    assert len(trials) == 50
    assert trials.success.dtype == bool and trials.simulated.all()
    assert trials.groupby("sigma_uv_mm").success.sum().tolist() == [16, 16]
    assert found[["sigma_uv_mm", "sigma_theta_deg"]].values.tolist() == [[6.2, 4.7], [20.0, 15.0]]
    for row, errors in zip(found.to_dict("records"), (narrow, wide), strict=True):
        # The slow way: u and v pooled about their means, theta about its own.
        uv = np.sqrt((errors[:, :2] - errors[:, :2].mean(axis=0)).var(ddof=1, axis=0).mean()) * 1000
        assert row["estimated_uv_mm"] == pytest.approx(uv, rel=1e-6)
        assert row["estimated_theta_deg"] == pytest.approx(np.degrees(errors[:, 2].std(ddof=1)), rel=0.02)
        assert (row["trials"], row["draws"]) == (25, 25)


def test_methods_that_shared_their_errors_add_no_observations(tmp_path):
    errors = draw(10, np.random.default_rng(3))
    record(tmp_path, errors)
    _, alone = analyse(tmp_path.glob("*.mcap"), TOPICS)
    record(tmp_path, errors, method="Best Grasp")
    trials, both = analyse(tmp_path.glob("*.mcap"), TOPICS)
    assert len(trials) == 20
    assert (both.trials.item(), both.draws.item()) == (20, 10)
    columns = [name for name in both if name != "trials"]
    np.testing.assert_allclose(both[columns].astype(float), alone[columns].astype(float), rtol=1e-6)


def table(objects: str, reached: np.ndarray) -> pd.DataFrame:
    """Trials of placement 0 of objects of one letter each, all sent to 0 and reaching reached (n, 3)."""
    rows = pd.DataFrame({"object": list(objects), "placement": "0"})
    rows[["u_m", "v_m", "theta_rad"]] = 0.0
    rows[["reached_u_m", "reached_v_m", "reached_theta_rad"]] = reached
    return rows


def test_equal_errors_of_different_placements_are_all_observations():
    assert len(independent_errors(table("ab", np.zeros((2, 3))))) == 2
    assert len(independent_errors(table("ab", np.zeros((2, 3))).assign(object="a", placement=["0", "1"]))) == 2


@pytest.mark.parametrize("axis", range(3))
def test_different_errors_of_one_placement_are_all_observations(axis):
    """A tenth of a micrometre, or of a microradian, apart; but not what rounding makes of one error."""
    reached = np.full((3, 3), 0.01)
    reached[1, axis] += 1e-7
    reached[2, axis] += 1e-16
    assert len(independent_errors(table("aaa", reached))) == 2


def test_errors_are_what_was_reached_less_what_was_commanded():
    rows = table("a", np.array([[0.003, -0.002, 3.1]])).assign(u_m=0.001, v_m=0.004, theta_rad=0.1)
    np.testing.assert_allclose(pose_errors(rows), [[0.002, -0.006, 3.0 - np.pi]])


def test_the_same_trial_twice_is_refused(tmp_path):
    """By the names of the two, the first of more, and no others."""
    for name, placement in (("z", "0"), ("a", "2"), ("b", "2"), ("c", "3"), ("d", "3")):
        made = trial(condition=dataclasses.replace(CONDITION, placement=placement))
        write_trial(tmp_path / f"{name}.mcap", made, TOPICS, "16UC1")
    with pytest.raises(RecordingError, match=r"^a\.mcap and b\.mcap: two recordings of the same trial"):
        analyse(tmp_path.glob("*.mcap"), TOPICS)
    with pytest.raises(RecordingError, match="no recordings"):
        analyse([], TOPICS)


def test_the_order_of_files_does_not_matter(tmp_path):
    record(tmp_path, draw(6, np.random.default_rng(4)))
    paths = sorted(tmp_path.glob("*.mcap"))
    for one, other in zip(analyse(paths, TOPICS), analyse(paths[::-1], TOPICS), strict=True):
        pd.testing.assert_frame_equal(one, other)


def test_memory_does_not_grow_with_the_recordings(tmp_path):
    paths = []
    for i in range(6):
        paths.append(tmp_path / f"{i}.mcap")
        changed = dataclasses.replace(CONDITION, placement=str(i))
        write_trial(paths[-1], trial(i, condition=changed), TOPICS, "32FC1")
    peaks = []
    for count in (2, 6):
        tracemalloc.start()
        analyse(paths[:count], TOPICS)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] + 1e6  # an image alone is 1.2 MB
