"""Scenes from MODEL and the options of a verb.

Options of a medium that stand behind an ``--object`` on the command line are for that object alone.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import click
import numpy as np

from translucent.commands.options import (
    medium_options,
    read_any_medium,
    read_roughness,
    roughness_option,
    scattering_medium_options,
)
from translucent.errors import InputError

if TYPE_CHECKING:
    from translucent.geometry.mesh import Mesh
    from translucent.media.medium import Medium
    from translucent.scene.camera import Camera
    from translucent.scene.environment import Environment
    from translucent.scene.scene import Object, Scene
    from translucent.scene.showcase import AnyScene
    from translucent.scene.stages import Stage


#: Default field of view in degrees, and up vector, of a camera that options define.
DEFAULT_FOV, DEFAULT_UP = 30.0, "0,1,0"


F = TypeVar("F", bound=Callable[..., Any])


def camera_options(command: F) -> F:
    """Options that choose a camera, as `CameraOptions` holds them."""
    for option in (
        click.option("--fov", type=float, metavar="DEG", help=f"Vertical angle of view. Default: {DEFAULT_FOV:g}."),
        click.option("--up", metavar="X,Y,Z", help=f"What is up in the picture. Default: {DEFAULT_UP}."),
        click.option("--target", metavar="X,Y,Z", help="What the camera looks at. Default: the model's center."),
        click.option(
            "--eye", metavar="X,Y,Z", help="Position of the camera in metres. Default: the whole model in view."
        ),
        click.option(
            "--camera", type=int, metavar="N", help="Camera of a glTF file, counted from 0. Default: 0, if it has any."
        ),
    ):
        command = option(command)
    return command


class CameraOptions(NamedTuple):
    """The options that choose a camera, as they were given."""

    camera: int | None = None
    eye: str | None = None
    target: str | None = None
    up: str | None = None
    fov: float | None = None

    @property
    def defining(self) -> list[str]:
        """The options among these that define a camera, rather than choose one of the file."""
        options = {"--eye": self.eye, "--target": self.target, "--up": self.up, "--fov": self.fov}
        return [option for option, value in options.items() if value is not None]


class FileLook(NamedTuple):
    """Choice of a file's looks, and media for single objects: the options of `translucent.commands.model`."""

    media: Sequence[NamedMedium] = ()
    variant: str | None = None
    time: float | None = None


def is_scene_file(model: str) -> bool:
    """True if MODEL is a glTF file, which holds a scene; all others hold one mesh."""
    from translucent.gltf.load import SUFFIXES

    return Path(model).suffix.lower() in SUFFIXES


def read_scene(
    model: str,
    unit: str,
    medium: Medium | None,
    options: CameraOptions | None = None,
    size: tuple[int, int] = (1280, 720),
    environment: Environment | None = None,
    roughness: float | None = None,
    stage: str | None = "none",
    *,
    allow_outside: bool = False,
    look: FileLook | None = None,
    draft_extensions: bool = False,
) -> Scene:
    """The scene of a glTF file, with `medium` in its translucent objects if there is one; or one mesh on show.

    Objects that `look` names have media and roughness of their own. A stage of None is the default one, where it suits
    what the model and the options bring with them.
    """
    from translucent.scene.showcase import framing, objects_named, with_roughness
    from translucent.scene.stages import staged, upright

    stage, turn = _turned(stage)
    options, look = options or CameraOptions(), look or FileLook()
    if options.camera is not None and options.defining:
        raise InputError(
            f"--camera {options.camera}", f"{', '.join(options.defining)} given, too", "give one or the other"
        )
    asked = _Asked(model, unit, medium, options, size, environment, stage, look, allow_outside)
    scene, chosen = _file_scene(asked, draft_extensions) if is_scene_file(model) else _mesh_scene(asked)
    named = {id(item) for one in look.media for item in objects_named(scene, one.name)}
    scene = with_roughness(scene, roughness, [item for item in scene.objects if id(item) not in named])
    for one in look.media:
        scene = with_roughness(scene, one.roughness, objects_named(scene, one.name))
    if options.defining:
        scene = dataclasses.replace(scene, camera=_defined_camera(scene, options, size, chosen))
    if chosen is None:
        return scene
    scene = upright(scene, read_vector("--up", options.up or DEFAULT_UP))
    if options.eye is None and not getattr(scene, "has_camera", False):
        fov = DEFAULT_FOV if options.fov is None else options.fov
        scene = dataclasses.replace(scene, camera=framing(scene.objects, size, fov_y=fov, stage=chosen))
    return staged(scene, chosen, environment, turn)


def _turned(stage: str | None) -> tuple[str | None, float]:
    """Name of a stage, and the degrees after it."""
    name, comma, degrees = (stage or "").partition(",")
    try:
        turn = float(degrees) if comma else 0.0
    except ValueError:
        raise InputError(f"--stage {stage!r}", f"{degrees!r} is no number of degrees", f"write {name},90") from None
    return (name if comma else stage), turn


