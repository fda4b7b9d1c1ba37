"""Scenes of several models: a .toml file that lists them, one that comes with the toolkit, or their names in a text.

``goblet:crystal wine:merlot`` is such a text: models, each with its material, a preset or a color at a distance. The
.toml file says more: where objects are and how large, cameras, lights and the environment. `docs/scenes.md` lists its
keys.
"""

from __future__ import annotations

import os
import re
import shlex
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from translucent.arguments import checked_but, require_path
from translucent.arrays import Array
from translucent.assets import mesh_names, mesh_path, scene_names, scene_path
from translucent.errors import InputError, TranslucentWarning, close_names, did_you_mean
from translucent.files.reading import linked_file, read_text, toml_value
from translucent.geometry.foreign import is_scene
from translucent.gltf.load import SUFFIXES as GLTF
from translucent.gltf.load import load_scene as load_gltf
from translucent.media.albedo import scattering_medium
from translucent.media.colors import parse_color
from translucent.media.conversion import CLAMP, clamp_colors
from translucent.media.medium import Medium
from translucent.media.presets import preset
from translucent.mesh_files import load_mesh
from translucent.scene.camera import FRAMED_FROM, Camera, direction_from
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, Light, PointLight, SphereLight, SpotLight
from translucent.scene.patterns import patterned, uniform_scale
from translucent.scene.scene import Object, Scene
from translucent.scene.showcase import LIGHT_TABLE, SOLID_IOR, default_medium, filled, framing, named_environment
from translucent.scene.stages import DEFAULT_STAGE, NO_STAGE, Stage, has_ground, stage_named, staged
from translucent.scene.surface import Surface
from translucent.scene.touching import with_priorities
from translucent.units import metres_in, metres_per_unit, scale_to

#: Index of refraction of media that a scattering color makes: that of soap, wax, skin and milk is 1.33 to 1.5.
SCATTERING_IOR = 1.4

#: Materials of objects in files: each set of keys is one of them.
_MATERIALS = {
    "preset": ("preset",),
    "color": ("color", "distance"),
    "scattering_color": ("scattering_color", "mean_free_path"),
    "opaque": ("opaque",),
}
_OBJECT_KEYS = [
    *("model", "name", "ior", "dilute", "roughness", "surface", "priority"),
    *(key for keys in _MATERIALS.values() for key in keys),
    *("unit", "height", "longest", "translate", "rotate", "scale"),
]
_CAMERA_KEYS = ["eye", "target", "up", "fov", "orbit", "fit"]
_SCENE_KEYS = ["object", "camera", "light", "environment", "background", "stage", "overlap"]
_LIGHTS: dict[str, type] = {
    "directional": DirectionalLight,
    "point": PointLight,
    "sphere": SphereLight,
    "spot": SpotLight,
}


Made = TypeVar("Made")


@dataclass(frozen=True, eq=False, repr=False)
class ComposedScene(Scene):
    """Scene of several models.

    Parameters
    ----------
    has_camera : bool
        Whether its file states the view, rather than that all objects are framed.
    stage : str
        What it stands on.
    with_material : frozenset of int
        Objects whose material is stated.
    remarks : tuple of str
        Choices that nobody stated, such as which body displaces another.
    """

    has_camera: bool = False
    stage: str = DEFAULT_STAGE
    with_material: frozenset[int] = frozenset()
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class _StatedModel:
    """Model of a scene, with its material and place.

    Attributes
    ----------
    model : str
        File, or mesh of the toolkit.
    where : str
        What errors call it.
    values : Mapping
        Keys of the file's table.
    """

    model: str
    where: str
    values: Mapping[str, Any] = field(default_factory=dict)


