"""Figures of scenes rendered in three dimensions: a simulated grasp (paper, Fig. 3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from matplotlib.figure import Figure

from graspfn.reporting.figures.shading import OBJECT_COLOUR, View, render_scene
from graspfn.reporting.figures.style import WIDE_IN, bare, new_figure, styled
from graspfn.reporting.film import Film

PALM_COLOUR, FINGER_COLOUR = (0.38, 0.42, 0.48), (0.27, 0.47, 0.68)


def film_scenes(film: Film) -> list[tuple[str, np.ndarray]]:
    """(title, (480, 330, 3) image in [0, 1]) of every shot of a grasp, seen from beside the closing direction."""
    toward = np.array([np.cos(film.q[2]), -np.sin(film.q[2])])  # the closing direction, in world x, y
    across = np.array([toward[1], -toward[0]])
    x, y = film.q[0] + 1.0 * across[0] + 0.5 * toward[0], -film.q[1] + 1.0 * across[1] + 0.5 * toward[1]
    view = View((x, y, 0.6), (film.q[0], -film.q[1], 0.165), 0.30, 330, 480)
    scenes = []
    for shot in film.shots:
        parts = [(film.mesh.copy().apply_transform(shot.T_world_object), OBJECT_COLOUR)]
        for (T, size), colour in zip(shot.boxes, (PALM_COLOUR, FINGER_COLOUR, FINGER_COLOUR), strict=True):
            parts.append((trimesh.creation.box(size, T), colour))
        scenes.append((shot.title, render_scene(parts, view)))
    return scenes


@styled
def draw_films(films: Sequence[Film]) -> Figure:
    """Filmstrips of several grasps, two to a row, each under its object and outcome."""
    rows = -(-len(films) // 2)
    figure = new_figure(WIDE_IN, 1.45 * rows)
    for strip, film in zip(figure.subfigures(rows, 2, squeeze=False).flat, films, strict=False):
        strip.suptitle(f"{film.id}: {film.outcome}", fontsize=7, parse_math=False)
        for axes, (_, image) in zip(strip.subplots(1, len(film.shots)), film_scenes(film), strict=True):
            axes.imshow(image, interpolation="antialiased")
            bare(axes)
    return figure


@styled
def draw_simulated_grasp(shots: Sequence[tuple[str, np.ndarray]]) -> Figure:
    """A filmstrip of (title, (height, width, 3) image in [0, 1])."""
    figure = new_figure(WIDE_IN, 2.85)
    for axes, (title, image) in zip(figure.subplots(1, len(shots), squeeze=False)[0], shots, strict=True):
        axes.imshow(image, interpolation="antialiased")
        axes.set_title(title)
        bare(axes)
    return figure
