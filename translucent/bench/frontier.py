"""Pareto frontier of a case: the methods that no other beats in both time and accuracy."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from translucent.bench.row import Quantity, Row

#: Factor within which times are equal, as are those within `NOISES` standard errors: two runs differ by as
#: much. A report compares some hundred pairs of rows of about the same time, of which chance takes five for different
#: at two standard errors, and none at three.
TIME_MARGIN = 1.05
NOISES = 3.0

#: Factor within which errors are equal, as are all below `ERROR_FLOOR`: float32 of a path has no more to say.
ERROR_MARGIN = 1.5
ERROR_FLOOR = 1e-6

#: Errors up to a hundred roundings of float32, which the hard cases call exact, are rounding: of two such, neither is
#: the smaller one, whatever the digits say.
ROUNDING = 100 * float(np.finfo(np.float32).eps) / 2


def error_of(row: Row, quantity: Quantity) -> float | None:
    """Root mean square error, by which methods are ranked. None where there is none to trust."""
    errors = row.errors(quantity)
    return None if errors is None else errors.rms


def mark_frontier(rows: Sequence[Row], quantity: Quantity) -> tuple[Row, ...]:
    """Mark the rows on the frontier by `Row.pareto`."""
    shown = [row for row in rows if _coordinates(row, quantity) is not None]
    return tuple(
        dataclasses.replace(
            row, pareto=_coordinates(row, quantity) is not None and not any(beats(o, row, quantity) for o in shown)
        )
        for row in rows
    )


def beats(one: Row, other: Row, quantity: Quantity) -> bool:
    """True if one row is clearly better in time or error, and not clearly worse in the other.

    A row that marks pixels as not to be trusted leaves a part of the picture out: it beats none that marks fewer.
    """
    a, b = _coordinates(one, quantity), _coordinates(other, quantity)
    if a is None or b is None or (one.invalid or 0.0) > (other.invalid or 0.0) + 1e-3:
        return False
    (time_a, noise_a, error_a), (time_b, noise_b, error_b) = a, b
    margin = max((TIME_MARGIN - 1.0) * min(time_a, time_b), NOISES * math.hypot(noise_a, noise_b))
    faster, slower = time_a + margin < time_b, time_a > time_b + margin
    tied = max(error_a, error_b) <= ROUNDING
    better, worse = not tied and error_a * ERROR_MARGIN < error_b, not tied and error_a > error_b * ERROR_MARGIN
    return (faster and not worse) or (better and not slower)


def _coordinates(row: Row, quantity: Quantity) -> tuple[float, float, float] | None:
    """Time, its noise, and error."""
    error = error_of(row, quantity)
    if row.ratio is None or error is None or row.kind == "floor":
        return None
    return row.ratio.median, row.ratio.noise, max(error, ERROR_FLOOR)
