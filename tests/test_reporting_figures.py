import warnings

import numpy as np
import pandas as pd
import pytest
import trimesh
from made_trials import HELD, TRUE, account, name, simulated_trials

from graspfn.evaluation.statistics import resampled_rate
from graspfn.geometry import grid
from graspfn.imaging.camera import Camera
from graspfn.meshes.placed import placed_row
from graspfn.physics.attempt import Frame
from graspfn.reporting import expectation, film, tables
from graspfn.reporting import sizes as object_sizes
from graspfn.reporting.figures import (
    contact_sheet,
    depth_images,
    expected,
    grasp_functions,
    label_outcomes,
    promise,
    registry,
    shading,
    simulated_grasps,
    sizes,
    success,
    training_curves,
)
from graspfn.reporting.figures.shading import TABLE, View, render_scene
from graspfn.reporting.figures.style import pdf_bytes, png_bytes, show_depth, square, window_round
from graspfn.reporting.plans import graspable_objects, of_method, plans_of

CAMERA = Camera.of_the_paper(640, 480, 570.0)
RNG = np.random.default_rng(0)


def scene():
    """A 60 x 30 mm block, 40 mm high, off the centre, and a grasp function on it."""
    depth = np.full((480, 640), CAMERA.table_depth, dtype=np.float32)
    depth[200:242, 330:414] -= 0.04
    f = np.zeros(grid.SHAPE)
    f[15:18, 24:28, 3] = 0.8
    f[16, 25, 2] = 1.0
    return depth, f


PLANS = plans_of(simulated_trials())
SURE = graspable_objects(account(), 5)
WIDTHS_M = {name(i): 0.015 + 0.01 * i for i in range(10)}


def placed(*rows):
    columns = ["id", "status", "fit_scale"]
    return pd.DataFrame(rows, columns=columns)


MANIFESTS = {
    "train": pd.DataFrame({"id": ["a", "b", "c", "d"], "size_m": [0.1, 0.2, 0.2, 0.15]}),
    "test": pd.DataFrame({"id": ["e"], "size_m": [0.05]}),
}
TOO_LARGE = "no part of it fits the gripper at 5 cm or more"
PLACED = {
    "train": placed(
        ("d", "never came to rest in 4 s", 1.0), ("c", TOO_LARGE, 1.0), ("a", "resting", 1.0), ("b", "resting", 0.5)
    ),
    "test": placed(("e", "resting", 1.0)),
}


def history(steps):
    return pd.DataFrame({"epoch": np.arange(steps) / 10, "loss": 1 / (1 + np.arange(steps))})