@checked_but("path", "camera", "size")
def load_scene(
    path: Any,
    unit: str | None = None,
    camera: int | None = 0,
    size: tuple[int, int] = (1, 1),
    *,
    allow_outside: bool = False,
    variant: str | None = None,
    time: float | None = None,
    draft_extensions: bool = False,
) -> Scene:
    """Read a scene: its objects with their media, a camera, its lights.

    Parameters
    ----------
    path : path, str or trimesh.Scene
        A glTF 2.0 file, .gltf or .glb; a .toml file that lists models; one of the toolkit's scenes, as
        ``glass-of-wine``; or models with their materials, as ``goblet:crystal wine:merlot``. Of a glTF file, its
        default scene is read, or else its first. A scene of trimesh is what it exports as .glb.
    unit : str, optional
        Unit of the file's lengths. glTF is in metres by definition; another unit rescales the whole, attenuation
        distances and lights included, so that it looks the same. Models of other scenes are scaled, and media are not.
        Default: metres, and for a scene of trimesh its units.
    camera : int or None
        Which of the cameras that nodes of a glTF file place, counted from 0. None frames all objects, and so does 0 in
        a file without cameras.
    size : (width, height)
        Size of the picture in pixels, which the framing depends on; a wider picture shows all objects, too.
    allow_outside : bool
        Whether what a file links to may lie outside its folder: only for files that you trust.
    variant : str, optional
        Name of a variant of materials of a glTF file (KHR_materials_variants). Default: those of the primitives.
    time : float, optional
        Seconds on the clock of a glTF file's animations at which nodes, skins and morph targets stand. Default: as they
        are written.
    draft_extensions : bool
        Whether to read KHR_materials_scatter and KHR_materials_volume_scatter of a glTF file, which are drafts.

    Returns
    -------
    GltfScene or ComposedScene
        Of glTF one object per node and primitive. Nodes that share a mesh share it here, too; a mesh has its node's
        name, and a shared one its own. Meshes are welded and wound as by `load_mesh`. What materials make of objects
        says `translucent.gltf.objects`. The environment, which glTF does not have, is `Environment.studio`, or that of
        `showcase` in a file without materials. `left_out` lists what the scene does not hold, and a
        `TranslucentWarning` reports it. Other scenes stand on their stage.

    Raises
    ------
    InputError
        If a file is missing, broken, compressed or without triangles; if a value in it is wrong; if there is no such
        camera, variant, animation, preset or stage.
    """
    if is_scene(path) or not is_composed(_text(path)):
        more = {"variant": variant, "time": time, "draft_extensions": draft_extensions}
        return load_gltf(path, unit, camera, size, allow_outside=allow_outside, **more)  # type: ignore[arg-type]
    for name, value in (("variant", variant), ("time", time)):
        if value is not None:
            raise InputError(f"{name} {value!r}", f"{_text(path)} is not a glTF file", "omit this key")
    scene = load_composed(_text(path), unit, size, allow_outside=allow_outside)
    if scene.stage == NO_STAGE:
        return scene
    if not scene.has_camera:
        scene = replace(scene, camera=framing(scene.objects, size, stage=stage_named(scene.stage)))
    return staged(scene, scene.stage)


def _text(path: Any) -> str:
    require_path("load_scene path", path, "a .glb, .gltf or .toml file, models with materials, or a scene of trimesh")
    return str(path)


def is_composed(model: str) -> bool:
    """True for a .toml file, for one of the toolkit's scenes, and for a text of several models or one with material."""
    if os.path.lexists(model):
        return Path(model).suffix.lower() == ".toml"
    if model in mesh_names():
        return False
    if model in scene_names() or Path(model).suffix.lower() == ".toml":
        return True
    words = [_divided(word) for word in _words(model)]
    # Folders without a model among the words: the text is one path, whose name has spaces.
    known = os.sep not in model or any(os.path.lexists(head) or head in mesh_names() for head, _ in words)
    return any(material for _, material in words) or (len(words) > 1 and known)


def joined(models: tuple[str, ...]) -> str:
    """Text of several models, each with its material or without."""
    return models[0] if len(models) == 1 else shlex.join(models)


def model_names(model: str) -> list[str]:
    """Files and names of the models in a text, without their materials."""
    return [_divided(word)[0] for word in _words(model)]


def load_composed(
    model: str,
    unit: str | None = None,
    size: tuple[int, int] = (1, 1),
    default: Callable[[Any], Medium] | None = None,
    *,
    allow_outside: bool = False,
) -> ComposedScene:
    """Read a scene of several models, without its stage.

    Parameters
    ----------
    model : str
        As `is_composed` takes it.
    unit : str, optional
        Of the coordinates of meshes that state none; it scales their places, too.
    size : (width, height)
        Of the picture that it is framed for.
    default : callable, optional
        Makes the medium of a mesh for which none is stated. Default: jade green that suits it.
    allow_outside : bool
        Whether models may lie outside the folder of the file.

    Raises
    ------
    InputError
        It names the key, and its line.
    """
    if os.path.lexists(model) or Path(model).suffix.lower() == ".toml":
        return _SceneFile(Path(model), unit, size, default, allow_outside).scene()
    if model in scene_names():
        return _SceneFile(scene_path(model), unit, size, default, allow_outside).scene()
    parts = [_StatedModel(*_of_word(word)) for word in _words(model)]
    return _composed([_loaded(part, part.model, unit, default, False) for part in parts], size, {})


