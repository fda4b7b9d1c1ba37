"""``translucent render``: pictures of a mesh or of a scene, in one file, or from all around.

Black pictures, by a wrong unit of a file or a medium too dense for it, and white ones are explained in warnings.
"""

from __future__ import annotations

import json
import math
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from translucent.commands.console import ProgressLine, echo, time_text
from translucent.commands.model import (
    ObjectCommand,
    SceneRequest,
    echo_advice,
    files_of,
    is_own,
    medium_lines,
    models_argument,
    read_objects,
    read_scene,
    require_translucent,
    size_text,
)
from translucent.commands.options import (
    BodyOptions,
    CameraOptions,
    ChoiceOptions,
    FileOptions,
    LookOptions,
    ground_option,
    overwrite_option,
    read_size,
    refuse_overwriting,
    stage_option,
    verbose_option,
)
from translucent.commands.verbs import group, option, takes
from translucent.errors import InputError
from translucent.extras import install_command
from translucent.planning.passes import NoteKind, PassName
from translucent.units import METRES_PER_UNIT, extent_text, metres_per_unit, short_length

if TYPE_CHECKING:
    import numpy.typing as npt

    from translucent.frames.frame import Frame
    from translucent.planning.request import RenderRequest
    from translucent.renderer import Renderer
    from translucent.scene.scene import Scene
    from translucent.tiles import Tile

#: Below these fractions of light, passed straight or scattered back, a picture shows little but black.
NEARLY_BLACK, HARDLY_LIT = 0.02, 0.05

#: Radiance from which on a picture is white, with what rounding adds, and the fraction of pixels that hides a shape.
WHITE, BURNT_OUT = 1.02, 0.3

#: Range of the fraction of light that passes in a picture that shows its medium.
SHOWS_MEDIUM = (0.05, 0.97)

#: Triangles from which on the first progress takes long, and seconds of processor time for each, with a software
#: OpenGL.
MANY_FACES, PREPARING = 1_000_000, 2e-5

#: Metres across, from which on a model is rarely one of a thing that light shines through, and what such are usually.
LARGE, USUAL = 0.5, (0.01, 1.0)

#: Units of files, and their names.
_FILE_UNITS = {"mm": "millimetres", "cm": "centimetres", "in": "inches"}

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

#: Samples of all pixels up to which shaders take longer to compile than pictures to draw with a software rasterizer.
FEW_SAMPLES = 1 << 18


@dataclass(frozen=True, kw_only=True)
class RenderOptions:
    """Options of ``translucent render``."""

    output: Path = option(
        names=("-o", "--output"),
        required=True,
        help="Output file: .png, .exr or .npz.",
    )
    system: str | None = option(
        names=("--as",),
        type=click.Choice(["mitsuba"]),
        help=(
            "Instead of a picture, write a scene file for another renderer: an .xml file for Mitsuba 3. "
            "Mitsuba then traces --samples paths per pixel. By default, the file has no stage."
        ),
    )
    medium: BodyOptions = group(BodyOptions)
    object_names: tuple[str, ...] = option(
        (),
        names=("--object",),
        metavar="NAME",
        help=(
            "Give the next medium (--preset P, or --color C --distance D) only to the object of this "
            "name. May be repeated."
        ),
    )
    variant: str | None = option(
        metavar="NAME", help="Use the materials of this variant of a glTF file (KHR_materials_variants)."
    )
    time: float | None = option(
        metavar="S",
        help=(
            "Show a glTF file S seconds after the start of its animations. Default: the pose that the "
            "file stores for nodes, skins and morph targets."
        ),
    )
    file: FileOptions = group(FileOptions)
    size: str = option("1280x720", metavar="WxH", help="Size of the picture.")
    camera: CameraOptions = group(CameraOptions)
    stage: str | None = stage_option()
    ground: str | None = ground_option()
    look: LookOptions = group(LookOptions)
    choices: ChoiceOptions = group(ChoiceOptions)
    samples: int = option(16, metavar="N", help="Number of samples per pixel.")
    denoise: bool = option(
        False,
        help=(
            "Remove the noise of rough surfaces and random paths with Open Image Denoise. The error of "
            "a denoised picture is unknown. 4 denoised samples of frosted glass look like 64 samples."
        ),
    )
    opaque_with: str | None = option(
        type=click.Choice(["pyrender"]), help="Draw the opaque objects of a glTF file with another renderer."
    )
    transparent: bool = option(
        False,
        help="Make the background transparent, with an alpha channel. The ground of a stage then shows only shadows.",
    )
    turntable: int | None = option(
        type=click.IntRange(2, 3600),
        metavar="N",
        help=(
            "Write N pictures of the model from all sides, as a .webp, .gif or .mp4, or as a folder of "
            "numbered .png files."
        ),
    )
    fps: float | None = option(metavar="N", help=f"Number of pictures per second of a --turntable. Default: {FPS:g}.")
    aov: Path | None = option(
        type=click.Path(path_type=Path, file_okay=False),
        metavar="DIR",
        help="Also write pictures of thickness, transmittance and validity into this folder.",
    )
    overwrite: bool = overwrite_option()
    verbose: bool = verbose_option()
    backend: str | None = option(
        metavar="B",
        help=(
            "Renderer: egl, window and osmesa use OpenGL, cpu does not. Default: the first that works on this machine."
        ),
    )


