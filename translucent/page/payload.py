"""Data of a page: the scene, its meshes, and the renderer's passes as steps, in one container."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.formulas.diffuse_interface import diffuse_interface
from translucent.formulas.sampling import sample_shifts
from translucent.formulas.tone import TONES
from translucent.frames.aovs import false_colors
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import drawn_normals
from translucent.gpu.features import FrameFeatures
from translucent.gpu.layout import BLOCKS, BODY, TABLES, PackedTable, UniformBlock
from translucent.gpu.lifting import lift
from translucent.gpu.passes.traced_interfaces import microfacet_points
from translucent.gpu.placement import PlacedScene, face_counts
from translucent.gpu.recording import FrameRecorder, RecordedFrame
from translucent.gpu.recording.context import INFO, RecordingContext
from translucent.gpu.uniforms import BodyRoles, bounded_extinction, media_center
from translucent.media.medium import Medium
from translucent.media.presets import presets
from translucent.page.container import Container
from translucent.page.plans import PagePlan, current, editable, variant
from translucent.scene.scene import Object, Scene
from translucent.version import VERSION

#: Bits of the mantissa of light that are kept: errors are 5e-4 of each value at most, a tenth of a step of 8 bits.
LIGHT_BITS = 10

#: Bits of the mantissa of the table of reflectances that are kept: errors are 3e-5 of each value at most.
REFLECTANCE_BITS = 14

#: Endings of names that meshes have of their files.
_FILES = (".ply", ".obj", ".stl", ".off", ".glb", ".gltf")

#: Indices of refraction from 1 to 3 for which pages know the fraction of diffuse light that an interface mirrors.
MIRROR_STEPS = 65

#: Samplers of textures that hold light.
_LIGHT = ("light_map", "light_levels", "light_irradiance", "seen_map", "diffused_light")

_COMMENT = re.compile(r"//.*")

#: Steps of `RecordedFrame`, by their names in the header.
_PARTS = ("once", "media", "single", "averaged")


def payload(
    planned: PagePlan,
    name: str,
    size: tuple[int, int],
    samples: int,
    exposure: float,
    tone: str,
    *,
    albedos: bool = False,
) -> bytes:
    """Data of a page that shows a scene.

    Parameters
    ----------
    planned : PagePlan
    name : str
        For people.
    size : (width, height)
        Of the picture that the camera frames.
    samples : int
        Of each pixel, at rest.
    exposure : float
        Stops brighter.
    tone : {"none", "neutral", "agx"}
    albedos : bool
        The page can change the albedo of a medium that scatters: it holds light of several.
    """
    scene = planned.scene
    recorder = FrameRecorder(samples, planned.most_layers, planned.texture_units)
    into = Container()
    frames, aliases = _recorded(recorder, planned)
    gl = recorder.gl
    # Pages build hierarchies themselves.
    kept = frozenset(
        entry["content"] for entry in gl.textures if entry["dtype"] == "u4" and entry["content"] is not None
    )
    spectral_maps = recorder.resources.shadows.spectral
    header = {
        "version": VERSION,
        "name": name,
        "samples": samples,
        "shifts": sample_shifts(samples).tolist(),
        "microfacet_points": [microfacet_points(i) for i in range(samples)],
        "exposure": exposure,
        "tone": tone,
        "notes": [{"kind": str(note.kind), "text": str(note)} for note in planned.notes],
        "scene": _scene_entry(planned, size, gl),
        "presets": _presets_entry(),
        "inner_mirror": [diffuse_interface(ior).reflected for ior in np.linspace(1.0, 3.0, MIRROR_STEPS)],
        "layout": {
            "blocks": {block: _layout(item) for block, item in BLOCKS.items()},
            "tables": {table: _layout(item) for table, item in TABLES.items()},
        },
        "present": _present_entry(),
        "false_colors": into.add(false_colors()),
        "hierarchies": _hierarchies_entry(recorder, scene, into),
        "meshes": [_mesh_entry(mesh, into) for mesh in gl.meshes],
        "spectral_maps": spectral_maps,
        "aliases": aliases,
        "variants": {
            key: _variant_entry(frame, rendered, gl, into, spectral_maps) for key, (rendered, frame) in frames.items()
        },
    }
    sections = _Sections(gl, into, kept)
    bits = dict.fromkeys(_held_as(frames, _LIGHT), LIGHT_BITS)
    bits |= dict.fromkeys(_held_as(frames, ("reflectance_table",)), REFLECTANCE_BITS)
    header["textures"] = [sections.texture(entry, bits.get(i)) for i, entry in enumerate(gl.textures)]
    if albedos:
        _add_albedos(header, recorder, planned, into, frames)
    header["programs"] = [[_code(stage) for stage in program] for program in gl.programs]
    header["framebuffers"] = gl.framebuffers
    _number_blocks(header, sections)
    return into.packed(header)


def _recorded(
    recorder: FrameRecorder, planned: PagePlan
) -> tuple[dict[str, tuple[Scene, RecordedFrame]], dict[str, str]]:
    """Frames of the scene and of its variants, and the frame that each switch setting shows."""
    frames = {"base": (planned.scene, recorder.record(planned.plan))}
    aliases: dict[str, str] = {}
    if all(editable(body) for body in planned.scene.objects):
        return frames, aliases
    now = current(planned.scene)
    for bends in (False, True):
        for rough in (False, True):
            key = f"{'bends' if bends else 'straight'} {'rough' if rough else 'smooth'}"
            if (bends, rough) == now:
                aliases[key] = "base"
                continue
            rendered = variant(planned.scene, bends=bends, rough=rough)
            try:
                frames[key] = rendered, recorder.record(planned.planned(rendered))
                aliases[key] = key
            except InputError:
                continue  # a requested method cannot draw it
    return frames, aliases


def _add_albedos(
    header: dict[str, Any],
    recorder: FrameRecorder,
    planned: PagePlan,
    into: Container,
    frames: Mapping[str, tuple[Scene, RecordedFrame]],
) -> None:
    """Add the light of the scattering medium for other albedos, or the reason why its color is fixed."""
    texture = recorder.resources.diffusion.of(planned.plan)
    if texture is None:
        return
    from translucent.page.albedos import AlbedoLight, fixed_albedo  # loads much of SciPy

    scene, fixed = planned.scene, fixed_albedo(planned.plan)
    light = None if fixed else AlbedoLight.of(planned.plan)
    for i, body in enumerate(scene.objects):
        if body.medium is None or not body.medium.scatters or body.covers:
            continue
        entry = header["scene"]["media"][header["scene"]["objects"][i]["medium"]]
        if light is not None and i in light.surfaces:
            entry["has_albedo"] = True
        elif "The color" not in entry["why"]:
            entry["why"] += f" The color cannot change either, because {fixed or 'the medium does not use diffusion'}."
    if light is not None:
        header["albedos"] = {
            **light.entry(into, texture.first_layers, texture.ground_layer),
            "objects": [body.mean_thickness if i in light.surfaces else None for i, body in enumerate(scene.objects)],
            "textures": sorted(_held_as(frames, ("diffused_light",))),
        }


class _Sections:
    """Numbers of sections for arrays of a recording."""

    def __init__(self, gl: RecordingContext, into: Container, kept: frozenset[int]) -> None:
        self._gl, self._into, self._kept = gl, into, kept
        self._numbers: dict[int, int] = {}

    def number(self, content: int, packing: str = "plain", bits: int = 23) -> int:
        """Section of one of the contents."""
        if content not in self._numbers:
            self._numbers[content] = self._into.add(self._gl.contents[content], packing, bits)
        return self._numbers[content]

    def texture(self, entry: Mapping[str, Any], bits: int | None) -> dict[str, Any]:
        """Entry of a texture in the header; its values are rounded to `bits` of the mantissa."""
        content = entry["content"]
        if content is None or content in self._kept:
            return {**entry, "content": None}
        return {**entry, "content": self.number(content) if bits is None else self.number(content, "picture", bits)}


def _held_as(frames: Mapping[str, tuple[Scene, RecordedFrame]], names: Sequence[str]) -> set[int]:
    """Textures that samplers of these names read."""
    steps = [step for _, frame in frames.values() for part in _PARTS for step in getattr(frame, part)]
    return {step["textures"][name] for step in steps for name in names if name in step.get("textures", {})}


def _number_blocks(header: dict[str, Any], sections: _Sections) -> None:
    """Replace the contents of uniform blocks in all steps by the numbers of their sections."""
    for entry in header["variants"].values():
        for part in _PARTS:
            for step in entry[part]:
                if "blocks" in step:
                    step["blocks"] = {name: sections.number(content) for name, content in step["blocks"].items()}


def _scene_entry(planned: PagePlan, size: tuple[int, int], gl: RecordingContext) -> dict[str, Any]:
    scene = planned.scene
    camera = scene.camera
    media = list(dict.fromkeys(body.medium for body in scene.objects if body.medium is not None and not body.covers))
    numbers = [i for i, body in enumerate(scene.objects) if body.medium is not None]
    throwing = [i for i in numbers if not scene.objects[i].covers] or numbers
    return {
        "size": list(size),
        "camera": {
            "eye": camera.eye.tolist(),
            "right": camera.right.tolist(),
            "up": camera.up.tolist(),
            "forward": camera.forward.tolist(),
            "fov_y": camera.fov_y,
            "height": camera.height,
        },
        "diagonal": scene.diagonal,
        "bounds": scene.bounds.tolist(),
        "center": media_center(scene).tolist(),
        "first_body": numbers[0],
        "first_throwing": throwing[0],
        "media": [_medium_entry(planned, medium) for medium in media],
        "objects": [
            {
                "mesh": gl.number_of_mesh(body.mesh),
                "matrix": body.matrix.ravel().tolist(),
                "bounds": body.bounds.tolist(),
                "inverted": body.mesh.diagnosis.inverted,
                "opaque": body.medium is None,
                "sheet": body.sheet_thickness,
                "medium": media.index(body.medium) if body.medium in media and not body.covers else None,
            }
            for body in scene.objects
        ],
    }


def _medium_entry(planned: PagePlan, medium: Medium) -> dict[str, Any]:
    bodies = [body for body in planned.scene.objects if body.medium is medium and not body.covers]
    first = bodies[0]
    why = next(filter(None, map(editable, bodies)), "")
    extinction: Array = bounded_extinction(medium, planned.scene.diagonal)
    return {
        "name": ", ".join(dict.fromkeys(name_of(body.mesh) for body in bodies)),
        "extinction": extinction.tolist(),
        "ior": medium.ior,
        "roughness": 0.0 if first.surface is None else first.surface.roughness,
        "distance": planned.panel_distance(first),
        "preset": _preset_of(planned, first),
        "editable": not why,
        "has_albedo": False,
        "why": why,
    }


def _preset_of(planned: PagePlan, body: Object) -> str:
    """Name of the preset of a body's medium; empty if there is none."""
    given = planned.given_body(body)
    roughness = 0.0 if given.surface is None else given.surface.roughness
    found = (name for name, one in presets().items() if (one.medium, one.roughness) == (given.medium, roughness))
    return next(found, "")


