"""Groups of options that verbs share."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

import click

from translucent.commands.console import advise, echo
from translucent.commands.verbs import NamesOf, group, option
from translucent.errors import InputError
from translucent.planning.flags import Flags

if TYPE_CHECKING:
    import numpy.typing as npt

    from translucent.arrays import Array
    from translucent.media.medium import Medium
    from translucent.planning.interfaces import InterfaceMode
    from translucent.planning.methods import Method
    from translucent.planning.request import RenderRequest
    from translucent.planning.scattering import Scattering
    from translucent.scene.environment import Environment

#: Index of refraction of media that ``--scattering-color`` makes: that of soap, wax, skin and milk is 1.33 to 1.5.
SCATTERING_IOR = 1.4

#: Default field of view in degrees, and up vector, of a camera that options define.
DEFAULT_FOV, DEFAULT_UP = 30.0, "0,1,0"

#: Key under which a verb finds whether it may replace a file that it reads.
_OVERWRITE = "translucent.overwrite"


def clamp_option() -> Any:
    """Option that replaces color channels of 0, which would need an infinite extinction."""
    reported = "Replace color channels below 1e-4 by 1e-4, with a warning; or refuse channels of 0. Default: --clamp."
    return option(names=("--clamp/--no-clamp",), help=reported)


@dataclass(frozen=True, kw_only=True)
class MediumOptions:
    """Options that choose a medium by its transmitted color, or by name."""

    color: str | None = option(
        metavar="C", help="Color that the medium transmits: '#7b1e3a', salmon, 'linear(.18,.62,.35)'."
    )
    distance: str | None = option(metavar="D", help="Distance after which light has this color: 2cm.")
    preset: str | None = option(metavar="NAME", help="A named medium, such as merlot.")
    clamp: bool | None = clamp_option()

    def read(self, *, shows_scattering: bool = False) -> Medium | None:
        """Chosen medium, if any; warns if a preset needs scattered light and the verb does not render it."""
        from translucent.media.medium import Medium
        from translucent.media.presets import preset
        from translucent.units import parse_length

        color, distance = self.color, self.distance
        if self.preset is not None:
            if color is not None or distance is not None:
                requested, found = f"--preset {self.preset}", "--color or --distance is given, too"
                raise InputError(requested, found, "use one or the other")
            chosen = preset(self.preset)
            if chosen.warning and not shows_scattering:
                echo(f"warning: {chosen.warning}", err=True)
            return chosen.medium
        if (color is None) != (distance is None):
            given, missing = ("--color", "--distance") if distance is None else ("--distance", "--color")
            raise InputError(given, f"{missing} is missing", "give both: a color has a meaning only at a distance")
        if color is None or distance is None:
            return None
        metres = parse_length(distance)
        if metres >= 1.0 and not distance.strip()[-1:].isalpha():
            advise(f"--distance {distance} means {metres:g} m; to use another unit, write for example {distance}cm")
        applied, warnings = clamped(color) if self.clamp is not False else (color, [])
        medium = Medium.from_color(applied, metres)
        for line in warnings:
            echo(f"warning: {line}", err=True)
        return medium

    def surface_roughness(self, stated: float | None = None) -> float | None:
        """Roughness that is stated, or that the preset's surfaces have; if neither, surfaces keep their own."""
        from translucent.media.presets import preset

        return (preset(self.preset).roughness or None) if stated is None and self.preset is not None else stated

    @property
    def surface_pattern(self) -> str:
        """Pattern of the preset's surfaces, or nothing."""
        from translucent.media.presets import preset

        return preset(self.preset).pattern if self.preset is not None else ""


