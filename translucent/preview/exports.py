"""Files made from the window: pictures, turntables, thickness maps, and recipes that make a picture again."""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from translucent.assets import mesh_names
from translucent.errors import InputError
from translucent.formulas.color import srgb_to_linear
from translucent.formulas.sampling import sample_shifts
from translucent.frames.animation import check_animation, turntable, write_animation
from translucent.frames.aovs import EMPTY, false_colors
from translucent.frames.frame import Frame
from translucent.frames.writing import SUFFIXES, check_output
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import keep_drawn_normals, made_normals
from translucent.media.medium import Medium
from translucent.media.presets import preset
from translucent.planning.caustics import Caustics
from translucent.planning.flags import Flags
from translucent.planning.request import RenderRequest
from translucent.preview.document import (
    AUTO,
    AddedLight,
    Document,
    Material,
    Orbit,
    Placed,
    camera_of,
    length_text,
)
from translucent.preview.scenes import (
    Loaded,
    light_of,
    medium_of,
    own_material,
    placement,
    request_of,
    stage_name,
    tone_of,
    turn_from,
)
from translucent.preview.tasks import Task
from translucent.preview.worker import Pool, Urgency, report
from translucent.renderer import Renderer
from translucent.scene.camera import Lens, Window, direction_from
from translucent.scene.environment import Environment
from translucent.scene.lights import SphereLight
from translucent.scene.scene import Object, Scene
from translucent.scene.showcase import SOLID_IOR
from translucent.scene.stages import NO_STAGE
from translucent.scene.surface import Surface
from translucent.scene.texture import Texture
from translucent.scene_files import is_composed

if TYPE_CHECKING:
    from translucent.bake.thickness_map import ThicknessMap


Size: TypeAlias = tuple[int, int]

#: Exposure in stops, and the name of the tone curve.
Look: TypeAlias = tuple[float, str]

#: Suffixes of files with a moving picture.
MOVING = (".gif", ".webp", ".mp4")

FPS = 24.0

#: Samples of a pixel.
SAMPLES = 16


def check_export(path: str) -> None:
    """Raise before any work is done if a picture or turntable could not be written."""
    suffix = Path(path).suffix.lower()
    if suffix in MOVING:
        return check_animation(Path(path), FPS)
    if suffix not in SUFFIXES:
        raise InputError(f"output {path!r}", f"suffix {suffix!r}", f"use {', '.join((*SUFFIXES, *MOVING))}")
    return check_output(Path(path))


def write_picture(
    path: str,
    scene: Scene,
    size: Size,
    look: Look = (0.0, "none"),
    request: RenderRequest | None = None,
    samples: int = SAMPLES,
    lens: Lens | None = None,
) -> None:
    """Write a .png, or an .exr with all quantities; a transparent one has the bodies alone.

    Through a lens, each sample of a pixel is a picture of its own, and quantities are those of the pinhole.
    """
    report(None, "drawing")
    request = replace(request or RenderRequest(), samples=samples)
    with Renderer() as renderer:
        if lens is None:
            frame = renderer.render_requested(scene, size, request)
        else:
            frame = _through_lens(renderer, scene, size, request, lens)
    report(None, "writing")
    frame.save(path, *look)


def _through_lens(renderer: Renderer, scene: Scene, size: Size, request: RenderRequest, lens: Lens) -> Frame:
    """Frame with the mean radiance through all parts of a lens."""
    count, shifts = request.samples, sample_shifts(request.samples)
    one = replace(request, samples=1)
    frame = renderer.render_requested(scene, size, one)
    parts = [name for name in ("radiance", "alpha", "passed") if getattr(frame, name) is not None]
    sums = {name: np.zeros(getattr(frame, name).shape) for name in parts}
    for number, (right, down) in enumerate(shifts):
        report(number / count, f"lens sample {number + 1} of {count}")
        camera = lens.camera(scene.camera, size, number, count)
        window = camera.window or Window(0, 0, size)
        shifted = replace(window, left=window.left + float(right), top=window.top + float(down))
        view = replace(scene, camera=replace(camera, window=shifted))
        if one.caustics is not None:
            one = replace(one, caustics=replace(one.caustics, seed=number))
        found = renderer.render_requested(view, size, one)
        for name, values in sums.items():
            values += getattr(found, name)
    means: dict[str, Any] = {name: (values / count).astype(np.float32) for name, values in sums.items()}
    return replace(frame, **means)