def _presets_entry() -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "extinction": preset.medium.extinction.tolist(),
            "ior": preset.medium.ior,
            "roughness": preset.roughness,
        }
        for name, preset in presets().items()
        if preset.regime == "absorbing"
    ]


def _layout(item: UniformBlock | PackedTable) -> dict[str, Any]:
    fields, held = {}, item.dtype.fields
    assert held is not None
    for name, base, shape in item.fields:
        fields[name] = [int(held[name][1]), base, int(np.prod(shape, dtype=int))]
    binding = item.binding if isinstance(item, UniformBlock) else None
    return {"binding": binding, "size": item.dtype.itemsize, "fields": fields}


def _present_entry() -> dict[str, str]:
    texts = {tone: _code(lift("present/present.frag", {"TONE": i}, "webgl2").text) for i, tone in enumerate(TONES)}
    return {"vertex": _code(lift("geometry/fullscreen.vert", {}, "webgl2").text), **texts}


def _code(shader: str) -> str:
    """Text of a shader without comments, indentation and empty lines."""
    return "\n".join(filter(None, (_COMMENT.sub("", line).strip() for line in shader.splitlines())))


def _hierarchies_entry(recorder: FrameRecorder, scene: Scene, into: Container) -> dict[str, Any] | None:
    """Nodes of the hierarchy of objects, and the meshes whose hierarchies follow."""
    gl = recorder.gl
    meshes = list(dict.fromkeys(body.mesh for body in scene.objects))
    traced = [entry for entry in gl.textures if entry["dtype"] == "u4" and entry["content"] is not None]
    if not traced:
        return None
    nodes = gl.contents[traced[0]["content"]]
    rows = -(-16 * len(scene.objects) // nodes.shape[1])
    return {
        "objects": into.add(np.ascontiguousarray(nodes[:rows]).reshape(-1, 4)),
        "meshes": [gl.number_of_mesh(mesh) for mesh in meshes],
    }


def _variant_entry(
    frame: RecordedFrame, scene: Scene, gl: RecordingContext, into: Container, spectral_maps: bool
) -> dict[str, Any]:
    features = FrameFeatures(frame.plan)
    roles = BodyRoles.of(features, face_counts(scene, int(INFO["GL_SUBPIXEL_BITS"])))
    names = {block.binding: name for name, block in BLOCKS.items()}
    blocks = {names[binding]: into.add(_bytes(content)) for binding, content in frame.blocks.items()}
    steps = {part: [dict(step) for step in getattr(frame, part)] for part in _PARTS}
    if spectral_maps:
        for step in steps["once"]:
            if "Body" in step.get("blocks", {}):
                step["object"] = _object_of(gl.contents[step["blocks"]["Body"]], gl.meshes[step["mesh"]], scene)
    return {
        **steps,
        "blocks": blocks,
        "bodies": [into.add(_bytes(content)) for content in frame.bodies],
        "targets": frame.targets,
        "roles": [
            {"anchored": roles.anchored, "weight": weight, "subpixel": roles.counts.subpixel}
            for weight in roles.counts.weights.tolist()
        ],
        "slots": [list(slot.objects) for slot in features.slots],
        "spectral": frame.plan.spectral,
        "makes_sheets": frame.plan.method.makes_sheets,
        "counts_from_camera": frame.plan.method.counts_from_camera,
        "starts_inside": PlacedScene.of(scene).starts_inside,
    }


def _object_of(content: npt.NDArray[Any], mesh: object, scene: Scene) -> int | None:
    """Number of the object that a Body block of a shadow map belongs to."""
    extinction = np.frombuffer(content.tobytes(), BODY.dtype)["extinction"][0, :3]
    for i, body in enumerate(scene.objects):
        own = bounded_extinction(body.medium, scene.diagonal).astype(np.float32)
        if body.mesh is mesh and body.medium is not None and np.array_equal(own, extinction):
            return i
    return None


def _bytes(content: bytes) -> npt.NDArray[np.uint8]:
    return np.frombuffer(content, np.uint8)


def name_of(mesh: Mesh) -> str:
    """Name of a mesh for people: without the ending of its file."""
    stem, dot, ending = mesh.name.rpartition(".")
    return stem if stem and (dot + ending).lower() in _FILES else mesh.name


def _mesh_entry(mesh: Mesh, into: Container) -> dict[str, Any]:
    """Entry of a mesh in a page's header; its arrays go into the container."""
    low, high = mesh.bounds
    faces = mesh.faces.astype(np.uint32)
    entry: dict[str, Any] = {
        "name": mesh.name,
        "center": mesh.center.tolist(),
        "low": low.tolist(),
        "high": high.tolist(),
        "diagonal": mesh.diagonal,
        "offsets": into.add((mesh.vertices - mesh.center).astype(np.float32), "rows"),
        "faces": into.add(faces, "rows"),
        **_normals(mesh, faces, into),
        "uv": None,
        "colors": None,
    }
    for name, values in (("uv", mesh.uv), ("colors", mesh.colors)):
        if values is not None:
            entry[name] = into.add(np.asarray(values, np.float32), "rows")
    return entry


def _normals(mesh: Mesh, faces: np.ndarray, into: Container) -> dict[str, int | None]:
    """Normals of vertices where all faces around each agree; else the distinct normals, with an index per corner."""
    normals = drawn_normals(mesh).reshape(-1, 3)
    ofs = np.zeros((len(mesh.vertices), 3), np.float32)
    ofs[faces.ravel()] = normals
    if np.array_equal(ofs[faces.ravel()], normals):
        return {"normals": into.add(ofs, "rows"), "normal_index": None}
    found, index = np.unique(normals, axis=0, return_inverse=True)
    return {
        "normals": into.add(found.astype(np.float32), "rows"),
        "normal_index": into.add(index.reshape(faces.shape).astype(np.uint32), "rows"),
    }
