"""Options that several verbs share, and readers of their values."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar
from urllib.parse import unquote

import click

from translucent.commands.console import echo
from translucent.errors import InputError

if TYPE_CHECKING:
    import numpy.typing as npt

    from translucent.media.medium import Medium
    from translucent.planning.caustics import Caustics
    from translucent.planning.interfaces import Interfaces
    from translucent.planning.methods import Method
    from translucent.planning.scattering import Scattering
    from translucent.planning.shadow_maps import ShadowMaps
    from translucent.scene.environment import Environment
    from translucent.scene.scene import Scene


#: Names of tone curves, as in `translucent.formulas.tone.TONES`, which only rendering imports.
TONE_NAMES = ("none", "neutral", "agx")

#: Names of the ways of finding interfaces, as in `translucent.planning.interfaces.INTERFACES`, likewise.
INTERFACE_NAMES = ("traced", "screen", "front")

#: Names of the ways of showing light that is scattered many times, as in `translucent.planning.scattering.SCATTERINGS`.
SCATTERING_NAMES = ("diffusion", "layer", "single")

#: Names of stages, the default one first, as in `translucent.scene.stages.STAGES`, likewise.
STAGE_NAMES = ("studio", "light-table", "night", "daylight")

#: Index of refraction of what `scattering_medium_options` choose: that of soap, wax, skin and milk is 1.33 to 1.5.
SCATTERING_IOR = 1.4

F = TypeVar("F", bound=Callable[..., Any])

#: Key under which a verb finds whether it may replace a file that it reads.
_OVERWRITE = "translucent.overwrite"


def common_options(command: F) -> F:
    """Options of every verb."""
    command = click.option("--debug", is_flag=True, expose_value=False, help="Show the traceback of an error.")(command)
    return click.option("--json", "as_json", is_flag=True, help="Print the result as one JSON object.")(command)


def medium_options(command: F) -> F:
    """Options that choose a medium."""
    command = clamp_option(command)
    command = click.option("--preset", "preset_name", metavar="NAME", help="A named medium, such as merlot.")(command)
    command = click.option("--distance", metavar="D", help="Distance at which light has the color: 2cm, 0.8in.")(
        command
    )
    return click.option("--color", metavar="C", help="Transmitted color: '#7b1e3a', salmon, 'linear(.18,.62,.35)'.")(
        command
    )


def clamp_option(command: F) -> F:
    """Option for colors with a channel of 0, which no finite extinction makes."""
    return click.option(
        "--clamp/--no-clamp",
        default=None,
        help="Take channels below 1e-4 for 1e-4 and say so, or refuse those of 0. Default: --clamp.",
    )(command)


def unit_option(command: F) -> F:
    """Option for the unit of a file."""
    return click.option(
        "--unit", default="m", show_default=True, metavar="U", help="Unit of the file's coordinates: mm, cm, in, ..."
    )(command)


def overwrite_option(command: F) -> F:
    """Option of verbs that read files and write one, which `refuse_overwriting` looks at."""

    def note(context: click.Context, _: click.Parameter, given: bool) -> None:
        context.meta[_OVERWRITE] = given

    return click.option(
        "--overwrite",
        is_flag=True,
        expose_value=False,
        callback=note,
        help="Write the output even where that replaces a file that is read.",
    )(command)


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
                    f"it is read, as {str(file)!r}",
                    "choose another name, or add --overwrite to replace it",
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


def outside_option(command: F) -> F:
    """Option for files that a model links to."""
    return click.option(
        "--allow-outside",
        is_flag=True,
        help="Read files that MODEL links to wherever they are, not only below its folder. For models that you trust.",
    )(command)


def draft_option(command: F) -> F:
    """Option for extensions of glTF that are no standard yet."""
    return click.option(
        "--draft-extensions",
        is_flag=True,
        help="Of a glTF MODEL: read KHR_materials_scatter and KHR_materials_volume_scatter, which are drafts.",
    )(command)


def interface_options(command: F) -> F:
    """Options for how the interfaces are found at which light refracts and reflects."""
    command = click.option(
        "--interface-forks",
        type=int,
        metavar="N",
        help="Of --interfaces traced: how often rays go on as the weaker of reflected and refracted light. Default: 2.",
    )(command)
    command = click.option(
        "--interface-depth",
        type=int,
        metavar="N",
        help="Of --interfaces traced: interfaces that light may meet. Default: 8.",
    )(command)
    return click.option(
        "--interfaces",
        "interfaces_name",
        type=click.Choice(INTERFACE_NAMES),
        help="Where light bends and is mirrored: at all interfaces, traced through the meshes; where it enters bodies "
        "and where it leaves them, in screen space (quicker); or only where it enters (quickest). Default: traced, "
        "where bodies are solid and rays can be; the plan says what was taken.",
    )(command)


def read_interfaces(name: str | None, depth: int | None, forks: int | None) -> Interfaces | None:
    """The way of finding interfaces that the options choose, if any."""
    from translucent.planning.interfaces import INTERFACES, TracedInterfaces

    given = {key: value for key, value in (("depth", depth), ("forks", forks)) if value is not None}
    if given and name != TracedInterfaces.name:
        asked = f"--interface-{next(iter(given))}"
        raise InputError(asked, "only --interfaces traced takes it", "add --interfaces traced")
    return TracedInterfaces(**given) if given else None if name is None else INTERFACES[name]()


def scattering_options(command: F) -> F:
    """Options for how light is shown that media scatter more than once."""
    command = click.option(
        "--diffusion-resolution",
        type=int,
        metavar="N",
        help="Of --scattering diffusion: a body gets about N^3 / 4 cells, 8 to 128. Default: 32.",
    )(command)
    return click.option(
        "--scattering",
        "scattering_name",
        type=click.Choice(SCATTERING_NAMES),
        help="Light that media scatter many times: as it diffuses in the body (wax, milk, jade); as a flat layer gives "
        "it back (quicker where the light or the medium changes all the time); or not at all, with what is scattered "
        "once alone (smoke, clear drinks). Default: diffusion in closed bodies with an interface, layers in sheets and "
        "open meshes, single where there is no interface or little scatters.",
    )(command)


def read_scattering(name: str | None, resolution: int | None) -> Scattering | None:
    """The way of showing light scattered many times that the options choose, if any."""
    from translucent.planning.scattering import SCATTERINGS, Diffusion

    if resolution is None:
        return None if name is None else SCATTERINGS[name]()
    if name != Diffusion.name:
        raise InputError("--diffusion-resolution", "only --scattering diffusion takes it", "add --scattering diffusion")
    return Diffusion(resolution)


def scattering_medium_options(command: F) -> F:
    """Options that choose a medium by the color that it has where it is thick."""
    command = click.option(
        "--mean-free-path",
        metavar="L",
        help="Length after which light in such a medium is scattered or absorbed, on average: 0.5mm.",
    )(command)
    return click.option(
        "--scattering-color",
        metavar="C",
        help=f"Diffuse color of a body that is thick and scatters, with --mean-free-path; its ior is "
        f"{SCATTERING_IOR:g}. Wax: --scattering-color '#f2e0b8' --mean-free-path 2mm.",
    )(command)


def read_any_medium(
    color: str | None,
    distance: str | None,
    preset_name: str | None,
    clamp: bool | None,
    scattering_color: str | None,
    mean_free_path: str | None,
) -> Medium | None:
    """Medium that the options choose by what it transmits, or by the color of what it scatters, if any."""
    from translucent.media.albedo import scattering_medium
    from translucent.units import parse_length

    if scattering_color is None and mean_free_path is None:
        return read_medium(color, distance, preset_name, clamp, shows_scattering=True)
    given, missing = "--scattering-color", "--mean-free-path"
    if scattering_color is None:
        given, missing = missing, given
    others = {"--color": color, "--distance": distance, "--preset": preset_name}
    if other := [option for option, value in others.items() if value is not None]:
        raise InputError(given, f"{other[0]} is given, too", "give one medium: by what it transmits or scatters")
    if scattering_color is None or mean_free_path is None:
        do = "give both: the color of a body with no end says nothing about how far light gets in it"
        raise InputError(given, f"{missing} is missing", do)
    return scattering_medium(scattering_color, parse_length(mean_free_path), ior=SCATTERING_IOR)


def read_medium(
    color: str | None,
    distance: str | None,
    preset_name: str | None,
    clamp: bool | None = None,
    *,
    shows_scattering: bool = False,
) -> Medium | None:
    """Medium that the options choose, if any; where scattered light is not shown, presets that live by it are told."""
    from translucent.media.medium import Medium
    from translucent.media.presets import preset
    from translucent.units import parse_length

    if preset_name is not None:
        if color is not None or distance is not None:
            raise InputError(f"--preset {preset_name}", "--color or --distance is given, too", "give one or the other")
        chosen = preset(preset_name)
        if chosen.warning and not shows_scattering:
            echo(f"warning: {chosen.warning}", err=True)
        return chosen.medium
    if (color is None) != (distance is None):
        given, missing = ("--color", "--distance") if distance is None else ("--distance", "--color")
        raise InputError(given, f"{missing} is missing", "give both: a color has a meaning only at a distance")
    if color is None or distance is None:
        return None
    wanted, told = clamped(color) if clamp is not False else (color, [])
    medium = Medium.from_color(wanted, parse_length(distance))
    for line in told:
        echo(f"warning: {line}", err=True)
    return medium


def read_roughness(roughness: float | None, preset_name: str | None) -> float | None:
    """Roughness that the options choose, or that the preset's surfaces have; if neither, surfaces keep their own."""
    from translucent.media.presets import preset

    return (preset(preset_name).roughness or None) if roughness is None and preset_name is not None else roughness