def write_turntable(
    path: str,
    scene: Scene,
    size: Size,
    look: Look = (0.0, "none"),
    request: RenderRequest | None = None,
    count: int = 48,
) -> None:
    """Write an animation of the model from all around."""
    request = replace(request or RenderRequest(), samples=4)
    with Renderer() as renderer:

        def pictures() -> Iterator[npt.NDArray[np.uint8]]:
            for i, view in enumerate(turntable(scene, count)):
                report(i / count, f"picture {i + 1} of {count}")
                yield renderer.render_requested(view, size, request).to_srgb8(*look)

        write_animation(Path(path), pictures(), FPS)


@dataclass(eq=False)
class Bake:
    """Baked map, and the scene with the model textured by it.

    Attributes
    ----------
    map : ThicknessMap
    scene : Scene
        The model painted with it.
    """

    map: ThicknessMap
    scene: Scene
    _view: tuple[Orbit, Scene] | None = None

    @property
    def covered(self) -> float:
        """Fraction of the texels that have a value."""
        return float(np.mean(self.map.coverage))

    def thickest_text(self, unit: str) -> str:
        """Text of the largest value."""
        values = self.map.values[self.map.coverage]
        most = float(values.max(initial=0.0))
        return f"{most:.3g}" if self.map.settings.mode == "local" else length_text(most, unit)

    def seen_from(self, orbit: Orbit) -> Scene:
        """Scene of the textured model; the same object while the camera is unchanged."""
        if self._view is None or self._view[0] != orbit:
            self._view = orbit, dataclasses.replace(self.scene, camera=camera_of(orbit))
        return self._view[1]


def bake_map(task: Task, pool: Pool, body: Object, medium: Medium, mode: str, size: int, rays: int) -> Bake:
    """Bake a map of a body."""
    options: dict[str, Any] = {"mode": mode, "size": size, "rays": rays}
    if mode == "transmittance":
        options["medium"] = medium
    # xatlas holds the interpreter's lock while it makes texture coordinates.
    baked, normals = pool.call(task, _bake, body.mesh, options, urgency=Urgency.LATER)
    keep_drawn_normals(baked.mesh, normals)
    return Bake(baked, painted(dataclasses.replace(body, mesh=baked.mesh), baked))


def _bake(mesh: Mesh, options: dict[str, Any]) -> tuple[ThicknessMap, npt.NDArray[np.float32]]:
    """Bake a map; with the normals that the picture needs of its mesh, which is diagnosed, too."""
    from translucent.bake.bake import bake_thickness

    def progress(done: int, total: int, cast: int) -> None:
        report(done / max(total, 1), f"{cast / 1e6:.1f} million rays")

    report(None, "starting")
    baked = bake_thickness(mesh, progress=progress, **options)
    _ = baked.mesh.diagnosis  # goes with the mesh
    return baked, made_normals(baked.mesh)


def painted(body: Object, baked: ThicknessMap) -> Scene:
    """Scene with the body in the false colors of a map, unshaded, in front of white."""
    values = np.where(baked.coverage, baked.values, 0.0)
    most = float(values.max(initial=0.0)) or 1.0
    colors = false_colors()[np.rint(np.clip(values / most, 0.0, 1.0) * 255).astype(np.intp)]
    colors[~np.asarray(baked.coverage, dtype=bool)] = EMPTY
    texture = Texture(srgb_to_linear(colors / 255.0).astype(np.float32))
    surface = Surface(transmission=0.0, roughness=1.0, color_texture=texture)
    colored = dataclasses.replace(body, medium=Medium(absorption=1.0), surface=surface, sheet_thickness=None)
    return Scene([colored], camera_of(Orbit()), environment=Environment.constant((1.0, 1.0, 1.0)))


