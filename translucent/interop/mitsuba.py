"""Scenes for Mitsuba 3, so that anybody can check a picture against an independent path tracer.

What is written: closed bodies with a homogeneous medium behind a dielectric, rough dielectric or null interface; opaque
diffuse objects of one color or with a texture of it; point, directional and sphere lights; constant environments,
gradients and pictures of all directions; the camera; a film with a box filter; ``volpathmis`` without a limit of depth.
Triangles carry the normals for shading that pictures have here, in the world. Vertices and pictures lie in files
beside, since neither form has room for them.

Conventions that differ, and what is done about them:

- Rays of Mitsuba start about 1e-4 of a unit off a surface. So that it is small, the scene is scaled: its diagonal is
  `DIAGONAL` units, coefficients are per unit, and intensities of points grow with the square.
- Its cameras look along +Z with +X to the left.
- Row i of h in its environment maps is at the angle pi i / (h - 1) from +Y, and the center of the picture is +Z. Rows
  are at pi (i + 1/2) / h here, with -Z in the middle: rows are added, and between them lie the same straight lines.
- A roughness r is its ``alpha`` r^2, GGX. Its rough dielectrics have no scattering among facets, and lose light that
  ours keep: a frosted ball of ior 1.5 in a white world has a radiance of 0.99 there with r = 0.2, 0.95 with 0.3 and
  0.78 with 0.5, and 1 here. From `ROUGH` on a warning says so.
- Its pictures are flipped: v = 0 is the first row of a bitmap, and the last one here.
- A sphere light is seen there, and hides what is behind it.

Source: plugin documentation of Mitsuba 3.
"""

from __future__ import annotations

import math
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from translucent.arguments import checked
from translucent.arrays import Array
from translucent.errors import InputError, RenderError, TranslucentWarning
from translucent.files.paths import OutputFiles, require_output
from translucent.geometry.normals import corner_normals
from translucent.planning.bodies import open_bodies, overlapping_pair
from translucent.scene.camera import check_size
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, PointLight, SphereLight, SpotLight
from translucent.scene.scene import Object, Scene, check_scene, object_names
from translucent.scene.surface import TEXTURE_FIELDS, Surface
from translucent.scene.texture import Texture

#: Diagonal of the scene in units of Mitsuba, to a power of ten.
DIAGONAL = 1000.0

#: Depths between which its cameras see, in its units.
NEAR, FAR = 0.1, 1e6

#: Paths of each pixel.
SAMPLES = 256

#: Depth from which on Mitsuba ends paths by chance, 1 in 20 at each event and more where they carry little. Light
#: that crosses n mean free paths is scattered about n^2 / 2 times: with a depth of 100, hardly any path stands for it.
ROULETTE = 100_000

#: Roughness of an interface from which on its rough dielectric loses more than 2 % of the light.
ROUGH = 0.25

#: Element of XML for each plugin.
_ELEMENTS = {
    "volpathmis": "integrator",
    "perspective": "sensor",
    "orthographic": "sensor",
    "independent": "sampler",
    "hdrfilm": "film",
    "box": "rfilter",
    "ply": "shape",
    "sphere": "shape",
    "null": "bsdf",
    "dielectric": "bsdf",
    "roughdielectric": "bsdf",
    "twosided": "bsdf",
    "diffuse": "bsdf",
    "bitmap": "texture",
    "homogeneous": "medium",
    "hg": "phase",
    "point": "emitter",
    "directional": "emitter",
    "constant": "emitter",
    "envmap": "emitter",
    "area": "emitter",
}

#: Elements of XML for triples, which are points unless they are directions.
_VECTORS = {"direction": "vector"}

#: Plugins within others that XML names.
_NAMED = ("interior", "reflectance")

Described = dict[str, Any]