@click.command(
    cls=ObjectCommand,
    usual="output color distance preset object_names height size orbit stage samples transparent turntable",
    epilog="Example: translucent render goblet -o goblet.png --color '#7b1e3a' --distance 1cm",
)
@models_argument()
@takes(RenderOptions)
def render(model: str, given: RenderOptions, as_json: bool) -> None:
    """Render a picture of MODEL.

    MODEL is a file or a built-in mesh. By default, the model stands on a ground that shows its shadow; see --stage.
    A .glb or .gltf file keeps its camera, lights and media; --color, --preset or --scattering-color replaces the
    media. All other files hold one mesh.

    Several models, each with its material: translucent render goblet:crystal wine:red_wine -o wine.png

    To fill only one object of a file, name it before the medium: --object Wine --preset merlot.
    """
    import translucent as tl
    from translucent.frames.animation import framed_all_around
    from translucent.gpu.context import quick_compiles
    from translucent.scene.stages import NO_STAGE, STAGED_TONE

    pixels, began = read_size(given.size), time.perf_counter()
    request = replace(given.choices.read(), samples=given.samples, transparent=given.transparent, denoise=given.denoise)
    pictures = Pictures(given, given.look.tone or "none", pixels)
    _check_together(given, request, pictures)
    if given.system is None:
        pictures.check()
    else:
        from translucent.interop.mitsuba import check_output

        check_output(given.output)
    refuse_overwriting(given.output, *files_of(model), given.look.environment, given.look.background)
    requested = SceneRequest(
        medium=given.medium.read(),
        keeps_ior=given.medium.keeps_ior,
        change=given.medium.change,
        camera=given.camera,
        file=given.file,
        size=pixels,
        environment=given.look.lighting(),
        environment_shadows=given.choices.environment_shadows,
        roughness=given.medium.surface_roughness(given.look.roughness),
        pattern=given.medium.surface_pattern,
        stage=NO_STAGE if given.opaque_with or (given.system and given.stage is None) else given.stage,
        ground=given.ground,
        media=read_objects(given.object_names),
        variant=given.variant,
        time=given.time,
    )
    scene = read_scene(model, requested)
    if given.look.tone is None and len(scene.shown) < len(scene.objects):
        pictures = Pictures(given, STAGED_TONE, pixels)
    require_translucent(model, scene)
    if given.system is not None:
        files = tl.write_mitsuba(scene, pixels, given.output, samples=given.samples)
        names = [str(file) for file in files]
        echo(json.dumps({"output": names[0], "files": names}) if as_json else "\n".join(names))
        return
    if given.turntable is not None and given.camera.camera is None and given.camera.eye is None:
        scene = framed_all_around(scene, pixels)
    few = pixels[0] * pixels[1] * given.samples * (given.turntable or 1) <= FEW_SAMPLES
    with quick_compiles(few and request.method is None and request.caustics is None):
        opened = tl.Renderer(given.backend)
    with opened as renderer:
        tell_of_many_faces(scene)
        progress = ProgressLine(f"rendering on {renderer.provenance.get('renderer', 'the CPU')}")
        draw = partial(renderer.render_requested, size=pixels, request=request, progress=progress)
        if given.opaque_with is not None:
            from translucent.interop.pyrender import render_scene

            draw = partial(
                render_scene,
                size=pixels,
                method=request.method,
                samples=request.samples,
                renderer=renderer,
                scattering=request.scattering,
            )
        if pictures.tiled:
            frame, summary = pictures.write_tiles(scene, renderer, request, progress)
        else:
            frame = pictures.write(scene, draw)
            summary = frame.summary()
    black = black_text(scene, frame, given.file.unit or "m", own=is_own(model) or bool(given.file.sizes))
    white = white_text(frame, given.look.exposure, pictures.tone) if given.output.suffix.lower() == ".png" else ""
    media = medium_lines(scene)
    if as_json:
        said = {"medium": "; ".join(media), "model_size": size_text(scene)}
        echo(json.dumps({"output": str(given.output), **said, **summary}))
    else:
        drawn_by = [frame.provenance[key] for key in ("backend", "renderer") if key in frame.provenance]
        tiled, took = ", in tiles" if pictures.tiled else "", time.perf_counter() - began
        echo(f"{given.output}: {pixels[0]}x{pixels[1]}{tiled}, {', '.join(drawn_by)}, {took:.1f} s")
        if "opaque" in frame.provenance:
            echo(f"opaque objects: {frame.provenance['opaque']}")
        if given.verbose:
            for line in media:
                echo(f"medium: {line}")
            echo(str(frame.plan))
            echo(", ".join(f"{name} {1e3 * seconds:.1f} ms" for name, seconds in summary["seconds"].items()))
        # What the picture says of darkness is more than what its plan does.
        remarks = [str(note) for note in frame.plan.remarks if not (black and note.kind is NoteKind.BLACK)]
        if not request.denoise and not pictures.tiled and (grain := grain_text(frame, scene)):
            remarks.append(grain)
        echo_advice(scene, remarks)
    for text in filter(None, (black, white)):
        echo(f"warning: {text}", err=True)


