"""The uncertainty of the arm from its recordings."""

from __future__ import annotations

import dataclasses
import tracemalloc

import numpy as np
import pandas as pd
import pytest
from test_robot_recording import CONDITION, TOPICS, trial, write_trial

from graspfn.robot.analyse import analyse, independent, people_units, pose_errors
from graspfn.robot.spread import spread
from graspfn.robot.trial import RecordingError


def draw(n: int, rng: np.random.Generator, uv_mm=6.2, theta_deg=4.7, bias=(0, 0, 0)) -> np.ndarray:
    sigma = np.array([uv_mm / 1000, uv_mm / 1000, np.radians(theta_deg)])
    errors = rng.normal(size=(n, 3)) * sigma + np.array(bias)
    errors[:, 2] = (errors[:, 2] + np.pi / 2) % np.pi - np.pi / 2
    return errors


@pytest.mark.parametrize(("uv_mm", "theta_deg"), [(6.2, 4.7), (20, 15)])
def test_a_known_sigma_is_recovered_whatever_the_bias(uv_mm, theta_deg):
    """Also where the angle wraps."""
    bias = (0.01, -0.02, np.radians(88))
    found = spread(people_units(draw(20_000, np.random.default_rng(0), uv_mm, theta_deg, bias)))
    for i, (sigma, offset) in enumerate(((uv_mm, 10), (uv_mm, -20), (theta_deg, 88))):
        assert found.sigma[i].value == pytest.approx(sigma, rel=0.02)
        assert found.bias[i].value == pytest.approx(offset, abs=0.6)
    assert found.sigma_uv.value == pytest.approx(uv_mm, rel=0.02)


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
    done = analyse(tmp_path.glob("*.mcap"), TOPICS)
    trials, found = done.trials, done.uncertainty
    assert len(trials) == 50 and done.unused.empty
    assert trials.success.dtype == bool and trials.simulated.all()
    assert trials.groupby("sigma_uv_mm").success.sum().tolist() == [16, 16]
    assert found["condition"].tolist() == ["6.2 mm, 4.7° assumed", "20 mm, 15° assumed"]
    for row, errors in zip(found.to_dict("records"), (narrow, wide), strict=True):
        # The slow way: u and v pooled about their means, theta about its own.
        uv = np.sqrt((errors[:, :2] - errors[:, :2].mean(axis=0)).var(ddof=1, axis=0).mean()) * 1000
        assert row["estimated_uv_mm"] == pytest.approx(uv, rel=1e-6)
        assert row["estimated_theta_deg"] == pytest.approx(np.degrees(errors[:, 2].std(ddof=1)), rel=0.02)
        assert (row["trials"], row["draws"]) == (25, 25)


def test_methods_that_shared_their_errors_add_no_observations(tmp_path):
    errors = draw(10, np.random.default_rng(3))
    record(tmp_path, errors)
    alone = analyse(tmp_path.glob("*.mcap"), TOPICS).uncertainty
    record(tmp_path, errors, method="Best Grasp")
    done = analyse(tmp_path.glob("*.mcap"), TOPICS)
    both = done.uncertainty
    assert len(done.trials) == 20
    assert (both.trials.item(), both.draws.item()) == (20, 10)
    columns = [name for name in both.select_dtypes("number") if name != "trials"]
    np.testing.assert_allclose(both[columns].astype(float), alone[columns].astype(float), rtol=1e-6)


def table(objects: str, reached: np.ndarray) -> pd.DataFrame:
    """Trials of placement 0 of objects of one letter each, all sent to 0 and reaching reached (n, 3)."""
    rows = pd.DataFrame({"object": list(objects), "placement": "0"})
    rows[["u_m", "v_m", "theta_rad"]] = 0.0
    rows[["reached_u_m", "reached_v_m", "reached_theta_rad"]] = reached
    return rows


def test_equal_errors_of_different_placements_are_all_observations():
    assert len(independent(table("ab", np.zeros((2, 3))))) == 2
    assert len(independent(table("ab", np.zeros((2, 3))).assign(object="a", placement=["0", "1"]))) == 2


@pytest.mark.parametrize("axis", range(3))
def test_different_errors_of_one_placement_are_all_observations(axis):
    """A tenth of a micrometre, or of a microradian, apart; but not what rounding makes of one error."""
    reached = np.full((3, 3), 0.01)
    reached[1, axis] += 1e-7
    reached[2, axis] += 1e-16
    assert len(independent(table("aaa", reached))) == 2