@checked
def to_mitsuba(
    scene: Scene, size: tuple[int, int], folder: str | Path | None = None, *, samples: int = SAMPLES
) -> dict[str, Any]:
    """Describe a scene for ``mitsuba.load_dict``, to be rendered by Mitsuba 3 and compared with our pictures.

    Parameters
    ----------
    scene : Scene
    size : (width, height)
        Of the picture, in pixels.
    folder : path, optional
        Where its meshes (.ply) and its environment (.pfm) are written. Default: a new folder for temporary files.
    samples : int
        Paths of each pixel.

    Returns
    -------
    dict
        With a transform of ``mitsuba.ScalarTransform4f``. Render it with an RGB variant, such as ``llvm_ad_rgb``.

    Raises
    ------
    InputError
        If Mitsuba has no words for something in the scene; it names the object, and what to change.
    RenderError
        If Mitsuba is not installed, or no variant of it is set; `write_mitsuba` needs neither.
    """
    described, files = describe(scene, size, samples)
    without = "or write a file without Mitsuba: tl.write_mitsuba(scene, size, 'scene.xml')"
    try:
        mitsuba: Any = import_module("mitsuba")
    except ImportError:
        raise RenderError("to_mitsuba", "mitsuba is not installed", f"pip install mitsuba, {without}") from None
    if mitsuba.variant() is None:
        raise RenderError(
            "to_mitsuba", "no variant of Mitsuba has been chosen", "call mitsuba.set_variant('llvm_ad_rgb')"
        )
    home = Path(tempfile.mkdtemp(prefix="translucent-mitsuba-") if folder is None else folder)
    with OutputFiles() as written:
        for name, write in files.items():
            require_output(home / name, f"mitsuba file {str(home / name)!r}")
            written.write(home / name, write)

    def loaded(value: Any, key: str = "") -> Any:
        if isinstance(value, dict):
            return {name: loaded(one, name) for name, one in value.items()}
        if key == "to_world":
            return mitsuba.ScalarTransform4f(np.array(value))
        return str((home / value).resolve()) if key == "filename" else value

    result: dict[str, Any] = loaded(described)
    return result


@checked
def write_mitsuba(scene: Scene, size: tuple[int, int], path: str | Path, *, samples: int = SAMPLES) -> tuple[Path, ...]:
    """Write a scene as an .xml file that Mitsuba 3 loads: ``mitsuba scene.xml``, or ``mitsuba.load_file``.

    Parameters
    ----------
    scene : Scene
    size : (width, height)
    path : path
        An .xml file. Its meshes and its environment lie beside it, as ``scene.0.ply`` and ``scene.environment.pfm``.
    samples : int
        Paths of each pixel.

    Returns
    -------
    tuple of Path
        All files, the .xml first.

    Raises
    ------
    InputError
        If Mitsuba has no words for something in the scene, or the path is no .xml file.
    RenderError
        If a file cannot be written.
    """
    path = Path(path)
    check_output(path)
    described, files = describe(scene, size, samples)
    places = {name: path.with_name(f"{path.stem}.{name}") for name in files}
    root = ElementTree.Element("scene", version="3.0.0")
    for name, value in described.items():
        if name != "type":
            root.append(_element(value, None, {name: place.name for name, place in places.items()}))
    ElementTree.indent(root)
    with OutputFiles() as written:
        for name, place in places.items():
            written.write(place, files[name])
        written.write(path, partial(ElementTree.ElementTree(root).write, encoding="utf-8", xml_declaration=True))
    return (path, *places.values())


def check_output(path: Path) -> None:
    """Raise `InputError` before any work is done if no scene can be written to the path."""
    if path.suffix.lower() != ".xml":
        raise InputError(
            f"scene for Mitsuba {str(path)!r}", "the name must end in .xml", "name it for example scene.xml"
        )
    require_output(path, f"scene for Mitsuba {str(path)!r}")


def _element(value: Described, name: str | None, files: Mapping[str, str]) -> ElementTree.Element:
    """XML of a plugin and its children."""
    element = ElementTree.Element(_ELEMENTS[value["type"]], type=value["type"])
    if name is not None:
        element.set("name", name)
    for key, one in value.items():
        if key == "type":
            continue
        if key == "to_world":
            transform = ElementTree.SubElement(element, "transform", name=key)
            ElementTree.SubElement(transform, "matrix", value=" ".join(repr(v) for row in one for v in row))
        elif isinstance(one, dict) and one["type"] == "rgb":
            ElementTree.SubElement(element, "rgb", name=key, value=", ".join(map(repr, one["value"])))
        elif isinstance(one, dict):
            element.append(_element(one, key if key in _NAMED else None, files))
        elif isinstance(one, list):
            text = ", ".join(map(repr, one))
            ElementTree.SubElement(element, _VECTORS.get(key, "point"), name=key, value=text)
        else:
            kind = {str: "string", bool: "boolean", int: "integer", float: "float"}[type(one)]
            text = files.get(one, one) if isinstance(one, str) else str(one).lower()
            ElementTree.SubElement(element, kind, name=key, value=text)
    return element