def _check_together(given: RenderOptions, request: RenderRequest, pictures: Pictures) -> None:
    """Raise `InputError` if two options exclude each other."""
    from translucent.scene.stages import NO_STAGE

    if given.system is not None:
        chosen = {
            "--method": request.method,
            "--interfaces": request.interfaces,
            "--scattering": request.scattering,
            "--caustics": request.caustics,
            "--opaque-with": given.opaque_with,
            "--turntable": given.turntable,
            "--aov": given.aov,
            "--transparent": given.transparent or None,
            "--denoise": given.denoise or None,
        }
        if wrong := [name for name, value in chosen.items() if value is not None]:
            found = f"--as {given.system} writes a scene for another renderer, which ignores this option"
            raise InputError(wrong[0], found, "omit one of the two options")
        return
    if given.transparent and given.opaque_with is None and given.output.suffix.lower() == ".mp4":
        found = "a film format cannot store a transparent background"
        raise InputError("--transparent", found, "omit --transparent, or write pictures instead of a film")
    if given.opaque_with is None:
        return
    interfaces = request.interfaces
    clashes = {
        "--transparent": (given.transparent, "it draws the background"),
        "--denoise": (given.denoise, "the picture then comes from two renderers"),
        f"--interfaces {interfaces and interfaces.name}": (
            interfaces is not None and not interfaces.finds_exits,
            "it needs interfaces in screen space",
        ),
        f"--stage {given.stage}": (given.stage not in (None, NO_STAGE), "it draws no shadows of the stage"),
        "--caustics": (request.caustics is not None, "it draws the objects that caustics would illuminate"),
        f"--size {given.size}": (pictures.tiled, "it cannot draw such a large picture"),
    }
    for requested, (clash, why) in clashes.items():
        if clash:
            raise InputError(requested, f"not possible with --opaque-with: {why}", f"omit {requested} or --opaque-with")