def clamped(color: str) -> tuple[npt.ArrayLike, list[str]]:
    """Clamp channels of a color that are too dark, with a warning if there were any."""
    from translucent.media.colors import parse_color
    from translucent.media.conversion import CLAMP, clamp_colors

    triple, changed = clamp_colors(parse_color(color))
    # As it was written, if nothing is to be done: errors tell it so.
    return (triple, [f"color clamped to {CLAMP:g} where it was below"]) if changed.any() else (color, [])


def roughness_option(command: F) -> F:
    """Option for the surfaces of media."""
    return click.option(
        "--roughness",
        type=click.FloatRange(0.0, 1.0),
        metavar="R",
        help="Of the interfaces of media, 0 (polished) to 1. Default: the preset's, else the file's, or 0.",
    )(command)


def look_options(command: F) -> F:
    """Options for what lights the model, what is seen behind it, and how bright the picture is."""
    command = roughness_option(command)
    command = click.option(
        "--tone",
        type=click.Choice(TONE_NAMES),
        help="Tone curve of a .png: clamped, Khronos PBR Neutral, or AgX. Default: neutral on a stage, else none.",
    )(command)
    command = click.option("--exposure", type=float, default=0.0, metavar="STOPS", help="Makes a .png brighter.")(
        command
    )
    command = click.option(
        "--background", metavar="E", help="Seen behind the model instead of the environment, and through it; as above."
    )(command)
    return click.option(
        "--environment",
        metavar="E",
        help="Lights the model and is mirrored: light-table, studio, checkerboard, a color, or a .hdr, .exr or .png of "
        "all directions; studio,90 turns it by degrees. Default: the stage's, or else light-table.",
    )(command)


