"""The moment at which the fingers begin to close, from the positions of their joints."""

from __future__ import annotations

import numpy as np

from graspfn.robot.trial import RecordingError

GAP_S = 0.5  # between messages, within which the fingers' way is known
STILL = 0.05  # share of its whole way that a finger may wander while it stands open


def closing_s(time_s: np.ndarray, positions: np.ndarray, sign: int) -> float | None:
    """The last moment at which the fingers still stood open before they went furthest shut; None where they never did.
    RecordingError where nothing was recorded just then.

    time_s: (T,); positions: (T, fingers), NaN where a message did not name one; sign: 1 where they grow in closing.
    Fingers may open first: what counts is the way from where they were most open.
    """
    told = np.isfinite(positions).any(axis=1)
    time_s, shut = time_s[told], sign * np.nanmean(positions[told], axis=1) if told.any() else np.zeros(0)
    if len(shut) < 2:
        return None
    most = int(np.argmax(shut))
    before = shut[: most + 1]
    way = before[-1] - before.min()
    if not way > 0:
        return None
    last = int(np.flatnonzero(before <= before.min() + STILL * way)[-1])
    if time_s[last + 1] - time_s[last] > GAP_S:
        raise RecordingError(f"a gap of {time_s[last + 1] - time_s[last]:.1f} s as the fingers begin to close")
    return float(time_s[last])
