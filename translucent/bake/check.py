"""Check of thickness maps: a body shaded with its map, as in a glTF viewer, and with its true thickness.

A rasterizing viewer looks the thickness up where the view ray hits the front of the surface, and takes it for the path
length of the light: t = map(uv of the first hit), whatever the direction of the view, and nothing for the bodies
behind. The truth is the path inside along the ray. Both pass light by exp(-sigma_t t), straight on.

The maps of a bake are read back from its files, after a check that their texture coordinates are those of the file
that they are for.

Source of the lookup: KHR_materials_volume, "Thickness Texture"; as in rasterizers without refraction, since here too
light goes straight.
"""

from __future__ import annotations

import dataclasses
import warnings
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask, Pixels
from translucent.bake.gltf_builder import wrapping
from translucent.bake.gltf_targets import Bodies, first_transforms, transformed
from translucent.bake.jobs import has_parts, stays_gltf
from translucent.bake.rays import barycentric, blend
from translucent.bake.record import Record, parts_of
from translucent.bake.thickness_map import load_thickness_map
from translucent.cpu.renderer import CpuRenderer
from translucent.errors import InputError, RenderError, TranslucentWarning
from translucent.files.paths import write_atomically
from translucent.formulas.color import linear_to_srgb
from translucent.frames.frame import Frame
from translucent.frames.metrics import Errors, compare
from translucent.geometry.mesh import Mesh
from translucent.geometry.ray_caster import RayCaster
from translucent.gltf.accessors import Accessors
from translucent.gltf.file import GltfFile, read_gltf
from translucent.gltf.materials import GltfMaterial, materials_of
from translucent.gltf.nodes import thickness_map
from translucent.gltf.textures import sample
from translucent.media.medium import Medium
from translucent.planning.plan import plan
from translucent.scene.camera import Camera
from translucent.scene.showcase import showcase
from translucent.threads import import_trimesh
from translucent.units import metres_per_unit

if TYPE_CHECKING:
    import numpy.typing as npt
    from PIL import Image

    from translucent.bake.jobs import Job, Results
    from translucent.bake.record import Record


#: Distance within which surfaces coincide, as a fraction of the diagonal.
SAME_POINT = 1e-4


#: Corners: positions (n, 3) in metres and texture coordinates (n, 2), v upwards, or none.
Corners = tuple[Array, Array | None]

#: Tolerances of positions, as fractions of the diagonal, and of texture coordinates.
SAME = 1e-4

#: Fraction of the vertices that may differ: those on seams that a repair has closed.
MOST_OTHERS = 0.01

#: Colors of the error: too thin, right, too thick (sRGB 0..255).
THIN, RIGHT, THICK = (30, 90, 200), (245, 245, 245), (200, 50, 30)

#: Largest number of rows of a picture.
MOST_ROWS = 12

#: Color of pixels without the body.
NO_BODY = (70, 70, 74)

_CAPTION = 26  # pixels


#: Errors of transmittance up to which a map looks so: what one sees in a picture alone, and beside the true one.
VERDICTS = (
    (0.05, "looks right"),
    (0.12, "looks similar, but the difference is visible side by side"),
    (float("inf"), "looks different; try --mode transmittance with a medium, more --rays, or trace rays at run time"),
)


class NotSeenError(InputError):
    """Error for a map whose surface no pixel shows."""