def stage_option(command: F) -> F:
    """Option for what the model stands on and before."""
    return click.option(
        "--stage",
        metavar="S",
        help=f"What the model stands on, and is lit by: {', '.join(STAGE_NAMES)}, or none, before the environment "
        f"alone; {STAGE_NAMES[0]},90 turns it by degrees. Default: {STAGE_NAMES[0]}; none with --environment or "
        "--background, and for a glTF file with a camera, lights or a ground of its own.",
    )(command)


def read_environment(name: str | None, background: str | None) -> Environment | None:
    """Environment that the options name; None if they name none."""
    from translucent.scene.showcase import LIGHT_TABLE

    if background is None:
        return None if name is None else _environment(name)
    return (LIGHT_TABLE if name is None else _environment(name)).with_background(_environment(background))


def _environment(text: str) -> Environment:
    from translucent.scene.environment_files import READERS
    from translucent.scene.showcase import named_environment

    name, rotation = text, 0.0
    head, comma, tail = text.rpartition(",")
    if comma and (head == "studio" or Path(head).suffix.lower() in READERS):
        try:
            name, rotation = head, float(tail)
        except ValueError:
            raise InputError(f"environment {text!r}", f"rotation {tail!r}", "give degrees, as in studio,90") from None
    return named_environment(name, rotation)


