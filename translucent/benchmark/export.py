"""Scenes of the benchmark as files that any renderer can read: a .glb, a .json with every number, and the surroundings.

All vertices are in the world, in metres; y is up. What glTF has words for is in the .glb: absorption, index of
refraction, roughness, thickness as a texture, the camera, lights. Nested bodies, scattering, emission and the
surroundings are in the .json.
"""

from __future__ import annotations

import io
import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh
from PIL import Image

from translucent.arrays import Array
from translucent.benchmark.scenes import FEATURES, SCENES, BenchmarkScene
from translucent.files.images import write_exr
from translucent.files.paths import OutputFiles, make_folder, write_text_atomically
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import corner_normals
from translucent.geometry.ray_caster import ray_caster_of
from translucent.gltf.file import glb_bytes
from translucent.gltf.materials import VOLUME
from translucent.gltf.write import volume_extensions
from translucent.interop.mitsuba import SAMPLES, beyond_mitsuba, to_mitsuba, units_per_metre
from translucent.scene.environment import Environment
from translucent.scene.environment_map import texel_directions
from translucent.scene.lights import DirectionalLight, PointLight
from translucent.scene.scene import Object, Scene

#: Version of the layout of what is written.
FORMAT = "translucent benchmark scene 1"

#: Rays for the thickness below a corner, and triangles of a body at whose corners it is measured, at least.
_RAYS, _FEWEST = 33, 500

#: Rows of a picture of all directions.
ROWS = 64

Json = dict[str, Any]

#: What a stranger reads first.
README = """The scenes of `translucent benchmark`. One folder for each:

scene.glb        triangles (world, metres, y up), materials as far as glTF has words for them, camera, lights
scene.json       every number: camera, size, lights, media (1/m), interfaces, priorities, and what the scene needs
environment.exr  radiance from all directions, linear: row 0 is up (+y), the middle is -z, +x is to the right of it
environment.hdr  the same

Render each scene at its size and write linear Rec.709 radiance, without tone mapping, exposure or gamma, into one
folder as NAME.exr (or NAME.npy: float32, height x width x 3, row 0 on top). The background is the environment.
If you have thickness (metres in media along the view ray), write NAME.thickness.exr or .npy, NaN where you do not know.
Leave out scenes that your renderer cannot do. Then: translucent benchmark score FOLDER --name "My renderer"
"""


def export_scenes(folder: Path, scenes: Sequence[BenchmarkScene] = SCENES) -> list[Path]:
    """Write scenes, each into a folder of its name, and a README; returns the folders."""
    make_folder(folder)
    found = [export_scene(scene, folder / scene.name) for scene in scenes]
    listed = [{"name": one.name, "title": one.title, "tests": one.tests, "needs": one.needs} for one in scenes]
    write_text_atomically(
        folder / "scenes.json", json.dumps({"format": FORMAT, "features": FEATURES, "scenes": listed}, indent=1)
    )
    write_text_atomically(folder / "README.txt", README)
    return found


def export_scene(scene: BenchmarkScene, folder: Path) -> Path:
    """Write one scene into a folder."""
    make_folder(folder)
    made = scene.make()
    pixels = environment_pixels(made.environment)
    with OutputFiles() as written:
        written.write(folder / "scene.glb", lambda part: part.write_bytes(glb_of(made)))
        written.write(folder / "environment.exr", lambda part: write_exr(part, {"RGB": pixels}, {}))
        written.write(folder / "environment.hdr", lambda part: part.write_bytes(hdr_of(pixels)))
        text = json.dumps(described_scene(scene, made), indent=1)
        written.write(folder / "scene.json", lambda part: part.write_text(text, encoding="utf-8", newline="\n"))
    return folder


def environment_pixels(environment: Environment) -> Array:
    """(h, w, 3) float32: radiance from all directions, with the exposure and the rotation of a picture."""
    height, width = ROWS, 2 * ROWS
    if environment.map is not None:
        width, height = environment.map.size
    directions = texel_directions(height, width).reshape(-1, 3)
    radiance = environment.radiance(directions, np.zeros((len(directions), 2)))
    return radiance.reshape(height, width, 3).astype(np.float32)


