"""Output to the terminal, and progress of work that takes long.

Control characters from files are escaped, and only the toolkit's own lines have colors.
"""

from __future__ import annotations

import errno
import os
import re
import sys
import time
from functools import partial
from typing import TextIO

import click

from translucent.errors import RenderError, printable

#: Printable sequences: ends of lines, tabs, and swatches such as those of `translucent.media.colors`.
_KEPT = re.compile(r"(\n|\t|\x1b\[48;2;\d{1,3};\d{1,3};\d{1,3}m {2,8}\x1b\[0m)")


#: Seconds before the first line of progress, and between two: in a terminal, and in a file, where long
#: work has fewer lines: half as many seconds as have been spent lie between them.
TERMINAL, FILE = (1.0, 0.5), (10.0, 30.0)


def echo(text: str, *, err: bool = False, nl: bool = True, color: bool | None = None) -> None:
    """Print text with unprintable characters escaped, except line ends, tabs and swatches.

    Once nobody reads any more, as ``head`` does not after its lines, nothing is printed: that is no failure.

    Raises
    ------
    RenderError
        If standard output takes no more, as on a full disk.
    """
    parts = _KEPT.split(text)
    shown = "".join(part if i % 2 else printable(part) for i, part in enumerate(parts))
    try:
        click.echo(shown, err=err, nl=nl, color=color)
    except OSError as error:
        if error.errno == errno.EPIPE:
            _discard(sys.stderr if err else sys.stdout)
            return
        if err:
            raise
        found = f"the output cannot be written ({error.strerror})"
        raise RenderError("standard output", found, "check the disk, and the target of the redirection") from error


def advise(text: str) -> None:
    """Print advice on stderr, behind all that the running command prints."""
    say = partial(echo, f"note: {text}", err=True)
    context = click.get_current_context(silent=True)
    say() if context is None else context.call_on_close(say)


def _discard(stream: TextIO) -> None:
    """Discard the buffer of a stream, and all later output."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


def is_terminal(stream: TextIO | None) -> bool:
    """True if somebody reads along; a stream that the shell has closed is None."""
    return stream is not None and stream.isatty()


def takes_colors(stream: TextIO | None) -> bool:
    """True if a stream is a terminal whose user wants colors, see https://no-color.org."""
    return is_terminal(stream) and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def overwrite(text: str) -> None:
    """Print text over the last line on stderr, which has no end."""
    click.echo(f"\r{printable(text)}", nl=False, err=True)


class ProgressLine:
    """Line of progress: the finished fraction of some work, and the time left.

    Parameters
    ----------
    what : str
        What goes on, and on what.
    """

    def __init__(self, what: str) -> None:
        self._what = what
        self._begun: tuple[float, float] | None = None
        self._reported = 0.0
        self._terminal = is_terminal(sys.stderr)
        self._width = 0

    def __call__(self, fraction: float) -> None:
        """Report the fraction, 0 to 1, if it is time."""
        now = time.monotonic()
        # Shaders are compiled before the first fraction is known: that says nothing about the rest.
        begun, least = self._begun = self._begun or (now, fraction)
        spent = now - begun
        if fraction >= 1.0:
            self._begun, self._reported = None, 0.0  # the next picture begins anew
            if self._width:
                overwrite(" " * self._width)
                overwrite("")
                self._width = 0
            return
        before, between = TERMINAL if self._terminal else (FILE[0], max(FILE[1], 0.5 * spent))
        if fraction <= least or spent < before or (self._reported and now - self._reported < between):
            return
        self._reported = now
        text = f"{self._what}: {fraction:.0%}, about {time_text(spent * (1.0 - fraction) / (fraction - least))} left"
        if self._terminal:
            overwrite(text.ljust(self._width))
            self._width = max(self._width, len(text))
        else:
            echo(text, err=True)


def time_text(seconds: float) -> str:
    """A time in words: ``40 s``, ``3 min``, ``2.5 h``."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.1f} h"