def describe(scene: Scene, size: tuple[int, int], samples: int = SAMPLES) -> tuple[Described, dict[str, Any]]:
    """Describe a scene by Mitsuba plugins, and its files by name, each with its writer.

    Raises
    ------
    InputError
        If Mitsuba has no words for something in it.
    """
    check_scene(scene)
    size = check_size(size)
    if samples < 1:
        raise InputError(f"samples {samples}", "the number of samples must be at least 1", "use a value such as 256")
    for found, do in beyond_mitsuba(scene):
        raise InputError("a scene for Mitsuba", found, do)
    rough = [body for body in scene.bodies if body.surface is not None and body.surface.roughness > ROUGH]
    if rough:
        text = "Mitsuba renders rough dielectrics darker, without multiple scattering between microfacets"
        warnings.warn(f"{object_names(rough)}: {text}", TranslucentWarning, stacklevel=3)
    scale = units_per_metre(scene)
    described: Described = {
        "type": "scene",
        "integrator": {"type": "volpathmis", "max_depth": -1, "rr_depth": ROULETTE},
        "sensor": {
            **_camera(scene, size, scale),
            "film": {
                "type": "hdrfilm",
                "width": size[0],
                "height": size[1],
                "pixel_format": "rgb",
                "component_format": "float32",
                "filter": {"type": "box"},
            },
            "sampler": {"type": "independent", "sample_count": samples},
        },
    }
    files: dict[str, Any] = {}
    for i, item in enumerate(scene.objects):
        files[f"{i}.ply"] = partial(_write_mesh, item, scale)
        texture = _color_texture(item)
        if texture is not None:
            files[f"{i}.pfm"] = partial(_write_pfm, texture.pixels[..., :3] * item.base_color)
        color = _rgb(item.base_color) if texture is None else _bitmap(f"{i}.pfm", texture)
        described[f"object_{i}"] = {"type": "ply", "filename": f"{i}.ply", **_material(item, scale, color)}
    for i, light in enumerate(scene.lights):
        described[f"light_{i}"] = _light(light, scale)
    described["environment"], pixels = _environment(scene.environment)
    if pixels is not None:
        files["environment.pfm"] = partial(_write_pfm, pixels)
    return described, files


def units_per_metre(scene: Scene) -> float:
    """Units of Mitsuba in a metre: the power of ten that brings the diagonal of the scene next to `DIAGONAL`."""
    return float(10.0 ** round(math.log10(DIAGONAL / scene.diagonal)))


def _camera(scene: Scene, size: tuple[int, int], scale: float) -> Described:
    camera, eye = scene.camera, scene.camera.eye
    turned = np.column_stack([-camera.right, camera.up, camera.forward])
    described: Described = {"type": "perspective", "fov_axis": "y", "fov": float(camera.fov_y or 0.0)}
    if camera.fov_y is None:
        described = {"type": "orthographic"}
        turned[:, :2] *= scale * camera.half_extent(size)[0]  # the picture is 2 units wide there
        # Here its rays are whole lines: there they begin before everything.
        ahead = (scene.boxes.reshape(-1, 3) - eye) @ camera.forward
        reach = np.linalg.norm(scene.boxes[:, 1] - scene.boxes[:, 0], axis=1).max()
        eye = eye + min(float(ahead.min() - reach), 0.0) * camera.forward
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turned, scale * eye
    return {**described, "near_clip": NEAR, "far_clip": FAR, "to_world": pose.tolist()}


def _rgb(values: Any) -> Described:
    return {"type": "rgb", "value": [float(value) for value in np.asarray(values, dtype=np.float64)]}


def _color_texture(item: Object) -> Texture | None:
    """Texture of the diffuse reflection of an opaque object."""
    return None if item.medium is not None or item.surface is None else item.surface.color_texture


def _bitmap(file: str, texture: Texture) -> Described:
    """Texture of linear values; the mesh has the coordinates of the picture itself."""
    how = {"filter_type": "bilinear", "wrap_mode": texture.wrap[0]}
    return {"type": "bitmap", "filename": file, "raw": True, **how}


