"""What may be wrong with a depth image that is planned on: the disturbances of the robustness table.

All act on what a depth camera gives, before the table is found in it. A disturbance draws the same whatever its
amount: a table that is twice as wavy is wavy in the same places.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from graspfn.imaging.camera import Camera
from graspfn.imaging.noise import add_noise, observe
from graspfn.params import Disturb, Noise
from graspfn.seeds import generator

WAVES = 16  # that make up a smooth field
WAVE_M = (0.03, 0.20)  # their lengths in slow errors of depth: neighbouring pixels of a lens, or a whole image
BLOB_M = (0.02, 0.10)  # and in holes
CLEAN = "clean"


@dataclass(frozen=True, eq=False)
class Shot:
    """A depth image (height, width), metres, that was disturbed, and the camera that is said to have taken it."""

    disturbance: str
    amount: float
    unit: str
    depth: np.ndarray
    camera: Camera


def raised(camera: Camera, by_m: float) -> Camera:
    """The camera so much higher over the table."""
    T = camera.T_world_camera.copy()
    T[2, 3] += by_m
    return camera.at(T)


def turned(camera: Camera, tilt: float, direction: float) -> Camera:
    """The camera moved about the middle of Q, which it still looks at: radians, towards a direction in the world."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(tilt * np.array([-np.sin(direction), np.cos(direction), 0])).as_matrix()
    return camera.at(T @ camera.T_world_camera)


def waves(camera: Camera, lengths_m: tuple[float, float], rng: np.random.Generator) -> np.ndarray:
    """(height, width) smooth field of mean 0 and rms 1: plane waves of lengths between two, as seen on the table."""
    length, direction, phase = rng.random((3, WAVES))
    pixels = camera.K[0] / camera.table_depth
    k = 2 * np.pi / (lengths_m[0] * (lengths_m[1] / lengths_m[0]) ** length) / pixels
    direction, phase = 2 * np.pi * direction, 2 * np.pi * phase
    along = np.outer(k * np.cos(direction), np.arange(camera.width))
    down = np.outer(np.arange(camera.height), k * np.sin(direction)) + phase
    field = np.cos(down) @ np.cos(along) - np.sin(down) @ np.sin(along)
    return (field - field.mean()) / field.std()


def missing(camera: Camera, rng: np.random.Generator) -> Callable[[float], np.ndarray]:
    """The pixels (height, width) bool of which a share measures nothing: half of them in blobs, the others alone."""
    field, chance = waves(camera, BLOB_M, rng), rng.random((camera.height, camera.width))

    def holes(share: float) -> np.ndarray:
        blobs = field > np.quantile(field, 1 - share / 2)
        return blobs | (chance < (share - blobs.mean()) / (1 - blobs.mean()))

    return holes


def stepped(depth: np.ndarray, step_m: float) -> np.ndarray:
    """depth (...) in whole steps."""
    return (np.round(depth / step_m) * step_m).astype(np.float32) if step_m else depth


def shots(
    render: Callable[[Camera], np.ndarray],
    camera: Camera,
    noise: Noise,
    others: Mapping[str, tuple[Camera, Noise]],
    amounts: Disturb,
    seed: int,
    name: str,
) -> Iterator[Shot]:
    """What `camera` sees of scene `name`: clean (with eq. 2 alone), and then with every disturbance of `amounts`.

    render: the scene without noise, as a camera sees it; others: cameras by name, each with its own noise.
    """

    def draws(kind: str) -> np.random.Generator:
        return generator(seed, "disturb", kind, name)

    exact = render(camera)
    clean = observe(exact, noise, seed, name)
    yield Shot(CLEAN, 0.0, "", clean, camera)
    yield Shot("other noise", 1.0, "draw", add_noise(exact, noise, draws("noise")), camera)
    for mm in amounts.offset_mm:  # the camera is not where it is believed to be
        yield Shot("offset", mm, "mm", observe(render(raised(camera, mm / 1000)), noise, seed, name), camera)
    direction = draws("tilt").uniform(0, 2 * np.pi)
    for degrees in amounts.tilt_deg:  # where it is is known, not where it looks
        true = turned(camera, np.radians(degrees), direction)
        T = camera.T_world_camera.copy()
        T[:3, 3] = true.position
        yield Shot("tilt", degrees, "deg", observe(render(true), noise, seed, name), camera.at(T))
    field = waves(camera, WAVE_M, draws("wave")).astype(np.float32)
    for mm in amounts.wave_mm:
        yield Shot("waviness", mm, "mm rms", clean + np.float32(mm / 1000) * field, camera)
    for percent in amounts.scale_percent:
        yield Shot("scale", percent, "%", clean * np.float32(1 + percent / 100), camera)
    holes = missing(camera, draws("holes"))
    for percent in amounts.holes_percent:
        yield Shot("holes", percent, "%", np.where(holes(percent / 100), np.float32(np.nan), clean), camera)
    for mm in amounts.step_mm:
        yield Shot("quantisation", mm, "mm", stepped(clean, mm / 1000), camera)
    for mm in amounts.height_mm:  # moved, and known to be
        moved = raised(camera, mm / 1000)
        yield Shot("camera height", mm, "mm", observe(render(moved), noise, seed, name), moved)
    for other, (its, own) in others.items():
        height = 1000 * float(its.position[2])
        yield Shot(f"camera {other}", height, "mm high", observe(render(its), own, seed, name), its)