@dataclass(frozen=True, kw_only=True)
class AnyMediumOptions(MediumOptions):
    """Options that choose a medium by its transmitted color, by its scattering color, or by name."""

    scattering_color: str | None = option(
        metavar="C",
        help=(
            "With --mean-free-path: color of a thick body that scatters light. The index of refraction "
            f"of this body is {SCATTERING_IOR:g}. For wax: --scattering-color '#f2e0b8' --mean-free-path "
            "2mm."
        ),
    )
    mean_free_path: str | None = option(
        metavar="L",
        help=(
            "With --scattering-color: mean distance that light travels before it is "
            "scattered or absorbed, such as 0.5mm."
        ),
    )

    def read(self, *, shows_scattering: bool = True) -> Medium | None:
        """Medium that is chosen, if any."""
        from translucent.media.albedo import scattering_medium
        from translucent.units import parse_length

        color, length = self.scattering_color, self.mean_free_path
        if color is None and length is None:
            return super().read(shows_scattering=shows_scattering)
        given, missing = "--scattering-color", "--mean-free-path"
        if color is None:
            given, missing = missing, given
        others = {"--color": self.color, "--distance": self.distance, "--preset": self.preset}
        if other := [name for name, value in others.items() if value is not None]:
            raise InputError(
                given,
                f"{other[0]} is given, too, and both options define a medium",
                "give only one of the two",
            )
        if color is None or length is None:
            do = "give both: the color alone does not determine how far light goes into the body"
            raise InputError(given, f"{missing} is missing", do)
        return scattering_medium(color, parse_length(length), ior=SCATTERING_IOR)


@dataclass(frozen=True, kw_only=True)
class BodyOptions(AnyMediumOptions):
    """Options that choose what bodies are made of: a medium, and the interface around it."""

    ior: float | None = option(
        type=click.FloatRange(1.0, 100.0),
        metavar="N",
        help=(
            "Index of refraction. At 1, light enters without refraction, as in fog. Default: the index "
            f"of the preset or the file, {SCATTERING_IOR:g} with --scattering-color, otherwise 1.5 "
            "(glass)."
        ),
    )

    dilute: float | None = option(
        type=click.FloatRange(0.0, 1e12, min_open=True),
        metavar="F",
        help="Divide the coefficients of the medium by F. With F = 5, light travels five times as far.",
    )

    def read(self, *, shows_scattering: bool = True) -> Medium | None:
        """Chosen medium, if any, before dilution."""
        from translucent.scene.showcase import SOLID_IOR

        medium = super().read(shows_scattering=shows_scattering)
        if medium is None:
            return None
        if self.color is not None and not medium.extinction.any():
            do = "for white wax or milk, use --preset wax, or --scattering-color white --mean-free-path 2mm"
            advise(f"--color {self.color} absorbs no light, so the medium looks like clear glass; {do}")
        ior = self.ior or (SOLID_IOR if self.color is not None else medium.ior)
        return medium if ior == medium.ior else dataclasses.replace(medium, ior=ior)

    def changed(self, medium: Medium) -> Medium:
        """Medium as it is diluted, with the index of refraction that is requested."""
        medium = medium if self.dilute is None else medium.diluted(self.dilute)
        return medium if self.ior is None else dataclasses.replace(medium, ior=self.ior)

    @property
    def change(self) -> Callable[[Medium], Medium] | None:
        """Change of media that is requested, if any."""
        return None if self.dilute is None and self.ior is None else self.changed

    @property
    def keeps_ior(self) -> bool:
        """True if objects keep the index of refraction of their file, because the options only state a color."""
        return self.color is not None and self.ior is None


def clamped(color: str) -> tuple[npt.ArrayLike, list[str]]:
    """Clamp channels of a color that are too dark, with a warning if there were any."""
    from translucent.media.colors import parse_color
    from translucent.media.conversion import CLAMP, clamp_colors

    triple, changed = clamp_colors(parse_color(color))
    # As it was written, if nothing is to be done: errors repeat it.
    return (triple, [f"channels of the color below {CLAMP:g} were set to {CLAMP:g}"]) if changed.any() else (color, [])


def outside_option() -> Any:
    """Option to read files outside the folder of a model."""
    return option(
        False,
        help=(
            "Also read files outside the folder of MODEL, if MODEL links to them. Use this only for "
            "models that you trust."
        ),
    )