class Pictures:
    """Writer of pictures of a size, as the options say."""

    def __init__(self, given: RenderOptions, tone: str, size: tuple[int, int]) -> None:
        self.output, self.exposure, self.tone, self.size = given.output, given.look.exposure, tone, size
        self.denoise = given.denoise
        self.turntable, self.fps, self.aov = given.turntable, given.fps, given.aov

    @property
    def _rate(self) -> float:
        return FPS if self.fps is None else self.fps

    @property
    def tiled(self) -> bool:
        """True if a picture is so large that it is rendered and written in tiles."""
        large = self.size[0] * self.size[1] > TILED or max(self.size) > MOST_SIDE
        return large and self.turntable is None and self.output.suffix.lower() != ".npz"

    def check(self) -> None:
        """Raise before any work is done if pictures could not be written."""
        from translucent.files.paths import require_folder
        from translucent.frames.animation import check_animation
        from translucent.frames.frame import check_exposure
        from translucent.frames.writing import check_output

        check_exposure(self.exposure)
        self._check_size()
        if self.denoise and self.tiled:
            found = f"{self.size[0]}x{self.size[1]} pixels are rendered in tiles, and the denoiser would show seams"
            raise InputError("--denoise", found, "choose a smaller picture size, or omit --denoise")
        if self.aov is not None and self.tiled:
            found = f"{self.size[0]}x{self.size[1]} pixels are rendered in tiles, without --aov"
            raise InputError(f"--aov {str(self.aov)!r}", found, "write an .exr, which also stores these quantities")
        if self.aov is not None:
            require_folder(self.aov, f"--aov {str(self.aov)!r}")
        if self.turntable is None:
            if self.fps is not None:
                raise InputError(
                    f"--fps {self.fps:g}", "this option applies only to --turntable", "add --turntable, or omit --fps"
                )
            check_output(self.output)
            return
        check_animation(self.output, self._rate)
        if self.aov is not None:
            raise InputError(
                f"--turntable {self.turntable}",
                "--aov writes the quantities of a single picture",
                "render a single picture to get these quantities",
            )

    def _check_size(self) -> None:
        """Raise if the picture size is above the limit, or needs too much memory."""
        from translucent.files.reading import require_memory

        width, height = self.size
        requested, pixels = f"--size {width}x{height}", width * height
        if pixels > MOST_PIXELS:
            found = f"{pixels / 1e6:.0f} million pixels are more than the limit of {MOST_PIXELS / 1e6:.0f} million"
            raise InputError(requested, found, "choose a smaller picture size, at most about 32768x32768")
        if not self.tiled:
            do = "give a smaller size" if self.turntable else "give a smaller size, or write an .exr or .png"
            found = f"{pixels / 1e6:.0f} million pixels at once"
            require_memory(requested, found, _PIXEL_BYTES * pixels, do)

    def write(self, scene: Scene, draw: Callable[[Scene], Frame]) -> Frame:
        """Render and write all pictures; returns the first frame."""
        if self.turntable is not None:
            return self._write_turntable(scene, draw, self.turntable)
        frame = draw(scene)
        frame.save(self.output, self.exposure, self.tone)
        if self.aov is not None:
            frame.save_aovs(self.aov)
        return frame

    def write_tiles(
        self, scene: Scene, renderer: Renderer, request: RenderRequest, progress: Callable[[float], None]
    ) -> tuple[Frame, dict[str, Any]]:
        """Draw and write a large picture; returns a small frame of it, and the statistics of all its pixels."""
        from translucent.tiles import Totals, tiles_requested, write_tiles

        totals, (width, height) = Totals(), self.size

        def counted() -> Iterator[Tile]:
            for tile in tiles_requested(renderer, scene, self.size, request, progress=progress):
                totals.add(tile.frame)
                yield tile

        write_tiles(self.output, (width, height), counted(), self.exposure, self.tone)
        scale = SMALL / max(width, height)
        small = max(round(scale * width), 1), max(round(scale * height), 1)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # they have been reported
            frame = renderer.render_requested(scene, small, replace(request, samples=1), progress=progress)
        return frame, totals.summary((width, height))

    def _write_turntable(self, scene: Scene, draw: Callable[[Scene], Frame], count: int) -> Frame:
        from translucent.frames.animation import turntable, write_animation

        views = turntable(scene, count)
        first = draw(next(views))

        def pictures() -> Iterator[npt.NDArray[np.uint8]]:
            for frame in chain([first], map(draw, views)):
                yield frame.to_srgb8(self.exposure, self.tone)

        write_animation(self.output, pictures(), self._rate)
        return first


