"""``translucent render``: pictures of a mesh or of a scene."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import click

from translucent.commands.common import (
    common_options,
    draft_option,
    interface_options,
    look_options,
    medium_options,
    outside_option,
    overwrite_option,
    read_any_medium,
    read_environment,
    read_interfaces,
    read_roughness,
    read_scattering,
    read_size,
    refuse_overwriting,
    scattering_medium_options,
    scattering_options,
    stage_option,
    unit_option,
)
from translucent.commands.console import echo
from translucent.commands.darkness import warn_if_black, warn_if_white
from translucent.commands.method_options import (
    caustics_option,
    method_option,
    paths_option,
    read_caustics,
    read_method,
    read_shadows,
    shadow_options,
    with_environment_shadows,
)
from translucent.commands.model import (
    CameraOptions,
    FileLook,
    camera_options,
    is_own,
    medium_lines,
    read_scene,
    require_translucent,
)
from translucent.commands.objects import ObjectCommand, read_objects
from translucent.commands.pictures import Pictures, picture_options
from translucent.commands.progress import Progress
from translucent.errors import InputError

#: Samples of all pixels up to which shaders take longer to compile than pictures to draw with a software rasterizer.
FEW_SAMPLES = 1 << 18


@click.command(
    cls=ObjectCommand, epilog="Example: translucent render goblet -o goblet.png --color '#7b1e3a' --distance 1cm"
)
@click.argument("model")
@click.option(
    "-o", "--output", required=True, type=click.Path(path_type=Path), help="A .png, .exr or .npz file; see --turntable."
)
@medium_options
@scattering_medium_options
@click.option(
    "--object",
    "object_names",
    multiple=True,
    metavar="NAME",
    help="What follows of a medium, as --preset P or --color C --distance D, is this object's alone; may be repeated.",
)
@click.option("--variant", metavar="NAME", help="Materials of this variant of a glTF file (KHR_materials_variants).")
@click.option(
    "--time",
    type=float,
    metavar="S",
    help="Nodes of a glTF file as its animations have them after S seconds, without skins and morph targets. "
    "Default: as the file has them.",
)
@unit_option
@outside_option
@draft_option
@click.option("--size", default="1280x720", show_default=True, metavar="WxH", help="Size of the picture in pixels.")
@camera_options
@stage_option
@look_options
@method_option
@paths_option
@interface_options
@scattering_options
@caustics_option
@shadow_options
@click.option("--thickness", metavar="D", help="Of the sheets of --method thin-layer: 0.3mm. Default: 1mm.")
@click.option("--samples", default=16, show_default=True, metavar="N", help="Samples per pixel, for smooth edges.")
@click.option(
    "--adaptive/--no-adaptive",
    default=True,
    help="Trace rays from smooth interfaces for as many of these as change the picture, or all. Default: --adaptive.",
)
@click.option(
    "--opaque-with",
    type=click.Choice(["pyrender"]),
    help="Let another renderer draw the opaque objects of a glTF file.",
)
@click.option(
    "--transparent",
    is_flag=True,
    help="Leave out what is behind: a picture with alpha, and of the stage no more than shadows (a shadow catcher).",
)
@picture_options
@overwrite_option
@click.option("--backend", metavar="B", help="egl, window, osmesa or cpu. Default: what works here.")
@common_options
def render(
    model: str,
    output: Path,
    color: str | None,
    distance: str | None,
    preset_name: str | None,
    clamp: bool | None,
    scattering_color: str | None,
    mean_free_path: str | None,
    object_names: tuple[str, ...],
    variant: str | None,
    time: float | None,
    unit: str,
    allow_outside: bool,
    draft_extensions: bool,
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
    paths: int | None,
    interfaces_name: str | None,
    interface_depth: int | None,
    interface_forks: int | None,
    scattering_name: str | None,
    diffusion_resolution: int | None,
    caustics: int | None,
    shadow_size: int | None,
    environment_shadows: int | None,
    thickness: str | None,
    samples: int,
    adaptive: bool,
    opaque_with: str | None,
    transparent: bool,
    turntable: int | None,
    fps: float | None,
    aov: Path | None,
    backend: str | None,
    as_json: bool,
) -> None:
    """Render MODEL, a file or one of the toolkit's own meshes, to a picture with its physical quantities.

    The model stands on a ground with its shadow; see --stage. A .glb or .gltf file is rendered as the scene that it is,
    with the media of its materials; --color, --preset or --scattering-color replaces them. All other files are one
    mesh. Behind an --object they are for this object alone:

    translucent render bar.glb -o bar.png --object Wine --preset merlot --object Glass --preset crystal
    """
    import translucent as tl
    from translucent.gpu.drivers import quick_compiles
    from translucent.scene.stages import NO_STAGE, STAGED_TONE
    from translucent.scene.turntable import framed_all_around

    if transparent and (opaque_with is not None or output.suffix.lower() == ".mp4"):
        other = "--opaque-with, which draws what is behind" if opaque_with else "a film, which holds no alpha"
        raise InputError("--transparent", other, "leave out one of the two")
    interfaces = read_interfaces(interfaces_name, interface_depth, interface_forks)
    if interfaces is not None and not interfaces.finds_exits and opaque_with is not None:
        found = "--opaque-with, whose interfaces are those of the screen"
        raise InputError(f"--interfaces {interfaces.name}", found, "leave out one of the two")
    if stage not in (None, NO_STAGE) and opaque_with is not None:
        raise InputError(f"--stage {stage}", "--opaque-with, which throws no such shadows", "leave out one of the two")
    scattering = read_scattering(scattering_name, diffusion_resolution)
    photons = read_caustics(caustics)
    if photons is not None and opaque_with is not None:
        raise InputError("--caustics", "--opaque-with, which draws what light lands on", "leave out one of the two")
    pictures = Pictures(output, exposure, tone or "none", turntable, fps, aov)
    pixels = read_size(size)
    pictures.check(pixels)
    refuse_overwriting(output, model, environment, background)
    if pictures.tiled(pixels) and opaque_with is not None:
        raise InputError(f"--size {size}", "--opaque-with, which draws all of it at once", "leave out one of the two")
    medium = read_any_medium(color, distance, preset_name, clamp, scattering_color, mean_free_path)
    roughness = read_roughness(roughness, preset_name)
    method = read_method(method_name, thickness, paths)
    options = CameraOptions(camera, eye, target, up, fov)
    lit = read_environment(environment, background)
    stage = NO_STAGE if opaque_with is not None else stage
    look = FileLook(read_objects(object_names), variant, time)
    loaded = {"allow_outside": allow_outside, "draft_extensions": draft_extensions}
    scene = read_scene(model, unit, medium, options, pixels, lit, roughness, stage, look=look, **loaded)
    if tone is None and len(scene.shown) < len(scene.objects):
        pictures = pictures._replace(tone=STAGED_TONE)
    scene = with_environment_shadows(scene, environment_shadows)
    require_translucent(model, scene)
    if turntable is not None and camera is None and eye is None:
        scene = framed_all_around(scene, pixels)
    few = pixels[0] * pixels[1] * samples * (turntable or 1) <= FEW_SAMPLES and method is None and photons is None
    with quick_compiles(few):
        opened = tl.Renderer(backend)
    with opened as renderer:
        draw = partial(
            renderer.render,
            size=pixels,
            method=method,
            samples=samples,
            adaptive=adaptive,
            transparent=transparent,
            interfaces=interfaces,
            scattering=scattering,
            caustics=photons,
            shadows=read_shadows(shadow_size),
            progress=Progress(f"rendering on {renderer.provenance.get('renderer', 'the CPU')}"),
        )
        if opaque_with is not None:
            from translucent.interop.pyrender import render_scene

            draw = partial(
                render_scene, size=pixels, method=method, samples=samples, renderer=renderer, scattering=scattering
            )
        tiled = pictures.tiled(pixels)
        if tiled:
            frame, summary = pictures.write_tiles(scene, renderer, draw.keywords)
        else:
            frame = pictures.write(scene, draw)
            summary = frame.summary()
    warn_if_black(scene, frame, unit, own=is_own(model))
    if output.suffix.lower() == ".png":
        warn_if_white(frame, pictures.exposure, pictures.tone)
    media = medium_lines(scene)
    if as_json:
        echo(json.dumps({"output": str(output), "medium": "; ".join(media), **summary}))
        return
    drawn_by = [frame.provenance[key] for key in ("backend", "renderer") if key in frame.provenance]
    echo(f"{output}: {pixels[0]}x{pixels[1]}{', in tiles' if tiled else ''}, {', '.join(drawn_by)}")
    if "opaque" in frame.provenance:
        echo(f"opaque objects: {frame.provenance['opaque']}")
    for line in media:
        echo(f"medium: {line}")
    echo(str(frame.plan))
    echo(", ".join(f"{name} {1e3 * seconds:.1f} ms" for name, seconds in summary["seconds"].items()))