@dataclass(frozen=True, kw_only=True)
class FileOptions:
    """Options for how the file of a model is read."""

    unit: str | None = option(
        metavar="U", help="Unit of the coordinates in the file: mm, cm, in, ... or 25mm. Default: m."
    )
    height: str | None = option(metavar="L", help="Scale the model to this height: 12cm.")
    longest: str | None = option(metavar="L", help="Scale the model so that its longest side has this length: 12cm.")
    allow_outside: bool = outside_option()
    draft_extensions: bool = option(
        False,
        help=(
            "Read the draft extensions KHR_materials_scatter and KHR_materials_volume_scatter, if MODEL is a glTF file."
        ),
    )

    @property
    def sizes(self) -> dict[str, float]:
        """The height or the longest side in metres that is requested, by its name in `load_mesh`.

        Raises
        ------
        InputError
            If two of unit, height and longest side are given.
        """
        from translucent.units import parse_length

        given = {"unit": self.unit, "height": self.height, "longest": self.longest}
        stated = [name for name, value in given.items() if value is not None]
        if len(stated) > 1:
            requested = f"--{stated[0]} {given[stated[0]]}"
            raise InputError(requested, f"--{stated[1]} is given, too", "both options scale the model: use one of them")
        return {name: parse_length(value) for name, value in given.items() if name != "unit" and value is not None}


@dataclass(frozen=True, kw_only=True)
class CameraOptions:
    """Options that choose a camera."""

    camera: int | None = option(
        metavar="N", help="Number of a camera in the glTF file, counted from 0. Default: 0, if the file has a camera."
    )
    eye: str | None = option(
        metavar="X,Y,Z",
        help="Position of the camera in metres. Default: a position from which the whole model is visible.",
    )
    target: str | None = option(
        metavar="X,Y,Z", help="Point that the camera looks at. Default: the center of the model."
    )
    up: str | None = option(metavar="X,Y,Z", help=f"Direction that points up in the picture. Default: {DEFAULT_UP}.")
    fov: float | None = option(
        metavar="DEG", help=f"Vertical field of view of the camera in degrees. Default: {DEFAULT_FOV:g}."
    )
    orbit: str | None = option(
        metavar="YAW,PITCH",
        help="View the model from these angles in degrees: around +Y (0: front, 90: +X), and upwards: 30,15.",
    )
    fit: float | None = option(
        type=click.FloatRange(0.0, 1.0, min_open=True),
        metavar="F",
        help=(
            "Move the camera so that the model covers this fraction of the picture's width or height, "
            "whichever is larger: 0.8."
        ),
    )

    @property
    def direction(self) -> Array | None:
        """(3,): direction of the view that `orbit` states, if any.

        Raises
        ------
        InputError
            If it is none.
        """
        from translucent.scene.camera import direction_from

        if self.orbit is None:
            return None
        try:
            yaw, pitch = (float(part) for part in self.orbit.split(","))
        except ValueError:
            raise InputError(
                f"--orbit {self.orbit!r}", "the value is not two numbers", "write for example --orbit 30,15"
            ) from None
        if not (abs(yaw) <= 1e6 and abs(pitch) < 90.0):
            found = "the pitch must lie between -90 and 90" if abs(yaw) <= 1e6 else "the yaw is too large"
            raise InputError(f"--orbit {self.orbit}", found, "give degrees, such as 30,15")
        return -direction_from(yaw, pitch)

    @property
    def defining(self) -> list[str]:
        """Names of the given options that define a new camera."""
        options = {"--eye": self.eye, "--target": self.target, "--up": self.up, "--fov": self.fov}
        options |= {"--orbit": self.orbit, "--fit": self.fit}
        return [name for name, value in options.items() if value is not None]


