"""``python -m translucent.bench``: measure, print a table, and write JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

from translucent.bench.cases import CASES, METHODS
from translucent.bench.measure import measure, table
from translucent.errors import TranslucentError
from translucent.frame import write_atomically


@click.command()
@click.option("--json", "output", type=click.Path(path_type=Path), help="Write the rows to this file.")
@click.option("--seconds", default=4.0, show_default=True, help="Time to spend on each case.")
@click.option("--size", default=1024, show_default=True, help="Width and height in pixels.")
@click.option("--backend", help="egl, window or osmesa. Default: what works here.")
def main(output: Path | None, seconds: float, size: int, backend: str | None) -> None:
    """Time and error of each thickness method, interleaved, against a depth-only pass over the same geometry."""
    try:
        result = measure(CASES, METHODS, (size, size), seconds, backend)
        if output is not None:
            output.parent.mkdir(parents=True, exist_ok=True)
            text = json.dumps(result, indent=1)
            write_atomically(output, lambda path: _write_text(path, text))
    except TranslucentError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(1)
    click.echo(table(result))


def _write_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
