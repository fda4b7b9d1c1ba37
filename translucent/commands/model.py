"""Scenes from MODEL and the options of a verb.

Options of a medium that stand behind an ``--object`` on the command line are for that object alone.
"""

from __future__ import annotations

import dataclasses
import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from translucent.commands.console import advise, echo
from translucent.commands.options import (
    DEFAULT_FOV,
    DEFAULT_UP,
    BodyOptions,
    CameraOptions,
    FileOptions,
    roughness_option,
)
from translucent.commands.verbs import VerbCommand, collected, with_options
from translucent.errors import InputError
from translucent.units import scale_to, size_note, tall

if TYPE_CHECKING:
    from translucent.arrays import Array
    from translucent.geometry.mesh import Mesh
    from translucent.media.medium import Medium
    from translucent.scene.camera import Camera
    from translucent.scene.environment import Environment
    from translucent.scene.scene import Object, Scene
    from translucent.scene.showcase import AnyScene
    from translucent.scene.stages import Stage

#: Key under which a verb finds the options that stand behind each ``--object``.
_GROUPS = "translucent.objects"

_OBJECT = "--object"


@dataclass(frozen=True)
class NamedMedium:
    """Medium of the objects of a name, roughness and pattern of their surfaces, if any is requested, and whether they
    keep the index of refraction that their file states.
    """

    name: str
    medium: Medium
    roughness: float | None
    keeps_ior: bool = False
    pattern: str = ""


@dataclass(frozen=True)
class SceneRequest:
    """Request for a scene of a model: media, camera, size, lights and stage.

    Attributes
    ----------
    medium : Medium, optional
        In all translucent objects; None: those of the file.
    keeps_ior : bool
        Objects of a file keep the index of refraction that it states.
    change : callable, optional
        Change of all media but those of single objects.
    camera, file : CameraOptions, FileOptions
    size : (width, height)
        Of the picture that the scene is framed for.
    environment : Environment, optional
    environment_shadows : int, optional
        Directions of it that throw shadows.
    roughness : float, optional
        Of the interfaces of media.
    pattern : str
        On these, as a preset has it, or nothing.
    stage : str, optional
        None is the default one, where it suits what the model and the options bring with them.
    ground : str, optional
        Color of what it has as a ground, or none.
    media : sequence of NamedMedium
        Media and roughness of single objects.
    variant, time : optional
        Of a glTF file.
    """

    medium: Medium | None = None
    keeps_ior: bool = False
    change: Callable[[Medium], Medium] | None = None
    camera: CameraOptions = field(default_factory=CameraOptions)
    file: FileOptions = field(default_factory=FileOptions)
    size: tuple[int, int] = (1280, 720)
    environment: Environment | None = None
    environment_shadows: int | None = None
    roughness: float | None = None
    pattern: str = ""
    stage: str | None = "none"
    ground: str | None = None
    media: Sequence[NamedMedium] = ()
    variant: str | None = None
    time: float | None = None


def is_scene_file(model: str) -> bool:
    """True if MODEL is a glTF file, or several models; all others hold one mesh."""
    from translucent.gltf.load import SUFFIXES
    from translucent.scene_files import is_composed

    return Path(model).suffix.lower() in SUFFIXES or is_composed(model)


def models_argument(*, required: bool = True) -> Callable[[Any], Any]:
    """Argument of a verb: one model, or several, each with its material; the verb gets one text."""

    def together(_: click.Context, __: click.Parameter, words: tuple[str, ...]) -> str | None:
        from translucent.scene_files import joined

        return joined(words) if words else None

    return click.argument("model", nargs=-1, required=required, callback=together, metavar="MODEL...")


def files_of(model: str) -> list[str]:
    """Files and names that MODEL consists of."""
    from translucent.scene_files import is_composed, model_names

    return model_names(model) if is_composed(model) else [model]


