"""Success from weighted attempts, against closed forms, Monte Carlo and its own standard error."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from graspfn.evaluation.expected import FEW, Attempts, expected_success
from graspfn.geometry import grid

CELLS = (5, 10), (20, 10), (20, 40)


def block(q: np.ndarray) -> np.ndarray:
    """Held (...) within 15 mm of the middle along u, 25 mm along v and 0.6 rad of theta = 0.2: not along the cells."""
    turned = grid.angle_difference(q[..., 2], 0.2)
    return (np.abs(q[..., 0]) < 0.015) & (np.abs(q[..., 1]) < 0.025) & (np.abs(turned) < 0.6)


def block_truth(q: np.ndarray, uv: float, theta: float) -> float:
    """E[block] in closed form; theta is wrapped over three half turns."""
    along = [norm.cdf((half - at) / uv) - norm.cdf((-half - at) / uv) for half, at in ((0.015, q[0]), (0.025, q[1]))]
    turns = [k * np.pi + 0.2 - q[2] for k in range(-3, 4)]
    return float(along[0] * along[1] * sum(norm.cdf((t + 0.6) / theta) - norm.cdf((t - 0.6) / theta) for t in turns))


@pytest.mark.parametrize(("uv_mm", "theta_deg"), CELLS)
def test_mean_over_draws_is_the_truth_and_errors_are_their_spread(uv_mm: float, theta_deg: float) -> None:
    q, uv, theta = np.array([0.004, -0.011, 0.7]), uv_mm / 1e3, float(np.radians(theta_deg))
    truth = block_truth(q, uv, theta)
    found = []
    for seed in range(200):
        attempts = grid.sample_cells(5, np.random.default_rng(seed))
        found.append(expected_success(q, uv, theta, Attempts(attempts, block(attempts))))
    values = np.array([one.value for one in found])
    spread = values.std(ddof=1)
    assert abs(values.mean() - truth) < 4 * spread / np.sqrt(len(values)) + 0.003  # a ratio is a little biased
    assert np.mean([one.error**2 for one in found]) ** 0.5 == pytest.approx(spread, rel=0.25)


def test_everything_held_is_certain_within_q_and_lost_beyond() -> None:
    attempts = grid.sample_cells(2, np.random.default_rng(0))
    held = np.ones(attempts.shape[:4], dtype=bool)
    middle = expected_success(np.zeros(3), 0.01, 0.3, Attempts(attempts, held))
    assert middle.value == pytest.approx(1, abs=1e-12) and middle.error == pytest.approx(0, abs=1e-12)
    edge = expected_success(np.array([grid.SHAPE[1] * grid.CELL_M / 2, 0, 0]), 0.01, 0.3, Attempts(attempts, held))
    assert edge.value == pytest.approx(0.5, abs=1e-9)


def test_a_half_turn_of_the_pose_changes_nothing() -> None:
    attempts = grid.sample_cells(3, np.random.default_rng(1))
    one, other = (
        expected_success(np.array([0.01, 0.0, angle]), 0.01, 0.5, Attempts(attempts, block(attempts)))
        for angle in (0.1, 0.1 + np.pi)
    )
    assert one.value == pytest.approx(other.value, abs=1e-9)


def test_effective_attempts_grow_with_the_uncertainty_and_tell_when_there_are_few() -> None:
    attempts = grid.sample_cells(5, np.random.default_rng(2))
    sizes = [
        expected_success(np.zeros(3), s / 1e3, np.radians(t), Attempts(attempts, block(attempts))).effective
        for s, t in CELLS
    ]
    # Of a Gaussian in three dimensions: density of attempts times (4 pi)^(3/2) sigma^3.
    ideal = [5 * (4 * np.pi) ** 1.5 * (s / 10) ** 2 * t / 30 for s, t in CELLS[:2]]
    assert sizes[:2] == pytest.approx(ideal, rel=0.35) and sizes == sorted(sizes)
    assert expected_success(np.zeros(3), 0.002, 0.1, Attempts(attempts, block(attempts))).effective < FEW
    assert np.isnan(expected_success(np.zeros(3), 1e-6, 1e-6, Attempts(attempts, block(attempts))).value)


@pytest.mark.parametrize("u", [0.3, 0.5, 5.0])
def test_far_from_q_nothing_holds_and_that_is_known(u: float) -> None:
    """The image's corner can be half a metre from the object, where its labels have no attempt."""
    attempts = grid.sample_cells(2, np.random.default_rng(0))
    held = np.ones(attempts.shape[:4], dtype=bool)
    found = expected_success(np.array([u, 0.0, 0.3]), 0.005, 0.2, Attempts(attempts, held))
    assert (found.value, found.error) == (0, 0) and found.effective >= FEW
