"""The moment at which the fingers begin to close, from the positions of their joints."""

from __future__ import annotations

import numpy as np

from graspfn.robot.trial import RecordingError

GAP_S = 0.5  # between messages, within which the fingers' way is known
MOVED, STILL = 0.2, 0.05  # shares of its longest way: a finger closes; it may wander so far while it stands open


def closing_s(time_s: np.ndarray, positions: np.ndarray, sign: int) -> float | None:
    """The last moment at which the fingers still stood open before they first closed; None where they never did.
    RecordingError where nothing was recorded just then.

    time_s: (T,); positions: (T, fingers), NaN where a message did not name one; sign: 1 where they grow in closing.
    Fingers may open before: what counts is the way from where they were most open. They may let go and close again.
    """
    told = np.isfinite(positions).any(axis=1)
    time_s, shut = time_s[told], sign * np.nanmean(positions[told], axis=1) if told.any() else np.zeros(0)
    if len(shut) < 2:
        return None
    way = shut - np.minimum.accumulate(shut)  # from where they were most open until then
    if not way.max() > 0:
        return None
    closing = int(np.argmax(way >= MOVED * way.max()))
    last = int(np.flatnonzero(way[:closing] <= STILL * way.max())[-1])
    if time_s[last + 1] - time_s[last] > GAP_S:
        raise RecordingError(f"a gap of {time_s[last + 1] - time_s[last]:.1f} s as the fingers begin to close")
    return float(time_s[last])