def stage_option() -> Any:
    """Option for the stage: ground, backdrop and lights."""

    def words() -> str:
        from translucent.scene.stages import DEFAULT_STAGE, STAGES

        return (
            f"Ground, backdrop and lights of the model: {', '.join(STAGES)}, or none (the environment alone); "
            f"{DEFAULT_STAGE},90 turns the stage by 90 degrees. Default: {DEFAULT_STAGE}; none with --environment or "
            "--background, and none for a glTF file with a camera, lights or a ground."
        )

    return option(metavar="S", help=words)


def ground_option() -> Any:
    """Option for the color of the stage's ground."""
    words = (
        "Color of the stage's ground; none: no ground. For shadows without a ground: --transparent. Default: by stage."
    )
    return option(metavar="C", help=words)


def roughness_option() -> Any:
    """Option for the roughness of surfaces of media."""
    reported = "Roughness of the surfaces of media, 0 (polished) to 1. Default: as the preset or the file says, or 0."
    return option(type=click.FloatRange(0.0, 1.0), metavar="R", help=reported)


@dataclass(frozen=True, kw_only=True)
class LookOptions:
    """Options for environment, stage, background, exposure and roughness."""

    environment: str | None = option(
        metavar="E",
        help=(
            "Environment that illuminates the model and appears in reflections: light-table, studio, "
            "checkerboard, a color, or a panorama file (.hdr, .exr or .png). studio,90 rotates the "
            "environment by 90 degrees. Default: the environment of the stage, otherwise light-table."
        ),
    )
    background: str | None = option(
        metavar="E",
        help="Environment that is visible behind and through the model. Accepts the same values as --environment.",
    )
    exposure: float = option(
        0.0,
        metavar="STOPS",
        show_default=False,
        help="Exposure of a .png picture in stops: positive numbers make the picture brighter.",
    )
    tone: str | None = option(
        type=NamesOf("translucent.formulas.tone", "TONES"),
        help=(
            "Tone curve of a .png picture: none (values above 1 are clipped), neutral (Khronos PBR) or "
            "agx. Default: neutral on a stage, otherwise none."
        ),
    )
    roughness: float | None = roughness_option()

    def lighting(self) -> Environment | None:
        """Environment that the options name; None if they name none."""
        from translucent.scene.showcase import LIGHT_TABLE

        if self.background is None:
            return None if self.environment is None else _environment(self.environment)
        lit = LIGHT_TABLE if self.environment is None else _environment(self.environment)
        return lit.with_background(_environment(self.background))


def _environment(text: str) -> Environment:
    from translucent.scene.environment_files import READERS
    from translucent.scene.showcase import named_environment

    name, rotation = text, 0.0
    head, comma, tail = text.rpartition(",")
    if comma and (head == "studio" or Path(head).suffix.lower() in READERS):
        try:
            name, rotation = head, float(tail)
        except ValueError:
            raise InputError(
                f"environment {text!r}", f"{tail!r} is not a rotation in degrees", "write the rotation as in studio,90"
            ) from None
    return named_environment(name, rotation)


def _method_words() -> str:
    from translucent.planning.methods import METHODS

    *names, last = METHODS
    sheets = " and ".join(name for name, method in METHODS.items() if method.makes_sheets)
    return (
        f"{', '.join(names)} or {last}. Default: the planner's choice. Without OpenGL, the CPU finds all surfaces "
        f"on each ray, whatever the method, except for {sheets}."
    )


