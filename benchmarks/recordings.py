"""What reading recordings costs: `python benchmarks/recordings.py [FOLDER]`.

One large bag, uncompressed and by chunks of zstd; then as many trials as the paper's Table 2 has, from a folder of the
simulated robot's recordings (data/recordings), judged by fingers and lift, by one process and by as many as there are
cores (docs/recordings.md).
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from made_bags import ARM, SAID, TOPICS, at, entries, write_mcap  # type: ignore[import-not-found]

from graspfn.params import read_yaml, validate
from graspfn.robot import messages
from graspfn.robot.analyse import analyse
from graspfn.robot.read import read_trial, recordings
from graspfn.robot.source import source_of

SECONDS, TRIALS = 15, 600


def large(path: Path, compression: CompressionType) -> Path:
    """Depth of 640x480 at 30 Hz, joints at 1 kHz, around the made trial."""
    rng = np.random.default_rng(0)
    depth = (0.4 + 0.002 * rng.standard_normal((480, 640))).astype(np.float32)
    image = messages.depth_image(depth, "16UC1", messages.header(at(0), "camera_optical"))
    info = messages.camera_info(np.array([[570.0, 0, 319.5], [0, 570, 239.5], [0, 0, 1]]), depth.shape, image["header"])
    found = [entry for entry in entries() if entry[1] not in (TOPICS.depth, TOPICS.camera_info, TOPICS.joints)]
    for i in range(30 * SECONDS):
        found += [(at(i / 30), TOPICS.depth, "sensor_msgs/msg/Image", image)]
        found += [(at(i / 30), TOPICS.camera_info, "sensor_msgs/msg/CameraInfo", info)]
    names = ("wrist", "finger_1", "finger_2")
    for i in range(1000 * SECONDS):
        finger = np.interp(i / 1000, [0, 3, 3.5], [0.1, 0.1, 0.6])
        state = messages.joint_state(names, np.array([0, finger, finger]), messages.header(at(i / 1000), ""))
        found.append((at(i / 1000), TOPICS.joints, "sensor_msgs/msg/JointState", state))
    found.sort(key=lambda entry: entry[0])
    return write_mcap(path, found, SAID, compression=compression, chunk_size=1 << 20)


def peak_mib() -> int:
    return max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)) // 1024


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        read_trial(write_mcap(Path(folder) / "first.mcap", entries()), TOPICS, ARM)  # what is loaded once
        for compression in (CompressionType.NONE, CompressionType.ZSTD):
            path = large(Path(folder) / "large.mcap", compression)
            started, used = time.perf_counter(), time.process_time()
            read_trial(path, TOPICS, ARM)
            wall, cpu = time.perf_counter() - started, time.process_time() - used
            print(f"{path.stat().st_size / 1e6:.0f} MB, chunks {compression.name}: {wall:.2f} s, {cpu:.2f} s of CPU")
    if len(sys.argv) < 2:
        return
    params = validate(read_yaml(Path("params.yaml")))
    _, arm = source_of(params.robot, params.arm, params.gripper)
    with tempfile.TemporaryDirectory() as folder:
        bags = recordings(Path(sys.argv[1]))
        for i in range(TRIALS):
            (Path(folder) / f"{i}-{bags[i % len(bags)].name}").symlink_to(bags[i % len(bags)].absolute())
        few = recordings(Path(folder))[:60]
        analyse(few, params.topics, arm)
        before = peak_mib()
        for name, compute in (("one process", None), ("processes", params.compute)):
            started, used = time.perf_counter(), time.process_time()
            found = analyse(recordings(Path(folder)), params.topics, arm, compute=compute)
            wall, cpu = time.perf_counter() - started, time.process_time() - used
            print(f"{TRIALS} trials, {name}: {wall:.1f} s, {cpu:.1f} s of CPU in this one; {len(found.trials)} differ")
        print(f"peak of memory after 60 trials {before} MiB, after all {peak_mib()} MiB")


if __name__ == "__main__":
    main()
