"""``translucent render``: pictures of a mesh or of a scene, in one file, or from all around.

Black pictures, by a wrong unit of a file or a medium too dense for it, and white ones are explained in warnings.
"""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click
import numpy as np

from translucent.commands.console import Progress, echo
from translucent.commands.model import (
    CameraOptions,
    FileLook,
    ObjectCommand,
    camera_options,
    is_own,
    medium_lines,
    read_objects,
    read_scene,
    require_translucent,
)
from translucent.commands.options import (
    caustics_option,
    common_options,
    draft_option,
    interface_options,
    look_options,
    medium_options,
    method_option,
    outside_option,
    overwrite_option,
    paths_option,
    read_any_medium,
    read_caustics,
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
from translucent.errors import InputError
from translucent.units import METRES_PER_UNIT, metres_per_unit

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from translucent.frames.frame import Frame
    from translucent.frames.tiled import Tile
    from translucent.media.medium import Medium
    from translucent.renderer import Renderer
    from translucent.scene.scene import Scene


#: Below these shares of light, passed straight or scattered back, a picture shows little but black.
NEARLY_BLACK, HARDLY_LIT = 0.02, 0.05

#: Radiance from which on a picture is white, with what rounding adds, and the share of such pixels that hides a shape.
WHITE, BURNT_OUT = 1.02, 0.3

#: Range of the share of light that passes in a picture that shows its medium.
SHOWS_MEDIUM = (0.05, 0.97)

#: Metres across, from which on a model is rarely one of a thing that light shines through, and what such are usually.
LARGE, USUAL = 0.5, (0.01, 1.0)

#: Units of files, and their names.
_FILE_UNITS = {"mm": "millimetres", "cm": "centimetres", "in": "inches"}


def warn_if_black(scene: Scene, frame: Frame, unit: str, *, own: bool = False) -> None:
    """Warn if hardly any light passes or is scattered back, with the likely reason.

    Parameters
    ----------
    scene : Scene
    frame : Frame
        Of it.
    unit : str
        That the file was taken to be in.
    own : bool
        The model comes with the toolkit, so that its unit is known.
    """
    seen = frame.coverage & frame.valid
    if not seen.any():
        return
    from translucent.planning.darkness import given_back

    passed = float(frame.transmittance[seen].mean())
    if passed >= NEARLY_BLACK or any(given_back(scene, medium) >= HARDLY_LIT for medium in _media(scene)):
        return
    depth = frame.optical_depth[seen].astype(np.float64)
    low, high = (
        np.min([body.bounds[0] for body in scene.bodies], 0),
        np.max([body.bounds[1] for body in scene.bodies], 0),
    )
    thickness = float(np.median(frame.thickness[seen]))
    # Of the channel that gets farthest.
    clearest = float(np.median(depth, axis=0).min())
    tenth = thickness * math.log(10.0) / clearest if clearest > 0 else math.inf
    echo(
        f"warning: only {passed:.2%} of the light passes: the model is {_extent(high - low)} and {_length(thickness)} "
        f"thick at the median, and this medium leaves a tenth of the light after {_length(tenth)}; "
        + (_other_unit(high - low, depth, unit, own) or _clearer(clearest)),
        err=True,
    )


def warn_if_white(frame: Frame, exposure: float, tone: str) -> None:
    """Warn if much of what media cover is beyond the white of a picture that clamps, with what shows it."""
    seen = frame.coverage & frame.valid
    if tone != "none" or not seen.any():
        return
    bright = frame.radiance[seen].astype(np.float64).min(axis=-1) * 2.0**exposure
    if (share := float((bright > WHITE).mean())) < BURNT_OUT:
        return
    darker = exposure - math.ceil(math.log2(float(np.quantile(bright, 0.95))))
    echo(
        f"warning: {share:.0%} of what media cover is brighter than white, and shown as white; "
        f"--tone neutral keeps its shape, and --exposure {darker:g} its brightness",
        err=True,
    )


def _other_unit(size: np.ndarray, depth: np.ndarray, unit: str, own: bool) -> str:
    """Unit in which the model would have a usual size, and the medium would show; empty if there is none."""
    if own or size.max() < LARGE:
        return ""
    for name, words in _FILE_UNITS.items():
        scale = METRES_PER_UNIT[name] / metres_per_unit(unit)
        with np.errstate(under="ignore"):
            passes = float(np.exp(-scale * depth).mean())
        usual = scale < 1 and USUAL[0] <= scale * size.max() <= USUAL[1]
        if usual and SHOWS_MEDIUM[0] <= passes <= SHOWS_MEDIUM[1]:
            return f"is the file in {words}? With --unit {name} it is {_extent(scale * size)}, and {passes:.0%} passes"
    return ""


def _clearer(depth: float) -> str:
    """Factor by which the medium would have to be clearer, for the optical depth of its clearest channel."""
    times = float(f"{depth / math.log(5.0):.2g}")
    return f"in a medium {times:.3g} times as clear (a color at a --distance so much longer), a fifth would pass"


def _media(scene: Scene) -> list[Medium]:
    """Media in which multiple scattering matters."""
    return [
        body.medium for body in scene.bodies if body.medium is not None and body.has_interface and body.medium.scatters
    ]


def _extent(size: np.ndarray) -> str:
    unit, scale = _unit(float(size.max()))
    return f"{' x '.join(f'{value / scale:.3g}' for value in size)} {unit}"


def _length(metres: float) -> str:
    unit, scale = _unit(metres)
    return f"{metres / scale:.3g} {unit}"


def _unit(metres: float) -> tuple[str, float]:
    """Unit in which a length is read best."""
    return next(
        ((name, METRES_PER_UNIT[name]) for name in ("m", "cm", "mm") if metres >= METRES_PER_UNIT[name]), ("um", 1e-6)
    )


#: Pixels from which on a picture is rendered in tiles.
TILED = 1 << 23

#: Width and height up to which OpenGL draws a picture at once, and pixels of the largest picture.
MOST_SIDE, MOST_PIXELS = 1 << 14, 1 << 30

#: Pictures per second of a turntable for which none are given.
FPS = 24.0

#: Bytes of memory that each pixel of a picture takes that is not rendered in tiles, at least: its arrays, read back.
_PIXEL_BYTES = 100

#: Width and height within which a large picture is looked at as a whole.
SMALL = 512


class Pictures(NamedTuple):
    """The options that say what is written, as they were given."""

    output: Path
    exposure: float
    tone: str
    turntable: int | None
    fps: float | None
    aov: Path | None

    @property
    def _rate(self) -> float:
        return FPS if self.fps is None else self.fps

    def tiled(self, size: tuple[int, int]) -> bool:
        """True if a picture of this size is so large that it is rendered and written in tiles."""
        large = size[0] * size[1] > TILED or max(size) > MOST_SIDE
        return large and self.turntable is None and self.output.suffix.lower() != ".npz"

    def check(self, size: tuple[int, int]) -> None:
        """Raise before any work is done if pictures of this size could not be written."""
        from translucent.files.paths import require_folder
        from translucent.frames.animation import check_animation
        from translucent.frames.frame import check_exposure
        from translucent.frames.writing import check_output

        check_exposure(self.exposure)
        self._check_size(size)
        if self.aov is not None and self.tiled(size):
            found = f"{size[0]}x{size[1]} pixels, which are written in tiles"
            raise InputError(f"--aov {str(self.aov)!r}", found, "write an .exr, which holds these quantities")
        if self.aov is not None:
            require_folder(self.aov, f"--aov {str(self.aov)!r}")
        if self.turntable is None:
            if self.fps is not None:
                raise InputError(f"--fps {self.fps:g}", "only --turntable takes it", "add --turntable, or leave it out")
            check_output(self.output)
            return
        check_animation(self.output, self._rate)
        if self.aov is not None:
            raise InputError(f"--turntable {self.turntable}", "--aov is given, too", "render one picture for it")

    def _check_size(self, size: tuple[int, int]) -> None:
        """Raise if nobody could wait for pictures of this size, or memory could not hold them."""
        from translucent.files.reading import require_memory

        asked, pixels = f"--size {size[0]}x{size[1]}", size[0] * size[1]
        if pixels > MOST_PIXELS:
            found = f"{pixels / 1e6:.0f} million pixels, and {MOST_PIXELS / 1e6:.0f} million are the most"
            raise InputError(asked, found, "give a smaller size, at most about 32768x32768")
        if not self.tiled(size):
            do = "give a smaller size" if self.turntable else "give a smaller size, or write an .exr or .png, in tiles"
            found = f"{pixels / 1e6:.0f} million pixels at once"
            require_memory(asked, found, _PIXEL_BYTES * pixels, do)

    def write(self, scene: Scene, draw: Callable[[Scene], Frame]) -> Frame:
        """Draw and write all of them; returns the first frame."""
        if self.turntable is not None:
            return self._write_turntable(scene, draw, self.turntable)
        frame = draw(scene)
        frame.save(self.output, self.exposure, self.tone)
        if self.aov is not None:
            frame.save_aovs(self.aov)
        return frame

    def write_tiles(self, scene: Scene, renderer: Renderer, options: dict[str, Any]) -> tuple[Frame, dict[str, Any]]:
        """Draw and write a large picture; returns a small frame of it, and the statistics of all its pixels."""
        from translucent.frames.tiled import write_tiles
        from translucent.tiles import Totals, render_tiles

        totals, (width, height) = Totals(), options["size"]

        def counted() -> Iterator[Tile]:
            for tile in render_tiles(renderer, scene, **options):
                totals.add(tile.frame)
                yield tile

        write_tiles(self.output, (width, height), counted(), self.exposure, self.tone)
        scale = SMALL / max(width, height)
        small = max(round(scale * width), 1), max(round(scale * height), 1)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # they have been told
            frame = renderer.render(scene, **{**options, "size": small, "samples": 1})
        return frame, totals.summary((width, height))

    def _write_turntable(self, scene: Scene, draw: Callable[[Scene], Frame], count: int) -> Frame:
        from translucent.frames.animation import write_animation
        from translucent.scene.turntable import turntable

        views = turntable(scene, count)
        first = draw(next(views))

        def pictures() -> Iterator[npt.NDArray[np.uint8]]:
            for frame in chain([first], map(draw, views)):
                yield frame.to_srgb8(self.exposure, self.tone)

        write_animation(self.output, pictures(), self._rate)
        return first


def picture_options(command: Callable[..., None]) -> Callable[..., None]:
    """Options that choose what is written besides one picture."""
    command = click.option(
        "--aov",
        type=click.Path(path_type=Path, file_okay=False),
        metavar="DIR",
        help="Also write pictures of thickness, transmittance and validity into this folder.",
    )(command)
    command = click.option(
        "--fps", type=float, metavar="N", help=f"Pictures per second of a --turntable. Default: {FPS:g}."
    )(command)
    return click.option(
        "--turntable",
        type=click.IntRange(2, 3600),
        metavar="N",
        help="N pictures from all around, into a .webp, .gif, .mp4, or a folder of numbered .png files.",
    )(command)


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
