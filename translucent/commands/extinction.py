"""``translucent extinction``: from a color at a distance to extinction."""

from __future__ import annotations

import json

import click

from translucent.commands.common import common_options, triple_text


@click.command(epilog="Example: translucent extinction '#7b1e3a' 1cm")
@click.argument("color")
@click.argument("distance")
@common_options
def extinction(color: str, distance: str, as_json: bool) -> None:
    """Extinction of a medium that turns white light into COLOR after DISTANCE: sigma_t = -log(color) / distance."""
    import numpy as np

    from translucent.color import parse_color, to_hex
    from translucent.medium import Medium
    from translucent.units import parse_length

    metres = parse_length(distance)
    medium = Medium.from_color(color, metres)
    factors = (0.1, 0.5, 1.0, 2.0, 10.0)
    colors = medium.transmittance(np.array(factors) * metres)
    with np.errstate(divide="ignore"):
        free_path = 1.0 / medium.extinction
    if as_json:
        click.echo(
            json.dumps(
                {
                    "color": parse_color(color).tolist(),
                    "distance": metres,
                    "extinction": medium.extinction.tolist(),
                    "mean_free_path": [value if np.isfinite(value) else None for value in free_path.tolist()],
                    "transmittance": {f"{factor:g}": row.tolist() for factor, row in zip(factors, colors, strict=True)},
                }
            )
        )
        return
    linear = parse_color(color)
    click.echo(f"color           {triple_text(linear)} linear, {to_hex(linear)} sRGB, after {metres:g} m")
    click.echo(f"extinction      {triple_text(medium.extinction)} 1/m")
    click.echo(f"mean free path  {triple_text(free_path)} m")
    for factor, row in zip(factors, colors, strict=True):
        click.echo(f"after {factor * metres:<9.4g} m {triple_text(row)} linear, {to_hex(row)}")
