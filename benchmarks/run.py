"""`make bench`: what labelling costs, and whether its shortcuts change any outcome (docs/physics.md).

    python benchmarks/run.py --objects 30 --sample 50

Labels whole objects of Bullet's random ones as the stage does, on the processor's clock. Then the same attempts, a
random sample of each object's, as labelled (culling, early stops), as the reference (every step run) and in MuJoCo.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import itertools
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from objects import committed, finished, resting_objects, results_of, rig_of, touching, unculled

from graspfn.evaluation.statistics import Proportion, proportion
from graspfn.meshes.placed import Resting
from graspfn.params import Params
from graspfn.physics.attempt import Grasper, Outcome, Result
from graspfn.physics.labelling import ENDS, OUTCOMES, RETRIED, label_object
from graspfn.seeds import generator
from graspfn.workflow.cores import cores


@dataclass(frozen=True)
class Measured:
    """One object: seconds of processor time, and (n,) bools of sampled attempts."""

    account: dict[str, int]
    label_s: float
    sampled_s: dict[str, float]  # all sampled attempts: fast, reference and, where it is installed, mujoco
    agree: np.ndarray  # held or not, as labelled and in the reference
    clear: np.ndarray  # attempts not simulated, since they touch nothing: not held in the reference either


def measure(name: str, resting: Resting, params: Params, sample: int) -> Measured:
    rig, rng = rig_of(params), generator(params.seed, "bench", name)
    grasper = Grasper(resting, rig)  # before the clock runs: a process compiles once, not once an object
    started = time.process_time()
    labels = label_object(resting, params.label.attempts, rig, generator(params.seed, "label_grasps", name))
    label_s = time.process_time() - started
    poses = touching(resting, rig, sample, rng)
    ways: dict[str, Callable[[np.ndarray], Result]] = {
        "fast": functools.partial(grasper.run, whole=False),
        "reference": functools.partial(grasper.run, whole=True),
    }
    with contextlib.suppress(ImportError):
        from mujoco_grasp import MujocoGrasper

        ways["mujoco"] = MujocoGrasper(resting, rig).run
    seconds, held = {}, {}
    for way, run in ways.items():
        started = time.process_time()
        held[way] = np.array([run(q).held for q in poses])
        seconds[way] = time.process_time() - started
    near, culled = unculled(resting, rig, rng)
    passed = (q for q in near if grasper.run(q).outcome is Outcome.UNTOUCHED)
    spared = [*itertools.islice(passed, sample // 2), *culled[: sample // 2]]
    clear = [not grasper.run(q, whole=True).held for q in spared]
    return Measured(labels.account, label_s, seconds, held["fast"] == held["reference"], np.array(clear))


def print_labelling(names: Sequence[str], done: Sequence[Measured]) -> None:
    """Seconds per object and attempts per second; the account of all attempts."""
    account = pd.DataFrame([one.account for one in done], index=pd.Index(names, name="object"))
    table = account[list(OUTCOMES)]
    table.insert(0, "seconds", [round(one.label_s, 1) for one in done])
    table.insert(1, "simulated", account[list(ENDS)].sum(axis=1))
    print(table.to_string())
    total, seconds = account.sum(), np.array([one.label_s for one in done])
    simulated, attempts = total[list(ENDS)].sum(), total[list(OUTCOMES)].sum()
    print(
        f"\n{seconds.mean():.1f} s per object and core (median {np.median(seconds):.1f}, most {seconds.max():.1f}) for "
        f"{attempts / len(done):.0f} attempts; {simulated / seconds.sum():.0f} simulated attempts per second and core"
    )
    shares = "; ".join(f"{entry} {total[entry] / attempts:.3%}" for entry in (*OUTCOMES, *ENDS, RETRIED))
    print(f"of all attempts: {shares}")


def print_agreement(done: Sequence[Measured]) -> None:
    """Time of sampled attempts in every way, and how often the shortcuts change an outcome."""
    attempts = sum(len(one.agree) for one in done)
    ms = {way: 1e3 * sum(one.sampled_s[way] for one in done) / attempts for way in done[0].sampled_s}
    for way, each in ms.items():
        print(f"{way:10} {each:7.1f} ms per simulated attempt, {each / ms['fast']:.2f} times the fast one")
    if "mujoco" not in ms:
        print("mujoco not installed: pip install 'graspfn[bench]'")
    agree, clear = (
        proportion(np.concatenate(samples)) for samples in ([d.agree for d in done], [d.clear for d in done])
    )
    print(f"agree with the reference: {_interval(agree)} of {attempts} simulated attempts")
    print(f"not held in the reference either: {_interval(clear)} of {clear.trials} that touch nothing")
    total = pd.DataFrame([one.account for one in done]).sum()
    weights = np.array([total[list(ENDS)].sum(), total[Outcome.UNTOUCHED], total[Outcome.COLLIDED]])
    shares = np.array([[agree.value, clear.value, 1], [agree.low, clear.low, 1]]) @ weights / weights.sum()
    print(
        f"agree, of all attempts: {shares[0]:.4f} (at least {shares[1]:.4f}); inside at the start fails in both alike"
    )


def _interval(share: Proportion) -> str:
    return f"{share.value:.3f} ({share.low:.3f} to {share.high:.3f})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", type=int, default=12)
    parser.add_argument("--sample", type=int, default=20, help="attempts of each object that are run in every way")
    parser.add_argument("--workers", type=int, default=cores())
    arguments = parser.parse_args()
    params = committed()
    objects = resting_objects(params, arguments.objects, arguments.workers)
    tasks = [(name, resting, params, arguments.sample) for name, resting in objects]
    drawn = (name for name, _ in objects)
    measured = dict(finished(drawn, results_of(measure, tasks, arguments.workers, "bench")))
    names, done = list(measured), list(measured.values())
    print_labelling(names, done)
    print_agreement(done)
    print("reproduce: python benchmarks/" + " ".join(["run.py", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