@dataclass(frozen=True, kw_only=True)
class ChoiceOptions:
    """Options for how a scene is rendered."""

    method: str | None = option(metavar="NAME", help=_method_words)
    paths: int | None = option(
        metavar="N",
        help=(
            "With --method path-traced: number of random paths per pixel. Default: 64. Four times as "
            "many paths halve the noise."
        ),
    )
    interfaces: str | None = option(
        type=NamesOf("translucent.planning.interfaces", "INTERFACES"),
        help=(
            "How interfaces reflect and refract light. traced: ray tracing through the meshes. screen: "
            "refraction in screen space, where rays enter and leave bodies (quicker). front: refraction "
            "only where rays enter (quickest). Default: traced for solid bodies, if ray tracing is "
            "possible; the plan states the choice."
        ),
    )
    interface_depth: int | None = option(
        metavar="N",
        help="With --interfaces traced: largest number of interfaces that a ray may cross, 1 to 64. Default: 24.",
    )
    interface_forks: int | None = option(
        metavar="N",
        help=(
            "With --interfaces traced: how many times a ray may split into a reflected and a refracted ray. Default: 2."
        ),
    )
    interface_hits: str | None = option(
        type=NamesOf("translucent.planning.methods.base", "HITS"),
        help=(
            "With --interfaces traced: ray caster that finds the hits of rays, Embree (embree) or "
            "shaders (gl). Default: Embree if OpenGL is a software rasterizer."
        ),
    )
    scattering: str | None = option(
        type=NamesOf("translucent.planning.scattering", "SCATTERINGS"),
        help=(
            "Model of multiple scattering. diffusion: light spreads in the body (wax, milk, jade). "
            "layer: light leaves where it entered, as from a flat layer (quicker if lights or media "
            "change often). single: only single scattering is rendered (smoke, clear drinks). Default: "
            "diffusion for closed bodies with an interface, layer for sheets and open meshes, single "
            "for bodies without an interface or with little scattering."
        ),
    )
    diffusion_resolution: int | None = option(
        metavar="N",
        help=(
            "With --scattering diffusion: resolution of the grid, 8 to 128. A body gets about N^3 / 4 "
            "cells. Default: 32."
        ),
    )
    caustics: int | None = option(
        is_flag=False,
        flag_value=1_000_000,
        metavar="[N]",
        help=(
            "Render caustics with N photons, which carry the light of point, spot, sphere and "
            "directional lights through interfaces onto opaque objects and into fog, wax and milk. "
            "Default: caustics are added if a clear body focuses light on an opaque object, and if "
            "photons take less than a third of the render time. 0: no caustics. Without N: a million "
            "photons. Largest N: 2^30. Four times as many photons halve the noise."
        ),
    )
    shadow_size: int | None = option(
        metavar="N",
        help=(
            "Number of texels along a side of each light's shadow map, 64 to 8192. Default: 1024, or fewer "
            "for bodies of very many surfaces. More texels make shadow edges sharper."
        ),
    )
    environment_shadows: int | None = option(
        metavar="N",
        help=(
            "Number of directions from which the environment casts shadows onto opaque objects, 0 to "
            "256. Default: 128 on a stage, otherwise none."
        ),
    )
    thickness: str | None = option(
        metavar="D", help="With --method thin-layer: thickness of the sheets, such as 0.3mm. Default: 1mm."
    )

    flags: Flags = group(Flags)

    def read(self) -> RenderRequest:
        """Rendering request from the options; None for each choice that is left to the planner."""
        from translucent.planning.caustics import Caustics
        from translucent.planning.request import RenderRequest
        from translucent.planning.shadow_maps import ShadowMaps

        return RenderRequest(
            interfaces=self._interfaces(),
            scattering=self._scattering(),
            caustics=None if self.caustics is None else Caustics(self.caustics),
            method=self._method(),
            shadows=None if self.shadow_size is None else ShadowMaps(self.shadow_size),
            **dataclasses.asdict(self.flags),
        )

    def _method(self) -> Method | None:
        from translucent.planning.methods import METHODS, method_from_name
        from translucent.units import parse_length

        method = method_from_name(self.method) if self.method else None
        if self.paths is not None:
            if method is None or not method.follows_paths:
                names = " or ".join(name for name, known in METHODS.items() if known.follows_paths)
                raise InputError("--paths", f"this option applies only to --method {names}", f"add --method {names}")
            method = method.with_paths(self.paths)
        if self.thickness is None:
            return method
        if method is None or not method.makes_sheets:
            names = " or ".join(name for name, known in METHODS.items() if known.makes_sheets)
            raise InputError("--thickness", f"this option applies only to --method {names}", f"add --method {names}")
        return method.with_thickness(parse_length(self.thickness))

    def _interfaces(self) -> InterfaceMode | None:
        from translucent.planning.interfaces import INTERFACES, USUAL_DEPTH, TracedInterfaces

        stated: dict[str, Any] = {
            "depth": self.interface_depth,
            "forks": self.interface_forks,
            "hits": self.interface_hits,
        }
        given = {key: value for key, value in stated.items() if value is not None}
        if given and self.interfaces != TracedInterfaces.name:
            requested = f"--interface-{next(iter(given))}"
            raise InputError(requested, "this option applies only to --interfaces traced", "add --interfaces traced")
        if self.interfaces == TracedInterfaces.name:
            return TracedInterfaces(**{"depth": USUAL_DEPTH, **given})
        return None if self.interfaces is None else INTERFACES[self.interfaces]()

    def _scattering(self) -> Scattering | None:
        from translucent.planning.scattering import SCATTERINGS, Diffusion

        name, resolution = self.scattering, self.diffusion_resolution
        if resolution is None:
            return None if name is None else SCATTERINGS[name]()
        if name != Diffusion.name:
            do = "add --scattering diffusion"
            raise InputError("--diffusion-resolution", "this option applies only to --scattering diffusion", do)
        return Diffusion(resolution)


