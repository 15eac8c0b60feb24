"""Plans on disturbed images: what is tried, what is counted, and the table and figure of it."""

from __future__ import annotations

import dataclasses
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import trimesh
from physics_params import ATTEMPT, GRIPPER, PARAMS, PHYSICS

from graspfn.evaluation import bench
from graspfn.evaluation.expected import Attempts
from graspfn.evaluation.planner import TRUE, Planner
from graspfn.evaluation.robustness import Case, Conditions, Trained, disturb_case, near
from graspfn.geometry import grid
from graspfn.geometry.transforms import translation
from graspfn.imaging.camera import Camera
from graspfn.imaging.disturbances import CLEAN
from graspfn.learning.networks import build_network
from graspfn.meshes.placed import Resting
from graspfn.params import Network, Plan
from graspfn.physics.attempt import Outcome, Result
from graspfn.physics.world import Rig
from graspfn.planning.methods import BEST, CENTROID, ROBUST
from graspfn.reporting.figures.robustness import draw_robustness, plates
from graspfn.reporting.figures.style import png_bytes
from graspfn.reporting.layout import to_html, to_markdown
from graspfn.reporting.robustness import COLUMNS, caption_robustness, expectations, layout_robustness, robustness_table
from graspfn.workflow.files import write_parquet

ROOT = Path(__file__).parents[1]
FEW = dataclasses.replace(
    PARAMS.disturb,
    errors_per_object=2,
    offset_mm=(0.0, 10.0),
    tilt_deg=(0.0, 40.0),
    wave_mm=(0.0,),
    scale_percent=(0.0,),
    holes_percent=(0.0,),
    step_mm=(0.0,),
    height_mm=(0.0,),
)
CONDITIONS = Conditions(
    rig=Rig(PHYSICS, GRIPPER, ATTEMPT),
    planner=Planner(Plan(1, 1), 0),
    camera=Camera.from_params(PARAMS.camera),
    renderer="embree",
    table=PARAMS.table,
    noise=PARAMS.noise,
    others={},
    disturb=FEW,
    seed=0,
)
BLADE = trimesh.creation.box((0.03, 0.12, 0.05))
RESTING = Resting(BLADE, BLADE, translation(0, 0, 0.025))


def trained() -> list[Trained]:
    """Networks that have learned nothing, but see what they are given."""
    return [
        Trained(name, 0, kind, build_network(Network("fcn", 4, 1e-3, 1e-2, input=kind), 0))
        for name, kind in (("maps", "height_map"), ("images", "depth"))
    ]


def case(resting: Resting | None = RESTING) -> Case:
    held = np.zeros((*grid.SHAPE, 5), bool)
    held[14:19, 20:24, 5] = held[14:19, 20:24, 0] = True
    attempts = Attempts(grid.sample_cells(5, np.random.default_rng(0)), held)
    if resting is None:
        return Case("empty table 0", None, np.zeros(2), 0.0, None)
    return Case("blade", resting, np.array([0.02, -0.03]), 0.4, attempts)


class Sure:
    """Holds whatever is tried, and counts."""

    asked = 0

    def __init__(self, *_):
        Sure.asked = 0

    def run(self, _, film=False):
        Sure.asked += 1
        return Result(Outcome.HELD)


@pytest.fixture(scope="module")
def plans() -> pd.DataFrame:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bench, "Grasper", Sure)
        tried = disturb_case(case(), CONDITIONS, trained())
        asked = Sure.asked
        patch.setattr(bench, "Grasper", None)  # nothing else is tried
        empty = disturb_case(case(resting=None), CONDITIONS, trained())
    table = pd.DataFrame([*tried, *empty])
    table.attrs["asked"] = asked
    return table


def test_every_shot_is_planned_on_by_every_method_in_both_ways(plans):
    own = plans[(plans["id"] == "blade") & (plans["network"] != TRUE)]
    for (disturbance, amount), group in own.groupby(["disturbance", "amount"]):
        keys = set(zip(group["table_fit"], group["method"], group["network"], strict=True))
        with_fit = {(True, CENTROID, ""), *((True, method, "maps") for method in (BEST, ROBUST))}
        believed = {(False, method, network) for _, method, network in with_fit}
        images = {(False, method, "images") for method in (BEST, ROBUST)}  # which believe the camera's pose anyway
        assert keys == with_fit | believed | images, (disturbance, amount)
        assert len(group) == len(keys)
    true = plans[plans["network"] == TRUE]
    assert set(true["disturbance"]) == {CLEAN} and true["table_fit"].all() and len(true) == 2


def test_amounts_of_nothing_leave_every_plan_as_it_is(plans):
    key = ["id", "table_fit", "method", "network"]
    own = plans[(plans["amount"] == 0) & (plans["network"] != TRUE)].set_index(key)
    clean = own[own["disturbance"] == CLEAN]
    for name in ("offset", "tilt", "waviness", "scale", "holes", "quantisation", "camera height"):
        for column in ("u_m", "v_m", "theta_rad", "held", "expected", "highest"):
            here = own.loc[own["disturbance"] == name, column]
            np.testing.assert_allclose(here, clean.loc[here.index, column], atol=1e-6, err_msg=f"{name} {column}")
    assert own["stays"].all()