def hdr_of(pixels: Array) -> bytes:
    """Radiance .hdr file of linear pixels (h, w, 3), not compressed (Ward 1991)."""
    brightest = np.maximum(pixels.max(axis=-1), 1e-32)
    _, exponent = np.frexp(brightest)
    scaled = pixels / np.exp2(exponent.astype(np.float64))[..., None] * 256
    coded = np.concatenate([np.clip(scaled, 0, 255), exponent[..., None] + 128.0], axis=-1).astype(np.uint8)
    height, width = pixels.shape[:2]
    return f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode() + coded.tobytes()


def mean_chord(item: Object) -> float:
    """Mean length of random straight paths through a body, 4 V / S (Cauchy), in metres: a thicknessFactor for glTF."""
    return 2.0 * item.mean_thickness


def corner_thickness(corners: Array) -> Array:
    """(n, 3) thickness in metres below the corners (n, 3, 3) of the triangles of a body, for a thicknessTexture.

    It is the median of the first stretch of `_RAYS` rays, distributed by the cosine to the face, as bakers measure
    it. A mean would follow rays that run along a wall.
    """
    placed = Mesh(corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3))
    inwards = np.cross(corners[:, 2] - corners[:, 0], corners[:, 1] - corners[:, 0])
    inwards /= np.maximum(np.linalg.norm(inwards, axis=1, keepdims=True), 1e-30)
    side = np.cross(inwards, np.eye(3)[np.abs(inwards).argmin(axis=1)])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(inwards, side)
    origins = 0.9 * corners + 0.1 * corners.mean(axis=1, keepdims=True) + 1e-5 * placed.diagonal * inwards[:, None]
    caster, found = ray_caster_of(placed), []
    for k in range(_RAYS):
        height, turn = np.sqrt((k + 0.5) / _RAYS), k * np.pi * (3 - np.sqrt(5))
        flat = np.sqrt(1 - height**2)
        direction = height * inwards + flat * (np.cos(turn) * side + np.sin(turn) * other)
        faces, far = caster.nearest(origins.reshape(-1, 3), np.repeat(direction, 3, axis=0))
        found.append(np.where(faces >= 0, far, 0.0))
    return np.median(found, axis=0).reshape(-1, 3)


def divided(values: Array) -> Array:
    """Each triangle as four: values (n, 3, k) of their corners, (4 n, 3, k)."""
    a, b, c = np.moveaxis(values, 1, 0)
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    fours = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([np.stack(four, axis=1) for four in fours])


def thickness_texture(thickness: Array) -> tuple[bytes, Array]:
    """PNG with thickness (n, 3) as green, as a fraction of the largest, and texture coordinates (n, 3, 2) of corners.

    Each triangle has 2 x 2 texels. The fourth makes bilinear interpolation linear in the triangle.
    """
    across = math.ceil(math.sqrt(len(thickness)))
    texels = np.zeros((across, 2, across, 2))
    down, right = np.divmod(np.arange(len(thickness)), across)
    a, b, c = np.moveaxis(thickness / max(float(thickness.max()), 1e-30), 1, 0)
    for (y, x), value in zip(((0, 0), (0, 1), (1, 0), (1, 1)), (a, b, c, b + c - a), strict=True):
        texels[down, y, right, x] = value
    pixels = np.zeros((2 * across, 2 * across, 3), np.uint8)
    pixels[..., 1] = np.round(255 * np.clip(texels.reshape(2 * across, 2 * across), 0, 1))
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, format="PNG")
    first = (2 * np.stack([right, down], axis=-1) + 0.5)[:, None] / (2 * across)
    return stream.getvalue(), first + np.array([(0, 0), (1, 0), (0, 1)]) / (2 * across)