def _material(item: Object, scale: float, color: Described) -> Described:
    """Interface and medium behind it; or diffuse reflection of a color."""
    if (medium := item.medium) is None:
        diffuse = {"type": "diffuse", "reflectance": color}
        one_sided = item.surface is not None and not item.surface.double_sided
        return {"bsdf": diffuse if one_sided else {"type": "twosided", "bsdf": diffuse}}
    roughness = 0.0 if item.surface is None else item.surface.roughness
    bsdf: Described = {"type": "null"}
    if medium.ior != 1.0:
        bsdf = {"type": "dielectric", "int_ior": float(medium.ior), "ext_ior": 1.0}
        if roughness:
            bsdf |= {"type": "roughdielectric", "distribution": "ggx", "alpha": float(roughness) ** 2}
    extinction = medium.extinction
    if not (largest := float(extinction.max())):
        return {"bsdf": bsdf}
    albedo = np.asarray(medium.scattering) / np.where(extinction > 0, extinction, 1.0)
    interior = {
        "type": "homogeneous",
        "albedo": _rgb(albedo),
        "sigma_t": _rgb(extinction / largest),
        "scale": largest / scale,
        "phase": {"type": "hg", "g": float(medium.anisotropy)},
    }
    return {"bsdf": bsdf, "interior": interior}


def _light(light: Any, scale: float) -> Described:
    if isinstance(light, DirectionalLight):
        direction = np.asarray(light.direction).tolist()
        return {"type": "directional", "direction": direction, "irradiance": _rgb(light.irradiance)}
    position = (scale * np.asarray(light.position)).tolist()
    if isinstance(light, SphereLight):
        # pi r^2 L in each direction
        radiance = _rgb(np.asarray(light.intensity) / (math.pi * light.radius**2))
        emitter = {"type": "area", "radiance": radiance}
        return {"type": "sphere", "center": position, "radius": scale * light.radius, "emitter": emitter}
    return {"type": "point", "position": position, "intensity": _rgb(scale**2 * np.asarray(light.intensity))}


def _environment(environment: Environment) -> tuple[Described, Array | None]:
    """Emitter, and the pixels (h, w, 3) of its picture, if it has one."""
    if environment.kind == "constant":
        return {"type": "constant", "radiance": _rgb(environment.first)}, None
    pixels = np.asarray(environment.light_map.pixels, dtype=np.float32)
    # Ours are at odd ones of 2 h + 1 rows; beyond the first and the last they are constant.
    below = np.concatenate([pixels, pixels[-1:]])
    rows = np.empty((2 * len(pixels) + 1, *pixels.shape[1:]), np.float32)
    rows[1::2] = pixels
    rows[0::2] = 0.5 * (below + np.concatenate([pixels[:1], pixels]))
    turn = math.radians(180.0 + environment.rotation)
    cosine, sine = math.cos(turn), math.sin(turn)
    to_world = [[cosine, 0.0, sine, 0.0], [0.0, 1.0, 0.0, 0.0], [-sine, 0.0, cosine, 0.0], [0.0, 0.0, 0.0, 1.0]]
    described = {"type": "envmap", "filename": "environment.pfm", "scale": environment.scale, "to_world": to_world}
    return described, rows