@dataclass(frozen=True, eq=False)
class MapCheck:
    """Check of a map: a body shaded with it and with the true thickness, from one view.

    Attributes
    ----------
    baked, true : Frame
    thickness, transmittance : Errors
        Of `baked` against `true`: metres, and 0..1 over the three channels.
    mean_thickness : float
        True one, over the same pixels, in metres.
    background : (h, w, 3)
        Radiance without the body.
    empty : float
        Fraction of these pixels at which the map has no value.
    """

    baked: Frame
    true: Frame
    thickness: Errors
    transmittance: Errors
    mean_thickness: float
    background: Array
    empty: float = 0.0

    def summary(self) -> dict[str, Any]:
        """Errors as values that JSON can hold."""
        return {
            "thickness": dataclasses.asdict(self.thickness),
            "transmittance": dataclasses.asdict(self.transmittance),
            "mean_thickness": self.mean_thickness,
            "empty": self.empty,
        }

    @property
    def verdict(self) -> str:
        """Whether the body looks right with the map, in a sentence."""
        off, bias = self.transmittance.rms, self.transmittance.bias
        sides = "" if abs(bias) < 0.5 * off else ", and too bright" if bias > 0 else ", and too dark"
        words = next(text for most, text in VERDICTS if off <= most)
        return f"verdict: {words}: the transmitted light is wrong by {off:.0%}{sides}"

    def __str__(self) -> str:
        scale = 100.0 / self.mean_thickness
        found, passed = self.thickness, self.transmittance
        bare = f"\n{self.empty:.1%} of the visible surface has no value in the map" if self.empty else ""
        return (
            f"thickness      rms {found.rms:.4g} m, {scale * found.rms:.3g} % of the mean {self.mean_thickness:.4g} m; "
            f"median {found.median:.4g} m, p99 {found.p99:.4g} m, bias {found.bias:+.4g} m\n"
            f"transmittance  rms {passed.rms:.4g}, median {passed.median:.4g}, p99 {passed.p99:.4g}, "
            f"bias {passed.bias:+.4g}{bare}\n{self.verdict}"
        )


def check_map(
    mesh: Mesh,
    values: npt.ArrayLike,
    medium: Medium | None = None,
    size: tuple[int, int] = (480, 480),
    camera: Camera | None = None,
    body: Mesh | None = None,
) -> MapCheck:
    """Compare shading with a thickness map to the truth.

    Parameters
    ----------
    mesh : Mesh
        With the uv that the map belongs to.
    values : array_like (h, w)
        Thickness in metres; row 0 is v = 1. Read bilinearly; beyond 0..1 it repeats.
    medium : Medium, optional
        Default: that of `showcase`.
    size : (width, height)
        Of the picture in pixels.
    camera : Camera, optional
        Default: from the front right and above, the whole mesh in view.
    body : Mesh, optional
        The closed body that the mesh is a part of; pixels that show other parts of it do not count.

    Raises
    ------
    InputError
        If the mesh has no uv, or no pixel shows both; `NotSeenError` if the rest of the body hides the mesh.
    RenderError
        If embreex is missing.
    """
    scene = showcase(body or mesh, medium, size, camera, stage="none")
    renderer = CpuRenderer()
    true = renderer.render(plan(scene, None, renderer.capabilities), size)
    renderer.close()
    directions = scene.camera.rays(size)[1]
    # Positions of pixel centers in the picture, in units of its height.
    across, down = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    background = scene.environment.radiance(directions, np.stack([across, down], axis=-1) / size[1])
    inside = scene.bodies[0].medium
    assert inside is not None  # a showcase has one
    visible = true.coverage & true.valid
    found = first_uv(mesh, scene.camera, size, body)
    covered = visible & np.isfinite(found).all(axis=-1)
    if body is not None and not covered.any():
        raise NotSeenError(f"check of {mesh.name!r}", "other parts of its body hide it", "give another camera")
    thickness = np.zeros(covered.shape)
    thickness[covered] = look_up(mesh, values, found[covered])
    with np.errstate(under="ignore"):
        depth = thickness[..., None] * inside.extinction
        passed = np.exp(-depth)
    baked = dataclasses.replace(
        true,
        thickness=thickness,
        optical_depth=depth,
        transmittance=passed,
        radiance=background * passed,
        coverage=covered,
    )
    errors = [compare(baked, true, quantity) for quantity in ("thickness", "transmittance")]
    mean = float(true.thickness[covered].mean(dtype=np.float64))
    empty = float(np.mean(thickness[covered] == 0))
    return MapCheck(baked, true, errors[0], errors[1], mean, background, empty)


def look_up(mesh: Mesh, values: npt.ArrayLike, uv: Array) -> Array:
    """(n,): a map at uv (n, 2), v upwards, as textures are read: between texels linearly."""
    coordinates = np.column_stack([uv[:, 0], 1.0 - uv[:, 1]])
    return sample(np.asarray(values, dtype=np.float64), coordinates, wrapping(mesh))


