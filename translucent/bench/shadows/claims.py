"""Claims about shadows and caustics, checked on the numbers of a report."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from translucent.bench.frontier import NOISES
from translucent.bench.record import Claim
from translucent.bench.shadows.record import (
    CONSTANT,
    HALF,
    OPAQUE,
    CausticCase,
    CausticMediumCase,
    CausticRow,
    ShadowCase,
    Shadows,
    SkyRow,
)

#: Largest error of transmittance in the rays of texels, for 99.9 % of them.
EXACT = 1e-5

#: Largest time of a map of `USUAL` texels along a side, as a multiple of a depth-only one.
MOST_OF_DEPTH, USUAL = 1.3, 1024

#: Least order with which errors fall with the width of texels, where outlines are among them.
LEAST_ORDER = 0.9

#: Shortcuts are at least so many times as far off, in the median.
FACTOR = 10.0

#: Smaller errors of transmittance than this are float32's, and count as it.
LEAST_ERROR = 1e-6

#: Largest error of so many directions of an environment, as a share of the mean.
SKY_ERROR, DIRECTIONS = 0.05, 32

#: Least order with which these errors fall with the number of directions.
LEAST_SKY_ORDER = 0.5

#: Largest errors of caustics of so many photons: of power, and of irradiance.
POWER_ERROR, CAUSTIC_ERROR, PHOTONS = 0.01, 0.2, 250_000


@dataclass(frozen=True)
class _Check:
    """Check of a claim on one case.

    Attributes
    ----------
    where : str
    value : float
        The larger, the worse.
    held : bool or None
        None where noise leaves it open.
    words : str
    """

    where: str
    value: float
    held: bool | None
    words: str


def shadow_claims(shadows: Shadows) -> tuple[Claim, ...]:
    """All claims about the part, each with the numbers behind it."""
    cases = [case for case in shadows.cases if not case.failure]
    plain = [case for case in cases if case.alike and not case.opaque]
    others = [case for case in cases if case not in plain]
    caustics = [case for case in shadows.caustics if not case.failure]
    least = f"{PHOTONS:,} photons"
    return (
        _over(
            "In the rays of a shadow map's texels, transmittance is within 1e-5 of the reference, but for one "
            "in a thousand and for outlines",
            map(_exact, cases),
        ),
        _over(
            f"Errors of shadows fall with the width of texels, outlines included: order {LEAST_ORDER:g} or better",
            map(_falling, cases),
        ),
        _over(
            f"A shadow map takes at most {MOST_OF_DEPTH:g} times as long as one of depth alone, at {USUAL} texels, "
            "where bodies have one medium and nothing opaque is in the way",
            map(_cheap, plain),
        ),
        _over(
            f"It takes at most {MOST_OF_DEPTH:g} times as long where media differ, or something opaque is in the way",
            map(_cheap, others),
        ),
        _over(
            f"Opaque shadow maps, one thickness for each body and float16 are at least {FACTOR:g} times as far off as "
            f"a map of {USUAL}, in the median",
            map(_shortcuts, cases),
        ),
        _over(
            f"Shadows of an environment by {DIRECTIONS} directions are within {SKY_ERROR:.0%} of the mean",
            (_near_sky(row) for row in shadows.sky if row.directions == DIRECTIONS),
        ),
        _over(
            "Errors of shadows of an environment fall with the root of the number of directions, or faster",
            map(_converging, _by_environment(shadows)),
        ),
        _over(f"Caustics have the power of the truth within {POWER_ERROR:.0%}, from {least}", map(_powerful, caustics)),
        _over(
            f"Caustics are within {CAUSTIC_ERROR:g} of the mean, blurred by a pixel, from {least}",
            map(_sharp, caustics),
        ),
        _over(
            f"In fog, wax and milk, light behind glass is within {CAUSTIC_ERROR:g} of the mean, with photons",
            (_near_in_medium(case) for case in shadows.media if not case.failure),
        ),
    )


def _over(text: str, found: Iterable[_Check | None]) -> Claim:
    """A claim over several cases: the worst of them if it holds, and else those where it does not."""
    checks = sorted((check for check in found if check is not None), key=lambda check: -check.value)
    if not checks:
        return Claim(text, None, "nothing in this run to check it on")
    wrong = [f"not on {one.where!r}: {one.words}" for one in checks if one.held is False]
    vague = [f"undecided on {one.where!r}: {one.words}" for one in checks if one.held is None]
    count = sum(one.held is True for one in checks)
    worst = next((f"worst of {count}: {one.where}, {one.words}" for one in checks if one.held), "")
    held = False if wrong else None if vague else True
    return Claim(text, held, "; ".join(filter(None, [*wrong, *vague, worst])))


def _exact(case: ShadowCase) -> _Check | None:
    if case.texels is None:
        return None
    return _Check(case.name, case.texels.p999, case.texels.p999 <= EXACT, f"{case.texels.p999:.1e}")


def _falling(case: ShadowCase) -> _Check | None:
    return (
        None if case.order is None else _Check(case.name, -case.order, case.order >= LEAST_ORDER, f"{case.order:.2f}")
    )


def _cheap(case: ShadowCase) -> _Check | None:
    found = next((row.ratio for row in case.rows if row.kind == "method" and row.size == USUAL), None)
    if found is None:
        return None
    vague = abs(found.median - MOST_OF_DEPTH) <= NOISES * found.noise
    held = None if vague else found.median <= MOST_OF_DEPTH
    return _Check(case.name, found.median, held, f"{found.median:.2f} ± {found.noise:.2f}")


def _shortcuts(case: ShadowCase) -> _Check | None:
    medians = {row.method: row.errors.median for row in case.rows if row.errors is not None}
    ours = medians.get(f"map of {USUAL}")
    found = [(medians[name], name) for name in (OPAQUE, CONSTANT, HALF) if name in medians]
    if ours is None or not found:
        return None
    error, name = min(found)
    factor = error / max(ours, LEAST_ERROR)
    return _Check(case.name, -factor, factor >= FACTOR, f"{name} {error:.1e}, {factor:.2g} times")


def _near_sky(row: SkyRow) -> _Check:
    return _Check(row.environment, row.error, row.error <= SKY_ERROR, f"{row.error:.1%}")


def _by_environment(shadows: Shadows) -> Iterator[list[SkyRow]]:
    for name in dict.fromkeys(row.environment for row in shadows.sky):
        yield sorted((row for row in shadows.sky if row.environment == name), key=lambda row: row.directions)


def _converging(rows: list[SkyRow]) -> _Check | None:
    fewest, most = rows[0], rows[-1]
    if fewest.directions == most.directions or not most.error > 0.0:
        return None
    order = math.log(fewest.error / most.error) / math.log(most.directions / fewest.directions)
    words = f"order {order:.2f}: {fewest.error:.1%} with {fewest.directions}, {most.error:.1%} with {most.directions}"
    return _Check(fewest.environment, -order, order >= LEAST_SKY_ORDER, words)


def _many(case: CausticCase) -> list[CausticRow]:
    return [row for row in case.rows if row.photons >= PHOTONS]


def _powerful(case: CausticCase) -> _Check | None:
    if not (rows := _many(case)):
        return None
    off = max(rows, key=lambda row: abs(row.power)).power
    vague = abs(abs(off) - POWER_ERROR) <= case.power_noise
    held = None if vague else abs(off) <= POWER_ERROR
    return _Check(case.name, abs(off), held, f"{off:+.2%}, that of the truth ± {case.power_noise:.2%}")


def _sharp(case: CausticCase) -> _Check | None:
    if not (rows := _many(case)):
        return None
    worst = max(rows, key=lambda row: row.nrmse)
    held = None if worst.nrmse <= CAUSTIC_ERROR < worst.most else worst.nrmse <= CAUSTIC_ERROR
    return _Check(case.name, worst.nrmse, held, f"{worst.nrmse:.3f}, at most {worst.most:.3f}")


def _near_in_medium(case: CausticMediumCase) -> _Check | None:
    if not (rows := [row for row in case.rows if row.photons]):
        return None
    row = rows[-1]
    held = None if row.nrmse <= CAUSTIC_ERROR < row.most else row.nrmse <= CAUSTIC_ERROR
    without = "".join(f"; without {one.nrmse:.3f}" for one in case.rows if not one.photons)
    return _Check(case.name, row.nrmse, held, f"{row.nrmse:.3f}, at most {row.most:.3f}{without}")