def described_scene(scene: BenchmarkScene, made: Scene) -> Json:
    """Contents of a scene.json."""
    camera = made.camera
    return {
        "format": FORMAT,
        "name": scene.name,
        "title": scene.title,
        "tests": scene.tests,
        "needs": list(scene.needs),
        "size": list(scene.size),
        "thickness": scene.thickness,
        "camera": {
            "eye": camera.eye.tolist(),
            "forward": camera.forward.tolist(),
            "right": camera.right.tolist(),
            "up": camera.up.tolist(),
            "fov_y_degrees": camera.fov_y,
        },
        "environment": {
            "image": "environment.exr",
            "constant": np.asarray(made.environment.first).tolist() if made.environment.kind == "constant" else None,
        },
        "lights": [_light(light) for light in made.lights],
        "overlap": made.overlap,
        "objects": [_object(i, item) for i, item in enumerate(made.objects)],
    }


def _light(light: Any) -> Json:
    if isinstance(light, DirectionalLight):
        direction, irradiance = np.asarray(light.direction).tolist(), np.asarray(light.irradiance).tolist()
        return {"type": "directional", "direction": direction, "irradiance": irradiance}
    assert isinstance(light, PointLight)
    position, intensity = np.asarray(light.position).tolist(), np.asarray(light.intensity).tolist()
    return {"type": "point", "position": position, "intensity": intensity}


def _object(number: int, item: Object) -> Json:
    entry: Json = {"node": number, "name": item.mesh.name or f"object {number}"}
    if item.medium is None:
        return entry | {"type": "opaque", "diffuse_reflectance": np.asarray(item.base_color)[:3].tolist()}
    medium = item.medium
    return entry | {
        "type": "body" if item.sheet_thickness is None else "sheet",
        "sheet_thickness": item.sheet_thickness,
        "ior": medium.ior,
        "roughness": 0.0 if item.surface is None else item.surface.roughness,
        "absorption": np.asarray(medium.absorption).tolist(),
        "scattering": np.asarray(medium.scattering).tolist(),
        "emission": np.asarray(medium.emission).tolist(),
        "anisotropy": float(medium.anisotropy),
        "priority": item.priority,
        "mean_chord": None if item.sheet_thickness is not None else mean_chord(item),
    }


