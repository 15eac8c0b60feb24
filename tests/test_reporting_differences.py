import numpy as np
import pytest
from made_trials import LABELLED, TRUE, account, simulated_trials

from graspfn.evaluation.statistics import resampled
from graspfn.reporting import layout, tables
from graspfn.reporting.differences import EXPECTED, SHARE, TRIALS, compared, differences, share_of
from graspfn.reporting.plans import graspable_objects, per_object, plans_of

METHODS = ("Centroid", "Best Grasp", "Robust Best Grasp")
ROBUST, BEST, CENTROID = ("Robust Best Grasp", "fcn"), ("Best Grasp", "fcn"), ("Centroid", "")


@pytest.fixture(scope="module")
def plans():
    return plans_of(simulated_trials())


def test_differences_are_paired_by_object_and_change_sign_with_their_order(plans):
    robust, best, centroid = ("Robust Best Grasp", "fcn"), ("Best Grasp", "fcn"), ("Centroid", "")
    found = compared(plans, robust, best)
    assert found.value == pytest.approx(0.2) and found.objects == 10
    back = compared(plans, best, robust)
    assert (back.value, back.low, back.high) == pytest.approx((-found.value, -found.high, -found.low))
    whole = compared(plans, robust, centroid).value
    assert whole == pytest.approx(found.value + compared(plans, best, centroid).value)
    assert compared(plans, robust, robust).high == 0  # less spread than either has: they are paired


def test_the_gap_to_the_ceiling_is_over_the_objects_that_have_one(plans):
    found = compared(plans, ("Robust Best Grasp", TRUE), ("Robust Best Grasp", "fcn"))
    assert found.objects == LABELLED and found.value == pytest.approx(1 / LABELLED)
    assert compared(plans, ("Robust Best Grasp", TRUE), ("Robust Best Grasp", "alexnet")) is None


def test_differences_pair_training_seeds_and_set_each_against_what_has_none():
    trials = simulated_trials(seeds=(0, 1))
    worse = (trials["training_seed"] == 1) & (trials["method"] == "Robust Best Grasp") & (trials["id"] == "o0")
    plans = plans_of(trials.assign(success=trials["success"] & ~worse))
    robust, best = (plans[(plans["method"] == m) & (plans["network"] == "fcn")] for m in METHODS[:0:-1])
    expected = resampled(per_object(robust).to_numpy() - per_object(best).to_numpy())
    found = compared(plans, ("Robust Best Grasp", "fcn"), ("Best Grasp", "fcn"))
    assert found == expected and found.networks == 2
    assert compared(plans, ("Robust Best Grasp", "fcn"), ("Centroid", "")).value == pytest.approx(0.4 - 0.05)


def test_what_is_expected_is_compared_where_both_poses_are_known(plans):
    """Centroid's pose of o1 in one cell rests on too few attempts: that cell of o1 is left out, the others stay."""
    own = plans[plans["network"] != TRUE].assign(expected=np.nan)
    cells = own.groupby(["sigma_theta_deg", "sigma_uv_mm"]).ngroup()
    known = own["id"].isin(["o0", "o1"])
    own.loc[known, "expected"] = 0.5
    own.loc[known & (own["method"] == "Best Grasp"), "expected"] = 0.6
    own.loc[known & (own["method"] == "Best Grasp") & (own["id"] == "o1") & (cells > 0), "expected"] = 0.9
    assert compared(own, BEST, CENTROID, EXPECTED).value == pytest.approx(
        (0.1 + (0.1 + 0.4 * cells.max()) / (1 + cells.max())) / 2
    )
    own.loc[(own["method"] == "Centroid") & (own["id"] == "o1") & (cells == 0), "expected"] = np.nan
    found = compared(own, BEST, CENTROID, EXPECTED)
    assert found.value == pytest.approx((0.1 + 0.4) / 2) and found.objects == 2