@dataclass(frozen=True)
class Recipe:
    """How to make a picture again: the document, its model and scene, the size in pixels, and its photons."""

    document: Document
    loaded: Loaded
    scene: Scene
    size: tuple[int, int]
    caustics: Caustics | None = None

    @property
    def orbit(self) -> Orbit:
        """Orbit of the camera."""
        assert self.document.orbit is not None
        return self.document.orbit

    @property
    def stage(self) -> str:
        """Name of the stage."""
        return stage_name(self.document.look, self.loaded)

    @property
    def turn(self) -> float:
        """Degrees by which the stage is turned, as this camera sees it."""
        return round(turn_from(self.document, self.loaded, camera_of(self.orbit)), 6) + 0.0

    @property
    def output(self) -> str:
        """Name of the file."""
        return f"{Path(self.loaded.model.path).stem}.png"


def command_line(recipe: Recipe) -> tuple[str, list[str]]:
    """Command that renders the picture, and the parts of it that no option states."""
    document, look, display = recipe.document, recipe.document.look, recipe.document.display
    model, orbit = recipe.loaded.model, recipe.orbit
    words = ["translucent", "render", model.path, "-o", recipe.output, "--size", f"{recipe.size[0]}x{recipe.size[1]}"]
    if model.unit != "m":
        low, high = recipe.loaded.scene.shown_bounds
        own = model.path in mesh_names() and not Path(model.path).exists()
        words += ["--height", f"{high[1] - low[1]:.12g}m"] if own else ["--unit", model.unit]
    own = document.material == own_material(look, recipe.loaded)  # which translucent render gives the model by itself
    medium, left_out = ([], []) if own else _medium_options(document.material)
    words += medium
    names = [item.mesh.name for item in recipe.loaded.scene.objects]
    for one in document.assigned:
        medium, lost = _medium_options(one.material)
        if one.object < len(names) and (name := names[one.object]) and names.count(name) == 1:
            words += ["--object", name, *medium]
            left_out += [f"{part} of {name}" for part in lost]
        else:
            left_out.append(f"the material of object {one.object}")
    words += ["--eye", _numbers(camera_of(orbit).eye), "--target", _numbers(orbit.target)]
    words += ["--fov", f"{orbit.fov_y:.12g}", "--stage", recipe.stage + (f",{recipe.turn:g}" if recipe.turn else "")]
    turned = f",{look.rotation:g}" if look.rotation and recipe.scene.environment.kind == "image" else ""
    lit = look.environment or ("light-table" if look.background else "")
    words += ["--environment", lit + turned] if lit else []
    words += ["--background", look.background] if look.background else []
    words += ["--exposure", f"{look.exposure:g}"] if look.exposure else []
    words += ["--tone", tone_of(look, recipe.scene)]
    words += ["--method", display.method] if display.method != AUTO else []
    words += ["--thickness", f"{document.material.thickness:.12g}m"] if display.method == "thin-layer" else []
    words += ["--scattering", display.scattering] if display.scattering != AUTO else []
    words += ["--caustics", str(recipe.caustics.photons)] if recipe.caustics else []
    left_out += ["the orthographic camera"] if orbit.orthographic else []
    left_out += ["the directional light"] if look.light else []
    left_out += ["added lights"] if document.lights else []
    left_out += ["places of objects"] if document.placed else []
    left_out += ["depth of field"] if look.depth_of_field else []
    left_out += ["the Z axis upwards"] if model.up == "z" else []
    words += ["--time", f"{model.time:.12g}"] if model.time is not None else []
    words += ["--samples", f"{document.export.samples:.0f}"] if document.export.samples != SAMPLES else []
    words += ["--denoise"] if document.export.denoise else []
    left_out += ["hidden objects"] if document.hidden else []
    return shlex.join(words), left_out


