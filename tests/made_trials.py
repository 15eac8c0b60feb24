"""Trials with known rates, as stage evaluate writes them, for tests of reports."""

import itertools

import numpy as np
import pandas as pd

CELLS = tuple(itertools.product((5.0, 12.5), (10.0, 40.0)))  # sigma_uv [mm], sigma_theta [deg]
TRUE = "true function"
# Of ten objects the first so many are held, whatever the error.
HELD = {
    ("Centroid", ""): 3,
    ("Best Grasp (likeliest class)", "fcn"): 4,
    ("Best Grasp", "fcn"): 5,
    ("Best Grasp", TRUE): 6,
    ("Robust Best Grasp", "fcn"): 7,
    ("Robust Best Grasp", TRUE): 8,
}
LABELLED, ERRORS = 9, 4


def name(i):
    return f"o{i}"


def simulated_trials(seeds=(0,), cells=CELLS, errors=ERRORS):
    """Ten objects, of which LABELLED are; attempts say of the labelled ones exactly what the trials do."""
    rows = []
    for (uv, theta), ((method, network), held) in itertools.product(cells, HELD.items()):
        for seed in seeds if network == "fcn" else (-1,):
            for i, error in itertools.product(range(LABELLED if network == TRUE else 10), range(errors)):
                known = i < LABELLED
                row = {"id": name(i), "method": method, "network": network, "training_seed": seed, "error": error}
                row |= {"sigma_uv_mm": uv, "sigma_theta_deg": theta, "success": i < held, "u_m": 0.0}
                row |= {"promise": np.nan if method == "Centroid" else 0.5, "expected_error": 0.1 if known else np.nan}
                row |= {"expected": float(i < held) if known else np.nan, "effective": 40.0 if known else 0.0}
                rows.append(row)
    return pd.DataFrame(rows).sample(frac=1, random_state=0)


def account(attempts=5, sure=range(2, LABELLED)):
    """Of the labels: o0 and o1 have no pose at which every attempt holds, though the trials hold them."""
    ended = {"untouched": 60, "held": 10, "left": 20, "missed": 5, "collided": 5, "diverged": 0}
    best = {i: attempts if i in sure else attempts - 1 for i in range(LABELLED)}
    return pd.DataFrame([{"id": name(i), "status": "labelled", "best": best[i]} | ended for i in range(LABELLED)])


def disturbed_plans(names, errors=2):
    """As stage disturb writes them: an offset that takes Best Grasp away where the camera's pose is believed."""
    rows = []
    for amount, fit, (method, network) in itertools.product((0.0, -5.0, 5.0), (True, False), HELD):
        if (network == TRUE and (amount or not fit)) or "likeliest" in method:
            continue
        gone = amount != 0 and not fit and method == "Best Grasp"
        for i in (*names, "empty table 0"):
            empty = i not in names
            row = {"id": i, "empty": empty, "disturbance": "offset" if amount else "clean", "amount": amount}
            row |= {"unit": "mm" if amount else "", "table_fit": fit, "method": method, "network": network}
            row |= {"training_seed": 0 if network == "fcn" else -1, "u_m": np.nan if gone else 0.0, "stays": not gone}
            row |= {"highest": 0.1 if network else np.nan, "refused": "table: none" if gone else ""}
            row |= {"held": 0 if gone or empty else 1, "trials": 0 if empty else errors}
            known = not gone and not empty and network != TRUE
            rows.append(row | {"expected": 0.5 if known else np.nan, "effective": 40.0 if known else 0.0})
    return pd.DataFrame(rows)
