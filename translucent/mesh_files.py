"""Meshes from files, all parts of a file in one: glTF by the toolkit's own reader, the others by trimesh.

trimesh gets an open file and nothing to follow links with: what an .obj or .ply says of materials and pictures has no
meaning for a mesh. Archives are no meshes, though trimesh unpacks them.
"""

from __future__ import annotations

import logging
import os
import re
import warnings
import zipfile
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from translucent.arguments import checked_but, require_path
from translucent.errors import InputError
from translucent.files.paths import require_file
from translucent.files.reading import open_file, require_memory, require_room, shown, size_text
from translucent.geometry.foreign import foreign_name, foreign_parts, unit_of
from translucent.geometry.mesh import PER_TRIANGLE, Mesh, Triangles, adopted, joined, mended
from translucent.gltf.load import read_whole
from translucent.threads import import_trimesh
from translucent.units import metres_per_unit, scale_to

# Without a handler of its own, what trimesh logs of a damaged file is printed.
logging.getLogger("trimesh").addHandler(logging.NullHandler())

#: Bytes of memory that loading and diagnosing take at most for each byte of a text file, and for each triangle of a
#: binary file that brings its own corners (measured by tools/measure_loading.py; see geometry/mesh.py for the others).
_PER_BYTE, PER_SOUP_TRIANGLE = 8, 350

#: Bytes at the beginning of a file in which its numbers of vertices and faces are looked for.
_HEADER = 1 << 13

#: Formats of trimesh that are archives.
_ARCHIVES = {"zae", "zip"}

#: Formats of glTF, which trimesh is not asked for: importing it takes longer than reading a small file.
_GLTF = {"glb", "gltf"}

#: Formats that trimesh reads into arrays of vertices and faces, without transforms.
_PLAIN = {"obj", "off", "ply", "stl"}

#: Headers of binary .ply files with nothing but triangles, and the types of their numbers.
_PLY = re.compile(
    rb"ply\nformat binary_little_endian 1\.0\n(?:comment .*\n)*element vertex (\d{1,9})\n"
    rb"property (float|double) x\nproperty \2 y\nproperty \2 z\n"
    rb"element face (\d{1,9})\nproperty list uchar (ushort|int|uint) vertex_ind(?:ices|ex)\nend_header\n"
)
_PLY_TYPES = {b"float": "<f4", b"double": "<f8", b"ushort": "<u2", b"int": "<i4", b"uint": "<u4"}

#: Suffixes of the native files of programs that can all export .glb.
_SCENES_OF_PROGRAMS = (
    ".blend",
    ".fbx",
    ".max",
    ".ma",
    ".mb",
    ".c4d",
    ".skp",
    ".usd",
    ".usda",
    ".usdc",
    ".usdz",
    ".abc",
)


