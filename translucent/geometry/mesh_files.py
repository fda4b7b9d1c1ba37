"""Triangles of mesh files, all parts of a file in one: glTF by the toolkit's own reader, the others by trimesh.

trimesh gets an open file and nothing to follow links with: what an .obj or .ply says of materials and pictures has no
meaning for a mesh. Archives are no meshes, though trimesh unpacks them.
"""

from __future__ import annotations

import os
import warnings
import zipfile
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from translucent.errors import InputError
from translucent.files.reading import open_file, require_room, shown

Array = npt.NDArray[np.float64]
Triangles = tuple[Array, npt.NDArray[np.int32], Array | None]

#: Formats of trimesh that are archives.
_ARCHIVES = {"zae", "zip"}


def mesh_formats() -> set[str]:
    """Suffixes of the files that can be read, without their dots."""
    from trimesh.exchange.load import mesh_formats

    return set(mesh_formats()) - _ARCHIVES


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
    if path.suffix.lower() in (".glb", ".gltf"):
        from translucent.gltf.whole import read_whole

        return read_whole(path, allow_outside)
    import trimesh

    with open_file(path, asked) as stream, warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        _require_archive_room(stream, asked)
        try:
            kind = path.suffix[1:].lower()
            known = {"skip_materials": True} if kind in ("obj", "ply") else {}
            scene = trimesh.load_scene(stream, file_type=kind, resolver=_NoLinks(), process=False, **known)
            parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh)]
            return joined([_part(part) for part in parts if len(part.faces)], asked)
        except InputError:
            raise
        except Exception as error:  # each of trimesh's readers raises its own kinds
            raise InputError(asked, f"it cannot be read ({shown(error)})", "export the mesh again") from error


def joined(parts: list[Triangles], asked: str) -> Triangles:
    """The triangles of all parts; raises `InputError` if there are none."""
    if not parts:
        raise InputError(asked, "it has no faces", "give a triangle mesh, not points or lines")
    starts = np.cumsum([0, *(len(vertices) for vertices, _, _ in parts[:-1])])
    faces = [part.astype(np.int64) + start for (_, part, _), start in zip(parts, starts.tolist(), strict=True)]
    uv = [coordinates for _, _, coordinates in parts if coordinates is not None]
    return (
        np.concatenate([vertices for vertices, _, _ in parts]),
        np.concatenate(faces).astype(np.int32),
        np.concatenate(uv) if len(uv) == len(parts) else None,
    )


def _part(part: Any) -> Triangles:
    vertices, faces = np.array(part.vertices, dtype=np.float64), np.array(part.faces, dtype=np.int32)
    found = getattr(part.visual, "uv", None)
    return vertices, faces, None if found is None or len(found) != len(vertices) else np.array(found, dtype=np.float64)


def _require_archive_room(stream: BinaryIO, asked: str) -> None:
    """Raise `InputError` if a format that is an archive within, such as 3MF, unpacks into too much."""
    if stream.read(4) == b"PK\3\4":
        try:
            size = sum(member.file_size for member in zipfile.ZipFile(stream).infolist())
        except Exception as error:  # zipfile raises whatever its parts do
            raise InputError(asked, f"it cannot be read ({shown(error)})", "export the mesh again") from error
        require_room(asked, "its parts", size, os.fstat(stream.fileno()).st_size)
    stream.seek(0)


class _NoLinks:
    """What trimesh asks for the files that a mesh names: there are none."""

    file_name = None

    def get(self, name: str) -> bytes:
        raise FileNotFoundError(name)

    __getitem__ = get
