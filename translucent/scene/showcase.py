"""Default scenes: a mesh, framed, in a medium that suits its size, on a stage."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path, PurePath
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from translucent.arguments import brief, checked
from translucent.errors import InputError, close_names, did_you_mean
from translucent.geometry.grouping import extent
from translucent.geometry.mesh import Mesh
from translucent.media.colors import ColorLike, parse_color
from translucent.media.medium import Medium
from translucent.media.preset import Preset
from translucent.media.presets import presets
from translucent.scene.camera import FRAMED_FROM, Camera, framing_directions
from translucent.scene.environment import Environment
from translucent.scene.patterns import patterned, uniform_scale
from translucent.scene.scene import Light, Object, Scene
from translucent.scene.stages import (
    DEFAULT_STAGE,
    NO_STAGE,
    Stage,
    farthest_vertices,
    stage_lights,
    stage_named,
    staged,
    with_shadows,
)
from translucent.scene.surface import Surface

#: Linear color of white light in the default medium on its mean path through a closed mesh, if that is more than
#: `DEFAULT_REACH` of the mesh's diagonal, else after that.
DEFAULT_COLOR = (0.18, 0.62, 0.35)
DEFAULT_REACH = 0.15

#: Index of refraction of glass: for solids that only have a color, and for the default medium on a stage, where there
#: is something to mirror. Without a stage the default medium has 1.
SOLID_IOR = 1.5

#: The default environment: white above and light gray below.
LIGHT_TABLE = Environment.gradient((0.55, 0.56, 0.58), (1.15, 1.15, 1.15))

#: How much larger than the objects a picture of them on a stage is framed, beside its margin.
ROOM = 1.1

#: Names of environments for `named_environment`, besides colors and pictures.
ENVIRONMENT_NAMES = ("light-table", "studio", "checkerboard")

#: Most names of objects that an error lists.
MOST_NAMES = 20

AnyScene = TypeVar("AnyScene", bound=Scene)


@checked
def showcase(
    mesh: Mesh,
    medium: Medium | Preset | ColorLike | None = None,
    size: tuple[int, int] | float = (1280, 720),
    camera: Camera | None = None,
    environment: Environment | None = None,
    lights: Sequence[Light] = (),
    stage: str | None = None,
    *,
    distance: float | None = None,
) -> Scene:
    """Scene that shows one mesh well, with defaults for everything else.

    Parameters
    ----------
    mesh : Mesh
    medium : Medium, Preset, str or array_like (3,), optional
        A medium, polished; a preset, or its name, with its medium and surface; or a color, of a solid with the ior of
        glass, at a `distance`: ``showcase(mesh, "wax")``, ``showcase(mesh, "#ace5c9", 0.25)``. Default: jade green on
        the mean path through the mesh, or after 15 % of its diagonal where that is more, whatever its size; on a stage,
        with the ior of glass.
    size : (width, height), or float
        Size of the picture in pixels, which the framing and the stage depend on. After a color: the `distance`.
    camera : Camera, optional
        Default: from the front right and above, the whole mesh in view.
    environment : Environment, optional
        Default: the stage's; without one, a light table, white above and light gray below. Lights show best before a
        dark one.
    lights : sequence of PointLight, SpotLight or DirectionalLight
        What shines, in place of the stage's lights.
    stage : str, optional
        One of `translucent.scene.stages.STAGES`, or ``none``: what the mesh stands on and before. +Y is up. The
        ground is the last of the objects. Default: ``studio``, or none with an environment or lights of your own.
    distance : float, optional
        In metres, after which white light has the color.

    Raises
    ------
    InputError
        If there is no such stage or preset, or a color without a distance.
    """
    if isinstance(size, int | float):
        distance, size = size, (1280, 720)
    lights = tuple(lights)
    own = environment is not None or len(lights) > 0
    chosen = stage_named(stage or (NO_STAGE if own else DEFAULT_STAGE))
    model = _body(mesh, medium, distance, chosen)
    scene = Scene([model], camera or framing([model], size, stage=chosen), lights, environment or LIGHT_TABLE)
    return scene if chosen is None else staged(scene, chosen, environment)


def _body(
    mesh: Mesh, medium: Medium | Preset | ColorLike | None, distance: float | None, stage: Stage | None
) -> Object:
    """Object of a medium, of a preset, or of a color at a distance; by default of a medium that suits the mesh."""
    if medium is None or isinstance(medium, Medium | Preset):
        if distance is not None:
            what = "no medium" if medium is None else f"a {type(medium).__name__}"
            raise InputError(
                f"showcase distance {distance!r}",
                f"{what}, and no color is given",
                "give a color, or omit the distance",
            )
        if isinstance(medium, Preset):
            return Object(mesh, material=medium)
        return Object(mesh, medium=medium or default_medium(mesh, stage))
    if distance is not None:
        return Object(mesh, medium=Medium.from_color(medium, distance, ior=SOLID_IOR))
    try:
        color = parse_color(medium)
    except InputError:
        color = None
    if isinstance(medium, str) and (color is None or medium in presets()):
        return Object(mesh, material=medium)
    do = f"give the distance in metres after which white light has this color: showcase(mesh, {brief(medium)}, 0.02)"
    raise InputError(f"showcase medium {brief(medium)}", "a color needs a distance", do)


def default_medium(mesh: Mesh, stage: Stage | None) -> Medium:
    """Jade green medium that suits a mesh: compact ones are as bright as slender ones.

    With an interface on a stage, where there is much to mirror.
    """
    reach = DEFAULT_REACH * (mesh.diagonal or 1.0)
    if mesh.diagnosis.sound:
        # The mean chord of rays through a body is 4 V / S (Cauchy): twice its mean thickness.
        reach = max(reach, 2.0 * Object(mesh, medium=Medium()).mean_thickness)
    return Medium.from_color(DEFAULT_COLOR, reach, ior=1.0 if stage is None else SOLID_IOR)


def named_environment(name: str, rotation: float = 0.0) -> Environment:
    """Environment by name: light-table, studio, checkerboard, a color, or a file with a picture of all directions.

    Parameters
    ----------
    name : str
    rotation : float
        Of the studio or the picture, in degrees.

    Raises
    ------
    InputError
        If it is none of these.
    """
    from translucent.scene.environment_files import READERS

    if name == "studio":
        return Environment.studio(rotation)
    if Path(name).suffix.lower() in READERS:
        return Environment.image(name, rotation)
    if name == "light-table":
        return LIGHT_TABLE
    if name in ("checkerboard", "checker"):
        return Environment.checkerboard(tiles=12)
    try:
        return Environment.constant(name)
    except InputError:
        if not (close := close_names(name.partition(",")[0].strip().lower(), ENVIRONMENT_NAMES)):
            raise
        found = f"not a color, not a picture, and none of {', '.join(ENVIRONMENT_NAMES)}"
        raise InputError(f"environment {name!r}", found, did_you_mean(close)) from None


def framing(
    objects: Sequence[Object],
    size: tuple[int, int],
    fov_y: float = 30.0,
    up: npt.ArrayLike = (0.0, 1.0, 0.0),
    stage: Stage | None = None,
    direction: npt.ArrayLike | None = None,
    fit: float | None = None,
) -> Camera:
    """Camera of `Camera.framing` that sees all of these objects, on a stage with room for their shadows.

    With a `fit`, the objects alone take that fraction of the picture, whatever of their shadows is seen.
    """
    along = direction if direction is not None else FRAMED_FROM if stage is None else stage.view
    if stage is None or fit is not None:
        points = farthest_vertices(objects, framing_directions(size, along, fov_y, up, fit))
        return Camera.framing(points, size, along, fov_y, up, fit)
    lights, directions = stage_lights(stage), framing_directions(size, along, fov_y, up)
    # A shadow is a linear map of its points: one map for each light, applied to unit vectors.
    maps = with_shadows(np.eye(4, 3, -1), lights).reshape(-1, 4, 3)[:, 1:]
    points = farthest_vertices(objects, (directions @ maps.transpose(0, 2, 1)).reshape(-1, 3))
    points = with_shadows(points, lights)
    middle = extent(points).mean(axis=0)
    return Camera.framing(middle + ROOM * (points - middle), size, along, fov_y, up)


def with_roughness(scene: AnyScene, roughness: float | None, among: Sequence[Object] | None = None) -> AnyScene:
    """Scene with this roughness of all surfaces of media, or of those of some objects; the scene itself for None."""
    if roughness is None:
        return scene
    chosen = set(map(id, scene.objects if among is None else among))

    def surfaced(item: Object) -> Object:
        if item.medium is None or item.covers or id(item) not in chosen:
            return item
        return dataclasses.replace(item, surface=dataclasses.replace(item.surface or Surface(), roughness=roughness))

    return dataclasses.replace(scene, objects=[surfaced(item) for item in scene.objects])


def with_pattern(scene: AnyScene, pattern: str, among: Sequence[Object] | None = None) -> AnyScene:
    """Scene with a pattern of `translucent.scene.patterns` on all solids, or on some objects, that have no textures."""
    if not pattern:
        return scene
    chosen = set(map(id, scene.objects if among is None else among))

    def marked(item: Object) -> Object:
        if item.medium is None or item.covers or item.sheet_thickness is not None or id(item) not in chosen:
            return item
        mesh, surface = patterned(item.mesh, item.surface, pattern, uniform_scale(item.matrix))
        return item if mesh is item.mesh else dataclasses.replace(item, mesh=mesh, surface=surface)

    return dataclasses.replace(scene, objects=[marked(item) for item in scene.objects])


def with_media(scene: AnyScene, change: Callable[[Medium], Medium], among: Sequence[Object] | None = None) -> AnyScene:
    """Scene with changed media, of all objects or of some."""
    chosen = set(map(id, scene.objects if among is None else among))
    media = {id(item.medium): change(item.medium) for item in scene.objects if item.medium is not None}
    objects = [
        dataclasses.replace(item, medium=media[id(item.medium)])
        if item.medium is not None and not item.covers and id(item) in chosen
        else item
        for item in scene.objects
    ]
    return dataclasses.replace(scene, objects=objects)


def filled(
    scene: AnyScene, medium: Medium, among: Sequence[Object] | None = None, *, keeps_ior: bool = False
) -> AnyScene:
    """Scene with this medium in some objects; or in all translucent ones, or in all objects if none is translucent.

    Thin sheets become bodies: they had no inside that a medium could fill. With `keeps_ior`, objects keep the index of
    refraction that they have.
    """
    media: dict[float, Medium] = {medium.ior: medium}
    chosen = set(map(id, fillable(scene) if among is None else among))

    def fill(item: Object) -> Object:
        surface = item.surface
        if surface is not None and surface.opacity is not None:
            surface = dataclasses.replace(surface, opacity=None)
        ior = item.medium.ior if keeps_ior and item.medium is not None and not item.covers else medium.ior
        filling = media.setdefault(ior, dataclasses.replace(medium, ior=ior))
        return dataclasses.replace(item, medium=filling, sheet_thickness=None, surface=surface)

    return dataclasses.replace(scene, objects=[fill(item) if id(item) in chosen else item for item in scene.objects])


def objects_named(scene: Scene, name: str) -> tuple[Object, ...]:
    """Objects with this name: of the mesh, of the parts of a mesh (``Cup`` for ``Cup[0]``), or of its file (``goblet``
    for ``goblet.ply``).

    Raises
    ------
    InputError
        If there is none.
    """
    names = [item.mesh.name for item in scene.objects]
    for items in (
        [item for item in scene.objects if item.mesh.name == name],
        [item for item in scene.objects if item.mesh.name.startswith(f"{name}[")],
        [item for item in scene.objects if name and PurePath(item.mesh.name).stem == name],
    ):
        if items:
            return tuple(items)
    known = list(dict.fromkeys(names))
    others = f" and {len(known) - MOST_NAMES} more" if len(known) > MOST_NAMES else ""
    do = f"use one of {', '.join(map(repr, known[:MOST_NAMES]))}{others}"
    near = close_names(name, known)
    raise InputError(f"object {name!r}", "no object has this name", f"{did_you_mean(near)} {do}" if near else do)


def fillable(scene: Scene) -> tuple[Object, ...]:
    """Objects to fill with a medium if none is named: all translucent objects, or else all objects.

    Layers that cover a fraction of what is behind them are among them only where there is nothing else.
    """
    bodies = tuple(body for body in scene.bodies if not body.covers)
    return bodies or tuple(item for item in scene.objects if not item.covers) or tuple(scene.objects)