@checked_but("path")
def load_mesh(
    path: Any,
    unit: str | None = None,
    *,
    allow_outside: bool = False,
    height: float | None = None,
    longest: float | None = None,
) -> Mesh:
    """Read a triangle mesh from a file, or take one of another library, weld it and wind it consistently.

    Parameters
    ----------
    path : path, trimesh.Trimesh, trimesh.Scene, pyvista.PolyData or any object with vertices and faces
        Of files what trimesh reads: obj, stl, ply, glb, gltf, off and more. The parts of a scene become one mesh, where
        its transforms place them.
    unit : str, optional
        Unit of the coordinates, or a length such as ``25mm``. Default: that of the object where it has one, as
        ``mesh.units`` of trimesh, or else m. glTF is in metres by definition; another unit rescales it.
    allow_outside : bool
        Whether the buffers of a .gltf file may lie outside its folder: only for files that you trust.
    height, longest : float, optional
        Extent along +Y, or of the longest side, in metres, that the mesh is scaled to, whatever the unit of its file.

    Returns
    -------
    Mesh
        In metres. Vertices within 1e-6 of the diagonal are one (with equal uv: seams stay); faces are wound alike per
        part, and closed parts outwards. `repairs` says what was done; a changed winding is also a `TranslucentWarning`.
        Of a file or object that names no unit, `assumed_unit` says which one was assumed.

    Raises
    ------
    InputError
        If the file is missing, unreadable, has no faces, has coordinates that are not finite, or would take more memory
        than is free; if more than one of unit, height and longest is given; if faces of an object are no triangles, or
        its unit is not known.
    """
    stated = [name for name, value in (("unit", unit), ("height", height), ("longest", longest)) if value is not None]
    if len(stated) > 1:
        raise InputError(
            f"load_mesh {stated[0]}", f"{stated[1]} is given, too, and both set the size", "use only one of them"
        )
    parts = None if isinstance(path, str | Path) else foreign_parts(path)
    if parts is not None:
        name = foreign_name(path)
        (scale, assumed), (vertices, faces, uv) = unit_of(path, unit), joined(parts, f"mesh {name!r}")
    else:
        require_path("load_mesh path", path, "a path, or an object with vertices and faces")
        path = Path(path)
        name, scale = path.name, metres_per_unit(unit or "m")
        assumed = "" if path.suffix[1:].lower() in _GLTF else "m"
        vertices, faces, uv = _read(path, allow_outside)
    if height is not None or longest is not None:
        scale = scale_to(adopted(vertices, faces, uv, name).bounds, height, longest, name)
    assumed = "" if stated else assumed
    raw = adopted(vertices if scale == 1 else vertices * scale, faces, uv, name, assumed_unit=assumed)
    raw.require_finite()
    return mended(raw)


def _read(path: Path, allow_outside: bool) -> Triangles:
    asked = f"mesh {str(path)!r}"
    require_file(path, asked)
    suffix = path.suffix[1:].lower()
    if suffix not in _GLTF | _PLAIN and suffix not in mesh_formats():
        do = (
            "export it as .glb" if path.suffix.lower() in _SCENES_OF_PROGRAMS else "use glb, gltf, obj, stl, ply or off"
        )
        raise InputError(asked, f"the mesh format {path.suffix or 'without suffix'!r} is not supported", do)
    return read_triangles(path, asked, allow_outside)


def mesh_formats() -> set[str]:
    """Suffixes of the files that can be read, without their dots."""
    return set(import_trimesh("trimesh.exchange.load").mesh_formats()) - _ARCHIVES


def read_triangles(path: Path, asked: str, allow_outside: bool = False) -> Triangles:
    """Vertices (n, 3), faces (m, 3), and texture coordinates (n, 2) if all parts have some.

    Parameters
    ----------
    path : Path
    asked : str
        What errors say was asked for.
    allow_outside : bool
        Whether the buffers of a glTF file may lie outside its folder.

    Raises
    ------
    InputError
        If the file cannot be read, or has no triangles.
    """
    if path.suffix[1:].lower() in _GLTF:
        return read_whole(path, allow_outside)
    with open_file(path, asked) as stream, warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        _require_archive_room(stream, asked)
        _require_free(stream, path.suffix[1:].lower(), asked)
        try:
            return joined([part for part in _parts(stream, path.suffix[1:].lower()) if len(part[1])], asked)
        except InputError:
            raise
        except Exception as error:  # each of trimesh's readers raises its own kinds
            raise InputError(asked, f"the file cannot be read ({shown(error)})", "export the mesh again") from error


def _parts(stream: BinaryIO, kind: str) -> list[Triangles]:
    """Triangles of each part of a file. Plain .ply files need no trimesh, whose import takes long."""
    if kind == "ply" and (found := _plain_ply(stream)) is not None:
        return [found]
    trimesh, loaders = import_trimesh(), import_trimesh("trimesh.exchange.load").mesh_loaders
    known = {"skip_materials": True} if kind in ("obj", "ply") else {}
    if kind in _PLAIN:
        # Copying what they hold into a scene and out of it takes longer than reading.
        content = loaders[kind](stream, file_type=kind, resolver=_NoLinks(), **known)
        listed = list(content["geometry"].values()) if kind == "obj" and "geometry" in content else [content]
        if all(_is_plain(one) for one in listed):
            return [_triangles(one["vertices"], one["faces"], one.get("visual")) for one in listed]
        stream.seek(0)
    scene = trimesh.load_scene(stream, file_type=kind, resolver=_NoLinks(), process=False, **known)
    return foreign_parts(scene) or []


