"""What the paper prints (Johns, Leutenegger, Davison, IROS 2016): its sections, the success rates of its tables."""

from __future__ import annotations

import math

# By the paper's own commands; tests/test_citations.py holds every citation to them.
SECTIONS = {
    "I": "Introduction",
    "II": "Related work",
    "III": "Defining a target pose",
    "IV": "Generating training data",
    "IV-A": "Physics simulation",
    "IV-B": "Image simulation",
    "IV-C": "Grasp synthesis",
    "V": "Learning the grasp function",
    "VI": "Grasp execution",
    "VII": "Experiments",
    "VII-A": "Simulation",
    "VII-B": "Real-world grasping",
    "VIII": "Conclusions",
}

# Rows of Table I: sigma_theta 10, 20, 30, 40 degrees; within each, sigma_uv 5, 10, 15, 20 mm.
_TABLE_1 = {
    "Centroid": (
        (0.767, 0.732, 0.689, 0.638),
        (0.742, 0.716, 0.669, 0.620),
        (0.730, 0.698, 0.654, 0.61),
        (0.703, 0.639, 0.648, 0.587),
    ),
    "Best Grasp": (
        (0.832, 0.789, 0.720, 0.612),
        (0.813, 0.772, 0.699, 0.587),
        (0.800, 0.767, 0.697, 0.555),
        (0.753, 0.740, 0.655, 0.548),
    ),
    "Robust Best Grasp": (
        (0.838, 0.813, 0.780, 0.756),
        (0.828, 0.801, 0.763, 0.697),
        (0.801, 0.779, 0.754, 0.688),
        (0.767, 0.768, 0.731, 0.656),
    ),
}
# Table II: (sigma_uv 6.2 mm, sigma_theta 4.7 degrees) and (20, 15).
_TABLE_2 = {"Centroid": (0.752, 0.648), "Best Grasp": (0.780, 0.624), "Robust Best Grasp": (0.803, 0.701)}

# method, sigma_uv_mm, sigma_theta_deg: success rate
TABLE_1 = {
    (method, float(uv), float(theta)): rate
    for method, rows in _TABLE_1.items()
    for theta, row in zip((10, 20, 30, 40), rows, strict=True)
    for uv, rate in zip((5, 10, 15, 20), row, strict=True)
}
TABLE_2 = {
    (method, *condition): rate
    for method, row in _TABLE_2.items()
    for condition, rate in zip(((6.2, 4.7), (20.0, 15.0)), row, strict=True)
}


def table_1(method: str, sigma_uv_mm: float, sigma_theta_deg: float) -> float:
    """The paper's success rate in Table 1, NaN where it has none."""
    return TABLE_1.get((method, float(sigma_uv_mm), float(sigma_theta_deg)), math.nan)


def table_2(method: str, sigma_uv_mm: float, sigma_theta_deg: float) -> float:
    """The paper's success rate in Table 2, NaN where it has none."""
    return TABLE_2.get((method, float(sigma_uv_mm), float(sigma_theta_deg)), math.nan)