def _words(text: str) -> list[str]:
    if os.path.lexists(text):
        return [text]
    try:
        return shlex.split(text) if os.sep == "/" else text.split()
    except ValueError:
        return [text]


def _divided(word: str) -> tuple[str, str]:
    """Model and material of a word; no material where the whole is a file."""
    head, colon, tail = word.rpartition(":")
    if not colon or os.path.lexists(word):
        return word, ""
    # A drive, or the scheme of an address, is no model.
    return (head, tail) if len(head) > 1 and not tail.startswith(("/", "\\")) else (word, "")


def _of_word(word: str) -> tuple[str, str, dict[str, Any]]:
    model, material = _divided(word)
    values: dict[str, Any] = {}
    if "@" in material:
        values["color"], _, values["distance"] = material.rpartition("@")
    elif material:
        values["preset"] = material
    if not os.path.lexists(model) and model not in mesh_names():
        if model in scene_names():
            raise InputError(
                f"model {word!r}",
                "the word names a whole scene, which cannot be combined with other models",
                f"render the scene alone: translucent render {model}",
            )
        close = close_names(model, mesh_names())
        do = did_you_mean(close) if close else f"give a path, or one of {', '.join(sorted(mesh_names()))}"
        raise InputError(f"model {word!r}", f"no file {model!r} and no built-in mesh has this name", do)
    return model, f"model {word!r}", values


@dataclass(frozen=True)
class _LoadedModel:
    objects: list[Object]
    has_material: bool


def _loaded(
    part: _StatedModel, path: str, unit: str | None, default: Callable[[Any], Medium] | None, allow_outside: bool
) -> _LoadedModel:
    """Objects of a part in their places."""
    values, factor = part.values, metres_per_unit(unit or "m")
    own = not os.path.lexists(path) and path in mesh_names()
    stated = values.get("unit") or unit or ("m" if own else None)
    sizes = {key: factor * _length(values[key]) for key in ("height", "longest") if key in values}
    medium, roughness, pattern = _medium_of(values)
    if Path(path).suffix.lower() in GLTF:
        scene: Scene = load_gltf(path, stated, allow_outside=allow_outside)
        if sizes:
            scale = scale_to(scene.shown_bounds, sizes.get("height"), sizes.get("longest"), path)
            scene = load_gltf(path, f"{scale * metres_per_unit(stated or 'm')!r}m", allow_outside=allow_outside)
        if medium is not None:
            scene = filled(scene, medium)
        objects = [replace(item, priority=0) for item in scene.objects]  # among all parts, each has one later
    else:
        if sizes:
            mesh = load_mesh(mesh_path(path) if own else path, None, allow_outside=allow_outside, **sizes)
        else:
            mesh = load_mesh(mesh_path(path) if own else path, stated, allow_outside=allow_outside)
        if "opaque" in values:
            objects = [Object(mesh, color=values["opaque"])]
        elif medium is None:
            made = default(mesh) if default is not None else default_medium(mesh, stage_named(DEFAULT_STAGE))
            objects = [Object(mesh, made)]
        else:
            objects = [Object(mesh, medium)]
    matrix = _transform(values, factor)
    surface = dict(values.get("surface", {}))
    if (rough := values.get("roughness", roughness)) is not None:
        surface["roughness"] = float(rough)
    placed = []
    for item in objects:
        of_it = item.surface if not surface else replace(item.surface or Surface(), **surface)
        mesh = replace(item.mesh, name=values["name"]) if "name" in values else item.mesh
        priority = values.get("priority", 0)
        place = matrix @ item.matrix
        if item.medium is not None:
            mesh, of_it = patterned(mesh, of_it, pattern, uniform_scale(place))
        placed.append(replace(item, mesh=mesh, transform=place, surface=of_it, priority=priority))
    return _LoadedModel(placed, medium is not None or "opaque" in values or Path(path).suffix.lower() in GLTF)


def _length(value: Any) -> float:
    """Metres of a length: a number of them, or a text with a unit."""
    if not isinstance(value, str):
        return float(value)
    if not (metres := _coordinate(value)) > 0:
        raise InputError(
            f"length {value!r}", "the length must be positive", "give a length above zero, for example 2cm"
        )
    return metres