def glb_of(made: Scene) -> bytes:
    """Binary glTF 2.0 of a scene: each object a node of its number, with its own corners and their normals."""
    parts: list[bytes] = []
    views: list[Json] = []
    accessors: list[Json] = []
    meshes: list[Json] = []
    materials: list[Json] = []
    images: list[Json] = []

    def view(data: bytes, **more: int) -> int:
        views.append({"buffer": 0, "byteOffset": sum(map(len, parts)), "byteLength": len(data), **more})
        parts.append(data + b"\0" * (-len(data) % 4))
        return len(views) - 1

    def add(values: npt.NDArray[np.float32], bounded: bool = False) -> int:
        at = view(values.astype("<f4").tobytes(), target=34962)
        accessor: Json = {
            "bufferView": at,
            "componentType": 5126,
            "count": len(values),
            "type": f"VEC{values.shape[-1]}",
        }
        if bounded:
            accessor |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        accessors.append(accessor)
        return len(accessors) - 1

    for item in made.objects:
        corners = item.mesh.vertices[item.mesh.faces] @ item.matrix[:3, :3].T + item.matrix[:3, 3]
        normals = corner_normals(item.mesh) @ np.linalg.inv(item.matrix[:3, :3])
        if item.faces_inwards:
            corners, normals = corners[:, ::-1], normals[:, ::-1]
        solid = item.medium is not None and item.sheet_thickness is None
        while solid and len(corners) < _FEWEST:
            corners, normals = divided(corners), divided(normals)
        normals = normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-30)
        attributes = {"POSITION": add(corners.reshape(-1, 3).astype(np.float32), True)}
        attributes["NORMAL"] = add(normals.reshape(-1, 3).astype(np.float32))
        material = _gltf_material(item)
        if solid:
            thickness = corner_thickness(corners)
            image, texels = thickness_texture(thickness)
            attributes["TEXCOORD_0"] = add(texels.reshape(-1, 2).astype(np.float32))
            volume = {"thicknessFactor": float(thickness.max()), "thicknessTexture": {"index": len(images)}}
            material["extensions"][VOLUME] |= volume
            images.append({"bufferView": view(image), "mimeType": "image/png"})
        meshes.append({"primitives": [{"attributes": attributes, "material": len(materials)}], "name": item.mesh.name})
        materials.append(material)
    nodes: list[Json] = [{"mesh": i, "name": f"object_{i}"} for i in range(len(meshes))]
    camera = made.camera
    far = 10 * float(np.linalg.norm(made.boxes.reshape(-1, 3) - camera.eye, axis=1).max())
    lens = {"yfov": float(np.radians(camera.fov_y or 45.0)), "aspectRatio": 1.0, "znear": far * 1e-4, "zfar": far}
    nodes.append({"camera": 0, "name": "camera", "matrix": camera.pose.T.ravel().tolist()})
    content: Json = {
        "asset": {"version": "2.0", "generator": "translucent benchmark"},
        "scene": 0,
        "cameras": [{"type": "perspective", "perspective": lens}],
        "meshes": meshes,
        "materials": materials,
        "accessors": accessors,
        "bufferViews": views,
    }
    if images:
        content |= {"images": images, "textures": [{"source": i, "sampler": 0} for i in range(len(images))]}
        content["samplers"] = [{"magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071}]
    used = {name for material in materials for name in material.get("extensions", {})}
    if made.lights:
        lights, places = zip(*(_gltf_light(light) for light in made.lights), strict=True)
        content["extensions"] = {"KHR_lights_punctual": {"lights": list(lights)}}
        for i, place in enumerate(places):
            nodes.append({"matrix": place, "extensions": {"KHR_lights_punctual": {"light": i}}})
        used.add("KHR_lights_punctual")
    content |= {"nodes": nodes, "scenes": [{"nodes": list(range(len(nodes)))}]}
    if used:
        content["extensionsUsed"] = sorted(used)
    binary = b"".join(parts)
    content["buffers"] = [{"byteLength": len(binary)}]
    return glb_bytes(content, binary)


def _gltf_material(item: Object) -> Json:
    if item.medium is None:
        color = [*np.asarray(item.base_color)[:3].tolist(), 1.0]
        return {"pbrMetallicRoughness": {"baseColorFactor": color, "metallicFactor": 0.0, "roughnessFactor": 1.0}}
    roughness = 0.0 if item.surface is None else float(item.surface.roughness)
    thickness = 0.0 if item.sheet_thickness is not None else mean_chord(item)
    extensions = volume_extensions(item.medium, None, max(thickness, 1e-9), item.medium.ior)
    return {
        "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": roughness},
        "extensions": extensions,
    }


def _gltf_light(light: Any) -> tuple[Json, list[float]]:
    """Light of KHR_lights_punctual, and its matrix by columns: it shines along -z."""
    strength = np.asarray(light.irradiance if isinstance(light, DirectionalLight) else light.intensity)
    brightest = float(strength.max()) or 1.0
    strengths = {"color": (strength / brightest).tolist(), "intensity": brightest}
    if isinstance(light, PointLight):
        place = np.eye(4)
        place[:3, 3] = light.position
        return {"type": "point", **strengths}, place.T.ravel().tolist()
    back = -np.asarray(light.direction)
    side = np.cross((0.0, 1.0, 0.0) if abs(back[1]) < 0.9 else (1.0, 0.0, 0.0), back)
    side /= np.linalg.norm(side)
    place = np.eye(4)
    place[:3, :3] = np.stack([side, np.cross(back, side), back], axis=1)
    return {"type": "directional", **strengths}, place.T.ravel().tolist()


# --- Mitsuba, which has no priorities --------------------------------------------------------------------------------


def mitsuba_scene(
    made: Scene, size: tuple[int, int], folder: Path | None = None, samples: int = SAMPLES
) -> dict[str, Any]:
    """Dictionary of a scene for ``mitsuba.load_dict``, with nested bodies where they overlap by priority.

    Parameters
    ----------
    made : Scene
    size : (int, int)
        Width and height in pixels.
    folder : Path, optional
        Where meshes and pictures are written.
    samples : int
        Paths of each pixel.

    Raises
    ------
    InputError
        If Mitsuba has no words for something in the scene.
    """
    if made.overlap != "priority":
        return to_mitsuba(made, size, folder, samples=samples)
    return _nested(made, size, folder, samples)


def lacking_in_mitsuba(made: Scene) -> str:
    """Name the feature of a scene that Mitsuba cannot represent; empty if Mitsuba represents all features."""
    return next((found for part in _parts(made) for found, _ in beyond_mitsuba(part)), "")


def _parts(made: Scene) -> list[Scene]:
    """Scenes of one body each where bodies overlap by priority; else the scene."""
    return [replace(made, objects=[body]) for body in made.bodies] if made.overlap == "priority" else [made]


def _nested(made: Scene, size: tuple[int, int], folder: Path | None, samples: int) -> dict[str, Any]:
    """Bodies in each other for Mitsuba: each interface once, with the medium on either side of it.

    A face belongs to its body where that body has the highest priority of all just behind the face, and not just
    before it. `to_mitsuba` describes the rest of the scene, and each body by itself.
    """
    bodies, parts = made.bodies, _parts(made)
    alone = []
    for i, part in enumerate(parts):
        place = None if folder is None else folder / f"body-{i}"
        if place is not None:
            make_folder(place)
        alone.append(to_mitsuba(part, size, place, samples=samples))
    units = np.array([units_per_metre(part) for part in parts])
    larger = units.min() / units
    described = dict(alone[int(units.argmin())])
    del described["object_0"]
    for one, factor in zip(alone, larger, strict=True):
        one["object_0"]["interior"]["scale"] /= factor
    ranks = np.array([body.priority for body in bodies] + [-np.inf])
    away = 1e-4 * made.diagonal
    for i, body in enumerate(bodies):
        corners = body.mesh.vertices[body.mesh.faces] @ body.matrix[:3, :3].T + body.matrix[:3, 3]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals *= away / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        middle = corners.mean(axis=1)
        before, behind = (_strongest(bodies, middle + side * normals) for side in (1.0, -1.0))
        path = Path(alone[i]["object_0"]["filename"])
        header, data = path.read_bytes().split(b"end_header\n", 1)
        vertices = np.frombuffer(data, np.dtype("<f4"), 18 * len(corners)).reshape(-1, 3, 6).copy()
        vertices[..., :3] *= larger[i]
        for other in np.unique(before):
            kept = (behind == i) & (before == other) & (ranks[before] < body.priority)
            if not kept.any():
                continue
            shell = path.with_name(f"{i}-{other}.ply")
            count = int(kept.sum())
            faces = np.zeros(count, np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
            faces["count"], faces["corners"] = 3, np.arange(3 * count).reshape(-1, 3)
            text = header.replace(b"vertex %d\n" % (3 * len(corners)), b"vertex %d\n" % (3 * count))
            text = text.replace(b"face %d\n" % len(corners), b"face %d\n" % count)
            shell.write_bytes(text + b"end_header\n" + vertices[kept].tobytes() + faces.tobytes())
            shape = {**alone[i]["object_0"], "filename": str(shell)}
            if other < len(bodies):
                outside = bodies[other].medium
                shape["bsdf"] = {**shape["bsdf"], "ext_ior": float(outside.ior)}
                shape["exterior"] = alone[other]["object_0"]["interior"]
            described[f"interface_{i}_{other}"] = shape
    return described


def _strongest(bodies: Sequence[Object], points: Array) -> npt.NDArray[np.int64]:
    """Index of the body with the highest priority at each point; the number of bodies where there is none."""
    found = np.full(len(points), len(bodies), np.int64)
    for i in sorted(range(len(bodies)), key=lambda i: bodies[i].priority):
        mesh, matrix = bodies[i].mesh, np.linalg.inv(bodies[i].matrix)
        solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        found[solid.contains(points @ matrix[:3, :3].T + matrix[:3, 3])] = i
    return found
