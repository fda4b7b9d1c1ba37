"""Claims about shadows and caustics, checked on the numbers of a report."""

from __future__ import annotations

import math
from collections.abc import Sequence

from translucent.bench.claim import over_cases
from translucent.bench.frontier import NOISES
from translucent.bench.record import Claim
from translucent.bench.shadows.record import CONSTANT, HALF, OPAQUE, CausticCase, ShadowCase, Shadows, SkyRow

#: Largest error of transmittance in the rays of texels, for 99.9 % of them.
EXACT = 1e-5

#: Largest time of a map of `USUAL` texels along a side, as a multiple of a depth-only one.
MOST_OF_DEPTH, USUAL = 1.3, 1024

#: Least order with which errors fall with the width of texels, where outlines are among them.
LEAST_ORDER = 0.9

#: Shortcuts are at least so many times as far off, in the median.
FACTOR = 10.0

#: Largest error of so many directions of an environment, as a share of the mean.
SKY_ERROR, DIRECTIONS = 0.05, 32

#: Largest errors of caustics of so many photons: of power, and of irradiance.
POWER_ERROR, CAUSTIC_ERROR, PHOTONS = 0.01, 0.2, 250_000


def shadow_claims(shadows: Shadows) -> tuple[Claim, ...]:
    """All claims about the part, each with the numbers behind it."""
    cases = [case for case in shadows.cases if not case.failure]
    plain = [case for case in cases if case.alike and not case.opaque]
    others = [case for case in cases if case not in plain]
    few = [row for row in shadows.sky if row.directions == DIRECTIONS]
    caustics = [case for case in shadows.caustics if not case.failure]
    least = f"{PHOTONS:,} photons"
    return (
        over_cases(
            f"In the rays of a shadow map's texels, transmittance is within {EXACT:.0e} of the reference, but for one "
            "in a thousand and for outlines",
            cases,
            _exact,
        ),
        over_cases(
            f"Errors of shadows fall with the width of texels, outlines included: order {LEAST_ORDER:g} or better",
            cases,
            _falling,
        ),
        over_cases(
            f"A shadow map takes at most {MOST_OF_DEPTH:g} times as long as one of depth alone, at {USUAL} texels, "
            "where bodies have one medium and nothing opaque is in the way",
            plain,
            _cheap,
        ),
        over_cases("and where media differ, or something opaque is in the way", others, _cheap),
        over_cases(
            f"What others throw is at least {FACTOR:g} times as far off: opaque shadow maps, one thickness, float16",
            cases,
            _shortcuts,
        ),
        over_cases(
            f"Shadows of an environment by {DIRECTIONS} directions are within {SKY_ERROR:.0%} of the mean",
            [_Sky(row.environment, (row,)) for row in few],
            _near_sky,
        ),
        over_cases(
            "Their errors fall with the root of the number of directions, or faster", _skies(shadows), _converging
        ),
        over_cases(f"Caustics have the power of the truth within {POWER_ERROR:.0%}, from {least}", caustics, _powerful),
        over_cases(
            f"Caustics are within {CAUSTIC_ERROR:g} of the mean, blurred by a pixel, from {least}", caustics, _sharp
        ),
    )


class _Sky:
    """Rows of one environment."""

    def __init__(self, name: str, rows: tuple[SkyRow, ...]) -> None:
        self.name, self.rows = name, rows


def _skies(shadows: Shadows) -> Sequence[_Sky]:
    names = dict.fromkeys(row.environment for row in shadows.sky)
    return [_Sky(name, tuple(row for row in shadows.sky if row.environment == name)) for name in names]


def _exact(case: ShadowCase) -> tuple[bool | None, str]:
    if case.texels is None:
        return None, ""
    return case.texels.p999 <= EXACT, f"{case.texels.p999:.1e}"


def _falling(case: ShadowCase) -> tuple[bool | None, str]:
    return (None, "") if case.order is None else (case.order >= LEAST_ORDER, f"{case.order:.2f}")


def _cheap(case: ShadowCase) -> tuple[bool | None, str]:
    found = next((row.ratio for row in case.rows if row.kind == "method" and row.size == USUAL), None)
    if found is None:
        return None, ""
    words = f"{found.median:.2f} ± {found.noise:.2f}"
    if abs(found.median - MOST_OF_DEPTH) <= NOISES * found.noise:
        return None, words
    return found.median <= MOST_OF_DEPTH, words


def _shortcuts(case: ShadowCase) -> tuple[bool | None, str]:
    medians = {row.method: row.errors.median for row in case.rows if row.errors is not None}
    ours = medians.get(f"map of {USUAL}")
    found = [(name, medians[name]) for name in (OPAQUE, CONSTANT, HALF) if name in medians]
    if ours is None or not found:
        return None, ""
    words = ", ".join(f"{name} {error:.1e}" for name, error in found)
    return all(error >= FACTOR * ours for _, error in found), f"{words}; ours {ours:.1e}"


def _near_sky(sky: _Sky) -> tuple[bool | None, str]:
    (row,) = sky.rows
    return row.error <= SKY_ERROR, f"{row.error:.1%}"


def _converging(sky: _Sky) -> tuple[bool | None, str]:
    rows = sorted(sky.rows, key=lambda row: row.directions)
    if len(rows) < 2 or rows[-1].error <= 0.0:
        return None, ""
    fewest, most = rows[0], rows[-1]
    order = math.log(fewest.error / most.error) / math.log(most.directions / fewest.directions)
    words = f"order {order:.2f}, {fewest.error:.3f} with {fewest.directions}, {most.error:.3f} with {most.directions}"
    return order >= 0.5, words


def _powerful(case: CausticCase) -> tuple[bool | None, str]:
    rows = [row for row in case.rows if row.photons >= PHOTONS]
    if not rows:
        return None, ""
    worst = max(rows, key=lambda row: abs(row.power))
    words = f"{worst.power:+.2%} ± {case.power_noise:.2%}"
    if abs(abs(worst.power) - POWER_ERROR) <= case.power_noise:
        return None, words
    return abs(worst.power) <= POWER_ERROR, words


def _sharp(case: CausticCase) -> tuple[bool | None, str]:
    rows = [row for row in case.rows if row.photons >= PHOTONS]
    if not rows:
        return None, ""
    worst = max(rows, key=lambda row: row.nrmse)
    words = f"{worst.nrmse:.3f}, at most {worst.most:.3f}"
    if worst.nrmse <= CAUSTIC_ERROR < worst.most:
        return None, words
    return worst.nrmse <= CAUSTIC_ERROR, words