def read_size(text: str) -> tuple[int, int]:
    """Width and height from an option's value."""
    from translucent.scene.camera import check_size

    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        raise InputError(f"--size {text!r}", "not WxH", "write for example --size 1280x720") from None
    return check_size((width, height))


def triple_text(values: Any) -> str:
    """Three numbers, aligned."""
    return " ".join(f"{value:10.5g}" for value in values)


class _MethodOption(click.Option):
    """An option whose help names the methods, which are imported only where it is shown."""

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        from translucent.planning.methods import METHODS

        record = super().get_help_record(ctx)
        *names, last = METHODS
        sheets = " and ".join(name for name, method in METHODS.items() if method.makes_sheets)
        told = (
            f"{', '.join(names)} or {last}. Default: by plan. Without OpenGL all but {sheets} give way to all surfaces "
            "on each ray."
        )
        return None if record is None else (record[0], told)


def method_option(command: F) -> F:
    """The option for how thickness is found."""
    return click.option("--method", "method_name", cls=_MethodOption, metavar="NAME")(command)


def paths_option(command: F) -> F:
    """Option for the number of random paths."""
    told = "Of --method path-traced: random paths of each pixel. Default: 64. Four times as many halve the noise."
    return click.option("--paths", type=int, metavar="N", help=told)(command)


def caustics_option(command: F) -> F:
    """Option for photons from lights through interfaces onto opaque objects."""
    told = (
        "Let N photons carry the light of lamps through interfaces onto opaque objects, into fog, wax and milk. "
        "Default: none; without N: a million; at most 2^30. Four times as many halve the noise."
    )
    return click.option("--caustics", type=int, is_flag=False, flag_value=1_000_000, metavar="[N]", help=told)(command)


def shadow_options(command: F) -> F:
    """Options for shadows on opaque objects."""
    command = click.option(
        "--environment-shadows",
        type=int,
        metavar="N",
        help="Directions of the environment that throw shadows onto opaque objects, 0 to 256. Default: 128 on a stage, "
        "else none.",
    )(command)
    told = "Texels along a side of each light's map of shadows, 64 to 8192. Default: 1024. More make edges sharper."
    return click.option("--shadow-size", type=int, metavar="N", help=told)(command)


def read_shadows(size: int | None) -> ShadowMaps | None:
    """Maps of shadows of this size, if one is asked for."""
    from translucent.planning.shadow_maps import ShadowMaps

    return None if size is None else ShadowMaps(size)


def with_environment_shadows(scene: Scene, count: int | None) -> Scene:
    """Scene with so many directions of the environment that throw shadows, if a number is given."""
    return scene if count is None else replace(scene, environment_shadows=count)


def read_caustics(photons: int | None) -> Caustics | None:
    """Caustics by so many photons, if any are asked for."""
    from translucent.planning.caustics import Caustics

    return None if photons is None else Caustics(photons)


def read_method(name: str | None, thickness: str | None, paths: int | None = None) -> Method | None:
    """Thickness method of this name, if one is given."""
    from translucent.planning.methods import METHODS, method_from_name
    from translucent.units import parse_length

    method = method_from_name(name) if name else None
    if paths is not None:
        if method is None or not method.follows_paths:
            names = " or ".join(name for name, known in METHODS.items() if known.follows_paths)
            raise InputError("--paths", f"only --method {names} takes it", f"add --method {names}")
        method = method.with_paths(paths)
    if thickness is None:
        return method
    if method is None or not method.makes_sheets:
        names = " or ".join(name for name, known in METHODS.items() if known.makes_sheets)
        raise InputError("--thickness", f"only --method {names} takes it", f"add --method {names}")
    return method.with_thickness(parse_length(thickness))
