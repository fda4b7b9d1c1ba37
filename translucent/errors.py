"""Exceptions of the toolkit, whose messages name the request, the finding and a remedy; suggestions of known names."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

#: Characters of the longest message.
LONGEST = 300

#: Characters that every part of a message keeps, however long the others are.
_SHARE = 80


def printable(text: str) -> str:
    """`text` with every character that is not printable escaped, so that no file name can send control codes to a
    terminal.
    """
    if text.isprintable():
        return text
    # Undecodable bytes of file names, which are lone surrogates, are no printable characters either.
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def shortened(text: str, longest: int = LONGEST) -> str:
    """`text` with its middle cut out if it exceeds the limit."""
    if len(text) <= longest:
        return text
    kept = longest - len(" ... ")
    return f"{text[: kept - kept // 3]} ... {text[len(text) - kept // 3 :]}"


def message_of(*parts: str) -> str:
    """Join the nonempty parts into one printable line, with the longest parts shortened if it is too long."""
    found = [printable(part) for part in parts if part]
    room = LONGEST - len("; ") * (len(found) - 1)
    for i in sorted(range(len(found)), key=lambda i: len(found[i]), reverse=True):
        excess = sum(map(len, found)) - room
        if excess > 0:
            found[i] = shortened(found[i], max(len(found[i]) - excess, _SHARE))
    return "; ".join(found)


class TranslucentError(Exception):
    """Base class of every error that the toolkit raises on purpose.

    Parameters
    ----------
    what : str
        What was asked for.
    found : str
        What was found instead, and where.
    do : str
        What the user can do about it.
    """

    def __init__(self, what: str, found: str = "", do: str = "") -> None:
        super().__init__(message_of(what, found, do))


class InputError(TranslucentError, ValueError):
    """Error for input that cannot be used: a bad file, a value out of its range, an unknown name."""


class UnreadableError(InputError):
    """Error for a file, or an image in a file, that is missing or damaged."""


class RenderError(TranslucentError, RuntimeError):
    """Error for work that failed although the input is fine: no OpenGL, a shader that does not compile, a full disk."""


class TranslucentWarning(UserWarning):
    """Warning that part of a result cannot be used: the message counts what is affected."""

    def __init__(self, text: str) -> None:
        super().__init__(message_of(text))


#: Largest number of names to suggest.
MOST = 4

#: Smallest number of letters with which part of a name suggests that name.
LEAST_PART = 3


def close_names(written: str, known: Iterable[str]) -> list[str]:
    """Names that `written` may mean: misspelled ones first, then longer and shorter ones.

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


def closest_name(written: str, known: Iterable[str], otherwise: str) -> str:
    """The question "did you mean ...?" for the closest known name; if none is close, the advice `otherwise`."""
    close = get_close_matches(written, list(known), n=1)
    return did_you_mean(close) if close else otherwise


def did_you_mean(names: Iterable[str]) -> str:
    """The question "did you mean ...?" for one or more names."""
    *others, last = names
    return f"did you mean {', '.join(others)} or {last}?" if others else f"did you mean {last}?"


def _holds(written: str, name: str) -> bool:
    return written in name or name in written
