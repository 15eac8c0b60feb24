"""A depth camera over the table, simulated on height maps: what it sees, what it misses, and how wrong it is.

Whole batches at once, on any device: maps are (B, 132, 176) float32, metres over the table, rows along v and columns
along u, with cells of 2.5 mm. Every amount comes from `noise` in params.yaml; with an amount of 0 its disturbance
leaves a map as it is. What one sample draws depends on its seed alone.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch.nn import functional

from graspfn.geometry.grid import CELL_M
from graspfn.imaging.camera import Camera
from graspfn.imaging.disturbances import BLOB_M, WAVE_M, WAVES
from graspfn.imaging.height_map import CELL_M as STEP_M
from graspfn.imaging.network_input import INPUT_SHAPE
from graspfn.learning.draws import normal, normal4, uniform, uniform4
from graspfn.params import Noise

EDGE_M = 0.005  # neighbours that differ by more have a depth edge between them
SPECK_M = 0.1
CLUTTER_M = (0.02, 0.08)  # sizes and heights of what stands at the border
APART_M = 0.05  # from the object, so that no grasp of this one meets it


@dataclass(frozen=True)
class View:
    """Where a camera is and what it can see: half its image, in tangents of angles."""

    height_m: float
    focal_px: float
    tan_u: float
    tan_v: float

    @classmethod
    def of(cls, camera: Camera) -> View:
        """Of a camera as it stands; the lens is taken for a pinhole whose axis is in the image's middle."""
        fx, fy, cx, cy = camera.K
        reach = (min(cx, camera.width - 1 - cx) + 0.5) / fx, (min(cy, camera.height - 1 - cy) + 0.5) / fy
        return cls(float(np.linalg.norm(camera.position)), (fx + fy) / 2, *reach)


@functools.cache
def _cells(device: torch.device) -> tuple[torch.Tensor, torch.Tensor]:
    """v (132, 1) and u (176): centres of the cells, metres from the middle."""
    v, u = ((torch.arange(n, dtype=torch.float32, device=device) - (n - 1) / 2) * STEP_M for n in INPUT_SHAPE)
    return v[:, None], u


def _each(values: torch.Tensor, device: torch.device) -> torch.Tensor:
    """(B, ...) of any precision -> (B, ..., 1, 1) float32 beside the maps."""
    return values.to(torch.float32).to(device)[..., None, None]


def read_at(maps: torch.Tensor, u: torch.Tensor, v: torch.Tensor, cell: float = 1.0) -> torch.Tensor:
    """maps (B, H, W), bilinear at u, v (broadcast to (B, h, w)) from the middle, in the unit of `cell`; 0 outside."""
    rows, columns = maps.shape[-2:]
    grid = torch.empty(*torch.broadcast_shapes(u.shape, v.shape), 2, device=maps.device)
    grid[..., 0], grid[..., 1] = u * (2 / cell / (columns - 1)), v * (2 / cell / (rows - 1))
    return functional.grid_sample(maps[:, None], grid, padding_mode="zeros", align_corners=True)[:, 0]