class _Asked(NamedTuple):
    """Arguments of `read_scene` that both kinds of files take."""

    model: str
    unit: str
    medium: Medium | None
    options: CameraOptions
    size: tuple[int, int]
    environment: Environment | None
    stage: str | None
    look: FileLook
    allow_outside: bool


def _mesh_scene(asked: _Asked) -> tuple[Scene, Stage | None]:
    from translucent.scene.showcase import default_medium, showcase
    from translucent.scene.stages import DEFAULT_STAGE, NO_STAGE, stage_named

    model, look, environment = asked.model, asked.look, asked.environment
    if (camera := asked.options.camera) is not None:
        raise InputError(f"--camera {camera}", f"{model} is no glTF file and has no cameras", "use --eye")
    for option, value in (("--variant", look.variant), ("--time", look.time)):
        if value is not None:
            raise InputError(f"{option} {value}", f"{model} is no glTF file", "leave it out")
    chosen = stage_named(asked.stage or (DEFAULT_STAGE if environment is None else NO_STAGE))
    mesh = read_mesh(model, asked.unit, asked.allow_outside)
    filling = asked.medium or default_medium(mesh, chosen)
    scene = showcase(mesh, filling, asked.size, environment=environment, stage=NO_STAGE)
    return _with_media(scene, look), chosen


def _file_scene(asked: _Asked, draft_extensions: bool) -> tuple[Scene, Stage | None]:
    from translucent.gltf.load import load_scene
    from translucent.scene.showcase import filled
    from translucent.scene.stages import DEFAULT_STAGE, NO_STAGE, has_ground, stage_named

    look, environment = asked.look, asked.environment
    scene = load_scene(
        asked.model,
        asked.unit,
        None if asked.options.defining else asked.options.camera or 0,
        asked.size,
        variant=look.variant,
        time=look.time,
        allow_outside=asked.allow_outside,
        draft_extensions=draft_extensions,
    )
    if asked.medium is not None:
        scene = filled(scene, asked.medium)
    scene = _with_media(scene, look)
    bare = not (scene.has_camera or scene.lights or has_ground(scene)) and environment is None
    chosen = stage_named(asked.stage or (DEFAULT_STAGE if bare and scene.bodies else NO_STAGE))
    return scene if environment is None else dataclasses.replace(scene, environment=environment), chosen


def _with_media(scene: AnyScene, look: FileLook) -> AnyScene:
    """Scene with the media of the objects that are named."""
    from translucent.scene.showcase import filled, objects_named

    for one in look.media:
        scene = filled(scene, one.medium, objects_named(scene, one.name))
    return scene


def require_translucent(model: str, scene: Scene) -> None:
    """Raise `InputError` if light passes no object of the scene."""
    if not scene.bodies:
        count = len(scene.objects)
        raise InputError(
            f"rendering {model!r}",
            f"its {count} object{' is' if count == 1 else 's are'} opaque: no material has KHR_materials_transmission",
            "add --preset NAME, or --color C and --distance D, to give all of them a medium",
        )


def is_own(model: str) -> bool:
    """True if MODEL is a mesh that comes with the toolkit, and no file of the same name."""
    from translucent.assets import mesh_names

    return not os.path.lexists(model) and model in mesh_names()


def read_mesh(model: str, unit: str, allow_outside: bool = False) -> Mesh:
    """The mesh of a file, or of the toolkit's own by name."""
    from translucent.mesh_files import load_mesh

    return load_mesh(mesh_file(model, unit), unit=unit, allow_outside=allow_outside)


def mesh_file(model: str, unit: str) -> str:
    """The file of a mesh, which may be the name of one of the toolkit's own."""
    from translucent.assets import mesh_names, mesh_path

    if os.path.lexists(model):
        return model
    if is_own(model):
        if unit != "m":
            raise InputError(f"--unit {unit}", f"{model} comes with the toolkit, in metres", "leave --unit out")
        return str(mesh_path(model))
    if not os.path.dirname(model) and not Path(model).suffix:
        raise InputError(
            f"mesh {model!r}",
            "no file and no mesh of the toolkit",
            f"give a path, or one of {', '.join(sorted(mesh_names()))}",
        )
    return model


def _defined_camera(scene: Scene, options: CameraOptions, size: tuple[int, int], stage: Stage | None) -> Camera:
    """Camera that the options define, or that frames all objects as they say; on a stage, that is for later."""
    from translucent.scene.camera import Camera
    from translucent.scene.showcase import framing

    up, fov = read_vector("--up", options.up or DEFAULT_UP), DEFAULT_FOV if options.fov is None else options.fov
    if options.eye is None:
        if options.target is not None:
            raise InputError("--target", "--eye is missing", "give both, or neither")
        return framing(scene.objects, size, fov_y=fov, up=up) if stage is None else scene.camera
    target = scene.bounds.mean(axis=0) if options.target is None else read_vector("--target", options.target)
    return Camera.look_at(read_vector("--eye", options.eye), target, up, fov_y=fov)


