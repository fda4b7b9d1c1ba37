"""Results of thickness bakes, as maps and as values per vertex: their data, and their files.

Each file appears complete, with its record beside it, or not at all:

==========  =========================================================================================
file        holds
==========  =========================================================================================
.exr        float32: ``Y`` the values, ``standard_error.Y``, ``coverage.Y``; or ``Y`` alone; unit, mode,
             settings in its header
.npy        float32: the values
.npz        ``values``, ``standard_error``, ``coverage``, ``scale``, ``offset``
.png        16-bit gray; scale, offset, unit and mode in its text chunks
.glb        the mesh with its UVs and a volume material, 8 bits in the G channel of the thickness texture
.ply        of thickness per vertex: the mesh with a float property ``thickness``
==========  =========================================================================================

Where the UVs were made for the map, ``thickness.exr.uv.glb`` is the mesh that has them, in metres.

Row 0 is the top of the image. The encoding of values, and their record: `translucent.bake.record`.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from translucent.arguments import checked
from translucent.arrays import Array, Floats, Mask
from translucent.bake.gltf_builder import GlbBuilder, mesh_file
from translucent.bake.gltf_targets import PrimitiveKey, Target, nearest, positions_of
from translucent.bake.record import (
    Encoding,
    Record,
    add_record,
    fingerprint,
    mesh_record,
    plain,
    read_record,
    write_record,
)
from translucent.bake.settings import DEFINITIONS, BakeSettings
from translucent.errors import InputError, RenderError, TranslucentError
from translucent.extras import require_package
from translucent.files.images import (
    open_picture,
    read_array,
    read_arrays,
    read_exr,
    write_exr,
    write_npy,
    write_npz,
    write_png,
)
from translucent.files.paths import OutputFiles, require_file, require_output, write_atomically
from translucent.files.reading import open_file, read_bytes
from translucent.geometry.mesh import Mesh
from translucent.gltf.file import GltfFile, fill_gltf, write_gltf
from translucent.media.medium import Medium
from translucent.threads import import_trimesh

MAP_SUFFIXES = (".exr", ".png", ".npy", ".npz", ".glb")
VERTEX_SUFFIXES = (".ply", ".glb", ".npy")

#: Suffix, after the name of a map, of the mesh with the UVs that were made for it.
UV_SUFFIX = ".uv.glb"

#: Largest levels of a 16-bit PNG, and of the 8-bit channel of a glTF texture.
PNG_LEVELS, GLTF_LEVELS = 65535, 255
#: Prefix of the text chunks of a PNG.
PNG_PREFIX = "translucent:"

#: Attribute of glTF vertices with their thickness in units of the file; no extension reads it.
ATTRIBUTE = "_THICKNESS"


@dataclass(frozen=True, kw_only=True)
class BakeReport:
    """Report of a bake.

    Attributes
    ----------
    rays : int
        Traced, those included that went on behind a first surface.
    seconds : float
        From call to result.
    mrays_per_second : float
    samples : int
        Points of the surface from which rays started.
    texels : int
        With a value of their own, before padding; 0 for vertices.
    overlapping_texels : int
        Whose center is inside several triangles in UV; the first triangle has it.
    faces_without_texel : int
        Triangles so small in UV that other triangles have all texels which they touch.
    degenerate_faces : int
        Triangles without area; they are left out.
    udim_tiles : tuple of int
        Tiles that the UVs lie in, 1001 being 0 <= u, v <= 1.
    uv_from : str
        "mesh", "xatlas", or "" for vertices.
    escaped : float
        Fraction of the rays that left the mesh without an exit.
    missed : float
        Fraction of the samples from which no surface of the high mesh was found.
    mean_standard_error, max_standard_error : float
        Over texels or vertices with a value, in its unit.
    above_tolerance : int
        Samples whose standard error is still above the tolerance after the last ray they may have.
    warnings : tuple of str
    """

    rays: int
    seconds: float
    mrays_per_second: float
    samples: int
    texels: int = 0
    overlapping_texels: int = 0
    faces_without_texel: int = 0
    degenerate_faces: int
    udim_tiles: tuple[int, ...] = ()
    uv_from: str = ""
    escaped: float
    missed: float = 0.0
    mean_standard_error: float
    max_standard_error: float
    above_tolerance: int
    warnings: tuple[str, ...] = ()

    def summary(self) -> Record:
        """Report as values that JSON can hold."""
        return {**asdict(self), "udim_tiles": list(self.udim_tiles), "warnings": list(self.warnings)}


@dataclass(frozen=True, eq=False)
class ThicknessMap:
    """Baked thickness map, from `translucent.bake_thickness`.

    Attributes
    ----------
    values : (h, w) float32
        Metres, but dimensionless for mode "local". Row 0 is the top of the image: v = 1 as trimesh and OBJ count,
        v = 0 in glTF. Padded beyond `coverage`; 0 elsewhere.
    coverage : (h, w) bool
        Texels that a triangle touches, before padding.
    standard_error : (h, w) float32
        Of `values`, in their unit; 0 where a mode takes no samples, and beyond `coverage`.
    escaped : float
        Fraction of rays that left the mesh without an exit: above 0 for meshes with holes.
    mesh : Mesh
        With the uv that the map belongs to; new ones where the mesh that was given had none.
    settings : BakeSettings
    report : BakeReport
    """

    values: Floats
    coverage: Mask
    standard_error: Floats
    escaped: float
    mesh: Mesh
    settings: BakeSettings
    report: BakeReport

    @checked
    def save(self, path: str | Path) -> None:
        """Write the map as .exr, .png, .npy or, into a copy of the model, .glb.

        Raises
        ------
        InputError
            If the suffix is not known.
        RenderError
            If the file cannot be written.
        """
        save_map(self, Path(path))

    def record(self, encoding: Encoding) -> Record:
        """Description: definition, unit, range, encoding, settings, report and mesh."""
        height, width = self.values.shape
        return {
            "kind": "thickness map",
            **_described(self, self.values[self.coverage], encoding),
            "size": [width, height],
            "covered_texels": int(np.count_nonzero(self.coverage)),
            "escaped": float(self.escaped),
        }


@dataclass(frozen=True, eq=False)
class VertexThickness:
    """Thickness per vertex, from `translucent.bake_vertex_thickness`.

    Attributes
    ----------
    values : (n,) float32
        Metres, but dimensionless for mode "local"; 0 for vertices of no face. Vertices at one position are equal.
    standard_error : (n,) float32
        Of `values`, in their unit.
    mesh : Mesh
    settings : BakeSettings
    report : BakeReport
    """

    values: Floats
    standard_error: Floats
    mesh: Mesh
    settings: BakeSettings
    report: BakeReport

    @checked
    def save(self, path: str | Path) -> None:
        """Write the values as .ply or .glb attribute, or as .npy.

        Raises
        ------
        InputError
            If the suffix is not known.
        RenderError
            If the file cannot be written.
        """
        save_vertices(self, Path(path))

    def record(self, encoding: Encoding) -> Record:
        """Description: definition, unit, range, encoding, settings, report and mesh."""
        return {"kind": "vertex thickness", **_described(self, self.values, encoding)}


def _described(result: ThicknessMap | VertexThickness, values: Floats, encoding: Encoding) -> Record:
    """Common part of the records of maps and vertices, with the range of these values."""
    settings = result.settings
    spread = None
    if values.size:
        spread = {"min": float(values.min()), "median": float(np.median(values)), "max": float(values.max())}
    return {
        "mode": settings.mode,
        "definition": DEFINITIONS[settings.mode],
        "unit": settings.unit,
        "range": spread,
        "encoding": encoding.summary(),
        "settings": plain(settings.summary()),
        "report": plain(result.report.summary()),
        "mesh": mesh_record(result.mesh),
    }


def shared(parts: list[Record]) -> Record:
    """Common entries of all parts of one bake, for the head of their record."""
    return {key: parts[0][key] for key in ("kind", "mode", "definition", "unit", "settings")}


def check_map_output(
    path: Path, suffixes: tuple[str, ...] = MAP_SUFFIXES, *, normalize: bool = False, invert: bool = False
) -> str:
    """Check the output path of a map before any work is done, as `save_map` does; returns the suffix in lower case."""
    requested, suffix = f"output {str(path)!r}", path.suffix.lower()
    others = [other for other in suffixes if other != ".exr"]
    if suffix not in suffixes:
        *more, last = suffixes
        known = f"{', '.join(more)} or {last}" if more else last
        raise InputError(requested, f"suffix {path.suffix!r}", f"use {known}")
    require_output(path, requested)
    if not os.access(path.parent, os.W_OK):
        raise RenderError(requested, f"the folder {str(path.parent)!r} is read-only", "choose another folder")
    if suffix == ".glb" and (normalize or invert):
        raise InputError(
            requested, "glTF always stores fractions of the largest thickness", "omit --normalize and --invert"
        )
    if suffix == ".exr":
        require_package("OpenEXR", requested, f"write {' or '.join(others)}" if others else "")
    return suffix


def save_map(
    result: ThicknessMap,
    path: str | Path,
    *,
    normalize: bool = False,
    invert: bool = False,
    values_only: bool = False,
    about: Record | None = None,
) -> Record:
    """Write a thickness map and its record, and, if it has new UVs, the mesh with these UVs.

    Parameters
    ----------
    result : ThicknessMap
    path : path
        One of the module's table, not ``.ply``.
    normalize : bool
        Store fractions of the largest value. A PNG always does; what turns them into metres is in file and record.
    invert : bool
        Store 1 minus that fraction, the translucency that some engines want.
    values_only : bool
        An ``.exr`` file has the channel ``Y`` alone, as programs need that take three channels for red, green and blue.
    about : dict, optional
        More for the record, such as where the mesh is from.

    Returns
    -------
    dict
        The record.

    Raises
    ------
    InputError
        If the suffix is another one, the folder is missing, or the file cannot hold what is requested.
    RenderError
        If a file cannot be written, or ``.exr`` is requested without the OpenEXR package.
    """
    path = Path(path)
    if check_map_output(path, normalize=normalize, invert=invert) == ".glb":
        return write_maps(GlbBuilder(mesh_file(result.mesh)), path, {(0, 0): result}, about=about)
    about = dict(about or {})
    with OutputFiles() as files:
        if result.report.uv_from == "xatlas":
            about["uv_file"] = add_uv_file(files, mesh_file(result.mesh), path)
        storing = {"normalize": normalize, "invert": invert, "values_only": values_only}
        return add_map(files, result, path, **storing, about=about)


def add_map(
    files: OutputFiles,
    result: ThicknessMap,
    path: Path,
    *,
    normalize: bool,
    invert: bool,
    values_only: bool = False,
    about: Record,
    largest: float | None = None,
) -> Record:
    """Write a map as an image, with its record beside it, as a part of `files`; returns the record.

    Fractions are those of `largest`, by default the largest value.
    """
    suffix = check_map_output(path, normalize=normalize, invert=invert)
    levels = PNG_LEVELS if suffix == ".png" else 0
    of = result.values if largest is None else np.array([largest])
    encoding = Encoding.of(of, levels, normalize=normalize, invert=invert, unit=result.settings.unit)
    filled = files.write(path, partial(_fill, result=result, encoding=encoding, suffix=suffix, alone=values_only))
    return add_record(files, path, {**fingerprint(path, filled), **about, **result.record(encoding)})


def _fill(path: Path, result: ThicknessMap, encoding: Encoding, suffix: str, alone: bool) -> None:
    """Write the file of a map, without its record; an .exr file has values `alone`, or errors too."""
    settings, values = result.settings, encoding.encode(result.values)
    definition = DEFINITIONS[settings.mode]
    stated = {
        "unit": encoding.unit,
        "mode": settings.mode,
        # OpenEXR keeps a Python float as a float32; text has all digits.
        "scale": repr(encoding.scale),
        "offset": repr(encoding.offset),
        "seed": int(settings.seed),
        "settings": json.dumps(plain(settings.summary()), ensure_ascii=False),
    }
    errors, coverage = result.standard_error, result.coverage
    if suffix == ".exr":
        channels = {"Y": values} if alone else {"Y": values, "standard_error.Y": errors, "coverage.Y": coverage}
        comments = f"{definition}; value = offset + scale * Y in {encoding.unit}"
        write_exr(path, channels, {"comments": comments, **stated})
    elif suffix == ".npy":
        write_npy(path, values)
    elif suffix == ".npz":
        scale, offset = np.array(encoding.scale), np.array(encoding.offset)
        arrays = {"values": values, "scale": scale, "offset": offset}
        write_npz(path, {**arrays, "standard_error": errors, "coverage": coverage})
    else:
        text = {PNG_PREFIX + key: str(value) for key, value in stated.items()}
        write_png(path, values, {"Description": definition, **text})


def add_uv_file(files: OutputFiles, model: GltfFile, path: Path) -> Record:
    """Write a model with new UVs beside their map at `path`, together with other files; returns its name and hash."""
    uv_path = path.with_name(f"{path.name}{UV_SUFFIX}")
    return fingerprint(uv_path, files.write(uv_path, partial(fill_gltf, file=model, place=uv_path)))


def save_vertices(result: VertexThickness, path: str | Path, *, about: Record | None = None) -> Record:
    """Write thickness per vertex, and its record beside it.

    Parameters
    ----------
    result : VertexThickness
    path : path
        ``.ply``: the mesh with a property ``thickness``; ``.glb``: with an attribute ``_THICKNESS``; both float32.
        ``.npy``: (n,) float32.
    about : dict, optional
        More for the record.

    Raises
    ------
    InputError, RenderError
        As `save_map`.
    """
    path = Path(path)
    suffix = check_map_output(path, VERTEX_SUFFIXES)
    if suffix == ".glb":
        return write_vertices(GlbBuilder(mesh_file(result.mesh)), path, {(0, 0): result}, about=about)
    values = np.ascontiguousarray(result.values, dtype=np.float32)

    def fill(temporary: Path) -> None:
        if suffix == ".npy":
            write_npy(temporary, values)
            return
        trimesh = import_trimesh()

        mesh = trimesh.Trimesh(result.mesh.vertices, result.mesh.faces, process=False)
        mesh.vertex_attributes["thickness"] = values
        with np.errstate(all="ignore"):
            temporary.write_bytes(mesh.export(file_type="ply", include_attributes=True))

    write_atomically(path, fill)
    return write_record(path, {**(about or {}), **result.record(Encoding(unit=result.settings.unit))})


def write_maps(
    builder: GlbBuilder,
    path: Path,
    results: Mapping[PrimitiveKey, ThicknessMap],
    *,
    targets: Mapping[PrimitiveKey, Target] | None = None,
    metres: float = 1.0,
    medium: Medium | None = None,
    about: Record | None = None,
) -> Record:
    """Write a .glb whose materials have these maps, and its record beside it.

    Each primitive gets a material of its own, whose thicknessFactor is the largest value; max * G / 255 is then the
    thickness in mesh space. Standard errors are lost, and what is finer than max / 255, the record's quantum.

    Parameters
    ----------
    builder : GlbBuilder
    path : Path
        A .glb file.
    results : mapping of (mesh, primitive) to ThicknessMap
    targets : mapping, optional
        Which UVs the maps belong to. Default: TEXCOORD_0.
    metres : float
        Per unit of the file.
    medium : Medium, optional
        For materials that state no attenuation.
    about : dict, optional
        More for the record.

    Raises
    ------
    InputError
        If no map has any thickness, or they are of the mode that has no unit, or a material excludes a volume.
    RenderError
        If a file cannot be written.
    """
    records: list[Record] = []
    for key, result in results.items():
        if result.settings.unit != "m":
            raise InputError(
                f"output {str(path)!r}",
                f"values of mode {result.settings.mode!r} have no unit of length",
                "use a mode that bakes lengths",
            )
        encoding = Encoding.of(result.values, GLTF_LEVELS)
        one = {"place": list(key), **result.record(encoding)}
        if result.values.max() > 0:
            target = (targets or {}).get(key) or Target(key, result.mesh)
            factor = encoding.scale * encoding.levels / metres
            material = builder.own_material(*key)
            builder.let_light_in(material, medium, metres)
            levels, uv = encoding.encode(result.values), (target.tex_coord, target.keeps_transform)
            texture = builder.give_thickness(material, factor, levels, result.mesh, *uv)
            one |= {"material": material, "texture": texture, "thickness_factor": factor, "tex_coord": uv[0]}
        else:
            one["warnings"] = ["the thickness is 0, so the material stays unchanged"]
        records.append(one)
    if not any("material" in one for one in records):
        raise InputError(
            f"output {str(path)!r}", "the thickness is 0 at all points", "bake a closed mesh, which has an inside"
        )
    write_gltf(builder.file(), path)
    return write_record(path, {**(about or {}), **shared(records), "maps": records})


def write_vertices(
    builder: GlbBuilder,
    path: Path,
    results: Mapping[PrimitiveKey, VertexThickness],
    *,
    metres: float = 1.0,
    about: Record | None = None,
) -> Record:
    """Write a .glb whose vertices have their thickness as a float attribute, and its record beside it.

    Materials and everything else in the file stay as they are.

    Parameters
    ----------
    builder : GlbBuilder
    path : Path
        A .glb file.
    results : mapping of (mesh, primitive) to VertexThickness
        The vertices of their meshes may be in another order than those of the file, and welded: positions count.
    metres : float
        Per unit of the file.
    about : dict, optional
        More for the record.

    Raises
    ------
    InputError
        If the file's data are wrong.
    RenderError
        If a file cannot be written.
    """
    records: list[Record] = []
    for key, result in results.items():
        unit = result.settings.unit
        per_unit = metres if unit == "m" else 1.0
        attributes = builder.primitive(*key)["attributes"]
        values = result.values[nearest(result.mesh.vertices, positions_of(builder.file(), key) * metres)]
        with np.errstate(under="ignore"):
            attributes[ATTRIBUTE] = builder.add_accessor((values / per_unit).astype(np.float32))
        records.append({"place": list(key), "attribute": ATTRIBUTE, **result.record(Encoding(per_unit, unit=unit))})
    write_gltf(builder.file(), path)
    return write_record(path, {**(about or {}), **shared(records), "primitives": records})


@checked
def load_thickness_map(path: str | Path) -> Array:
    """Values of a map that `bake_thickness` or ``translucent bake`` wrote as .exr, .png, .npz or .npy.

    Normalized, inverted and 16-bit maps become what was baked again, up to their rounding. Of an .npy file, the record
    beside it says how; without a record, its values are taken as they are.

    Returns
    -------
    (h, w) float64
        Metres, but dimensionless for mode "local". Row 0 is the top of the image.

    Raises
    ------
    InputError
        If the file is missing, broken or of another kind, or says nothing of its scale.
    RenderError
        If ``.exr`` is to be read without the OpenEXR package.
    """
    path = Path(path)
    requested = f"thickness map {str(path)!r}"
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(requested, f"suffix {path.suffix!r}", f"give one of {', '.join(_READERS)}")
    require_file(path, requested)
    try:
        scale, offset, stored = reader(path, requested)
        return Encoding(float(scale), float(offset)).decode(stored)
    except TranslucentError:
        raise
    except Exception as error:  # each of the readers raises its own kinds
        raise InputError(
            requested, f"it cannot be read ({type(error).__name__}: {error})", "bake the map again"
        ) from error


def _read_exr(path: Path, requested: str) -> tuple[Any, ...]:
    header, channels = read_exr(path, requested)
    return header["scale"], header["offset"], channels["Y"]


def _read_png(path: Path, requested: str) -> tuple[Any, ...]:
    with open_picture(read_bytes(path, requested), requested, ("PNG",), per_pixel=16) as image:
        text, stored = getattr(image, "text", {}), np.array(image)
    if f"{PNG_PREFIX}scale" not in text:
        raise InputError(
            requested,
            "the image does not contain its scale from stored values to metres",
            "when you copy the image, keep its metadata",
        )
    if stored.ndim != 2 or stored.max(initial=0) > PNG_LEVELS:
        raise InputError(
            requested, "the image is not a 16-bit gray image", "give the file as the bake wrote it, without conversion"
        )
    return text[f"{PNG_PREFIX}scale"], text[f"{PNG_PREFIX}offset"], stored


def _read_npz(path: Path, requested: str) -> tuple[Any, ...]:
    return tuple(read_arrays(path, requested, ("scale", "offset", "values"), "bake it again").values())


def _read_npy(path: Path, requested: str) -> tuple[Any, ...]:
    with open_file(path, requested) as stream:
        stored = read_array(stream, os.fstat(stream.fileno()).st_size, requested, "bake it again")
    encoding = (read_record(path) or {}).get("encoding", {})
    return encoding.get("scale", 1.0), encoding.get("offset", 0.0), stored


#: By suffix, readers of scale, offset and stored values.
_READERS = {".exr": _read_exr, ".png": _read_png, ".npz": _read_npz, ".npy": _read_npy}