def read_scene(model: str, requested: SceneRequest) -> Scene:
    """Requested scene of a glTF file or of a mesh."""
    from translucent.scene.showcase import framing, objects_named, with_media, with_pattern, with_roughness
    from translucent.scene.stages import staged, upright
    from translucent.scene_files import is_composed

    options, (stage, turn) = requested.camera, _turned(requested.stage)
    if options.camera is not None and options.defining:
        raise InputError(
            f"--camera {options.camera}",
            f"--camera cannot be combined with {', '.join(options.defining)}",
            "use one or the other",
        )
    composed = is_composed(model)
    read = _composed_scene if composed else _file_scene if is_scene_file(model) else _mesh_scene
    scene, chosen = read(model, requested, stage)
    named = {id(item) for one in requested.media for item in objects_named(scene, one.name)}
    # What the options say of a material is of the objects that have none.
    named |= {id(scene.objects[i]) for i in getattr(scene, "with_material", ())}
    others = [item for item in scene.objects if id(item) not in named]
    scene = with_roughness(scene, requested.roughness, others)
    if requested.change is not None:
        mine = {id(item) for one in requested.media for item in objects_named(scene, one.name)}
        scene = with_media(scene, requested.change, [item for item in scene.objects if id(item) not in mine])
    for one in requested.media:
        scene = with_roughness(scene, one.roughness, objects_named(scene, one.name))
    for line in _textured_roughness(scene, requested):
        advise(line)
    for pattern, among in _patterns(scene, requested):
        scene = with_pattern(scene, pattern, among)
    if options.defining:
        scene = dataclasses.replace(scene, camera=_defined_camera(scene, options, requested.size, chosen))
    if chosen is not None:
        scene = upright(scene, read_vector("--up", options.up or DEFAULT_UP))
        if options.eye is None and not getattr(scene, "has_camera", False):
            fov = DEFAULT_FOV if options.fov is None else options.fov
            view = options.direction, options.fit
            camera = framing(scene.objects, requested.size, fov, (0.0, 1.0, 0.0), chosen, *view)
            scene = dataclasses.replace(scene, camera=camera)
        scene = staged(scene, chosen, requested.environment, turn, requested.ground)
    elif requested.ground is not None:
        raise InputError(
            f"--ground {requested.ground}", "the scene has no stage", "add --stage studio, or omit --ground"
        )
    count = requested.environment_shadows
    return scene if count is None else dataclasses.replace(scene, environment_shadows=count)


def _patterns(scene: Scene, requested: SceneRequest) -> list[tuple[str, Sequence[Object]]]:
    """Patterns of presets, and the objects that have them."""
    from translucent.scene.showcase import objects_named

    own = [(one.pattern, objects_named(scene, one.name)) for one in requested.media]
    apart = {id(item) for _, items in own for item in items}
    apart |= {id(scene.objects[i]) for i in getattr(scene, "with_material", ())}
    return [(requested.pattern, [item for item in scene.objects if id(item) not in apart]), *own]


def _textured_roughness(scene: Scene, requested: SceneRequest) -> list[str]:
    """Note that a roughness texture of the file multiplies the requested roughness."""
    from translucent.scene.scene import object_names

    values = {requested.roughness, *(one.roughness for one in requested.media)} - {None, 1.0}
    textured = [
        item
        for item in scene.objects
        if item.medium is not None
        and item.surface is not None
        and item.surface.roughness_texture is not None
        and item.surface.roughness in values
    ]
    factors = " or ".join(
        f"{value:g}" for value in sorted({item.surface.roughness for item in textured if item.surface})
    )
    names = f"{object_names(textured)}: the roughness is the texture of the file"
    return [f"{names} times the requested {factors}; --roughness 1 uses the texture unchanged"] if textured else []


def _turned(stage: str | None) -> tuple[str | None, float]:
    """Name of a stage, and the degrees after it."""
    name, comma, degrees = (stage or "").partition(",")
    try:
        turn = float(degrees) if comma else 0.0
    except ValueError:
        raise InputError(f"--stage {stage!r}", f"{degrees!r} is not a number of degrees", f"write {name},90") from None
    return (name if comma else stage), turn