def read_vector(option: str, text: str) -> list[float]:
    """Vector from an option's three numbers."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != 3:
        raise InputError(f"{option} {text!r}", "not three numbers", f"write for example {option} 0,1.5,4")
    return values


def medium_lines(scene: Scene, reach: Callable[[Object], float] | None = None) -> list[str]:
    """Lines about the media of a scene's translucent objects, one per medium, with a color after some way through it.

    Layers, which nothing fills, are not among them.

    Parameters
    ----------
    scene : Scene
    reach : callable, optional
        Gives that way in metres for an object. Default: a tenth of its diagonal.
    """
    users: dict[Medium, list[Object]] = {}
    for body in scene.bodies:
        if body.medium is not None and not body.covers:
            users.setdefault(body.medium, []).append(body)
    way = reach or _tenth
    return [_medium_text(medium, bodies, way(bodies[0]), several=len(users) > 1) for medium, bodies in users.items()]


def _tenth(body: Object) -> float:
    return 0.1 * float(np.linalg.norm(body.bounds[1] - body.bounds[0]))


def _medium_text(medium: Medium, bodies: list[Object], reach: float, *, several: bool) -> str:
    from translucent.formulas.color import to_hex

    names = ", ".join(sorted({repr(body.mesh.name) for body in bodies}))
    whose = f"{names}: " if several else ""
    if (sheet := bodies[0].sheet_thickness) is not None:
        return f"{whose}thin, white light is {to_hex(medium.transmittance(sheet))} behind it"
    sigma = ", ".join(f"{value:.4g}" for value in medium.extinction)
    seen = to_hex(medium.transmittance(reach))
    return f"{whose}extinction {sigma} 1/m: white light is {seen} after {reach:.3g} m"


#: Key under which a verb finds the options that stand behind each ``--object``.
_GROUPS = "translucent.objects"

_OBJECT = "--object"


class NamedMedium(NamedTuple):
    """Medium of the objects of a name, and the roughness of their surfaces, if any is asked for."""

    name: str
    medium: Medium
    roughness: float | None


@click.command()
@medium_options
@scattering_medium_options
@roughness_option
def _of_one_object(**_: Any) -> None:
    """The options that may stand behind an --object."""


class ObjectCommand(click.Command):
    """Verb in which the options of a medium belong to the ``--object`` before them; before the first, to all others."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Take the options of single objects out of the arguments, and parse the rest."""
        rest, groups = _grouped(args)
        ctx.meta[_GROUPS] = groups
        return super().parse_args(ctx, rest)


def read_objects(names: Sequence[str]) -> list[NamedMedium]:
    """Media of the objects that are named, of the verb that runs.

    Raises
    ------
    InputError
        If an object is named twice or gets no medium, or its options are wrong.
    """
    found: list[NamedMedium] = []
    for name, options in zip(names, click.get_current_context().meta[_GROUPS], strict=True):
        if name in [one.name for one in found]:
            raise InputError(f"{_OBJECT} {name!r}", "it is named twice", "give it one medium")
        given = _of_one_object.make_context("render", options).params
        roughness, preset_name = given.pop("roughness"), given["preset_name"]
        medium = read_any_medium(**given)
        if medium is None:
            do = "add --preset NAME, or --color C and --distance D, behind it"
            raise InputError(f"{_OBJECT} {name!r}", "no medium is named for it", do)
        found.append(NamedMedium(name, medium, read_roughness(roughness, preset_name)))
    return found


def _grouped(arguments: list[str]) -> tuple[list[str], list[list[str]]]:
    """Arguments without the options of single objects, and those options, for each ``--object``."""
    takes_value = {name: not option.is_flag for option in _options() for name in (*option.opts, *option.secondary_opts)}
    rest: list[str] = []
    groups: list[list[str]] = []
    words = iter(arguments)
    for word in words:
        name, sign, _ = word.partition("=")
        if word == "--":
            rest += [word, *words]
        elif groups and name in takes_value:
            groups[-1].append(word)
            if takes_value[name] and not sign:
                groups[-1] += [value for value in [next(words, None)] if value is not None]
        else:
            rest.append(word)
            if name == _OBJECT:
                groups.append([])
                if not sign:
                    rest += [value for value in [next(words, None)] if value is not None]
    return rest, groups


def _options() -> list[click.Option]:
    return [one for one in _of_one_object.params if isinstance(one, click.Option)]