def drawings():
    depth, f = scene()
    noisy = depth + RNG.normal(0, 0.0015, depth.shape).astype(np.float32)
    raw = depth.copy()
    raw[100:120] = np.nan
    q, r = np.array([0.03, -0.01, 1.2]), np.array([0.035, -0.01, 1.3])
    grasp = depth_images.ExecutedGrasp("a-box-with-a-very-long-name-indeed", depth, q, r)
    image = RNG.random((40, 30, 3))
    groups = [("Training objects", ["a_long-name of a $ thing"] * 5), ("Test objects", ["b"] * 2)]
    cells = contact_sheet.cells_for(groups)
    thumbnail = np.full((cells.side_px, cells.side_px, 3), 128, dtype=np.uint8)
    return {
        "grasp_function": lambda: grasp_functions.draw_grasp_function(depth, f, CAMERA),
        "training_example": lambda: grasp_functions.draw_training_example(depth, noisy, f, CAMERA),
        "predictions": lambda: grasp_functions.draw_predictions(
            [depth], {"alexnet": [f], "fcn": [f]}, {"alexnet": [(q, r)], "fcn": [(q, r)]}, 100, CAMERA
        ),
        "growing_uncertainty": lambda: grasp_functions.draw_growing_uncertainty(
            [depth, depth], [[q, r]] * 2, [(5, 10), (20, 40)], 100, CAMERA
        ),
        "summary_1d": lambda: grasp_functions.draw_summary_1d(*registry.slice_for_summary(f, 20.0), 20.0),
        "depth": lambda: depth_images.draw_depth(depth, CAMERA),
        "noise": lambda: depth_images.draw_noise(depth, noisy, CAMERA),
        "inpainting": lambda: depth_images.draw_inpainting(raw, depth, CAMERA, simulated=True),
        "example_grasps": lambda: depth_images.draw_example_grasps([grasp] * 5, 100, CAMERA, simulated=True),
        "success_vs_sigma_uv": lambda: success.draw_success_vs_sigma_uv(tables.table1(PLANS, ()), "fcn", "all"),
        "success_vs_width": lambda: success.draw_success_vs_width(PLANS, WIDTHS_M, "fcn", [(5.0, 10.0), (12.5, 10.0)]),
        "promise_against_fact": lambda: promise.draw_promise_against_fact(
            PLANS[PLANS["method"] == "Robust Best Grasp"], ["fcn", TRUE]
        ),
        "expected_against_trials": lambda: expected.draw_expected_against_trials(expectation.points(PLANS)),
        "object_sizes": lambda: sizes.draw_object_sizes(object_sizes.sizes(MANIFESTS, PLACED)),
        "training_curves": lambda: training_curves.draw_training_curves(
            {"fcn": history(0)}, {"alexnet": history(30), "fcn": history(1)}
        ),
        "label_outcomes": lambda: label_outcomes.draw_label_outcomes(account()),
        "simulated_grasp": lambda: simulated_grasps.draw_simulated_grasp([("a", image), ("b", image)]),
        "objects": lambda: contact_sheet.draw_contact_sheet(groups, cells, iter([thumbnail] * 7)),
    }


def test_bars_of_what_always_or_never_held_are_drawn():
    """Of 10 objects that always held, rounding leaves the end of the interval below the rate, of 7 above it."""
    widths = dict.fromkeys(WIDTHS_M, 0.03)
    for some, success_ in ((PLANS, 1.0), (PLANS[PLANS["id"].isin(list(widths)[:7])], 0.0)):
        plans = some.assign(success=success_)
        assert png_bytes(success.draw_success_vs_width(plans, widths, "fcn", [(5.0, 10.0)]))
        assert png_bytes(promise.draw_promise_against_fact(plans[plans["method"] == "Robust Best Grasp"], ["fcn"]))


def test_names_are_not_taken_for_formulas():
    depth, _ = scene()
    grasp = depth_images.ExecutedGrasp("cup $x_{$", depth, np.zeros(3), np.zeros(3))
    figure = depth_images.draw_example_grasps([grasp], 100, CAMERA, simulated=False)
    assert "cup $x_{$" in words(figure) and png_bytes(figure)


def test_a_function_without_a_grasp_is_drawn_with_words_in_its_place():
    depth, f = scene()
    q = np.zeros(3)
    poses = {"good": [(q, q)], "none": [(None, None)]}
    figure = grasp_functions.draw_predictions([depth], {"good": [f], "none": [0 * f]}, poses, 100, CAMERA)
    assert "no grasp" in words(figure) and png_bytes(figure)
    figure = grasp_functions.draw_growing_uncertainty([depth], [[q, None]], [(5, 10), (20, 40)], 100, CAMERA)
    assert words(figure).count("no grasp") == 1 and png_bytes(figure)


def words(figure):
    return " ".join(text.get_text() for text in figure.findobj(lambda artist: hasattr(artist, "get_text")))


