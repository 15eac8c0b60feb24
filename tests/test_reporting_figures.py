import warnings

import numpy as np
import pandas as pd
import pytest
import trimesh

from graspfn.geometry import grid
from graspfn.imaging.camera import Intrinsics
from graspfn.physics.attempt import Frame
from graspfn.reporting import (
    figures,
    figures_functions,
    figures_images,
    figures_objects,
    figures_results,
    figures_scenes,
    film,
    shading,
)
from graspfn.reporting.figures.shading import TABLE, View, render_scene
from graspfn.reporting.figures.style import pdf_bytes, png_bytes, show_depth, square, window_round

CAMERA = Intrinsics(640, 480, 570.0)
RNG = np.random.default_rng(0)


def scene():
    """A 60 x 30 mm block, 40 mm high, off the centre, and a grasp function on it."""
    depth = np.full((480, 640), CAMERA.table_depth, dtype=np.float32)
    depth[200:242, 330:414] -= 0.04
    f = np.zeros(grid.SHAPE)
    f[15:18, 24:28, 3] = 0.8
    f[16, 25, 2] = 1.0
    return depth, f


def table_1():
    rows = [
        {"method": method, "network": network, "sigma_theta_deg": 10.0, "sigma_uv_mm": uv, "success": 0.5}
        | {"ci_low": 0.4, "ci_high": 0.6, "trials": 10, "objects": 10, "paper": 0.7 if uv == 5 else np.nan}
        for method in ("Centroid", "Best Grasp", "Robust Best Grasp")
        for network in ([""] if method == "Centroid" else ["alexnet", "fcn"])
        for uv in (5.0, 12.0)
    ]
    return pd.DataFrame(rows)


def history(steps):
    return pd.DataFrame({"epoch": np.arange(steps) / 10, "loss": 1 / (1 + np.arange(steps))})


def account():
    return pd.DataFrame({"untouched": [100], "held": [3], "left": [2], "missed": [1], "collided": [4], "diverged": [0]})


def drawings():
    depth, f = scene()
    noisy = depth + RNG.normal(0, 0.0015, depth.shape).astype(np.float32)
    raw = depth.copy()
    raw[100:120] = np.nan
    q, r = np.array([0.03, -0.01, 1.2]), np.array([0.035, -0.01, 1.3])
    grasp = figures_images.ExecutedGrasp("a-box-with-a-very-long-name-indeed", depth, q, r)
    image = RNG.random((40, 30, 3))
    groups = [("Training objects", ["a_long-name of a $ thing"] * 5), ("Test objects", ["b"] * 2)]
    cells = figures_objects.cells_for(groups)
    thumbnail = np.full((cells.side_px, cells.side_px, 3), 128, dtype=np.uint8)
    return {
        "grasp_function": lambda: figures_functions.draw_grasp_function(depth, f, CAMERA),
        "training_example": lambda: figures_functions.draw_training_example(depth, noisy, f, CAMERA),
        "predictions": lambda: figures_functions.draw_predictions(
            [depth], {"alexnet": [f], "fcn": [f]}, {"alexnet": [(q, r)], "fcn": [(q, r)]}, 100, CAMERA
        ),
        "growing_uncertainty": lambda: figures_functions.draw_growing_uncertainty(
            [depth, depth], [[q, r]] * 2, [(5, 10), (20, 40)], 100, CAMERA
        ),
        "summary_1d": lambda: figures_functions.draw_summary_1d(*figures.slice_for_summary(f, 20.0), 20.0),
        "depth": lambda: figures_images.draw_depth(depth, CAMERA),
        "noise": lambda: figures_images.draw_noise(depth, noisy, CAMERA),
        "inpainting": lambda: figures_images.draw_inpainting(raw, depth, CAMERA, simulated=True),
        "example_grasps": lambda: figures_images.draw_example_grasps([grasp] * 5, 100, CAMERA, simulated=True),
        "success_vs_sigma_uv": lambda: figures_results.draw_success_vs_sigma_uv(table_1(), 10.0),
        "training_curves": lambda: figures_results.draw_training_curves(
            {"fcn": history(0)}, {"alexnet": history(30), "fcn": history(1)}
        ),
        "label_outcomes": lambda: figures_results.draw_label_outcomes(account()),
        "simulated_grasp": lambda: figures_scenes.draw_simulated_grasp([("a", image), ("b", image)]),
        "objects": lambda: figures_objects.draw_contact_sheet(groups, cells, iter([thumbnail] * 7)),
    }


def test_names_are_not_taken_for_formulas():
    depth, _ = scene()
    grasp = figures_images.ExecutedGrasp("cup $x_{$", depth, np.zeros(3), np.zeros(3))
    figure = figures_images.draw_example_grasps([grasp], 100, CAMERA, simulated=False)
    assert "cup $x_{$" in words(figure) and png_bytes(figure)


def test_a_function_without_a_grasp_is_drawn_with_words_in_its_place():
    depth, f = scene()
    q = np.zeros(3)
    poses = {"good": [(q, q)], "none": [(None, None)]}
    figure = figures_functions.draw_predictions([depth], {"good": [f], "none": [0 * f]}, poses, 100, CAMERA)
    assert "no grasp" in words(figure) and png_bytes(figure)
    figure = figures_functions.draw_growing_uncertainty([depth], [[q, None]], [(5, 10), (20, 40)], 100, CAMERA)
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
    grasp = figures_images.ExecutedGrasp("box", depth, np.zeros(3), np.zeros(3))
    for simulated in (True, False):
        figure = (
            figures_images.draw_inpainting(depth, depth, CAMERA, simulated)
            if draw == "inpainting"
            else figures_images.draw_example_grasps([grasp], 100, CAMERA, simulated)
        )
        assert ("simulated" in words(figure).lower()) is simulated


def test_lines_are_as_thick_as_the_score_and_point_where_the_jaws_close():
    figure = figures_functions.new_figure(3, 3)
    axes = figure.subplots()
    f = np.zeros(grid.SHAPE)
    f[10, 20, 0], f[12, 30, 3] = 0.5, 1.0
    figures_functions.add_function(axes, f, thickest_pt=2.0)
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
    axes = figures_functions.new_figure(3, 3).subplots()
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
    u_mm, values, smoothed = figures.slice_for_summary(f, 20.0)
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
