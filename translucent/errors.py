"""The few exceptions of the toolkit: each is also a builtin, and each message says what, found and do.

Messages quote names and values of files that others have made: what is no printable character is escaped here, and what
is too long for a line is shortened here, for all of them.
"""

from __future__ import annotations

#: Characters of the longest message.
LONGEST = 300

#: Characters that every part of a message may have, however long the others are.
_SHARE = 80


def printable(text: str) -> str:
    """`text` with every character that is not printable as an escape: no file's name commands a terminal."""
    if text.isprintable():
        return text
    # Undecodable bytes of file names, which are lone surrogates, are no printable characters either.
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def shortened(text: str, longest: int = LONGEST) -> str:
    """`text` without its middle where it is longer than this; its beginning and its end say the most."""
    if len(text) <= longest:
        return text
    kept = longest - len(" ... ")
    return f"{text[: kept - kept // 3]} ... {text[len(text) - kept // 3 :]}"


def message_of(*parts: str) -> str:
    """The parts that say something in one printable line, the longest ones shortened where it would be too long."""
    found = [printable(part) for part in parts if part]
    room = LONGEST - len("; ") * (len(found) - 1)
    for i in sorted(range(len(found)), key=lambda i: len(found[i]), reverse=True):
        excess = sum(map(len, found)) - room
        if excess > 0:
            found[i] = shortened(found[i], max(len(found[i]) - excess, _SHARE))
    return "; ".join(found)


class TranslucentError(Exception):
    """Base of every error that the toolkit raises on purpose.

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
    """The input cannot be used: a bad file, a value out of its range, an unknown name."""


class UnreadableError(InputError):
    """A file, or a picture in one, is missing or damaged."""


class RenderError(TranslucentError, RuntimeError):
    """The input is fine, yet the work failed: no OpenGL, a shader that does not compile, a full disk."""


class TranslucentWarning(UserWarning):
    """The result can be used, but not all of it: the message counts what is affected."""

    def __init__(self, text: str) -> None:
        super().__init__(message_of(text))
