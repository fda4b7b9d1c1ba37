"""``translucent render``: a picture of one mesh."""

from __future__ import annotations

import json
from pathlib import Path

import click

from translucent.commands.common import (
    common_options,
    medium_options,
    medium_text,
    read_camera,
    read_environment,
    read_medium,
    read_mesh,
    read_method,
    read_size,
    unit_option,
    warn_if_black,
)


@click.command(epilog="Example: translucent render goblet -o goblet.png --color '#7b1e3a' --distance 1cm")
@click.argument("model")
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="A .png, .exr or .npz file.")
@medium_options
@unit_option
@click.option("--size", default="1280x720", show_default=True, metavar="WxH", help="Size of the picture in pixels.")
@click.option("--eye", metavar="X,Y,Z", help="Position of the camera in metres. Default: the whole model in view.")
@click.option("--target", metavar="X,Y,Z", help="What the camera looks at. Default: the model's center.")
@click.option("--up", default="0,1,0", show_default=True, metavar="X,Y,Z", help="What is up in the picture.")
@click.option("--fov", default=30.0, show_default=True, metavar="DEG", help="Vertical angle of view.")
@click.option("--background", default="studio", show_default=True, help="studio, checkerboard, or a color.")
@click.option("--method", "method_name", metavar="NAME", help="signed-depth, back-face-depth or thin-layer.")
@click.option("--thickness", metavar="D", help="Of the sheets of --method thin-layer: 0.3mm. Default: 1mm.")
@click.option("--samples", default=16, show_default=True, metavar="N", help="Samples per pixel, for smooth edges.")
@click.option("--backend", metavar="B", help="egl, window or osmesa. Default: what works here.")
@common_options
def render(
    model: str,
    output: Path,
    color: str | None,
    distance: str | None,
    preset_name: str | None,
    unit: str,
    size: str,
    eye: str | None,
    target: str | None,
    up: str,
    fov: float,
    background: str,
    method_name: str | None,
    thickness: str | None,
    samples: int,
    backend: str | None,
    as_json: bool,
) -> None:
    """Render MODEL, a file or one of the toolkit's own meshes, to a picture with its physical quantities."""
    from translucent.frame import check_output
    from translucent.gpu.renderer import Renderer
    from translucent.showcase import showcase

    check_output(output)
    pixels = read_size(size)
    medium = read_medium(color, distance, preset_name)
    method = read_method(method_name, thickness)
    environment = read_environment(background)
    mesh = read_mesh(model, unit)
    scene = showcase(mesh, medium, pixels, read_camera(mesh, eye, target, up, fov, pixels), environment)
    with Renderer(backend) as renderer:
        frame = renderer.render(scene, pixels, method, samples)
    frame.save(output)
    warn_if_black(frame)
    if as_json:
        click.echo(json.dumps({"output": str(output), "medium": medium_text(scene), **frame.summary()}))
        return
    click.echo(f"{output}: {pixels[0]}x{pixels[1]}, {frame.provenance['backend']}, {frame.provenance['renderer']}")
    click.echo(f"medium: {medium_text(scene)}")
    click.echo(str(frame.plan))
    click.echo(", ".join(f"{name} {1e3 * seconds:.1f} ms" for name, seconds in frame.seconds.items()))