def _medium_options(material: Material) -> tuple[list[str], list[str]]:
    """Options for a medium and its surface, and the parts of them that no option states."""
    requested = medium_of(material)
    if material.source == "preset":
        found, words = preset(material.preset).medium, ["--preset", material.preset]
    else:
        found = Medium.from_color(material.color, material.distance, ior=SOLID_IOR)
        words = ["--color", f"linear({_numbers(material.color)})", "--distance", f"{material.distance:.12g}m"]
    if material.ior != found.ior:
        words += ["--ior", f"{material.ior:.12g}"]
    fields = {"scattering": "scattering", "emission": "emission"}
    left_out = [part for name, part in fields.items() if np.any(getattr(found, name) != getattr(requested, name))]
    left_out += ["textures"] if material.color_texture or material.roughness_texture else []
    known = preset(material.preset).pattern if material.source == "preset" else ""
    left_out += ["the pattern"] if material.pattern != known else []
    return [*words, "--roughness", f"{material.roughness:g}"], left_out + material.unsaid


def python_code(recipe: Recipe) -> str:
    """Python that renders the picture."""
    document, look = recipe.document, recipe.document.look
    model, orbit, camera = recipe.loaded.model, recipe.orbit, camera_of(recipe.orbit)
    lines = ["import dataclasses", ""]
    lines += ["import numpy as np", ""] if document.placed else []
    lines += ["import translucent as tl", "from translucent.assets import mesh_path"]
    lines += ["from translucent.scene.showcase import filled, named_environment", ""]
    is_own = model.path in mesh_names() and not Path(model.path).exists()
    path = f"mesh_path({model.path!r})" if is_own else repr(model.path)
    unit = "" if model.unit == "m" else f", unit={model.unit!r}"
    if recipe.loaded.bare:
        lines += [f"mesh = tl.load_mesh({path}{unit})", 'scene = tl.showcase(mesh, stage="none")']
    elif is_composed(model.path):
        lines += ["from translucent.scene_files import load_composed", "", f"scene = load_composed({path}{unit})"]
    else:
        time = "" if model.time is None else f", time={model.time:.12g}"
        lines += [f"scene = tl.load_scene({path}{unit}{time})"]
    if model.up == "z":
        lines += ["from translucent.preview.scenes import turned_up", "scene = turned_up(scene)"]
    count = len(recipe.loaded.scene.objects)
    if document.material.source != "file" or recipe.loaded.bare:
        lines += _filling_lines(document.material, None)
    for one in document.assigned:
        lines += _filling_lines(one.material, one.object) if one.object < count else []
    for place in document.placed if any(place.object < count for place in document.placed) else ():
        if place.object < count:
            lines += _placing_lines(place, recipe.loaded.scene.objects[place.object])
    ends = f"({_numbers(camera.eye, ', ')}), ({_numbers(orbit.target, ', ')})"
    if camera.fov_y is None:
        made = f"tl.Camera.orthographic({ends}, height={camera.height:.12g})"
    else:
        made = f"tl.Camera.look_at({ends}, fov_y={camera.fov_y:.12g})"
    lines += [f"scene = dataclasses.replace(scene, camera={made})"]
    own = ""
    if look.environment or (look.background and recipe.stage != NO_STAGE):
        own = f"named_environment({look.environment or 'light-table'!r}, {look.rotation:.12g})"
    elif look.background:
        own = "scene.environment"
    if look.background:
        own += f".with_background(named_environment({look.background!r}))"
    if recipe.stage != NO_STAGE:
        lines += [f"scene = tl.staged(scene, {recipe.stage!r}, {own or None}, turn={recipe.turn:g})"]
    elif own:
        lines += [f"scene = dataclasses.replace(scene, environment={own})"]
    if hidden := [i for i in document.hidden if i < count]:
        visible = f"[item for i, item in enumerate(scene.objects) if i not in {hidden}]"
        lines += [f"scene = dataclasses.replace(scene, objects={visible})"]
    if look.light:
        towards = _numbers(-direction_from(look.light_yaw, look.light_pitch), ", ")
        light = f"tl.DirectionalLight(({towards}), {look.light_irradiance:.12g})"
        lines += [f"scene = dataclasses.replace(scene, lights=[*scene.lights, {light}])"]
    for added in document.lights:
        lines += [f"scene = dataclasses.replace(scene, lights=[*scene.lights, {_light_text(added)}])"]
    if look.depth_of_field:
        lines += ["# without depth of field; see translucent.scene.camera.Lens"]
    choices = [f"samples={document.export.samples:.0f}"]
    choices += ["denoise=True"] if document.export.denoise else []
    request = request_of(document)
    if request.method is not None:
        choices += [f"method=tl.{request.method!r}"]
    stated, usual = dataclasses.asdict(document.flags), dataclasses.asdict(Flags())
    choices += [f"{name}={value}" for name, value in stated.items() if value != usual[name]]
    if request.scattering is not None:
        choices += [f"scattering=tl.{request.scattering!r}"]
    if recipe.caustics is not None:
        choices += [f"caustics=tl.Caustics({recipe.caustics.photons})"]
    lines += ["with tl.Renderer() as renderer:"]
    lines += [f"    frame = renderer.render(scene, {recipe.size}, {', '.join(choices)})"]
    lines += [f"frame.save({recipe.output!r}, exposure={look.exposure:.12g}, tone={tone_of(look, recipe.scene)!r})", ""]
    return "\n".join(lines)