def _mesh_scene(model: str, requested: SceneRequest, stage: str | None) -> tuple[Scene, Stage | None]:
    from translucent.scene.showcase import default_medium, showcase
    from translucent.scene.stages import DEFAULT_STAGE, NO_STAGE, stage_named

    if (camera := requested.camera.camera) is not None:
        raise InputError(
            f"--camera {camera}", f"{model} is not a glTF file, so it has no cameras", "use --eye to place the camera"
        )
    for option, value in (("--variant", requested.variant), ("--time", requested.time)):
        if value is not None:
            raise InputError(f"{option} {value}", f"{model} is not a glTF file", "omit the option")
    chosen = stage_named(stage or (DEFAULT_STAGE if requested.environment is None else NO_STAGE))
    mesh = read_mesh(model, requested.file)
    filling = requested.medium or default_medium(mesh, chosen)
    scene = showcase(mesh, filling, requested.size, environment=requested.environment, stage=NO_STAGE)
    return _with_media(scene, requested.media), chosen


def _file_scene(model: str, requested: SceneRequest, stage: str | None) -> tuple[Scene, Stage | None]:
    from translucent.gltf.load import load_scene
    from translucent.scene.showcase import filled
    from translucent.scene.stages import DEFAULT_STAGE, NO_STAGE, has_ground, stage_named

    scene = load_scene(
        model,
        file_unit(model, requested.file),
        None if requested.camera.defining else requested.camera.camera or 0,
        requested.size,
        variant=requested.variant,
        time=requested.time,
        allow_outside=requested.file.allow_outside,
        draft_extensions=requested.file.draft_extensions,
    )
    for remark in scene.remarks:
        advise(remark)
    if requested.medium is not None:
        scene = filled(scene, requested.medium, keeps_ior=requested.keeps_ior)
    scene = _with_media(scene, requested.media)
    bare = not (scene.has_camera or scene.lights or has_ground(scene)) and requested.environment is None
    chosen = stage_named(stage or (DEFAULT_STAGE if bare and scene.bodies else NO_STAGE))
    if requested.environment is not None:
        scene = dataclasses.replace(scene, environment=requested.environment)
    return scene, chosen


def _composed_scene(model: str, requested: SceneRequest, stage: str | None) -> tuple[Scene, Stage | None]:
    from translucent.scene.stages import NO_STAGE, stage_named
    from translucent.scene_files import load_composed

    for option, value in (
        ("--camera", requested.camera.camera),
        ("--variant", requested.variant),
        ("--time", requested.time),
    ):
        if value is not None:
            raise InputError(f"{option} {value}", f"{model} is not a glTF file", "omit the option")
    medium, file = requested.medium, requested.file
    scene: Scene = load_composed(
        model,
        file_unit(model, file) if file.unit or file.sizes else None,
        requested.size,
        None if medium is None else lambda _: medium,
        allow_outside=file.allow_outside,
    )
    for remark in scene.remarks:  # type: ignore[attr-defined]
        advise(remark)
    scene = _with_media(scene, requested.media)
    own: str = scene.stage  # type: ignore[attr-defined]
    chosen = stage_named(stage or (own if requested.environment is None else NO_STAGE))
    if requested.environment is not None:
        scene = dataclasses.replace(scene, environment=requested.environment)
    return scene, chosen


def _with_media(scene: AnyScene, media: Sequence[NamedMedium]) -> AnyScene:
    """Scene with the media of the objects that are named."""
    from translucent.scene.showcase import filled, objects_named

    for one in media:
        scene = filled(scene, one.medium, objects_named(scene, one.name), keeps_ior=one.keeps_ior)
    return scene


def require_translucent(model: str, scene: Scene) -> None:
    """Raise `InputError` if light passes no object of the scene."""
    if not scene.bodies:
        count = len(scene.objects)
        raise InputError(
            f"rendering {model!r}",
            f"its {count} object{' is' if count == 1 else 's are'} opaque: no material has KHR_materials_transmission",
            "add --preset NAME, or --color C and --distance D, to give a medium to all objects",
        )


