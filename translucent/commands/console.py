"""Output to the terminal: control characters from files are escaped, and only the toolkit's own lines have colors."""

from __future__ import annotations

import errno
import os
import re
from typing import TextIO

import click

from translucent.errors import RenderError, printable

#: Printable sequences: ends of lines, tabs, and swatches such as those of `translucent.media.swatches`.
_KEPT = re.compile(r"(\n|\t|\x1b\[48;2;\d{1,3};\d{1,3};\d{1,3}m {2,8}\x1b\[0m)")


def echo(text: str, *, err: bool = False, nl: bool = True, color: bool | None = None) -> None:
    """Print text; what is not printable in it is escaped, but for line ends, tabs and swatches.

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
        if err or error.errno == errno.EPIPE:  # who has read enough is no failure: click ends quietly
            raise
        found = f"it cannot be written ({error.strerror})"
        raise RenderError("standard output", found, "check the disk, and where it is redirected to") from error


def is_terminal(stream: TextIO | None) -> bool:
    """True if somebody reads along; a stream that the shell has closed is None."""
    return stream is not None and stream.isatty()


def takes_colors(stream: TextIO | None) -> bool:
    """True if a stream is a terminal whose user wants colors, see https://no-color.org."""
    return is_terminal(stream) and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def overwrite(text: str) -> None:
    """Print text over the last line on stderr, which has no end."""
    click.echo(f"\r{printable(text)}", nl=False, err=True)