def _write_mesh(item: Object, scale: float, path: Path) -> None:
    """Write the triangles of an object in the world, each with its own corners and their normals, facing outwards."""
    mesh, matrix = item.mesh, item.matrix
    corners = scale * (mesh.vertices[mesh.faces] @ matrix[:3, :3].T + matrix[:3, 3])
    normals = corner_normals(mesh) @ np.linalg.inv(matrix[:3, :3])
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), np.finfo(np.float64).tiny)
    if mesh.diagnosis.inverted:
        normals = -normals
    columns = [corners, normals]
    if (texture := _color_texture(item)) is not None:
        assert mesh.uv is not None
        u, v = np.moveaxis(mesh.uv[mesh.faces] @ texture.rows[:, :2].T + texture.rows[:, 2], -1, 0)
        columns.append(np.stack([u, 1.0 - v], axis=-1))
    vertices = np.concatenate(columns, axis=-1)
    if item.faces_inwards:
        vertices = vertices[:, ::-1]
    faces = np.empty(len(corners), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    faces["count"], faces["corners"] = 3, np.arange(3 * len(corners)).reshape(-1, 3)
    properties = ("x", "y", "z", "nx", "ny", "nz", "u", "v")[: vertices.shape[-1]]
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {3 * len(corners)}",
        *(f"property float {name}" for name in properties),
        f"element face {len(corners)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    path.write_bytes("\n".join(header).encode() + vertices.astype("<f4").tobytes() + faces.tobytes())


def _write_pfm(pixels: Array, path: Path) -> None:
    """Write linear radiance as a Portable Float Map: float32, the last row first."""
    height, width = pixels.shape[:2]
    path.write_bytes(f"PF\n{width} {height}\n-1.0\n".encode() + pixels[::-1].astype("<f4").tobytes())


def beyond_mitsuba(scene: Scene) -> Iterator[tuple[str, str]]:
    """Features of a scene that Mitsuba lacks, each with advice."""
    solids = [body for body in scene.bodies if body.sheet_thickness is None]
    groups = (
        (
            [body for body in scene.bodies if body.density is not None],
            "a varying density cannot be written for Mitsuba",
            "use a constant density, or tl.reference.path_trace for a reference picture",
        ),
        (
            [body for body in scene.bodies if body.sheet_thickness is not None],
            "thin-walled sheets have no inside for a medium",
            "model the thickness of the sheets, or omit them",
        ),
        (
            [scene.objects[i] for i in open_bodies(scene)],
            "the mesh is not closed, so the medium of a ray is not known",
            "close the meshes",
        ),
        (
            [body for body in scene.bodies if body.medium is not None and body.medium.emits],
            "Mitsuba cannot render this emission",
            "omit the emission",
        ),
        (
            [body for body in scene.bodies if body.medium is not None and body.medium.phase is not None],
            "only the Henyey-Greenstein phase function can be written",
            "use the parameter anisotropy instead of phase",
        ),
    )
    for items, found, do in groups:
        if items:
            yield f"{object_names(items)}: {found}", do
    for item in scene.objects:
        if said := _beyond_surface(item):
            do = "use a ground of one color" if item.shadow_catcher else "omit this property"
            more = ", or no stage" if item.shadow_catcher else ""
            yield f"{item.mesh.name!r}: its surface has {said}, which cannot be written", do + more
    if (pair := overlapping_pair(solids)) is not None:
        names = object_names([solids[i] for i in pair])
        found = f"{names}: these bodies may overlap, and Mitsuba has no rule for overlaps"
        yield found, "move the bodies apart"
    for light in scene.lights:
        if not isinstance(light, (PointLight, DirectionalLight, SphereLight)):
            kind = (
                "Mitsuba's spot lights have another falloff" if isinstance(light, SpotLight) else type(light).__name__
            )
            yield kind, "use a tl.PointLight"
    if np.asarray(scene.ambient).any():
        yield "ambient radiance stands for light that path tracing finds itself", "omit ambient"
    if scene.environment.kind == "checkerboard":
        yield "a checkerboard environment has no directions", "use tl.Environment.image or gradient"
    if scene.environment.background is not None:
        yield "the visible background differs from the environment that lights the scene", "omit the background"
    if scene.camera.window is not None:
        yield "the camera shows only a part of a larger picture", "use the camera of the whole picture"
    if scene.camera.fov_y is not None and any(abs(body.winding_number(scene.camera.eye)) > 0.5 for body in solids):
        yield "the camera is inside a body", "move the camera outside"


def _beyond_surface(item: Object) -> str:
    """Properties of a surface that cannot be written for Mitsuba, listed."""
    if (surface := item.surface) is None:
        return "colors of vertices" if item.mesh.colors is not None else ""
    default = Surface()
    names = ["clearcoat", "iridescence"]
    if item.medium is not None:
        names += ["transmission", "dispersion"]
    else:
        names += ["diffuse_transmission", "metallic", "alpha_cutoff"]
    found = [name for name in names if getattr(surface, name) != getattr(default, name)]
    if item.medium is None and surface.ior != 1.0:
        found.append("a coat with an ior")
    if item.medium is not None and not np.array_equal(surface.color, default.color):
        found.append("color")
    if surface.glows:
        found.append("emissive")
    held = [name for name in TEXTURE_FIELDS if getattr(surface, name) is not None]
    if item.medium is None and held == ["color_texture"] and surface.color_texture is not None:
        if len(set(surface.color_texture.wrap)) > 1:
            found.append("a texture that repeats along only one axis")
    elif held:
        found.append("textures")
    if item.mesh.colors is not None:
        found.append("colors of vertices")
    return " and ".join(found)