def first_uv(mesh: Mesh, camera: Camera, size: tuple[int, int], body: Mesh | None = None) -> Array:
    """(h, w, 2): uv where the ray of each pixel first hits the mesh, v upwards; NaN where it does not.

    Nor where other parts of the body are in front of it.

    Raises
    ------
    InputError
        If the mesh has no uv.
    """
    if mesh.uv is None:
        raise InputError(
            f"mesh {mesh.name!r}",
            "the mesh has no texture coordinates",
            "bake a map first, and check the mesh of the bake, which has texture coordinates",
        )
    visible = first_hits(mesh, camera, size, body)
    found = np.full((len(visible.hit), 2), np.nan)
    found[visible.hit] = blend(mesh.uv[mesh.faces[visible.face]], visible.weights)
    return found.reshape(size[1], size[0], 2)


@dataclass(frozen=True, eq=False)
class FirstHits:
    """First hits of the rays of pixels on a mesh.

    Attributes
    ----------
    hit : (h w,) bool
        Pixels whose rays do hit.
    face : (k,) int64
        For each of those.
    weights, points, directions : (k, 3)
        Barycentric weights of the hits, the hits, and directions of the rays.
    """

    hit: Mask
    face: Integers
    weights: Array
    points: Array
    directions: Array


def first_hits(mesh: Mesh, camera: Camera, size: tuple[int, int], body: Mesh | None = None) -> FirstHits:
    """First hits on a mesh, without hits behind other parts of its body."""
    face, distance = _first_faces(mesh, camera, size)
    hit = face >= 0
    if body is not None:
        with np.errstate(invalid="ignore"):
            hit &= distance <= _first_faces(body, camera, size)[1] + SAME_POINT * body.diagonal
    origins, directions = (part.reshape(-1, 3)[hit] for part in camera.rays(size))
    points = origins + distance[hit, None] * directions
    face = face[hit].astype(np.int64)
    return FirstHits(hit, face, barycentric(mesh.vertices[mesh.faces[face]], points), points, directions)


def _first_faces(mesh: Mesh, camera: Camera, size: tuple[int, int]) -> tuple[Integers, Array]:
    """(k,), (k,): the first face that the ray of each pixel hits, and the distance in metres; -1 and inf for none."""
    traced = RayCaster(mesh)
    origins, directions = (part.reshape(-1, 3) for part in camera.rays(size))
    starts = (origins - traced.center) / traced.radius
    # A far eye costs float32 its digits; begin where the ray comes near.
    ahead = np.maximum(-np.einsum("ki,ki->k", starts, directions) - 1.01, 0.0)
    face, distance = traced.first_hits(starts + ahead[:, None] * directions, directions)
    return face, np.where(face >= 0, traced.radius * (ahead + distance), np.inf)


def require_uv_of(corners: Corners, mesh: Mesh, path: Path) -> None:
    """Raise unless a map of `mesh` can be read with the texture coordinates in a file.

    Parameters
    ----------
    corners
        Of the file.
    mesh : Mesh
        As it was baked.
    path : Path
        The file, for the error.

    Raises
    ------
    RenderError
        If its vertices are not in the file, or have other texture coordinates there.
    """
    from scipy.spatial import cKDTree

    positions, uv = corners
    requested = f"check of the map of {mesh.name!r}"
    if uv is None:
        raise RenderError(requested, f"{str(path)!r} has no texture coordinates", "bake the map again with --unwrap")
    assert mesh.uv is not None
    with np.errstate(under="ignore"):
        known = cKDTree(np.column_stack([(positions - mesh.center) / mesh.diagonal, uv]))
        used = np.unique(mesh.faces)
        own = np.column_stack([(mesh.vertices[used] - mesh.center) / mesh.diagonal, mesh.uv[used]])
        distance, _ = known.query(own, p=np.inf)
    others = float(np.mean(distance > SAME))
    if others > MOST_OTHERS:
        found = f"{others:.0%} of the vertices have other texture coordinates in {str(path)!r}"
        raise RenderError(
            requested, found, "the thickness map was not baked for this file; bake it again with --unwrap"
        )


