"""When two times are one."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

#: Times closer than this are one, s.
SAME_TIME = 1e-9


def distinct(times: Iterable[float]) -> tuple[float, ...]:
    """Sort times; of those that differ by round-off only, keep the last."""
    ordered = sorted(set(times))
    kept = [time for time, following in pairwise(ordered) if following - time > SAME_TIME]
    return (*kept, *ordered[-1:])


def among(time: float, times: Iterable[float]) -> bool:
    """Whether a time is one of others."""
    return any(abs(time - other) <= SAME_TIME for other in times)