def _drawn(
    eye_u: torch.Tensor, eye_v: torch.Tensor, u: torch.Tensor, v: torch.Tensor, log: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """u (B, 1, 176) and v (B, 132, 1), their distances from the point below the eye made exp(log) (B) times as long."""
    times = _each(log.exp(), u.device)
    return eye_u + (u - eye_u) * times, eye_v + (v - eye_v) * times


def lit(heights: torch.Tensor, eye: torch.Tensor) -> torch.Tensor:
    """(B, 132, 176) bool: cells whose tops are seen from eye (B, 3) = (u, v, height), metres.

    A cell is hidden by one that is nearer to the point below the eye, on the line between them, and has the larger
    ratio of distance there to height below the eye. The largest ratio along all these lines is found by doubling: of
    the map and the same map drawn a step, two, four, ... towards that point, the larger.
    """
    device = heights.device
    v, u = _cells(device)
    eye_u, eye_v, eye_z = (_each(part, device) for part in eye.unbind(-1))
    below = (eye_z - heights).clamp_(min=CELL_M)
    ratio = ((u - eye_u).square() + (v - eye_v).square()).sqrt_() / below
    far = torch.hypot(*(eye[:, i].abs() + n * STEP_M / 2 for i, n in ((0, INPUT_SHAPE[1]), (1, INPUT_SHAPE[0]))))
    step = torch.log1p(-STEP_M / far)  # towards the point, of a whole cell in the corner that is furthest away
    # A shadow is as long as what casts it is high: no further has to be looked.
    longest = (below.amin(dim=(1, 2)).cpu() / eye[:, 2]).log() / step
    doublings = longest.clamp(min=1).log2().ceil()
    largest = read_at(ratio, *_drawn(eye_u, eye_v, u, v, step), STEP_M)  # without the cell itself
    for k in range(int(doublings.max())):
        before = read_at(largest, *_drawn(eye_u, eye_v, u, v, step * 2**k), STEP_M)
        before *= _each(k < doublings, device)  # what is drawn for another sample changes nothing
        largest = torch.maximum(largest, before)
    return ratio >= largest - STEP_M / 10 / eye_z


def in_view(heights: torch.Tensor, eye: torch.Tensor, view: View) -> torch.Tensor:
    """(B, 132, 176) bool: cells whose tops lie in the image of a camera at eye (B, 3) that looks at the middle of Q.

    It is turned from the vertical about a horizontal axis, so that u still runs along the image.
    """
    eye = eye.double()
    away = eye.norm(dim=-1)
    a, b, c = (eye / away[:, None]).unbind(-1)  # towards the camera
    bend = 1 / (1 + c)
    axes = [(1 - a * a * bend, -a * b * bend, -a), (-a * b * bend, 1 - b * b * bend, -b), (-a, -b, -c)]
    v, u = _cells(heights.device)
    rows = ([_each(part, heights.device) for part in row] for row in axes)
    x, y, z = (along_u * u + along_v * v + up * heights for along_u, along_v, up in rows)
    z = z + _each(away, heights.device)  # the camera's own place lies on its axis
    return (x.abs() <= view.tan_u * z) & (y.abs() <= view.tan_v * z)


def smooth(seeds: torch.Tensor, name: str, lengths: tuple[float, float], device: torch.device) -> torch.Tensor:
    """(B, 132, 176) random fields of mean 0 and rms 1: plane waves of lengths between two, metres, in all directions.

    cos(a + b) = cos a cos b - sin a sin b makes each wave a product of a column and a row.
    """
    length, direction, phase = uniform(seeds, name, 3, WAVES).unbind(1)
    k = 2 * math.pi / (lengths[0] * (lengths[1] / lengths[0]) ** length)
    direction, phase = 2 * math.pi * direction, _each(2 * math.pi * phase, device)[..., 0]
    v, u = _cells(device)
    down = _each(k * direction.sin(), device)[..., 0] * v[:, 0] + phase
    along = _each(k * direction.cos(), device)[..., 0] * u
    columns = torch.cat([down.cos(), -down.sin()], dim=1).transpose(1, 2)
    return columns @ torch.cat([along.cos(), along.sin()], dim=1) * math.sqrt(2 / WAVES)


def eyes(seeds: torch.Tensor, noise: Noise, view: View) -> tuple[torch.Tensor, torch.Tensor]:
    """Camera and its projector or second camera, each (B, 3) = (u, v, height), metres."""
    tilt, direction, nearer, baseline, side = uniform(seeds, "camera", 5).unbind(-1)
    tilt, direction, side = math.radians(noise.camera_tilt_deg) * tilt, 2 * math.pi * direction, 2 * math.pi * side
    away = view.height_m + noise.camera_height_mm / 1000 * (2 * nearer - 1)
    flat = away * tilt.sin()
    camera = torch.stack([flat * direction.cos(), flat * direction.sin(), away * tilt.cos()], dim=-1)
    apart = noise.baseline_mm / 1000 * baseline
    return camera, camera + torch.stack([apart * side.cos(), apart * side.sin(), torch.zeros_like(side)], dim=-1)


def add_clutter(heights: torch.Tensor, seeds: torch.Tensor, noise: Noise) -> torch.Tensor:
    """Blocks and domes across the border of some samples; none near the object."""
    drawn = uniform(seeds, "clutter", 8)
    there, side, along, turn, dome = (drawn[:, i] for i in range(5))
    size = CLUTTER_M[0] + (CLUTTER_M[1] - CLUTTER_M[0]) * drawn[:, 5:]
    half_v, half_u = (n * STEP_M / 2 for n in INPUT_SHAPE)
    lengthwise, sign = side < 0.5, 4 * (side * 2 % 1 < 0.5).double() - 2
    place_u = torch.where(lengthwise, (2 * along - 1) * half_u, sign / 2 * half_u)
    place_v = torch.where(lengthwise, sign / 2 * half_v, (2 * along - 1) * half_v)
    v, u = _cells(heights.device)
    du, dv = u - _each(place_u, heights.device), v - _each(place_v, heights.device)
    c, s = (_each(f(math.pi * turn), heights.device) for f in (torch.cos, torch.sin))
    half_a, half_b, top = (_each(part, heights.device) for part in (size[:, 0] / 2, size[:, 1] / 2, size[:, 2]))
    a, b = (du * c + dv * s).abs(), (dv * c - du * s).abs()
    near = (a <= half_a + APART_M) & (b <= half_b + APART_M) & (heights > 0)
    apart = ~near.flatten(1).any(dim=1) & (there < noise.clutter).to(heights.device)
    round_top = (1 - (a / half_a).square() - (b / half_b).square()).clamp(min=0).sqrt()
    block = ((a <= half_a) & (b <= half_b)).float()
    shape = torch.where(_each(dome, heights.device) < 0.5, round_top, block)
    return torch.maximum(heights, shape * top * apart[:, None, None])


def cell_noise_m(heights: torch.Tensor, noise: Noise, eye: torch.Tensor, view: View) -> torch.Tensor:
    """Std of a cell's height under eq. 2: of the mean of as many pixels as look at it, the paper's camera's 12."""
    away = (_each(eye[:, 2], heights.device) - heights).clamp(min=CELL_M)
    return noise.sigma_d_mm / 1000 / (view.focal_px * STEP_M / away).clamp(min=1)


def measure(heights: torch.Tensor, seeds: torch.Tensor, noise: Noise, eye: torch.Tensor, view: View) -> torch.Tensor:
    """Heights with the errors of depth: eq. 2's, the camera's slow ones, its steps, and what the table's fit left."""
    device = heights.device
    v, u = _cells(device)
    scale, wave, step, phase = uniform(seeds, "measure", 4).unbind(-1)
    offset, slope_u, slope_v = normal(seeds, "table", 3).unbind(-1)
    measured = heights * _each(1 + noise.scale * (2 * scale - 1), device)
    tops = normal4(seeds.to(device), "depth", heights[0].numel() // 4).view_as(heights)
    measured = measured + tops * cell_noise_m(heights, noise, eye, view)
    if noise.wave_mm:
        measured += smooth(seeds, "wave", WAVE_M, device) * _each(noise.wave_mm / 1000 * wave, device)
    slope = math.tan(math.radians(noise.table_tilt_deg))
    measured += _each(noise.table_offset_mm / 1000 * offset, device)
    measured += _each(slope * slope_u, device) * u + _each(slope * slope_v, device) * v
    if not noise.step_mm:
        return measured
    # Equal depths lie in planes across the camera's axis.
    a, b, c = (_each(part, device) for part in (eye / eye.norm(dim=-1, keepdim=True)).unbind(-1))
    across = a * u + b * v
    step = noise.step_mm / 1000 * step.clamp(min=1e-3)
    step, phase = _each(step, device), _each(phase, device)
    stepped = (((measured * c + across) / step + phase).round_() - phase) * step
    return (stepped - across) / c


def missing(heights: torch.Tensor, seeds: torch.Tensor, noise: Noise, chance: torch.Tensor) -> torch.Tensor:
    """(B, 132, 176) bool: cells without depth, a share of them in blobs and the rest one by one.

    chance: (B, 132, 176) uniform draws.
    """
    share, in_blobs = uniform(seeds, "holes", 2).unbind(-1)
    blobs, single = noise.holes * share * in_blobs, noise.holes * share * (1 - in_blobs)
    level = -torch.special.ndtri(blobs)
    holes = smooth(seeds, "blobs", BLOB_M, heights.device) > _each(level, heights.device)
    return holes | (chance < _each(single, heights.device))


def _around(heights: torch.Tensor, pick: Callable[[torch.Tensor, torch.Tensor], torch.Tensor]) -> torch.Tensor:
    """The largest or smallest of each 3 x 3 cells; a third of the time of max_pool2d."""
    padded = functional.pad(heights[:, None], (1, 1, 1, 1), mode="replicate")[:, 0]
    rows = pick(pick(padded[:, :-2], padded[:, 1:-1]), padded[:, 2:])
    return pick(pick(rows[..., :-2], rows[..., 1:-1]), rows[..., 2:])


def blur_edges(
    heights: torch.Tensor, seeds: torch.Tensor, noise: Noise, chance: torch.Tensor, between: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """Heights, and where cells at depth edges are unseen (bool): half of those that go wrong; the others lie between.

    chance, between: (B, 132, 176) uniform draws.
    """
    high, low = _around(heights, torch.maximum), _around(heights, torch.minimum)
    share = _each(noise.edges * uniform(seeds, "edges"), heights.device)
    wrong = (high - low > EDGE_M) & (chance < share)
    unseen = chance < share / 2
    return torch.where(wrong, low + between * (high - low), heights), wrong & unseen


def sense(heights: torch.Tensor, seeds: torch.Tensor, noise: Noise, view: View) -> tuple[torch.Tensor, torch.Tensor]:
    """True heights -> measured heights (B, 132, 176), 0 where nothing is seen, and where something is (bool).

    seeds: (B,) int64 on the CPU, where the few numbers that rule a sample are drawn in double precision.
    """
    device = heights.device
    if noise.clutter:
        heights = add_clutter(heights, seeds, noise)
    camera, projector = eyes(seeds, noise, view)
    seen = lit(heights, camera) & in_view(heights, camera, view)
    if noise.baseline_mm:
        seen &= lit(heights, projector)
    hole, edge, between, speck = uniform4(seeds.to(device), "cells", *INPUT_SHAPE).unbind(1)
    measured = heights
    if noise.edges:
        measured, unseen = blur_edges(measured, seeds, noise, edge, between)
        seen &= ~unseen
    measured = measure(measured, seeds, noise, camera, view)
    if noise.specks:
        share = _each(noise.specks * uniform(seeds, "specks"), device)
        measured = torch.where(speck < share, between * SPECK_M, measured)
    if noise.holes:
        seen &= ~missing(heights, seeds, noise, hole)
    return measured * seen, seen