def own_corners(file: GltfFile, part: Record, metres: float, material: GltfMaterial | None = None) -> Corners:
    """Corners of a primitive in its own space; with a material, at the coordinates of its thickness texture."""
    accessors = Accessors(file)
    mesh, primitive = part["place"]
    attributes = file.item("meshes", mesh)["primitives"][primitive]["attributes"]
    tex_coord = part.get("tex_coord", 0) if material is None else material.thickness_transform.tex_coord
    positions = metres * accessors.vectors(attributes["POSITION"], "VEC3")
    if f"TEXCOORD_{tex_coord}" not in attributes:
        return positions, None
    uv = accessors.vectors(attributes[f"TEXCOORD_{tex_coord}"], "VEC2")
    if material is not None:
        uv = material.thickness_transform.apply(uv)
    return positions, np.column_stack([uv[:, 0], 1.0 - uv[:, 1]])


def placed_corners(file: GltfFile, part: Record, metres: float) -> Corners:
    """Corners of a primitive, placed by the first node that shows it."""
    matrix = _matrix(file, part)
    positions, uv = own_corners(file, part, metres)
    return positions @ matrix[:3, :3].T + metres * matrix[:3, 3], uv


def placed_around(file: GltfFile, part: Record, metres: float) -> Mesh | None:
    """Body that a primitive bounds together with others, placed by the first node that shows it."""
    around = Bodies(file, metres).around((part["place"][0], part["place"][1]))
    return None if around is None else transformed(around, _matrix(file, part), metres)


def _matrix(file: GltfFile, part: Record) -> Array:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TranslucentWarning)  # the bake has reported them
        return first_transforms(file).get(part["place"][0], np.eye(4))


def mesh_corners(path: Path, metres: float) -> Corners:
    """Corners of a mesh in any other file, as stored."""
    trimesh = import_trimesh()

    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        parts = trimesh.load_scene(path, process=False).dump()
    uv = [getattr(part.visual, "uv", None) for part in parts]
    known = [(np.asarray(part.vertices), one) for part, one in zip(parts, uv, strict=True) if one is not None]
    if not known:
        return np.zeros((0, 3)), None
    positions, coordinates = (np.concatenate(arrays) for arrays in zip(*known, strict=True))
    return metres * positions, np.asarray(coordinates, dtype=np.float64)


#: By the name of a mesh; None where the rest of its body hides it.
Checks = dict[str, MapCheck | None]


def check_output(job: Job, record: Record, results: Results) -> Checks:
    """Check each map that a job has written, quantized as in the file.

    Parameters
    ----------
    job, record, results
        As `bake_file` takes and returns them.

    Returns
    -------
    dict
        By the name of the mesh; None where the rest of its body hides it.

    Raises
    ------
    InputError
        If no map is visible.
    RenderError
        If a map does not belong to the texture coordinates in the file that it is for.
    """
    path = Path(job["output"])
    medium = None if job.get("medium") is None else Medium(absorption=job["medium"])
    inside_file = path.suffix.lower() == ".glb"
    found = (_check_glb if inside_file else _check_maps)(job, record, results, medium)
    if not any(found.values()):
        raise InputError(
            f"check of {str(path)!r}",
            "no visible surface of the model has a thickness map",
            "check a model whose material lets light in",
        )
    return found


def _check_glb(job: Job, record: Record, results: Results, medium: Medium | None) -> Checks:
    """Checks of the maps in a glTF file."""
    path = Path(job["output"])
    # A bake from another format into a .glb is in metres; a glTF file keeps its unit.
    metres = metres_per_unit(job.get("unit", "m")) if stays_gltf(job) else 1.0
    file = read_gltf(path)
    bodies, found = Bodies(file, metres), Checks()
    for part in record["maps"]:
        key = part["place"][0], part["place"][1]
        mesh, material = results[key].mesh, _material_at(file, part)
        if "material" not in part or material is None or (values := thickness_map(file, material)) is None:
            continue
        require_uv_of(own_corners(file, part, metres, material), mesh, path)
        name = mesh.name if mesh.name not in found else f"{mesh.name} ({key[0]})"
        found[name] = _check(mesh, metres * values, medium or _medium(material, metres), bodies.around(key))
    return found


