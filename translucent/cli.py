"""The command line: parse, call the public API, write. Errors are one line; ``--debug`` shows the traceback."""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from translucent.errors import InputError, TranslucentError

if TYPE_CHECKING:
    from translucent.camera import Camera
    from translucent.lights import Environment
    from translucent.medium import Medium
    from translucent.mesh import Mesh
    from translucent.thickness import Method

F = TypeVar("F", bound=Callable[..., Any])


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code: 0 done, 1 failed at run time, 2 bad usage or input."""
    given = sys.argv[1:] if arguments is None else arguments
    warnings.showwarning = lambda message, *_, **__: click.echo(f"warning: {message}", err=True)
    try:
        cli.main(args=given, prog_name="translucent", standalone_mode=False)
    except click.exceptions.Abort:
        return _failed("interrupted", 130)
    except click.ClickException as error:
        context = getattr(error, "ctx", None)
        command = context.command_path if context else "translucent"
        return _failed(f"{error.format_message().rstrip('.')}; see '{command} --help'", 2)
    except TranslucentError as error:
        if "--debug" in given:
            raise
        return _failed(str(error), 2 if isinstance(error, InputError) else 1)
    except KeyboardInterrupt:
        return _failed("interrupted", 130)
    return 0


def _failed(message: str, code: int) -> int:
    click.echo(f"error: {message}", err=True)
    return code


@click.group(no_args_is_help=False, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(package_name="translucent-shading", prog_name="translucent")
def cli() -> None:
    """Translucent materials on meshes, with the exact thickness along every view ray."""


def _common(command: F) -> F:
    """Options of every verb."""
    command = click.option("--debug", is_flag=True, expose_value=False, help="Show the traceback of an error.")(command)
    return click.option("--json", "as_json", is_flag=True, help="Print the result as one JSON object.")(command)


def _medium_options(command: F) -> F:
    command = click.option("--preset", "preset_name", metavar="NAME", help="A named medium, such as merlot.")(command)
    command = click.option("--distance", metavar="D", help="Distance at which light has the color: 2cm, 0.8in.")(
        command
    )
    return click.option("--color", metavar="C", help="Transmitted color: '#7b1e3a', teal, 'linear(.18,.62,.35)'.")(
        command
    )


def _unit_option(command: F) -> F:
    return click.option("--unit", default="m", show_default=True, help="Unit of the file's coordinates.")(command)


@cli.command(epilog="Example: translucent render goblet -o goblet.png --color '#7b1e3a' --distance 1cm")
@click.argument("model")
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="A .png, .exr or .npz file.")
@_medium_options
@_unit_option
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
@_common
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
    pixels = _size(size)
    medium = _medium(color, distance, preset_name)
    method = _method(method_name, thickness)
    environment = _environment(background)
    mesh = _mesh(model, unit)
    scene = showcase(mesh, medium, pixels, _camera(mesh, eye, target, up, fov, pixels), environment)
    with Renderer(backend) as renderer:
        frame = renderer.render(scene, pixels, method, samples)
    frame.save(output)
    if as_json:
        click.echo(json.dumps({"output": str(output), **frame.summary()}))
        return
    click.echo(f"{output}: {pixels[0]}x{pixels[1]}, {frame.provenance['backend']}, {frame.provenance['renderer']}")
    click.echo(str(frame.plan))
    click.echo(", ".join(f"{name} {1e3 * seconds:.1f} ms" for name, seconds in frame.seconds.items()))


@cli.command(epilog="Example: translucent explain goblet")
@click.argument("model")
@_medium_options
@_unit_option
@click.option("--method", "method_name", metavar="NAME", help="Explain this method instead of the planner's choice.")
@_common
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

    medium = _medium(color, distance, preset_name)
    mesh = _mesh(model, unit)
    chosen = plan(showcase(mesh, medium), _method(method_name, None))
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


@cli.command(epilog="Example: translucent extinction '#7b1e3a' 1cm")
@click.argument("color")
@click.argument("distance")
@_common
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
    click.echo(
        f"color           {_triple(parse_color(color))} linear, {to_hex(parse_color(color))} sRGB, after {metres:g} m"
    )
    click.echo(f"extinction      {_triple(medium.extinction)} 1/m")
    click.echo(f"mean free path  {_triple(free_path)} m")
    for factor, row in zip(factors, colors, strict=True):
        click.echo(f"after {factor * metres:<9.4g} m {_triple(row)} linear, {to_hex(row)}")


@cli.command(epilog="Example: translucent doctor")
@_common
def doctor(as_json: bool) -> None:
    """Explain this machine: OpenGL, packages, and what is missing for what."""
    from translucent import doctor as examination

    facts = examination.examine()
    click.echo(json.dumps(facts) if as_json else examination.report(facts))
    if facts["backend"] is None:
        raise TranslucentError("OpenGL 3.3", "no backend works without a window", "see the lines above")


def _mesh(model: str, unit: str) -> Mesh:
    from translucent.assets import mesh_names, mesh_path
    from translucent.mesh import load_mesh

    if model in mesh_names() and not Path(model).exists():
        return load_mesh(mesh_path(model))
    return load_mesh(model, unit=unit)


def _medium(color: str | None, distance: str | None, preset_name: str | None) -> Medium | None:
    from translucent.medium import Medium
    from translucent.presets import preset
    from translucent.units import parse_length

    if preset_name is not None:
        if color is not None or distance is not None:
            raise InputError(f"--preset {preset_name}", "--color or --distance is given, too", "give one or the other")
        return preset(preset_name).medium
    if (color is None) != (distance is None):
        given, missing = ("--color", "--distance") if distance is None else ("--distance", "--color")
        raise InputError(given, f"{missing} is missing", "give both: a color has a meaning only at a distance")
    return None if color is None or distance is None else Medium.from_color(color, parse_length(distance))


def _method(name: str | None, thickness: str | None) -> Method | None:
    from translucent.thickness import ThinLayer, method_from_name
    from translucent.units import parse_length

    method = method_from_name(name) if name else None
    if thickness is None:
        return method
    if not isinstance(method, ThinLayer):
        raise InputError("--thickness", "only --method thin-layer takes it", "add --method thin-layer")
    return ThinLayer(parse_length(thickness))


def _environment(background: str) -> Environment | None:
    from translucent.lights import Environment

    if background == "studio":
        return None
    if background == "checkerboard":
        return Environment.checkerboard((0.9, 0.9, 0.9), (0.6, 0.6, 0.6), tiles=12)
    return Environment.constant(background)


def _camera(
    mesh: Mesh, eye: str | None, target: str | None, up: str, fov: float, size: tuple[int, int]
) -> Camera | None:
    from translucent.camera import Camera

    if eye is None:
        if target is not None:
            raise InputError("--target", "--eye is missing", "give both, or neither")
        if fov == 30.0 and up == "0,1,0":
            return None
        return Camera.framing(mesh.vertices[mesh.faces].reshape(-1, 3), size, fov_y=fov, up=_vector("--up", up))
    return Camera.look_at(
        _vector("--eye", eye),
        mesh.center if target is None else _vector("--target", target),
        _vector("--up", up),
        fov_y=fov,
    )


def _vector(option: str, text: str) -> list[float]:
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != 3:
        raise InputError(f"{option} {text!r}", "not three numbers", f"write for example {option} 0,1.5,4")
    return values


def _size(text: str) -> tuple[int, int]:
    from translucent.camera import check_size

    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        raise InputError(f"--size {text!r}", "not WxH", "write for example --size 1280x720") from None
    return check_size((width, height))


def _triple(values: Any) -> str:
    return " ".join(f"{value:10.5g}" for value in values)


if __name__ == "__main__":
    sys.exit(main())