def _coordinate(value: Any) -> float:
    """Metres of a coordinate, which may be negative."""
    if not isinstance(value, str):
        return float(value)
    if (metres := metres_in(value)) is None or not np.isfinite(metres):
        raise InputError(
            f"length {value!r}",
            "the text is not a number with a unit",
            "write a length such as 2cm or 0.8in, or a number of metres",
        )
    return metres


def _medium_of(values: Mapping[str, Any]) -> tuple[Medium | None, float | None, str]:
    """Medium, roughness and pattern of a material; None, or no text, where none is stated."""
    medium, roughness, pattern, ior = None, None, "", values.get("ior")
    if "preset" in values:
        chosen = preset(values["preset"])
        medium, roughness, pattern = chosen.medium, chosen.roughness or None, chosen.pattern
    elif "color" in values:
        length = _length(values["distance"])
        color, changed = clamp_colors(parse_color(values["color"]))
        if changed.any():
            text = f"color {values['color']}: channels below {CLAMP:g} were set to {CLAMP:g}"
            warnings.warn(TranslucentWarning(text), stacklevel=2)
        medium = Medium.from_color(color, length, ior=SOLID_IOR)
    elif "scattering_color" in values:
        length = _length(values["mean_free_path"])
        medium = scattering_medium(values["scattering_color"], length, ior=SCATTERING_IOR)
    if medium is None:
        return None, roughness, pattern
    medium = medium.diluted(float(values["dilute"])) if "dilute" in values else medium
    return (medium if ior is None else replace(medium, ior=float(ior))), roughness, pattern


def _transform(values: Mapping[str, Any], factor: float) -> Array:
    """(4, 4): scale, then rotation about x, y and z in degrees, in this order, then translation."""
    matrix = np.eye(4)
    scale = values.get("scale", 1.0)
    matrix[:3, :3] = np.diag(np.broadcast_to(np.asarray(scale, dtype=np.float64), 3))
    for axis, degrees in enumerate(values.get("rotate", (0.0, 0.0, 0.0))):
        cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        turn, (i, j) = np.eye(3), ((1, 2), (2, 0), (0, 1))[axis]
        turn[i, i] = turn[j, j] = cosine
        turn[i, j], turn[j, i] = -sine, sine
        matrix[:3, :3] = turn @ matrix[:3, :3]
    matrix[:3, 3] = [factor * _coordinate(value) for value in values.get("translate", (0.0, 0.0, 0.0))]
    return matrix


def _composed(loaded: list[_LoadedModel], size: tuple[int, int], more: dict[str, Any]) -> ComposedScene:
    """Scene of loaded parts, framed where no camera is stated, with priorities where bodies touch."""
    objects = [item for one in loaded for item in one.objects]
    known = [one.has_material for one in loaded for _ in one.objects]
    camera = more.pop("camera", None) or framing(objects, size)
    more.setdefault("environment", LIGHT_TABLE)
    scene = ComposedScene(objects, camera, with_material=frozenset(i for i, has in enumerate(known) if has), **more)
    scene, said = with_priorities(scene)
    return replace(scene, remarks=said)


