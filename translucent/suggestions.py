"""Suggestions for misspelled names."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

#: Largest number of names to suggest.
MOST = 4

#: Smallest number of letters with which part of a name suggests that name.
LEAST_PART = 3


def close_names(written: str, known: Iterable[str]) -> list[str]:
    """Names that `written` may stand for: misspelled ones first, then those that hold it or that it holds.

    Parameters
    ----------
    written : str
        In the case of the names.
    known : iterable of str
    """
    names = list(known)
    misspelled = get_close_matches(written, names, n=MOST - 1, cutoff=0.7)
    parts = [name for name in names if min(len(written), len(name)) >= LEAST_PART and _holds(written, name)]
    return list(dict.fromkeys([*misspelled, *sorted(parts, key=len)]))[:MOST]


def did_you_mean(names: Iterable[str]) -> str:
    """The question "did you mean ...?" for one or more names."""
    *others, last = names
    return f"did you mean {', '.join(others)} or {last}?" if others else f"did you mean {last}?"


def _holds(written: str, name: str) -> bool:
    return written in name or name in written
