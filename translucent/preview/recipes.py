"""The picture on show as a command line, and as Python."""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from translucent.assets import mesh_names
from translucent.media.medium import Medium
from translucent.media.presets import preset
from translucent.planning.caustics import Caustics
from translucent.preview.document import AUTO, Document, Material
from translucent.preview.loaded import Loaded
from translucent.preview.orbiting import camera_of
from translucent.preview.scenes import medium_of, method_of, scattering_of, towards_light
from translucent.preview.staging import own_material, stage_name, tone_of, turn_from
from translucent.scene.camera import Camera
from translucent.scene.scene import Scene
from translucent.scene.stages import NO_STAGE

#: Samples of a pixel, as of exported pictures.
SAMPLES = 16


@dataclasses.dataclass(frozen=True)
class Shot:
    """Picture to be told: the document, its model and scene, the size in pixels, and its photons."""

    document: Document
    loaded: Loaded
    scene: Scene
    size: tuple[int, int]
    caustics: Caustics | None = None

    @property
    def camera(self) -> Camera:
        """Camera of the orbit."""
        assert self.document.orbit is not None
        return camera_of(self.document.orbit)

    @property
    def stage(self) -> str:
        """Name of the stage."""
        return stage_name(self.document.look, self.loaded)

    @property
    def turn(self) -> float:
        """Degrees by which the stage is turned, as this camera sees it."""
        return round(turn_from(self.document, self.loaded, self.camera), 6) + 0.0

    @property
    def kept(self) -> bool:
        """True if the material is the one that ``translucent render`` gives the model by itself."""
        return self.document.material == own_material(self.document.look, self.loaded)

    def object_name(self, number: int) -> str | None:
        """Name by which a command finds an object; None if others have it, too, or it has none."""
        names = [item.mesh.name for item in self.loaded.scene.objects]
        return names[number] if number < len(names) and names[number] and names.count(names[number]) == 1 else None

    @property
    def output(self) -> str:
        """Name of the file."""
        return f"{Path(self.loaded.model.path).stem}.png"

    @property
    def is_own(self) -> bool:
        """True if the model is one of the toolkit's own."""
        path = self.loaded.model.path
        return path in mesh_names() and not Path(path).exists()


def command_line(shot: Shot) -> tuple[str, list[str]]:
    """Command that renders the picture, and what it leaves out, since no option says it."""
    document, look, display = shot.document, shot.document.look, shot.document.display
    model, orbit = shot.loaded.model, document.orbit
    assert orbit is not None
    words = ["translucent", "render", model.path, "-o", shot.output, "--size", f"{shot.size[0]}x{shot.size[1]}"]
    words += ["--unit", model.unit] if model.unit != "m" else []
    medium, left_out = _medium_options(shot)
    words += [*medium, "--eye", _numbers(shot.camera.eye), "--target", _numbers(orbit.target)]
    words += ["--fov", f"{orbit.fov_y:.12g}", "--stage", shot.stage + (f",{shot.turn:g}" if shot.turn else "")]
    turned = f",{look.rotation:g}" if look.rotation else ""
    lit = look.environment or ("light-table" if look.background else "")
    words += ["--environment", lit + (turned if shot.scene.environment.kind == "image" else "")] if lit else []
    words += ["--background", look.background] if look.background else []
    words += ["--exposure", f"{look.exposure:g}"] if look.exposure else []
    words += ["--tone", tone_of(look, shot.scene)]
    words += ["--method", display.method] if display.method != AUTO else []
    words += ["--thickness", f"{document.material.thickness:.12g}m"] if display.method == "thin-layer" else []
    words += ["--scattering", display.scattering] if display.scattering != AUTO else []
    words += ["--caustics", str(shot.caustics.photons)] if shot.caustics else []
    left_out += ["the orthographic camera"] if orbit.orthographic else []
    left_out += ["the directional light"] if look.light else []
    left_out += ["hidden objects"] if document.hidden else []
    return shlex.join(words), left_out


def _medium_options(shot: Shot) -> tuple[list[str], list[str]]:
    """Options for the medium and the finish of the bodies, and what they leave out."""
    material = shot.document.material
    words, left_out = ([], []) if shot.kept else _options_of(material)
    for one in shot.document.assigned:
        name = shot.object_name(one.object)
        told, lost = _options_of(one.material)
        if name is None:
            left_out.append(f"the material of object {one.object}")
        else:
            words += ["--object", name, *told]
            left_out += [f"{what} of {name}" for what in lost]
    return words, left_out


def _options_of(material: Material) -> tuple[list[str], list[str]]:
    wanted = medium_of(material)
    if material.source == "preset":
        found, words = preset(material.preset).medium, ["--preset", material.preset]
    else:
        found = Medium.from_color(material.color, material.distance)
        color = ",".join(f"{value:.12g}" for value in material.color)
        words = ["--color", f"linear({color})", "--distance", f"{material.distance:.12g}m"]
    fields = {"ior": "the index of refraction", "scattering": "scattering", "emission": "emission"}
    left_out = [told for name, told in fields.items() if np.any(getattr(found, name) != getattr(wanted, name))]
    left_out += material.unsaid
    return [*words, "--roughness", f"{material.roughness:g}"], left_out


