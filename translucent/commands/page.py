"""``translucent page``: a scene as one file for any browser."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import click

from translucent.commands.console import echo
from translucent.commands.model import (
    CameraOptions,
    camera_options,
    medium_lines,
    read_scene,
    require_translucent,
)
from translucent.commands.options import (
    common_options,
    interface_options,
    look_options,
    medium_options,
    method_option,
    outside_option,
    overwrite_option,
    read_any_medium,
    read_environment,
    read_interfaces,
    read_method,
    read_roughness,
    read_scattering,
    read_shadows,
    read_size,
    refuse_overwriting,
    scattering_medium_options,
    scattering_options,
    shadow_options,
    stage_option,
    unit_option,
    with_environment_shadows,
)
from translucent.errors import RenderError
from translucent.units import parse_length

#: Values of --poster that are no files.
RENDERED, NO_POSTER = "rendered", "none"


@click.command(epilog="Example: translucent page goblet -o goblet.html --color '#7b1e3a' --distance 1cm")
@click.argument("model")
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="An .html file.")
@medium_options
@scattering_medium_options
@unit_option
@outside_option
@click.option(
    "--size", default="1280x800", show_default=True, metavar="WxH", help="Of the poster, and of what the view frames."
)
@camera_options
@stage_option
@look_options
@method_option
@interface_options
@scattering_options
@shadow_options
@click.option("--thickness", metavar="D", help="Of the sheets of --method thin-layer: 0.3mm. Default: 1mm.")
@click.option("--samples", default=16, show_default=True, metavar="N", help="Samples per pixel while nothing moves.")
@click.option("--title", metavar="TEXT", help="Of the page. Default: the name of the model.")
@click.option(
    "--poster",
    default=RENDERED,
    show_default=True,
    metavar="PICTURE",
    help="Shown until the scene is, and where there is no WebGL2: a .png, .jpg or .webp, rendered, or none.",
)
@click.option("--simplify", type=int, metavar="N", help="Show a copy of the model with about N triangles.")
@overwrite_option
@common_options
def page(
    model: str,
    output: Path,
    color: str | None,
    distance: str | None,
    preset_name: str | None,
    clamp: bool | None,
    scattering_color: str | None,
    mean_free_path: str | None,
    unit: str,
    allow_outside: bool,
    size: str,
    camera: int | None,
    eye: str | None,
    target: str | None,
    up: str | None,
    fov: float | None,
    stage: str | None,
    environment: str | None,
    background: str | None,
    exposure: float,
    tone: str | None,
    roughness: float | None,
    method_name: str | None,
    interfaces_name: str | None,
    interface_depth: int | None,
    interface_forks: int | None,
    scattering_name: str | None,
    diffusion_resolution: int | None,
    shadow_size: int | None,
    environment_shadows: int | None,
    thickness: str | None,
    samples: int,
    title: str | None,
    poster: str,
    simplify: int | None,
    as_json: bool,
) -> None:
    """Write MODEL, a file or one of the toolkit's own meshes, as a page that any browser with WebGL2 shows.

    One file, which fetches nothing: to turn around, with the material on a panel, the thickness in false colors, and a
    probe. It runs the passes of the renderer; what it leaves out is told here and on the page.
    """
    from translucent.page.plans import plan_page
    from translucent.page.simplify import simplified, triangles
    from translucent.page.write import check_output, check_page_size, poster_of, save_page
    from translucent.scene.stages import STAGED_TONE

    check_output(output)
    refuse_overwriting(output, model, environment, background)
    pixels = check_page_size(read_size(size))
    picture = _read_poster(poster)
    medium = read_any_medium(color, distance, preset_name, clamp, scattering_color, mean_free_path)
    options = CameraOptions(camera, eye, target, up, fov)
    lit = read_environment(environment, background)
    scene = read_scene(
        model,
        unit,
        medium,
        options,
        pixels,
        lit,
        read_roughness(roughness, preset_name),
        stage,
        allow_outside=allow_outside,
    )
    scene = with_environment_shadows(scene, environment_shadows)
    require_translucent(model, scene)
    before = triangles(scene)
    if simplify is not None:
        scene = simplified(scene, simplify)
    curve = tone or (STAGED_TONE if len(scene.shown) < len(scene.objects) else "none")
    planned = plan_page(
        scene,
        read_method(method_name, thickness, None),
        interfaces=read_interfaces(interfaces_name, interface_depth, interface_forks),
        scattering=read_scattering(scattering_name, diffusion_resolution),
        shadows=read_shadows(shadow_size),
    )
    if distance is not None:
        planned = dataclasses.replace(planned, distance=parse_length(distance))
    if poster == RENDERED:
        try:
            picture = poster_of(planned, pixels, exposure, curve)
        except RenderError as error:
            echo(f"warning: no poster: {error}", err=True)
    written = save_page(planned, output, title or Path(model).stem, pixels, samples, exposure, curve, picture)
    notes = [{"kind": str(note.kind), "text": str(note)} for note in planned.notes]
    media = medium_lines(scene, planned.panel_distance)  # as the panel shows them
    if as_json:
        told = {
            "output": str(output),
            "bytes": written,
            "triangles": triangles(scene),
            "plan": planned.plan.summary(),
            "notes": notes,
        }
        echo(json.dumps({**told, "medium": "; ".join(media)}))
        return
    echo(f"{output}: {written / 1e6:.2f} MB")
    if simplify is not None:
        echo(f"simplified: {before:,} triangles to {triangles(scene):,}")
    for line in media:
        echo(f"medium: {line}")
    echo(str(planned.plan))
    for note in planned.own_notes:
        echo(f"  page: {note}")


def _read_poster(poster: str) -> bytes | None:
    """Picture of a file."""
    if poster in (RENDERED, NO_POSTER):
        return None
    from translucent.files.paths import require_file
    from translucent.page.write import check_poster

    require_file(Path(poster), f"--poster {poster!r}")
    return check_poster(Path(poster).read_bytes(), f"--poster {poster!r}")