@pytest.mark.parametrize("name", drawings())
def test_every_figure_draws_without_warnings_and_legibly(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure = drawings()[name]()
        assert png_bytes(figure).startswith(b"\x89PNG")
    smallest = min(
        text.get_fontsize()
        for text in figure.findobj(lambda artist: hasattr(artist, "get_fontsize"))
        if text.get_text()
    )
    assert smallest >= 8


@pytest.mark.parametrize("save", [png_bytes, pdf_bytes])
def test_the_same_data_give_the_same_bytes(save):
    draw = drawings()["summary_1d"]
    assert save(draw()) == save(draw())


@pytest.mark.parametrize("draw", ["inpainting", "example_grasps"])
def test_figures_of_the_simulated_robot_say_so_and_those_of_a_real_one_do_not(draw):
    depth, _ = scene()
    grasp = depth_images.ExecutedGrasp("box", depth, np.zeros(3), np.zeros(3))
    for simulated in (True, False):
        figure = (
            depth_images.draw_inpainting(depth, depth, CAMERA, simulated)
            if draw == "inpainting"
            else depth_images.draw_example_grasps([grasp], 100, CAMERA, simulated)
        )
        assert ("simulated" in words(figure).lower()) is simulated


def test_lines_are_as_thick_as_the_score_and_point_where_the_jaws_close():
    figure = grasp_functions.new_figure(3, 3)
    axes = figure.subplots()
    f = np.zeros(grid.SHAPE)
    f[10, 20, 0], f[12, 30, 3] = 0.5, 1.0
    grasp_functions.add_function(axes, f, thickest_pt=2.0)
    (lines,) = axes.collections
    assert sorted(lines.get_linewidths()) == [1.0, 2.0]
    for segment, width in zip(lines.get_segments(), lines.get_linewidths(), strict=True):
        v, u, theta = (10, 20, 0) if width == 1.0 else (12, 30, 3)
        q = grid.from_index(np.array([v, u, theta]))
        assert segment.mean(axis=0) == pytest.approx(q[:2] * 1000)
        along = segment[1] - segment[0]
        assert along / np.linalg.norm(along) == pytest.approx([np.cos(q[2]), np.sin(q[2])], abs=1e-12)


def test_a_depth_image_is_drawn_where_its_pixels_are_on_the_table():
    """The centre of a pixel of the picture is that pixel's point of the table, in mm."""
    axes = grasp_functions.new_figure(3, 3).subplots()
    depth, _ = scene()
    show_depth(axes, depth, CAMERA)
    left, right, bottom, top = axes.images[0].get_extent()
    shown = axes.images[0].get_array()
    for x, y in ((0, 0), (639, 479), (330, 200)):
        u, v = CAMERA.pixel_to_table(np.array([x, y])) * 1000
        assert left + (x + 0.5) * (right - left) / 640 == pytest.approx(u)
        assert top + (y + 0.5) * (bottom - top) / 480 == pytest.approx(v)
    assert shown[220, 370, 0] < shown[220, 300, 0]  # the higher the darker


def test_windows_hold_the_object_and_stay_in_the_image():
    depth, _ = scene()
    u0, u1, v0, v1 = window_round(depth, CAMERA)
    low, high = CAMERA.pixel_to_table(np.array([[330, 200], [413, 241]])) * 1000
    assert u0 < low[0] and high[0] < u1 and v0 < low[1] and high[1] < v1
    assert u1 - u0 == pytest.approx(v1 - v0)
    edge = CAMERA.pixel_to_table(np.array([639.5, 479.5])) * 1000
    _, u1, _, v1 = square(np.array([500.0, 500.0]), 100, CAMERA)
    assert (u1, v1) == pytest.approx(tuple(edge))


def test_summary_slice_is_one_where_smoothing_moves_the_maximum():
    """A lone peak beside a broad plateau: the plateau wins once smoothed."""
    f = np.zeros(grid.SHAPE)
    f[5, 10, 0] = 1.0
    f[5, 20:30, 0] = 0.8
    f[7, 15, 2] = 1.0
    u_mm, values, smoothed = registry.slice_for_summary(f, 20.0)
    u = grid.axes()[1] * 1000
    assert u_mm[np.argmax(values)] == pytest.approx(u[10])
    assert u[22] < u_mm[np.argmax(smoothed)] < u[27]


def test_rendering_sees_the_nearer_thing_its_colour_and_its_shadow():
    box = trimesh.creation.box([0.04, 0.04, 0.04], trimesh.transformations.translation_matrix([0, 0, 0.1]))
    red = (1.0, 0.0, 0.0)
    above = View((0.0, -0.001, 1.0), (0.0, 0.0, 0.0), 0.3, 60, 60)
    picture = render_scene([(box, red)], above)
    middle = picture[30, 30]
    assert middle[0] > 0.5 and middle[1] == middle[2] == 0
    inside_out = box.copy()
    inside_out.invert()
    assert render_scene([(inside_out, red)], above) == pytest.approx(picture)
    table = np.abs(picture - TABLE).max(axis=-1) < 0.15
    shadow = (picture.max(axis=-1) < 0.75) & (picture[..., 1] > 0.1)
    assert table.mean() > 0.5 and 20 < shadow.sum() < 400
    # The light comes from -x, -y: the shadow falls to the right (+x) and up (+y) of the picture's middle.
    rows, columns = np.nonzero(shadow)
    assert columns.mean() > 30 and rows.mean() < 30


def test_a_mesh_finer_than_the_picture_looks_the_same_without_smoothing(monkeypatch):
    ball = trimesh.creation.icosphere(5, 0.04)
    ball.apply_translation([0, 0, 0.04])
    view = View((0.3, -0.5, 0.5), (0.0, 0.0, 0.04), 0.15, 60, 60)
    assert len(ball.faces) > 60 * 60
    flat = render_scene([(ball, (1.0, 0.5, 0.0))], view)
    corners = shading._corners
    monkeypatch.setattr(shading, "_corners", lambda mesh, pixels: corners(mesh, len(mesh.faces)))
    assert np.abs(render_scene([(ball, (1.0, 0.5, 0.0))], view) - flat).max() < 0.05


def test_film_shows_start_closed_five_centimetres_and_top():
    heights = [0.0, 0.0, 0.0, 0.02, 0.05, 0.08, 0.2]
    frames = [Frame(i / 10, z, (i / 10, i / 10), np.eye(4)) for i, z in enumerate(heights)]
    shown = film.moments(frames)
    assert [frame.time_s for _, frame in shown] == [0.0, 0.2, 0.4, 0.6]
    assert shown[-1][0] == "20 cm up"
    assert film.moments([]) == []  # of an attempt that collides at once


def test_poses_to_film_are_the_best_scored_and_then_the_most_central():
    successes = np.zeros(grid.SHAPE, dtype=np.uint8)
    successes[0, 0, 0], successes[16, 22, 1], successes[10, 10, 2] = 5, 5, 4
    q = film.poses_to_try(successes)
    assert [tuple(grid.to_index(pose).round().astype(int)) for pose in q[:3]] == [(16, 22, 1), (0, 0, 0), (10, 10, 2)]


def plates():
    table = tables.table1(PLANS, SURE)
    return [
        *success.plates(table, PLANS, SURE, WIDTHS_M, ["fcn"]),
        *promise.plates(table, PLANS),
        *expected.plates(table, PLANS),
    ]


def test_every_figure_of_results_says_what_is_floor_and_what_is_ceiling():
    drawn = plates()
    names = ["success_vs_sigma_uv", "success_vs_width", "promise_against_fact", "expected_against_trials"]
    assert [plate.name for plate in drawn] == names
    for plate in drawn:
        assert "is the floor" in plate.caption and "is the ceiling" in plate.caption, plate.name


def test_where_nobody_knows_which_objects_can_be_held_figures_show_all_and_say_so():
    alone = PLANS[PLANS["network"] != TRUE]
    table = tables.table1(alone, frozenset())
    drawn = list(success.plates(table, alone, frozenset(), WIDTHS_M, ["fcn"]))
    assert "all 10 test objects; which of them can be held is not known without labels" in drawn[0].caption
    assert all("there is no ceiling" in plate.caption for plate in drawn)
    nothing_expected = alone.assign(expected=np.nan, expected_error=np.nan)
    assert list(expected.plates(table, nothing_expected)) == []


def test_rates_in_bins_of_width_are_those_of_the_objects_in_them():
    own = of_method(PLANS, "Robust Best Grasp", "fcn")
    table = success.by_width(own, WIDTHS_M)  # o0 at 15 mm, o1 and o2 at 25 and 35 mm, ...
    assert table["low_mm"].tolist() == [0, 20, 40, 60, 80, 100]
    assert table["objects"].tolist() == [1, 2, 2, 2, 2, 1]
    held = HELD["Robust Best Grasp", "fcn"]
    assert table["success"].tolist() == [1, 1, 1, 1, 0, 0] and held == 7
    rate = resampled_rate(np.ones((2, 1)))
    assert (table["ci_low"][1], table["ci_high"][1]) == (rate.low, rate.high)


def test_promises_are_binned_with_what_came_of_them():
    own = of_method(PLANS, "Robust Best Grasp", "fcn")
    promised = own.assign(promise=own["id"].map({name(i): 0.05 + 0.1 * i for i in range(9)} | {"o9": 1.0}))
    table = promise.binned(promised)
    assert table["middle"].tolist() == pytest.approx([0.05 + 0.1 * i for i in range(10)])
    assert table["poses"].tolist() == [4] * 10 and table["with_expected"].tolist() == [4] * 9 + [0]
    assert table["success"].tolist() == [1] * 7 + [0] * 3
    assert table["expected"][:9].tolist() == [1] * 7 + [0] * 2 and np.isnan(table["expected"][9])
    assert (promise.binned(own.assign(promise=np.nan))).empty


def test_expected_and_trials_that_agree_differ_by_chance_alone():
    """Trials drawn at the rates that are expected of them: chi2 is about its number, the difference about 0."""
    rng = np.random.default_rng(0)
    own = PLANS[PLANS["network"] == "fcn"]
    own = own.assign(expected=rng.random(len(own)), expected_error=0.0, trials=20)
    own = own.assign(success=rng.binomial(20, own["expected"]) / 20)
    check = expectation.check_expected(own)
    assert check.points == 3 * 4 and check.plans == len(own) and check.objects == 10
    assert 3 < check.chi2 < 30 and abs(check.difference) < 2 * (check.ci_high - check.difference)
    worse = expectation.check_expected(own.assign(expected=own["expected"].clip(0.1, 0.8) + 0.15))
    assert worse.ci_low > 0 and worse.chi2 > check.chi2
    assert worse.difference > check.difference
    # Of the true function it is of other poses than were tried, so that it is no check.
    assert expectation.check_expected(pd.concat([own, PLANS[PLANS["network"] == TRUE]])) == check


def test_sizes_count_every_object_once_by_its_fate():
    table = object_sizes.sizes(MANIFESTS, PLACED)
    assert sorted(table["id"]) == ["a", "b", "c", "d", "e"]
    found = object_sizes.size_statistics(table)["train"]
    assert found["selected"] == 4 and found["as_drawn"] == 1 and found["made_smaller"] == 1
    assert found["left_out"] == {"never came to rest in 4 s": 1, TOO_LARGE: 1}
    assert found["drawn_cm"]["median"] == pytest.approx(17.5)
    assert found["placed_cm"]["median"] == pytest.approx(10.0)
    assert object_sizes.reasons(PLACED["train"]["status"]) == found["left_out"]
    (plate,) = sizes.plates(table, fit=True)
    assert "Train: 1 as drawn, 1 made smaller, left out: 1 never came to rest in 4 s, 1 no part of it" in plate.caption


def test_width_is_the_least_one_seen_from_above_whatever_the_angle_and_the_height():
    box = trimesh.creation.box([0.12, 0.03, 0.2])
    for turn in (0.0, 0.5, 1.2):
        T = trimesh.transformations.rotation_matrix(turn, [0, 0, 1])
        # Angles are a degree apart.
        assert object_sizes.narrowest_width(box, T) == pytest.approx(0.03, rel=0.04)
    lying = trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0])
    assert object_sizes.narrowest_width(box, lying) == pytest.approx(0.12, rel=1e-6)


def test_widths_are_those_of_objects_as_they_were_placed(tmp_path):
    mesh = trimesh.creation.box([0.12, 0.03, 0.2])
    mesh.export(tmp_path / "a.ply")
    rows = [placed_row("a", "", "resting", np.eye(4), 0.5), placed_row("b", "", TOO_LARGE, np.eye(4))]
    assert object_sizes.widths(tmp_path, pd.DataFrame(rows)) == {"a": pytest.approx(0.015)}