def is_own(model: str) -> bool:
    """True if MODEL is a mesh that comes with the toolkit, and no file has the same name; a folder may."""
    from translucent.assets import mesh_names

    return model in mesh_names() and (os.path.isdir(model) or not os.path.lexists(model))


def read_mesh(model: str, file: FileOptions) -> Mesh:
    """The mesh of a file, or of the toolkit's own by name."""
    from translucent.mesh_files import load_mesh

    path, sizes = mesh_file(model, file.unit), file.sizes
    # The toolkit's own are in metres, though their files do not say so.
    unit = "m" if is_own(model) and not sizes else file.unit
    return load_mesh(path, unit, allow_outside=file.allow_outside, **sizes)


def file_unit(model: str, file: FileOptions) -> str:
    """Unit of a file's coordinates: as stated, or the length by which the model gets the size that is requested."""
    if not (sizes := file.sizes):
        return file.unit or "m"
    bounds = _file_bounds(model, file)
    return f"{scale_to(bounds, sizes.get('height'), sizes.get('longest'), model)!r}m"


def _file_bounds(model: str, file: FileOptions) -> Array:
    """(2, 3): bounds of a model in metres, as its file has them."""
    from translucent.gltf.load import load_scene
    from translucent.mesh_files import load_mesh
    from translucent.scene_files import is_composed, load_composed

    if not is_scene_file(model):
        return load_mesh(mesh_file(model, None), "m", allow_outside=file.allow_outside).bounds
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # they come again as the file is read with its unit
        if is_composed(model):
            return load_composed(model, allow_outside=file.allow_outside).shown_bounds
        return load_scene(model, allow_outside=file.allow_outside).shown_bounds


def mesh_file(model: str, unit: str | None) -> str:
    """The file of a mesh, which may be the name of one of the toolkit's own."""
    from translucent.assets import mesh_names, mesh_path

    if is_own(model):
        if unit not in (None, "m"):
            raise InputError(
                f"--unit {unit}",
                f"{model} is a built-in mesh, whose coordinates are in metres",
                "omit --unit, or set the size by --height",
            )
        return str(mesh_path(model))
    if not os.path.lexists(model) and not os.path.dirname(model) and not Path(model).suffix:
        raise InputError(
            f"mesh {model!r}",
            "no file and no built-in mesh has this name",
            f"give the path of a file, or one of {', '.join(sorted(mesh_names()))}",
        )
    return model


def _defined_camera(scene: Scene, options: CameraOptions, size: tuple[int, int], stage: Stage | None) -> Camera:
    """Camera that the options define, or that frames all objects; the camera of a stage is made later."""
    from translucent.scene.camera import Camera
    from translucent.scene.showcase import framing

    up, fov = read_vector("--up", options.up or DEFAULT_UP), DEFAULT_FOV if options.fov is None else options.fov
    if options.eye is None:
        if options.target is not None:
            raise InputError("--target", "--target works only together with --eye", "give both options, or neither")
        view = options.direction, options.fit
        return framing(scene.objects, size, fov, up, None, *view) if stage is None else scene.camera
    for name, value in (("--orbit", options.orbit), ("--fit", options.fit)):
        if value is not None:
            raise InputError(f"{name} {value}", "this option cannot be combined with --eye", "use one or the other")
    target = scene.bounds.mean(axis=0) if options.target is None else read_vector("--target", options.target)
    return Camera.look_at(read_vector("--eye", options.eye), target, up, fov_y=fov)


