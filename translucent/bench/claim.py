"""A claim over several cases of a report."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from translucent.bench.record import CaseRecord, Claim

#: Whether a claim holds on a case, and the numbers behind that in words.
Check = Callable[[CaseRecord], tuple[bool | None, str]]


def over_cases(text: str, cases: Sequence[CaseRecord], check: Check) -> Claim:
    """A claim over several cases: held where it holds on all, and not where it fails on one.

    A check gives no verdict (None) where the case has not the numbers, or they are too noisy, which it tells in words:
    a claim that is undecided anywhere is undecided, unless it fails elsewhere.
    """
    found = [(case, *check(case)) for case in cases]
    known = [(case, held, words) for case, held, words in found if held is not None]
    undecided = [f"undecided on {case.name!r}: {words}" for case, held, words in found if held is None and words]
    if not known:
        return Claim(text, None, "; ".join(undecided) or "no case in this run to check it on")
    wrong = [f"not on {case.name!r}: {words}" for case, held, words in known if not held]
    right = [f"{case.name}: {words}" for case, held, words in known if held]
    held = False if wrong else None if undecided else True
    return Claim(text, held, "; ".join([*wrong, *undecided, *right]))
