"""``translucent explain``: what is known about a mesh, and how it would be rendered."""

from __future__ import annotations

import json

import click

from translucent.commands.common import common_options, medium_options, read_medium, read_mesh, read_method, unit_option


@click.command(epilog="Example: translucent explain goblet")
@click.argument("model")
@medium_options
@unit_option
@click.option("--method", "method_name", metavar="NAME", help="Explain this method instead of the planner's choice.")
@common_options
def explain(
    model: str,
    color: str | None,
    distance: str | None,
    preset_name: str | None,
    unit: str,
    method_name: str | None,
    as_json: bool,
) -> None:
    """Say what is known about MODEL, which passes would render it, and why."""
    from translucent.plan import plan
    from translucent.showcase import showcase

    medium = read_medium(color, distance, preset_name)
    mesh = read_mesh(model, unit)
    chosen = plan(showcase(mesh, medium), read_method(method_name, None))
    if as_json:
        click.echo(json.dumps({"mesh": mesh.summary(), "plan": chosen.summary()}))
        return
    low, high = mesh.bounds
    click.echo(
        f"{mesh.name}: {len(mesh.vertices)} vertices, {len(mesh.faces)} faces, "
        f"{' x '.join(f'{v:.4g}' for v in high - low)} m"
    )
    click.echo(f"mesh: {mesh.diagnosis}")
    for repair in mesh.repairs:
        click.echo(f"repaired: {repair}")
    click.echo(f"plan: {chosen}")