def read_vector(option: str, text: str) -> list[float]:
    """Vector from an option's three numbers."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != 3:
        raise InputError(f"{option} {text!r}", "the value is not three numbers", f"write for example {option} 0,1.5,4")
    return values


def assumes_metres(model: str, file: FileOptions) -> bool:
    """True if neither MODEL nor an option says in which unit its coordinates are."""
    return not (file.unit or file.sizes or is_scene_file(model) or is_own(model))


def size_text(scene: Scene) -> str:
    """Size of the visible scene, with the option that changes its unit if the file has none."""
    notes = [note for item in scene.shown if (note := size_note(item.mesh))]
    return notes[0] if notes else tall(scene.shown_bounds)


def echo_advice(scene: Scene, remarks: Sequence[str]) -> None:
    """Print the size of a scene, and advice for a better picture."""
    echo(f"size: {size_text(scene)}")
    for remark in remarks:
        echo(f"advice: {remark}")


def medium_lines(scene: Scene, reach: Callable[[Object], float] | None = None) -> list[str]:
    """Lines about the media of a scene's translucent objects, one per medium, with a color after some length in it.

    Layers, which nothing fills, are not among them.

    Parameters
    ----------
    scene : Scene
    reach : callable, optional
        That length in metres for an object. Default: a tenth of its diagonal.
    """
    from translucent.formulas.color import to_hex

    users: dict[Medium, list[Object]] = {}
    for body in scene.bodies:
        if body.medium is not None and not body.covers:
            users.setdefault(body.medium, []).append(body)
    lines = []
    for medium, bodies in users.items():
        names = ", ".join(sorted({repr(body.mesh.name) for body in bodies}))
        whose, first = f"{names}: " if len(users) > 1 else "", bodies[0]
        if (sheet := first.sheet_thickness) is not None:
            lines.append(f"{whose}thin-walled: white light is {to_hex(medium.transmittance(sheet))} behind it")
            continue
        length = reach(first) if reach is not None else 0.1 * float(np.linalg.norm(first.bounds[1] - first.bounds[0]))
        sigma = ", ".join(f"{value:.4g}" for value in medium.extinction)
        color = to_hex(medium.transmittance(length))
        lines.append(f"{whose}extinction {sigma} 1/m: white light is {color} after {length:.3g} m")
    return lines


@dataclass(frozen=True, kw_only=True)
class _ObjectOptions(BodyOptions):
    """The options that may stand behind an --object."""

    roughness: float | None = roughness_option()


#: Parser of these options alone: ``--json`` and all else behind an --object is of the verb.
_of_one_object = click.command("object")(with_options(_ObjectOptions, lambda **_: None))


class ObjectCommand(VerbCommand):
    """Verb in which the options of a medium belong to the ``--object`` before them; before the first, to all others."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Take the options of single objects out of the arguments, and parse the rest."""
        rest, groups = _grouped(args)
        ctx.meta[_GROUPS] = groups
        return super().parse_args(ctx, rest)


def read_objects(names: Sequence[str]) -> list[NamedMedium]:
    """Media that the ``--object`` options of the running command give to single objects.

    Raises
    ------
    InputError
        If an object is named twice or gets no medium, or its options are wrong.
    """
    found: list[NamedMedium] = []
    for name, options in zip(names, click.get_current_context().meta[_GROUPS], strict=True):
        if name in [one.name for one in found]:
            raise InputError(f"{_OBJECT} {name!r}", "the object is named twice", "give the object one medium")
        given = collected(_ObjectOptions, _of_one_object.make_context("render", options).params)
        if (medium := given.read()) is None:
            do = "after the name, add --preset NAME, or --color C and --distance D"
            raise InputError(f"{_OBJECT} {name!r}", "no medium is given for this object", do)
        found.append(
            NamedMedium(
                name,
                given.changed(medium),
                given.surface_roughness(given.roughness),
                given.keeps_ior,
                given.surface_pattern,
            )
        )
    return found


def _grouped(arguments: list[str]) -> tuple[list[str], list[list[str]]]:
    """Arguments without the options of single objects, and those options, for each ``--object``."""
    options = [one for one in _of_one_object.params if isinstance(one, click.Option)]
    takes_value = {name: not one.is_flag for one in options for name in (*one.opts, *one.secondary_opts)}
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
