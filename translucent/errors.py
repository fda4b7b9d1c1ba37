"""The few exceptions of the toolkit: each is also a builtin, and each message says what, found and do."""

from __future__ import annotations


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
        super().__init__("; ".join(part for part in (what, found, do) if part))


class InputError(TranslucentError, ValueError):
    """The input cannot be used: a bad file, a value out of its range, an unknown name."""


class RenderError(TranslucentError, RuntimeError):
    """The input is fine, yet the work failed: no OpenGL, a shader that does not compile, a full disk."""


class TranslucentWarning(UserWarning):
    """The result can be used, but not all of it: the message counts what is affected."""
