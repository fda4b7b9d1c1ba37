"""Progress of work that takes long, told on stderr: how much is done, and how long the rest will take."""

from __future__ import annotations

import sys
import time

from translucent.commands.console import echo, is_terminal, overwrite

#: Seconds before anything is told, and between two tellings: in a terminal, and in a file.
TERMINAL, FILE = (1.0, 0.5), (10.0, 30.0)


class Progress:
    """Teller of the share of work that is done.

    Parameters
    ----------
    what : str
        What goes on, and on what.
    """

    def __init__(self, what: str) -> None:
        self._what = what
        self._begun: tuple[float, float] | None = None
        self._told = 0.0
        self._terminal = is_terminal(sys.stderr)
        self._width = 0

    def __call__(self, share: float) -> None:
        """Tell the share, 0 to 1, if it is time."""
        now = time.monotonic()
        # Shaders are compiled before the first share is known: that says nothing about the rest.
        begun, least = self._begun = self._begun or (now, share)
        spent = now - begun
        if share >= 1.0:
            self._begun, self._told = None, 0.0  # the next picture begins anew
            if self._width:
                overwrite(" " * self._width)
                overwrite("")
                self._width = 0
            return
        before, between = TERMINAL if self._terminal else FILE
        if share <= least or spent < before or (self._told and now - self._told < between):
            return
        self._told = now
        text = f"{self._what}: {share:.0%}, about {time_text(spent * (1.0 - share) / (share - least))} left"
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