def _plain_ply(stream: BinaryIO) -> Triangles | None:
    """Triangles of a binary .ply file that holds nothing else; None for any other file, damaged ones included."""
    content = stream.read()
    stream.seek(0)
    if (header := _PLY.match(content)) is None:
        return None
    corner, index = np.dtype(_PLY_TYPES[header[2]]), np.dtype(_PLY_TYPES[header[4]])
    face = np.dtype([("corners", "u1"), ("vertices", index, 3)])
    vertices, faces, begin = int(header[1]), int(header[3]), header.end()
    if len(content) != begin + 3 * corner.itemsize * vertices + face.itemsize * faces:
        return None
    positions = np.frombuffer(content, corner, 3 * vertices, begin).reshape(-1, 3)
    listed = np.frombuffer(content, face, faces, begin + positions.nbytes)
    if (listed["corners"] != 3).any() or listed["vertices"].max(initial=0) >= vertices:
        return None
    return positions.astype(np.float64), listed["vertices"].astype(np.int32), None


def _is_plain(content: dict[str, Any]) -> bool:
    """True if a part is a mesh of triangles as they are stored."""
    vertices, faces = content.get("vertices"), content.get("faces")
    return (
        isinstance(vertices, np.ndarray)
        and isinstance(faces, np.ndarray)
        and faces.dtype.kind in "iu"
        and (vertices.ndim, faces.ndim) == (2, 2)
        and (vertices.shape[1], faces.shape[1]) == (3, 3)
    )


def _triangles(vertices: Any, faces: Any, visual: Any) -> Triangles:
    vertices, faces = np.array(vertices, dtype=np.float64, order="C"), np.array(faces, dtype=np.int32, order="C")
    uv = getattr(visual, "uv", None)
    return vertices, faces, None if uv is None or len(uv) != len(vertices) else np.array(uv, dtype=np.float64)


def _require_archive_room(stream: BinaryIO, asked: str) -> None:
    """Raise `InputError` if a file in an archive format, such as 3MF, unpacks into too much data."""
    if stream.read(4) == b"PK\3\4":
        try:
            size = sum(member.file_size for member in zipfile.ZipFile(stream).infolist())
        except Exception as error:  # zipfile raises whatever its parts do
            raise InputError(asked, f"the file cannot be read ({shown(error)})", "export the mesh again") from error
        require_room(asked, "its parts", size, os.fstat(stream.fileno()).st_size)
    stream.seek(0)


def _require_free(stream: BinaryIO, kind: str, asked: str) -> None:
    """Raise `InputError` if a mesh needs more memory than is free, estimated from the header of its file."""
    size = os.fstat(stream.fileno()).st_size
    found, needed = f"{size_text(size)} of text", _PER_BYTE * size
    head = stream.read(_HEADER)
    if kind == "stl" and len(head) >= 84 and 84 + 50 * (count := int.from_bytes(head[80:84], "little")) == size:
        found, needed = f"its {count} triangles", PER_SOUP_TRIANGLE * count
    elif kind == "ply" and (stated := re.search(rb"element face (\d{1,18})\s", head)) and b"format binary" in head:
        # No face takes less than 13 bytes: of a count that is not true, the reader tells.
        count = min(int(stated[1]), size // 13)
        found, needed = f"its {count} faces", PER_TRIANGLE * count
    stream.seek(0)
    require_memory(asked, found, needed, "close other programs, or decimate the mesh")


class _NoLinks:
    """Resolver that refuses trimesh every file that a mesh links to."""

    file_name = None

    def get(self, name: str) -> bytes:
        raise FileNotFoundError(name)

    __getitem__ = get