def test_a_refused_image_is_no_grasp_and_says_why(plans):
    refused = plans[(plans["refused"] != "") & ~plans["empty"]]
    assert set(zip(refused["disturbance"], refused["amount"], strict=True)) == {("tilt", 40.0)}
    assert refused.loc[refused["table_fit"], "refused"].str.contains("table.max_tilt_deg").all()
    believed = refused[~refused["table_fit"]].set_index("network")["refused"]
    assert believed.loc[["images"]].str.contains("takes the paper's 14 px").all()
    assert believed.loc[["maps", ""]].str.startswith("no object").all()
    assert refused["u_m"].isna().all() and (refused["held"] == 0).all()
    assert set(refused.loc[refused["table_fit"], "method"]) == {CENTROID, BEST, ROBUST}
    tried = refused[refused["id"] == "blade"]
    assert (tried["trials"] == FEW.errors_per_object).all()  # which fail
    assert not refused["stays"].any()


def test_an_empty_table_gets_no_grasp_and_what_the_network_scores_there_is_kept(plans):
    empty = plans[plans["empty"]]
    assert empty["u_m"].isna().all() and (empty["refused"] != "").all()
    shown = empty[(empty["network"] != "") & empty["refused"].str.startswith("no object")]
    assert len(shown) and (shown["highest"] > 0).all()


def test_each_plan_is_tried_with_all_errors_and_no_pose_twice(plans):
    tried = plans[plans["id"] == "blade"]
    found = tried["u_m"].notna()
    assert (tried["trials"] == 2).all() and (tried["held"] == np.where(found, 2, 0)).all()
    poses = tried.loc[found, ["u_m", "v_m", "theta_rad"]].drop_duplicates()
    assert plans.attrs["asked"] <= 2 * len(poses) < 2 * found.sum()
    assert (plans.loc[plans["id"] != "blade", "trials"] == 0).all()


def test_an_offset_moves_no_plan_where_the_table_is_found(plans):
    own = plans[(plans["disturbance"] == "offset") & (plans["method"] == CENTROID) & ~plans["empty"]]
    assert own.loc[own["table_fit"], "stays"].all()


@pytest.mark.parametrize(
    ("other", "same"),
    [
        (np.array([0.009, 0.0, 0.1]), True),
        (np.array([0.011, 0.0, 0.1]), False),
        (np.array([0.0, 0.0, 0.1 - np.radians(14)]), True),  # past the half turn
        (np.array([0.0, 0.0, np.pi + 0.1 - np.radians(14)]), True),
        (np.array([0.0, 0.0, 0.1 + np.radians(16)]), False),
        (None, False),
    ],
)
def test_a_plan_stays_within_a_centimetre_and_fifteen_degrees(other, same):
    assert near(np.array([0.0, 0.0, 0.1]), other) is same
    assert near(None, None)


def test_the_table_has_its_columns_and_says_what_was_made(plans, tmp_path):
    table = robustness_table(plans)
    assert list(table.columns) == COLUMNS
    assert not table.duplicated(["disturbance", "amount", "method", "network", "table_fit"]).any()
    clean = table[table["disturbance"] == CLEAN]
    assert (clean["stay_share"] == 1).all() and (clean["expected_change"].dropna() == 0).all()
    assert (table["planned"] == 1).all() and (table["trials"] == 2).all() and (table["objects"] == 1).all()
    assert (table["success"] == 1).sum() and (table.loc[table["refused"] > 0, ["success", "expected"]] == 0).all(
        axis=None
    )
    assert table["refused"].sum() == (plans["refused"].ne("") & ~plans["empty"]).sum() > 0
    scores = plans[plans["empty"]].groupby(["disturbance", "amount", "network", "table_fit"])["highest"].max()
    maps = table[(table["network"] == "maps") & table["table_fit"]]
    for line in maps.itertuples():
        assert line.highest_score == pytest.approx(scores[line.disturbance, line.amount, "maps", True])
    assert table.loc[table["method"] == CENTROID, "highest_score"].isna().all()
    write_parquet(tmp_path / "robustness.parquet", plans)
    pd.testing.assert_frame_equal(robustness_table(pd.read_parquet(tmp_path / "robustness.parquet")), table)


def test_expected_success_is_known_for_labelled_objects_alone():
    made = {"id": ["a", "a", "a", "b"], "expected": [0.5, np.nan, 0.7, np.nan], "effective": [40, 0, 3, 0]}
    plans = pd.DataFrame(made | {"u_m": [0.0, np.nan, 0.0, np.nan]})
    np.testing.assert_array_equal(expectations(plans), [0.5, 0.0, np.nan, np.nan])


def test_the_layout_and_the_figure_show_every_disturbance(plans):
    table = robustness_table(plans)
    caption = caption_robustness(table, FEW, "made")
    assert "of 1 test object," in caption and "refused" in caption and "true function" in caption
    layout = layout_robustness(table, caption)
    text = to_markdown(layout)
    assert "| offset +10 mm |" in text and "| tilt 40 deg |" in text and caption in text
    assert [len(block.rows) for block in layout.blocks] == [11, 11]
    assert all(len(row.cells) == len(layout.columns) for block in layout.blocks for row in block.rows)
    assert "<table" in to_html(layout)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert png_bytes(draw_robustness(table, "maps")).startswith(b"\x89PNG")
    assert [plate.name for plate in plates(table, ["maps", "images"])] == ["robustness", "robustness_images"]