class _SceneFile:
    """Reader of a .toml scene file, whose errors name the line."""

    def __init__(
        self,
        path: Path,
        unit: str | None,
        size: tuple[int, int],
        default: Callable[[Any], Medium] | None,
        allow_outside: bool,
    ) -> None:
        self.path, self.what = path, f"scene {str(path)!r}"
        self.unit, self.size, self.default, self.allow_outside = unit, size, default, allow_outside
        self.factor = metres_per_unit(unit or "m")
        self.text = read_text(path, self.what)
        try:
            self.tree = toml_value(self.text)
        except ValueError as error:
            raise InputError(self.what, f"the file is not valid TOML: {error}", "correct the file") from None

    def scene(self) -> ComposedScene:
        """Read the whole."""
        if "version" in self.tree and "object" not in self.tree:
            found = "the file is a session of the previewer"
            raise InputError(self.what, found, f"open the session with: translucent preview --session {self.path}")
        self._check(self.tree, _SCENE_KEYS, "")
        tables = self.tree.get("object", [])
        if not (isinstance(tables, list) and tables and all(isinstance(one, dict) for one in tables)):
            raise self._wrong("", 0, "object", "no list of objects", "write [[object]], and model = ... below it")
        loaded = [self._object(values, i) for i, values in enumerate(tables)]
        more: dict[str, Any] = {"lights": [self._light(values, i) for i, values in enumerate(self._lights())]}
        if "overlap" in self.tree:
            more["overlap"] = self.tree["overlap"]
        if (lit := self._environment()) is not None:
            more["environment"] = lit
        objects = [item for one in loaded for item in one.objects]
        own = bool(more["lights"]) or lit is not None
        stage = self.tree.get("stage", NO_STAGE if own else DEFAULT_STAGE)
        camera = self._camera(objects, self._at("", 0, "stage", lambda: stage_named(stage)))
        scene = self._at("", 0, "overlap", lambda: _composed(loaded, self.size, {**more, "camera": camera}))
        if "stage" not in self.tree and has_ground(scene):
            stage = NO_STAGE
        return replace(scene, stage=stage, has_camera=camera is not None)

    def _object(self, values: dict[str, Any], number: int) -> _LoadedModel:
        self._check(values, _OBJECT_KEYS, "object", number)
        if not isinstance(model := values.get("model"), str):
            raise self._wrong("object", number, "model", "the model is missing", 'write model = "goblet", or a file')
        chosen = [key for key in _MATERIALS if key in values]
        if len(chosen) > 1:
            raise self._wrong("object", number, chosen[1], f"{chosen[0]} is given, too", "give one material")
        for keys in _MATERIALS.values():
            given = [key for key in keys if key in values]
            if given and (missing := [key for key in keys if key not in values]):
                raise self._wrong("object", number, given[0], f"{missing[0]} is missing", "give both")
        sizes = [key for key in ("unit", "height", "longest") if key in values]
        if len(sizes) > 1:
            raise self._wrong("object", number, sizes[1], f"{sizes[0]} is given, too", "give one of them")
        for key in ("translate", "rotate"):
            if key in values and not (isinstance(values[key], list) and len(values[key]) == 3):
                raise self._wrong("object", number, key, f"{values[key]!r}", f"write {key} = [0, 0.1, 0]")
        if "surface" in values:
            self._check(values["surface"], [one.name for one in fields(Surface)], "object", number)
        own = model in mesh_names() and not (self.path.parent / model).exists()
        path = model if own else self._at("object", number, "model", lambda: str(self._linked(model)))
        part = _StatedModel(model, self.what, values)
        return self._at(
            "object", number, "model", lambda: _loaded(part, path, self.unit, self.default, self.allow_outside), values
        )

    def _linked(self, model: str) -> Path:
        path = linked_file(self.path.parent, model, f"model {model!r}", self.allow_outside)
        if not path.exists() and not os.path.dirname(model) and not Path(model).suffix:
            close = close_names(model, mesh_names())
            do = did_you_mean(close) if close else f"give a path, or one of {', '.join(sorted(mesh_names()))}"
            raise InputError(f"model {model!r}", "no file and no built-in mesh has this name", do)
        return path

    def _lights(self) -> list[dict[str, Any]]:
        tables = self.tree.get("light", [])
        if not (isinstance(tables, list) and all(isinstance(one, dict) for one in tables)):
            raise self._wrong("", 0, "light", "the lights are not a list", "write [[light]], and type = ... below it")
        return tables

    def _light(self, values: dict[str, Any], number: int) -> Light:
        if (kind := values.get("type")) not in _LIGHTS:
            raise self._wrong("light", number, "type", f"unknown type {kind!r}", f"use one of {', '.join(_LIGHTS)}")
        made = _LIGHTS[str(kind)]
        given = {key: value for key, value in values.items() if key != "type"}
        self._check(given, [one.name for one in fields(made) if one.name != "disc"], "light", number)
        for key in {"position", "radius"} & set(given):
            value = given[key]
            scaled = [self.factor * _coordinate(v) for v in value] if isinstance(value, list) else _length(value)
            given[key] = scaled if isinstance(value, list) else self.factor * _length(value)
        if "intensity" in given:  # so that it falls alike on what is as much larger
            given["intensity"] = self.factor**2 * np.asarray(given["intensity"], dtype=np.float64)

        def make() -> Light:
            try:
                light: Light = made(**given)
            except TypeError as error:
                raise InputError(f"a {kind} light", str(error).partition(") ")[2], "add this parameter") from None
            return light

        return self._at("light", number, "type", make)

    def _environment(self) -> Environment | None:
        names = [self.tree.get(key) for key in ("environment", "background")]
        if names == [None, None]:
            return None
        lit = self._at("", 0, "environment", lambda: _environment_named(names[0]))
        if names[1] is None:
            return lit
        return lit.with_background(self._at("", 0, "background", lambda: _environment_named(names[1])))

    def _camera(self, objects: list[Object], stage: Stage | None) -> Camera | None:
        """Camera that the file states, if it does."""
        if (values := self.tree.get("camera")) is None:
            return None
        self._check(values, _CAMERA_KEYS, "camera")
        return self._at("camera", 0, "", lambda: self._stated_camera(values, objects, stage), values)

    def _stated_camera(self, values: dict[str, Any], objects: list[Object], stage: Stage | None) -> Camera:
        up, fov = values.get("up", (0.0, 1.0, 0.0)), float(values.get("fov", 30.0))
        if "eye" not in values:
            direction: Any = FRAMED_FROM if stage is None else stage.view
            if "orbit" in values:
                direction = -direction_from(*map(float, values["orbit"]))
            return framing(objects, self.size, fov, up, stage, direction, values.get("fit"))
        if extra := [key for key in ("orbit", "fit") if key in values]:
            raise InputError(extra[0], "the key eye is given, too", f"omit eye or {extra[0]}")
        bounds = np.array([item.bounds for item in objects])
        middle = 0.5 * (bounds[:, 0].min(axis=0) + bounds[:, 1].max(axis=0))
        eye, target = ([self.factor * _coordinate(v) for v in values.get(key, ())] for key in ("eye", "target"))
        return Camera.look_at(eye, target or middle, up, fov)

    def _check(self, values: Any, known: list[str], table: str, number: int = 0) -> None:
        if not isinstance(values, dict):
            raise self._wrong("", 0, table, "this is not a table", f"write [{table}], and keys below it")
        for key in values:
            if key not in known:
                close = close_names(key, known)
                do = did_you_mean(close) if close else f"use {', '.join(known)}"
                raise self._wrong(table, number, key, f"unknown key {key!r}", do)

    def _at(self, table: str, number: int, key: str, make: Callable[[], Made], values: Any = None) -> Made:
        """Result of a function; its errors get the line of a key, or of the one of `values` that they name."""
        try:
            return make()
        except InputError as error:
            found = {name: re.search(rf"\b{re.escape(name)}\b", str(error)) for name in values or ()}
            named = sorted((name for name in found if found[name]), key=lambda name: found[name].start())  # type: ignore[union-attr]
            held = [k for k, v in (values or {}).items() if isinstance(v, str) and repr(v) in str(error)]
            raise self._wrong(table, number, (held or named or [key])[0], str(error)) from None
        except (TypeError, ValueError) as error:
            raise self._wrong(table, number, key, f"a value of the wrong type ({error})", "correct it") from None

    def _wrong(self, table: str, number: int, key: str, found: str, do: str = "") -> InputError:
        where = f"line {_line_of(self.text, table, number, key)}"
        return InputError(f"{self.what}, {where}{f', {key}' if key else ''}", found, do)


def _environment_named(text: Any) -> Environment:
    if text is None:
        return LIGHT_TABLE
    if not isinstance(text, str):
        raise InputError(
            f"environment {text!r}", "the value is not a text", 'write a value such as environment = "studio"'
        )
    name, comma, degrees = text.rpartition(",")
    turned = comma and re.fullmatch(r"[-+]?\d+\.?\d*", degrees.strip())
    return named_environment(name, float(degrees)) if turned else named_environment(text)


def _line_of(text: str, table: str, number: int, key: str) -> int:
    """Number of the line of a key in the so manieth table of a name, or of the table's head; 1 where neither is."""
    lines, seen, head = text.splitlines(), -1, 1
    inside = not table
    for i, line in enumerate(lines, 1):
        if (opened := re.match(r"\s*\[+\s*([\w.]+)", line)) and "=" not in line.partition("]")[0]:
            if opened[1] == table:
                seen += 1
            inside = opened[1].partition(".")[0] == table and seen == number
            if inside and opened[1] == table:
                head = i
            if not table and opened[1] == key:
                return i
        elif inside and key and re.match(rf"\s*{re.escape(key)}\s*=|.*[{{,]\s*{re.escape(key)}\s*=", line):
            return i
    return head