def _placing_lines(place: Placed, item: Object) -> list[str]:
    """Lines of Python that put an object into its place."""
    rows = ", ".join(f"({_numbers(row, ', ')})" for row in placement(place, item).tolist())
    moved = f"[{place.object}]"
    return [
        f"moved, place = scene.objects{moved}, np.array([{rows}])",
        "moved_to = dataclasses.replace(moved, transform=place @ moved.matrix)",
        "scene = dataclasses.replace(scene, objects=[moved_to if one is moved else one for one in scene.objects])",
    ]


def _light_text(light: AddedLight) -> str:
    """Python of an added light."""
    made = light_of(light)
    values = f"({_numbers(np.asarray(made.position), ', ')}), ({_numbers(np.asarray(made.intensity), ', ')})"
    if isinstance(made, SphereLight):
        return f"tl.SphereLight({values}, {made.radius:.12g})"
    return f"tl.PointLight({values})"


def _filling_lines(material: Material, number: int | None) -> list[str]:
    """Lines of Python that fill all bodies, or one object."""
    medium = medium_of(material)
    triples = (
        f"{name}=({_numbers(np.asarray(getattr(medium, name)), ', ')})"
        for name in ("absorption", "scattering", "emission")
    )
    phase = f"phase=tl.{medium.phase!r}" if medium.phase else f"anisotropy={medium.anisotropy:.12g}"
    stated = f"{', '.join(triples)}, {phase}, ior={medium.ior:.12g}"
    among = "" if number is None else f", [scene.objects[{number}]]"
    chosen = "item.medium is not None" if number is None else f"item is scene.objects[{number}]"
    lines = [f"scene = filled(scene, tl.Medium({stated}){among})"]
    if material.source == "file" and number is None:
        return lines
    values = ", ".join(f"{name}={value:.12g}" for name, value in material.surface_values.items())
    values += "".join(
        f", {slot}=picture_texture({path!r}, 0, encoded={slot == 'color_texture'})"
        for slot, path in (("color_texture", material.color_texture), ("roughness_texture", material.roughness_texture))
        if path
    )
    if "picture_texture" in values:
        lines += ["from translucent.preview.scenes import picture_texture"]
    if material.pattern:
        marked = f"scene = with_pattern(scene, {material.pattern!r}{among})"
        after = ["from translucent.scene.showcase import with_pattern", marked]
    else:
        after = []
    return [
        *lines,
        f"values = dict({values}, opacity=None)",
        "scene = dataclasses.replace(scene, objects=[",
        "    dataclasses.replace(item, surface=dataclasses.replace(item.surface or tl.Surface(), **values))",
        f"    if {chosen} else item",
        "    for item in scene.objects",
        "])",
        *after,
    ]


def _numbers(values: Iterable[float], between: str = ",") -> str:
    return between.join(f"{value:.12g}" for value in np.asarray(list(values), dtype=np.float64) + 0.0)