def read_size(text: str) -> tuple[int, int]:
    """Width and height from an option's value."""
    from translucent.scene.camera import check_size

    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        raise InputError(
            f"--size {text!r}", "the size must be WIDTHxHEIGHT", "write for example --size 1280x720"
        ) from None
    return check_size((width, height))


def triple_text(values: Any) -> str:
    """Three numbers, aligned."""
    return " ".join(f"{value:10.5g}" for value in values)


def verbose_option() -> Any:
    """Option to print the media and the plan of a picture."""
    return option(
        False, names=("-v", "--verbose"), help="Also print the media of the scene, and the plan with its reasons."
    )


def overwrite_option() -> Any:
    """Option that allows a verb to overwrite an input file; see `refuse_overwriting`."""

    def note(context: click.Context, _: click.Parameter, given: bool) -> bool:
        context.meta[_OVERWRITE] = given
        return given

    return option(False, callback=note, help="Allow the output to replace one of the files that the command reads.")


def refuse_overwriting(output: Path, *inputs: str | Path | None) -> None:
    """Raise if a verb would replace a file that it reads, under whatever name, unless overwriting is allowed.

    Parameters
    ----------
    output : Path
    *inputs : str or Path, optional
        What the verb was given to read: files, also with what an option adds, as in ``sky.hdr,90``, or other names. The
        files that a glTF file links to are read, too.
    """
    from translucent.files.paths import same_file

    # What is not there yet can be none of them.
    if click.get_current_context().meta.get(_OVERWRITE) or not os.path.exists(output):
        return
    for name in [str(given) for given in inputs if given is not None]:
        for file in (Path(name), Path(name.rpartition(",")[0] or name), *_linked_files(name)):
            if same_file(file, output):
                raise InputError(
                    f"output {str(output)!r}",
                    f"the command reads this file, as {str(file)!r}",
                    "choose another name for the output, or add --overwrite to replace the file",
                )


def _linked_files(name: str) -> list[Path]:
    """The files that a glTF file links to."""
    from translucent.gltf.file import read_gltf
    from translucent.gltf.load import SUFFIXES

    if Path(name).suffix.lower() not in SUFFIXES or not os.path.isfile(name):
        return []
    try:
        file = read_gltf(name)
        links = [holder.get("uri") for holder in (*file.items("buffers"), *file.items("images"))]
    except InputError:
        return []  # whoever reads it says what is wrong with it
    return [
        file.path.parent / unquote(link) for link in links if isinstance(link, str) and not link.startswith("data:")
    ]
