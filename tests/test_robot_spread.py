"""Sigma of an arm from its errors: intervals that hold the truth, outliers named, sessions no spread."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from graspfn.planning.covariance_file import read_covariance
from graspfn.planning.uncertainty import PlanningError
from graspfn.robot.analyse import Measured
from graspfn.robot.covariance_file import file_name, write_covariance
from graspfn.robot.spread import spread, standard_deviation

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
from spread import CASES, Case, coverage


@pytest.mark.parametrize("name", CASES)
def test_intervals_hold_the_truth_as_often_as_they_say(name):
    """Few samples: the benchmark has thousands, and docs/recordings.md their table."""
    shares = coverage(CASES[name], 50, 250, seed=1)
    assert abs(shares.mean() - 0.95) < 0.015
    assert shares.min() > 0.90


def test_outliers_are_named_and_change_nothing_else():
    case = Case(correlation=(0.8, 0.2, 0.2))
    errors, session = case.draw(100, np.random.default_rng(0))
    clean = spread(errors, session)
    assert not clean.outliers.any()
    wild = np.concatenate([errors, [[200, 0, 0], [0, 0, 70], [20, -20, 0]]])  # the last across the correlation
    found = spread(wild, np.zeros(103))
    assert np.flatnonzero(found.outliers).tolist() == [100, 101, 102]
    np.testing.assert_allclose(found.covariance, clean.covariance)
    assert (found.rows, found.bias) == (100, clean.bias)


def test_many_equal_outliers_do_not_hide_each_other():
    errors, _ = Case().draw(100, np.random.default_rng(1))
    errors[:15] += [150, 0, 0]
    assert np.flatnonzero(spread(errors).outliers).tolist() == list(range(15))


def test_the_offset_of_a_session_is_no_spread():
    case = Case()
    errors, _ = case.draw(60, np.random.default_rng(2))
    session = np.repeat(["a", "b", "c"], 20)
    moved = errors + np.repeat([[0, 0, 0], [30, 0, 0], [0, -30, 20]], 20, axis=0)
    np.testing.assert_allclose(spread(moved, session).covariance, spread(errors, session).covariance)
    assert spread(moved).sigma[0].value > 2 * spread(moved, session).sigma[0].value
    assert spread(moved, session).sessions_sigma[0] > 10


def test_turning_the_axes_turns_the_covariance():
    errors, _ = Case(sigma=(3, 9, 4)).draw(80, np.random.default_rng(3))
    c, s = np.cos(0.7), np.sin(0.7)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    turned = spread(errors @ R.T)
    np.testing.assert_allclose(turned.covariance, R @ spread(errors).covariance @ R.T, rtol=1e-9)
    assert turned.sigma_uv.value == pytest.approx(spread(errors).sigma_uv.value)


def test_errors_that_are_not_gaussian_show():
    rng = np.random.default_rng(4)
    assert spread(rng.normal(size=(200, 3))).normality > 0.05
    assert spread(rng.uniform(size=(200, 3))).normality < 1e-4


@pytest.mark.parametrize("n", range(5))
def test_few_errors_say_little(n):
    found = spread(np.random.default_rng(5).normal(size=(n, 3)))
    assert not found.outliers.any()
    for sigma in (*found.sigma, found.sigma_uv):
        assert (sigma.low, sigma.high) == (0, np.inf) if n < 2 else sigma.low < sigma.value < sigma.high < np.inf
    for bias in found.bias:
        assert (bias.low, bias.high) == (-np.inf, np.inf) if n < 2 else bias.low < bias.value < bias.high


@pytest.mark.parametrize("errors", [np.zeros((30, 3)), np.outer(np.arange(30.0), [1, 0, 0]), np.ones((30, 3))])
def test_errors_without_spread_in_some_direction_are_no_trouble(errors):
    found = spread(errors)
    assert np.isfinite(found.covariance).all() and not found.outliers.any()


def test_no_freedom_no_spread():
    none = standard_deviation(1.0, 0)
    assert np.isnan(none.value) and (none.low, none.high) == (0, np.inf)


def test_the_file_says_all_and_comes_back(tmp_path):
    errors, session = Case(correlation=(0.5, -0.3, 0)).draw(100, np.random.default_rng(6))
    found = spread(errors, session)
    path = tmp_path / file_name("6.2 mm, 4.7° injected")
    assert path.name == "6.2mm-4.7deg-injected.yaml"
    write_covariance(path, Measured("6.2 mm, 4.7° injected", found, ("a.mcap",)))
    scale = np.array([1e-3, 1e-3, np.pi / 180])
    np.testing.assert_allclose(read_covariance(path), found.covariance * np.outer(scale, scale), rtol=1e-9)
    for few in (1, 2, 3):  # too few for a spread in all directions: that of some is singular, that of one is none
        found = spread(errors[:few])
        write_covariance(path, Measured("few", found, ()))
        if few == 1:
            with pytest.raises(PlanningError, match="9 of its 9 numbers are NaN"):
                read_covariance(path)
        else:
            np.testing.assert_allclose(read_covariance(path), found.covariance * np.outer(scale, scale), rtol=1e-9)
    found = spread(errors)
    write_covariance(path, Measured("6.2 mm, 4.7° injected", found, ("a.mcap",)))
    values = yaml.safe_load(path.read_text())
    assert values["units"] == {"u": "mm", "v": "mm", "theta": "deg"}
    assert values["outliers"] == ["a.mcap"] and values["bias"]["u"][1] < values["bias"]["u"][0]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"units": {"u": "mm", "v": "mm"}}, "units: takes u and v in mm or m"),
        ({"units": {"u": "mm", "v": "deg", "theta": "deg"}}, "units: takes"),
        ({"covariance": [[1, 0], [0, 1]]}, r"covariance: has the shape \(2, 2\)"),
        ({"covariance": [[1, 0, 0], [1, 1, 0], [0, 0, 1]]}, "covariance: not symmetric"),
        ({"covariance": [[1, 2, 0], [2, 1, 0], [0, 0, 1]]}, "covariance: not positive semi-definite"),
        ({"covariance": "wide"}, "covariance: takes 3 x 3 numbers"),
        ({"covariance": [[None, 0, 0], [0, 1, 0], [0, 0, 1]]}, "covariance: 1 of its 9 numbers are NaN"),
        ({"units": 3}, "units: takes"),
        ({"units": None}, "units: takes"),
    ],
)
def test_a_file_that_is_no_covariance_is_refused(tmp_path, change, says):
    good = {"units": {"u": "m", "v": "m", "theta": "rad"}, "covariance": np.eye(3).tolist()}
    path = tmp_path / "sigma.yaml"
    path.write_text(yaml.safe_dump(good))
    np.testing.assert_array_equal(read_covariance(path), np.eye(3))
    path.write_text(yaml.safe_dump(good | change))
    with pytest.raises(PlanningError, match=says) as error:
        read_covariance(path)
    assert str(error.value).startswith(f"{path}: ") and "\n" not in str(error.value)
    for text in (b"", b"- a\n", b"{", b"\xff", b"units: {u: m, v: m, theta: rad}\n"):
        path.write_bytes(text)
        with pytest.raises(PlanningError, match="takes YAML with units"):
            read_covariance(path)
