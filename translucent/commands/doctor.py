"""``translucent doctor``: what this machine has."""

from __future__ import annotations

import json

import click

from translucent.commands.console import echo
from translucent.commands.options import common_options
from translucent.errors import TranslucentError


@click.command(epilog="Example: translucent doctor")
@common_options
def doctor(as_json: bool) -> None:
    """Explain this machine: OpenGL, packages, and what is missing for what."""
    from translucent import doctor as examination

    facts = examination.examine()
    echo(json.dumps(facts) if as_json else examination.report(facts))
    if facts["backend"] is None:
        raise TranslucentError("rendering", "neither OpenGL nor Embree works", "see the lines above")
