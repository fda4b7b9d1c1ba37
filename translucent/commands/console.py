"""Output to the terminal: control characters from files are escaped, and only the toolkit's own lines have colors."""

from __future__ import annotations

import re

import click

from translucent.errors import printable

#: Printable sequences: ends of lines, tabs, and swatches such as those of `translucent.media.swatches`.
_KEPT = re.compile(r"(\n|\t|\x1b\[48;2;\d{1,3};\d{1,3};\d{1,3}m {2,8}\x1b\[0m)")


def echo(text: str, *, err: bool = False, nl: bool = True, color: bool | None = None) -> None:
    """Print text; what is not printable in it is escaped, but for line ends, tabs and swatches."""
    parts = _KEPT.split(text)
    click.echo("".join(part if i % 2 else printable(part) for i, part in enumerate(parts)), err=err, nl=nl, color=color)


def overwrite(text: str) -> None:
    """Print text over the last line on stderr, which has no end."""
    click.echo(f"\r{printable(text)}", nl=False, err=True)
