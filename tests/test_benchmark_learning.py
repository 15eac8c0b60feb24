"""What benchmarks/learning.py and benchmarks/resolution.py judge by."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

from graspfn.evaluation.expected import Attempts
from graspfn.geometry import grid
from graspfn.learning.targets import GraspTargets

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
import learning
import resolution


def test_average_precision_is_one_of_a_perfect_order_and_the_base_rate_of_none():
    rng = np.random.default_rng(0)
    positive = rng.random(20000) < 0.1
    assert learning.average_precision(positive + rng.random(20000) / 2, positive) == 1
    assert learning.average_precision(rng.random(20000), positive) == pytest.approx(0.1, abs=0.01)
    # Ranks 1 and 3 of four: (1/1 + 2/3) / 2.
    ranked = learning.average_precision(np.array([0.9, 0.8, 0.7, 0.1]), np.array([True, False, True, False]))
    assert ranked == pytest.approx(5 / 6)


def test_elongation_is_the_ratio_of_a_rectangles_sides():
    mask = np.zeros((132, 176), dtype=bool)
    mask[40:60, 50:110] = True
    assert learning.elongation(mask) == pytest.approx(3, rel=0.01)


def test_the_binomial_loss_is_least_at_the_rate():
    scores = torch.full((1, 1, 1, 1), 2.0)  # two of five

    def loss(share):
        logits = torch.tensor([1 - share, 0, 0, 0, 0, share]).clamp(min=1e-9).log().view(1, 1, 1, 1, 6)
        return learning.binomial_loss(logits, scores).item()

    assert min((0.2, 0.3, 0.4, 0.5, 0.6), key=loss) == 0.4
    beyond = torch.full((1, 1, 1, 1), np.nextafter(np.float32(5), np.float32(6)))  # as a moved label can be rounded
    assert learning.binomial_loss(torch.zeros(1, 1, 1, 1, 6), beyond).item() == pytest.approx(np.log(2))


@pytest.mark.parametrize("finer", resolution.FINER)
def test_binning_keeps_every_attempt_and_finds_the_middle_of_what_holds(finer):
    q = grid.sample_cells(4, np.random.default_rng(0))
    centre = np.array([0.013, -0.022, 0.4])
    turned = abs(grid.angle_difference(q[..., 2], np.full((), centre[2])))
    held = (np.linalg.norm(q[..., :2] - centre[:2], axis=-1) < 0.03) & (turned < np.radians(50))
    attempts = Attempts(q, held)
    in_bins, made = resolution.binned(attempts, finer)
    assert in_bins.sum() == pytest.approx(held.sum()) and made.sum() == pytest.approx(held.size)
    found = resolution.best_pose(in_bins, made, (10, 20))
    assert abs(found[:2] - centre[:2]).max() < 0.006
    assert abs(grid.angle_difference(found[2], centre[2])) < np.radians(12)


def test_attempts_that_move_are_neither_lost_nor_blurred():
    """Against the labels' own interpolation, which is unbiased too; unmoved they are the labels themselves."""
    seeds, rng = np.array([3, 4]), np.random.default_rng(0)
    held = np.zeros((2, *grid.SHAPE, 5), dtype=bool)
    held[:, 12:20, 18:27, 1:4] = rng.random((2, 8, 9, 3, 5)) < np.linspace(0.1, 1, 9)[:, None, None]
    motions = {"shift_u_m": [0, 0.031, 0.03, 0.01], "shift_v_m": [0, 0.02, -0.02, 0], "theta_rad": [0, 0.3, 2.0, 1.0]}
    flags = {"mirrored": [False, True, False, False], "empty": [False, False, False, True]}
    table = pd.DataFrame({"row": [0, 1, 0, 0], **motions, **flags, "noise_seed": 0})
    counts = learning.AttemptTargets(held, seeds, table).batch(range(4)).numpy()
    successes = held.sum(axis=-1).astype(np.uint8)
    moved = GraspTargets(successes, 5, table).batch(list(range(4))).numpy() / 5
    assert np.array_equal(counts[0], [successes[0], np.full(grid.SHAPE, 5)])
    for i, row in ((1, 1), (2, 0)):
        assert counts[i, 0].sum() == successes[row].sum()
        shares = counts[i, 0] / counts[i, 1].clip(1)
        assert np.corrcoef(shares.ravel(), moved[i].ravel())[0, 1] > 0.85
        assert shares.max() == 1 and counts[i, 1].min() >= 0
    assert counts[3, 0].sum() == 0 and counts[3, 1].sum() > 0