def test_the_share_of_the_ceiling_is_a_ratio_of_means_with_the_spread_of_one():
    """fcn holds 7 of the 9 that have a ceiling, it 8. The spread is that of drawing objects and networks anew."""
    robust, ceiling = ("Robust Best Grasp", "fcn"), ("Robust Best Grasp", TRUE)
    plans = plans_of(simulated_trials(seeds=(0, 1)))
    found = compared(plans, robust, ceiling, share=True)
    assert found.value == pytest.approx(7 / 8) and (found.objects, found.networks) == (LABELLED, 2)
    assert compared(plans, robust, ceiling, EXPECTED, share=True).value == pytest.approx(7 / 8)
    assert compared(plans, ceiling, ceiling, share=True).low == 1  # the same objects above and below
    rng = np.random.default_rng(0)
    whole = np.broadcast_to(rng.random((300, 1)) < 0.7, (300, 3)).astype(float)
    part = np.where(rng.random((300, 3)) < 0.1, rng.random((300, 3)) < 0.5, whole) * [0.9, 1.0, 0.95]
    interval = share_of(part, whole)
    drawn = rng.integers(0, 300, (4000, 300, 1)), rng.integers(0, 3, (4000, 1, 3))
    spread = (part[drawn].mean(axis=(1, 2)) / whole[drawn].mean(axis=(1, 2))).std()
    assert interval.high - interval.value == pytest.approx(1.968 * spread, rel=0.05)
    assert interval.value == part.mean() / whole.mean() and interval.networks == 3
    assert share_of(part * 0.0, whole * 0.0) is None


def test_the_share_of_all_cells_is_that_of_the_means(plans):
    """What is expected of fcn falls by half in one cell: of the means that is an eighth, in that cell a half."""
    cell = (plans["sigma_theta_deg"] == 10.0) & (plans["sigma_uv_mm"] == 5.0)
    fcn = (plans["network"] == "fcn") & (plans["method"] == "Robust Best Grasp")
    table = differences(plans.assign(expected=plans["expected"].where(~(cell & fcn), plans["expected"] / 2)), ())
    lines = table[(table["comparison"] == SHARE) & (table["by"] == EXPECTED)]
    assert lines["value"].tolist() == pytest.approx([7 / 16, 7 / 8, 7 / 8, 7 / 8, 7 / 8 * 7 / 8])


def test_every_cell_has_a_line_and_all_together_one_that_is_their_mean(plans):
    table = differences(plans, graspable_objects(account(), 5))
    keys = ["objects_of", "network", "comparison", "by"]
    for _, lines in table[table["by"] == TRIALS].groupby(keys):
        pooled = lines["sigma_uv_mm"].isna()
        assert pooled.sum() == 1
        if (lines["comparison"] != SHARE).all():
            assert lines[~pooled]["value"].mean() == pytest.approx(lines[pooled]["value"].item())
    assert not table.duplicated([*keys, "sigma_theta_deg", "sigma_uv_mm"]).any()


def test_the_table_counts_the_cells_that_are_surely_above_zero(plans):
    table = differences(plans, ())
    names = tables.block_names(tables.table1(plans, ()))
    (block,) = layout.layout_differences(table, names, "").blocks
    rows = {row.name: row.cells for row in block.rows}
    own = table[(table["network"] == "fcn") & (table["by"] == TRIALS) & table["sigma_uv_mm"].notna()]
    for comparison, name in (("robust_minus_best", "Robust − Best"), ("best_minus_centroid", "Best − Centroid")):
        lines = own[own["comparison"] == comparison]
        assert rows[f"{name} (fcn), by trials"][-1].rate == f"{(lines['ci_low'] > 0).sum()} of {len(lines)}"
    assert (own["ci_low"] > 0).any() and rows["Robust − Best (fcn), by trials"][-2].rate == "+0.200"
    assert not any(TRUE in name for name in rows)
    assert rows["Robust / Ceiling (fcn), as expected"][-2].rate == "0.875"  # no sign, and nothing to be above 0
    assert rows["Robust / Ceiling (fcn), as expected"][-1].rate == layout.BLANK