def python_code(shot: Shot) -> str:
    """Python that renders the picture."""
    document, look, display = shot.document, shot.document.look, shot.document.display
    model = shot.loaded.model
    lines = ["import dataclasses", "", "import translucent as tl", "from translucent.assets import mesh_path"]
    lines += ["from translucent.scene.showcase import filled, named_environment", ""]
    path = f"mesh_path({model.path!r})" if shot.is_own else repr(model.path)
    unit = "" if model.unit == "m" else f", unit={model.unit!r}"
    if shot.loaded.bare:
        lines += [f"mesh = tl.load_mesh({path}{unit})", 'scene = tl.showcase(mesh, stage="none")']
    else:
        lines += [f"scene = tl.load_scene({path}{unit})"]
    lines += _material_lines(shot) + _camera_lines(shot) + _stage_lines(shot)
    if hidden := [i for i in document.hidden if i < len(shot.loaded.scene.objects)]:
        shown = f"[item for i, item in enumerate(scene.objects) if i not in {hidden}]"
        lines += [f"scene = dataclasses.replace(scene, objects={shown})"]
    if look.light:
        way = tuple(-value for value in towards_light(look))
        light = f"tl.DirectionalLight(({_numbers(way, ', ')}), {look.light_irradiance:.12g})"
        lines += [f"scene = dataclasses.replace(scene, lights=[*scene.lights, {light}])"]
    ways = [f"samples={SAMPLES}"]
    if (method := method_of(display.method, document.material)) is not None:
        ways += [f"method=tl.{method!r}"]
    if (scattering := scattering_of(display.scattering)) is not None:
        ways += [f"scattering=tl.{scattering!r}"]
    if shot.caustics is not None:
        ways += [f"caustics=tl.Caustics({shot.caustics.photons})"]
    lines += ["with tl.Renderer() as renderer:", f"    frame = renderer.render(scene, {shot.size}, {', '.join(ways)})"]
    lines += [f"frame.save({shot.output!r}, exposure={look.exposure:.12g}, tone={tone_of(look, shot.scene)!r})", ""]
    return "\n".join(lines)


def _material_lines(shot: Shot) -> list[str]:
    lines = _filling_lines(shot, shot.document.material, None)
    for one in shot.document.assigned:
        if one.object < len(shot.loaded.scene.objects):
            lines += _filling_lines(shot, one.material, one.object)
    return lines


def _filling_lines(shot: Shot, material: Material, number: int | None) -> list[str]:
    """Lines that fill all bodies, or one object."""
    medium = medium_of(material)
    if material.source == "file" and not shot.loaded.bare and number is None:
        return []
    triples = (
        f"{name}=({_numbers(np.asarray(getattr(medium, name)), ', ')})"
        for name in ("absorption", "scattering", "emission")
    )
    told = f"{', '.join(triples)}, anisotropy={medium.anisotropy:.12g}, ior={medium.ior:.12g}"
    among = "" if number is None else f", [scene.objects[{number}]]"
    chosen = "item.medium is not None" if number is None else f"item is scene.objects[{number}]"
    lines = [f"scene = filled(scene, tl.Medium({told}){among})"]
    if material.source == "file" and number is None:
        return lines
    finish = ", ".join(f"{name}={value:.12g}" for name, value in material.finish.items())
    return [
        *lines,
        f"finish = dict({finish}, opacity=None)",
        "scene = dataclasses.replace(scene, objects=[",
        "    dataclasses.replace(item, surface=dataclasses.replace(item.surface or tl.Surface(), **finish))",
        f"    if {chosen} else item",
        "    for item in scene.objects",
        "])",
    ]


def _camera_lines(shot: Shot) -> list[str]:
    orbit, camera = shot.document.orbit, shot.camera
    assert orbit is not None
    ends = f"({_numbers(camera.eye, ', ')}), ({_numbers(orbit.target, ', ')})"
    if camera.fov_y is None:
        made = f"tl.Camera.orthographic({ends}, height={camera.height:.12g})"
    else:
        made = f"tl.Camera.look_at({ends}, fov_y={camera.fov_y:.12g})"
    return [f"scene = dataclasses.replace(scene, camera={made})"]


def _stage_lines(shot: Shot) -> list[str]:
    look, own = shot.document.look, ""
    if look.environment or (look.background and shot.stage != NO_STAGE):
        own = f"named_environment({look.environment or 'light-table'!r}, {look.rotation:.12g})"
    elif look.background:
        own = "scene.environment"
    if look.background:
        own += f".with_background(named_environment({look.background!r}))"
    if shot.stage != NO_STAGE:
        return [f"scene = tl.staged(scene, {shot.stage!r}, {own or None}, turn={shot.turn:g})"]
    return [f"scene = dataclasses.replace(scene, environment={own})"] if own else []


def _numbers(values: Iterable[float], between: str = ",") -> str:
    return between.join(f"{value:.12g}" for value in np.asarray(list(values), dtype=np.float64) + 0.0)