def _check_maps(job: Job, record: Record, results: Results, medium: Medium | None) -> Checks:
    """Checks of maps in files of their own."""
    output, metres = Path(job["output"]), metres_per_unit(job.get("unit", "m"))
    uv_file = output.with_name(record["uv_file"]["file"]) if "uv_file" in record else None
    path, found = uv_file or Path(job["model"]), Checks()
    for part, result in zip(parts_of(record), results.values(), strict=True):
        mesh, inside, body = result.mesh, medium, None
        if has_parts(job):
            file = read_gltf(path)
            corners, body = placed_corners(file, part, metres), placed_around(file, part, metres)
            inside = medium or _medium(_material_at(file, part), metres)
        elif uv_file is not None:
            corners = own_corners(read_gltf(uv_file), {"place": [0, 0]}, 1.0)
        else:
            corners = mesh_corners(path, metres)
        require_uv_of(corners, mesh, path)
        name = mesh.name if mesh.name not in found else f"{mesh.name} ({part['file']})"
        found[name] = _check(mesh, load_thickness_map(output.with_name(part["file"])), inside, body)
    return found


def _check(mesh: Mesh, values: npt.ArrayLike, medium: Medium | None, body: Mesh | None) -> MapCheck | None:
    try:
        return check_map(mesh, values, medium, body=body)
    except NotSeenError:
        return None


def _material_at(file: GltfFile, part: Record) -> GltfMaterial | None:
    mesh, primitive = part["place"]
    index = file.item("meshes", mesh)["primitives"][primitive].get("material")
    return None if index is None else materials_of(file)[index]


def _medium(material: GltfMaterial | None, metres: float) -> Medium | None:
    """Medium of an object with this material, per metre of the world; None for clear ones, which would show nothing."""
    found = None if material is None else material.medium()
    return Medium(absorption=found.extinction / metres) if found is not None and found.extinction.any() else None


def write_picture(checks: list[MapCheck], path: Path) -> None:
    """Write the checks below each other as a PNG, which appears complete or not at all.

    Raises
    ------
    RenderError
        If it cannot be written.
    """
    write_atomically(path, partial(picture(checks).save, format="PNG"))


def picture(checks: list[MapCheck]) -> Image.Image:
    """Rows of the first checks: the look with the map, the true look, and the error of thickness with its scale."""
    return stacked([_row(check) for check in checks[:MOST_ROWS]])


def stacked(rows: list[Image.Image]) -> Image.Image:
    """Rows below each other."""
    from PIL import Image

    whole = Image.new("RGB", (max(row.width for row in rows), sum(row.height for row in rows)))
    top = 0
    for row in rows:
        whole.paste(row, (0, top))
        top += row.height
    return whole


def _row(check: MapCheck) -> Image.Image:
    scale = check.thickness.p99 or 1.0
    return labeled(
        ("with the map", look(check.baked.radiance)),
        ("true thickness along the view", look(check.true.radiance)),
        (f"map - true: blue -{scale:.2g} m .. red +{scale:.2g} m", _difference(check, scale)),
    )


def labeled(*panels: tuple[str, Pixels]) -> Image.Image:
    """Pictures of one size beside each other, each below its caption."""
    from PIL import Image, ImageDraw, ImageFont

    height, width = panels[0][1].shape[:2]
    row = Image.new("RGB", (width * len(panels), height + _CAPTION), (20, 20, 22))
    draw, font = ImageDraw.Draw(row), ImageFont.load_default(14)
    for number, (caption, pixels) in enumerate(panels):
        row.paste(Image.fromarray(pixels), (number * width, _CAPTION))
        draw.text((number * width + 6, 5), caption, fill=(230, 230, 230), font=font)
    return row


def look(radiance: npt.NDArray[np.floating]) -> Pixels:
    """(h, w, 3): linear radiance as sRGB."""
    linear = np.clip(np.asarray(radiance, dtype=np.float64), 0.0, 1.0)
    return np.rint(linear_to_srgb(linear) * 255.0).astype(np.uint8)


def _difference(check: MapCheck, scale: float) -> Pixels:
    error = (np.asarray(check.baked.thickness, np.float64) - check.true.thickness) / scale
    fraction = np.clip(np.abs(error), 0.0, 1.0)[..., None]
    ends = np.where(error[..., None] < 0, THIN, THICK)
    colors = np.asarray(RIGHT) * (1 - fraction) + ends * fraction
    visible = check.baked.coverage & check.true.coverage & check.true.valid
    return np.rint(np.where(visible[..., None], colors, NO_BODY)).astype(np.uint8)