def black_text(scene: Scene, frame: Frame, unit: str, *, own: bool = False) -> str:
    """Warning where hardly any light passes or is scattered back, with the likely reason; empty for other pictures.

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
    visible = frame.coverage & frame.valid
    if not visible.any():
        return ""
    from translucent.planning.remarks import scattered_back

    passed = float(frame.transmittance[visible].mean())
    media = [body.medium for body in scene.bodies if body.medium is not None and body.has_interface]
    if passed >= NEARLY_BLACK or any(scattered_back(scene, one) >= HARDLY_LIT for one in media if one.scatters):
        return ""
    depth = frame.optical_depth[visible].astype(np.float64)
    low, high = (
        np.min([body.bounds[0] for body in scene.bodies], 0),
        np.max([body.bounds[1] for body in scene.bodies], 0),
    )
    thickness = float(np.median(frame.thickness[visible]))
    # Of the channel that gets farthest.
    clearest = float(np.median(depth, axis=0).min())
    tenth = thickness * math.log(10.0) / clearest if clearest > 0 else math.inf
    # How much clearer the medium would have to be for a fifth to pass.
    times = float(f"{clearest / math.log(5.0):.2g}")
    clearer = f"with --dilute {times:.3g}, a fifth of the light would pass"
    return (
        f"only {passed:.2%} of the light passes: the model is {extent_text(high - low)} and "
        f"{short_length(thickness)} thick (median), and a tenth of the light is left after {short_length(tenth)} in "
        f"this medium; {_other_unit(high - low, depth, unit, own) or clearer}"
    )


def grain_text(frame: Frame, scene: Scene) -> str:
    """Advice against the noise of clear bodies with rough surfaces; empty for other scenes."""
    from translucent.frames.denoising import CLEAR

    clear = [one for one in scene.bodies if one.has_interface and one.medium and not np.any(one.medium.scattering)]
    rough = [item.mesh.name for item in clear if item.surface is not None and item.surface.roughness > CLEAR]
    if not rough or not any(step.name is PassName.TRACED for step in frame.plan.passes):
        return ""
    install = install_command("denoise")
    return f"'{rough[0]}' is rough and clear, which leaves grain: --denoise takes it away ({install})"


def white_text(frame: Frame, exposure: float, tone: str) -> str:
    """Warning that many pixels of media are brighter than white, with advice; empty for other pictures."""
    visible = frame.coverage & frame.valid
    if tone != "none" or not visible.any():
        return ""
    bright = frame.radiance[visible].astype(np.float64).min(axis=-1) * 2.0**exposure
    if (fraction := float((bright > WHITE).mean())) < BURNT_OUT:
        return ""
    darker = exposure - math.ceil(math.log2(float(np.quantile(bright, 0.95))))
    return (
        f"{fraction:.0%} of the pixels of media are brighter than white, and appear white; --tone neutral "
        f"compresses them, and --exposure {darker:g} darkens the picture"
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
            return (
                f"is the file in {words}? With --unit {name} it is {extent_text(scale * size)}, and {passes:.0%} passes"
            )
    return ""


def tell_of_many_faces(scene: Scene) -> None:
    """Say how long large meshes take before the first progress, and that this can be stopped."""
    faces = sum(len(mesh.faces) for mesh in {item.mesh for item in scene.objects})
    if faces >= MANY_FACES:
        spent = time_text(PREPARING * faces)
        echo(f"preparing {faces:,} triangles: up to {spent} of processor time; Ctrl-C stops it", err=True)