def test_errors_are_what_was_reached_less_what_was_commanded():
    rows = table("a", np.array([[0.003, -0.002, 3.1]])).assign(u_m=0.001, v_m=0.004, theta_rad=0.1)
    np.testing.assert_allclose(pose_errors(rows), [[0.002, -0.006, 3.0 - np.pi]])


def test_the_same_trial_twice_counts_once_and_is_named(tmp_path):
    for name, placement in (("z", "0"), ("a", "2"), ("b", "2"), ("c", "3"), ("d", "3")):
        made = trial(condition=dataclasses.replace(CONDITION, placement=placement))
        write_trial(tmp_path / f"{name}.mcap", made, TOPICS, "16UC1")
    done = analyse(tmp_path.glob("*.mcap"), TOPICS)
    assert done.trials["file"].tolist() == ["z.mcap", "a.mcap", "c.mcap"]
    for file, reason in zip(["b.mcap", "d.mcap"], done.unused["reason"], strict=True):
        assert reason.startswith(f"{file}: the same trial as ")


def test_a_bad_bag_costs_itself_alone(tmp_path):
    """And the analysis fails where none is left, or more are bad than it may be."""
    record(tmp_path, draw(8, np.random.default_rng(0)))
    good = analyse(tmp_path.glob("*.mcap"), TOPICS)
    (tmp_path / "bad.mcap").write_bytes(b"no MCAP")
    done = analyse(tmp_path.glob("*.mcap"), TOPICS)
    pd.testing.assert_frame_equal(done.trials, good.trials)
    pd.testing.assert_frame_equal(done.uncertainty, good.uncertainty)
    assert done.unused["file"].tolist() == ["bad.mcap"]
    assert done.unused["reason"].item() == f"{tmp_path / 'bad.mcap'}: not an MCAP file"
    done.check(0.2)
    with pytest.raises(RecordingError, match=r"1 of 9 bags .* robot.max_failed .*bad.mcap: not an MCAP"):
        done.check(0.1)
    with pytest.raises(RecordingError, match=r"1 of 1 bags cannot be used; the first: .*bad.mcap"):
        analyse([tmp_path / "bad.mcap"], TOPICS).check(1)
    with pytest.raises(RecordingError, match="no recordings"):
        analyse([], TOPICS).check(1)


def test_what_was_injected_is_one_condition_whatever_was_assumed(tmp_path):
    rng = np.random.default_rng(1)
    known = {"injected_uv_mm": 0.0, "injected_theta_deg": 0.0}
    record(tmp_path, draw(6, rng), **known)
    record(tmp_path, draw(6, rng), sigma_uv_mm=20.0, **known)
    record(tmp_path, draw(6, rng))
    found = analyse(tmp_path.glob("*.mcap"), TOPICS).uncertainty.set_index("condition")
    assert found["draws"].to_dict() == {"0 mm, 0° injected": 12, "6.2 mm, 4.7° assumed": 6}


def test_values_that_cannot_be_are_named_and_not_in_sigma(tmp_path):
    """A reached pose that is the command, an axis turned by 90 degrees, a pose that no arm ends at."""
    errors = draw(24, np.random.default_rng(2))
    errors[3], errors[7, 2], errors[11, 0] = 0, np.radians(92), 0.7
    record(tmp_path, errors, simulated=False)
    done = analyse(tmp_path.glob("*.mcap"), TOPICS)
    doubts = done.trials.set_index(["object", "placement"])["doubts"]
    for at, says in (
        (("cup-0", "3"), "to the last bit"),
        (("cup-1", "2"), "turned by"),
        (("cup-2", "1"), "0.7 m from"),
    ):
        assert says in doubts[at]
    assert (doubts != "").sum() == 3 and len(done.trials) == 24
    good = np.delete(errors, [3, 7, 11], axis=0)
    odd = done.oddities()
    assert len(odd) == 3 and all(": not in Sigma: " in line for line in odd)
    expected = spread(people_units(good))
    np.testing.assert_allclose(done.measured[0].spread.covariance, expected.covariance, rtol=1e-5)


def test_the_order_of_files_does_not_matter(tmp_path):
    record(tmp_path, draw(6, np.random.default_rng(4)))
    paths = sorted(tmp_path.glob("*.mcap"))
    one, other = analyse(paths, TOPICS), analyse(paths[::-1], TOPICS)
    pd.testing.assert_frame_equal(one.trials, other.trials)
    pd.testing.assert_frame_equal(one.uncertainty, other.uncertainty)


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
