"""The two containers of glTF 2.0, .gltf (JSON) and .glb (JSON and binary chunks), written losslessly.

Source: glTF 2.0, section 4.4 (GLB).
"""

from __future__ import annotations

import base64
import copy
import json
import os
import warnings
from functools import partial
from pathlib import Path
from urllib.parse import quote, unquote

from translucent.errors import InputError, TranslucentWarning
from translucent.files.paths import require_output, write_atomically
from translucent.gltf.file import BINARY_CHUNK, CHUNK, GLB_VERSION, HEADER, JSON_CHUNK, MAGIC, GltfFile, Json
from translucent.gltf.pack import embed_images, gather, is_link

_LONGEST = 2**32 - 1  # bytes: the header states the length with 32 bits
_DATA_URI = "data:application/octet-stream;base64,"


def write_gltf(file: GltfFile, path: str | Path) -> None:
    """Write a file as .glb or .gltf, by its suffix, atomically.

    A .glb turned into .gltf holds its binary chunk as a data URI; a .gltf turned into .glb has its buffers in one, and
    every .glb holds its images, see `translucent.gltf.pack`. What links there are in a .gltf is made relative
    to the new folder.

    Raises
    ------
    InputError
        If the suffix is another one, or a .gltf has buffers that cannot be read.
    RenderError
        If the file cannot be written.

    Warns
    -----
    TranslucentWarning
        If an image cannot be read, and so stays a link in a .glb.
    """
    path = Path(path)
    check_gltf_output(path)
    write_atomically(path, partial(fill_gltf, file=file, place=path))


def fill_gltf(path: Path, file: GltfFile, place: Path) -> None:
    """Write a file, as `write_gltf`, to a path from which it will be moved to its place."""
    tree = _relocated(file, place)
    if place.suffix.lower() == ".gltf":
        content = (json.dumps(_unpacked(file, tree), indent=2, ensure_ascii=False) + "\n").encode()
    else:
        content = _packed(file, tree)
    path.write_bytes(content)


def check_gltf_output(path: Path) -> None:
    """Raise `InputError` unless `path` is a valid name for a glTF file in an existing folder."""
    if path.suffix.lower() not in (".glb", ".gltf"):
        raise InputError(f"output {str(path)!r}", f"suffix {path.suffix!r}", "use .glb or .gltf")
    require_output(path, f"output {str(path)!r}")


def _relocated(file: GltfFile, path: Path) -> Json:
    """JSON with links relative to the folder of `path`."""
    old, new = file.path.parent.resolve(), path.parent.resolve()
    if old == new:
        return file.tree
    tree = copy.deepcopy(file.tree)
    moved = GltfFile(file.path, tree)
    for holder in [*moved.items("buffers"), *moved.items("images")]:
        if is_link(holder):
            holder["uri"] = quote(Path(os.path.relpath(old / unquote(holder["uri"]), new)).as_posix())
    return tree


def _unpacked(file: GltfFile, tree: Json) -> Json:
    if not file.chunks or not file.items("buffers") or "uri" in file.items("buffers")[0]:
        return tree
    first = {**tree["buffers"][0], "uri": _DATA_URI + base64.b64encode(file.resource({})).decode()}
    return {**tree, "buffers": [first, *tree["buffers"][1:]]}


def _packed(file: GltfFile, tree: Json) -> bytes:
    chunks = file.chunks
    if not chunks:
        tree, binary = gather(file, tree)
        chunks = _binary_chunk(binary)
    if any(map(is_link, file.items("images"))):
        tree, chunks = _with_images(file, copy.deepcopy(tree), chunks)
    text = json.dumps(tree, separators=(",", ":"), ensure_ascii=False).encode()
    text += b" " * (-len(text) % 4)
    length = HEADER.size + CHUNK.size + len(text) + len(chunks)
    if length > _LONGEST:
        raise InputError(f"output .glb of {str(file.path)!r}", "more than 4 GiB, which no .glb holds", "write a .gltf")
    return HEADER.pack(MAGIC, GLB_VERSION, length) + CHUNK.pack(len(text), JSON_CHUNK) + text + chunks


def _with_images(file: GltfFile, tree: Json, chunks: bytes) -> tuple[Json, bytes]:
    """JSON and chunks with the images embedded in the binary chunk."""
    size, kind = CHUNK.unpack_from(chunks) if len(chunks) >= CHUNK.size else (0, None)
    end = CHUNK.size + size if kind == BINARY_CHUNK else 0
    binary = bytearray(chunks[CHUNK.size : end])
    if not binary and tree.get("buffers"):
        told = f"glTF {str(file.path)!r}: its first buffer is a link, so its images stay links, too"
        warnings.warn(told, TranslucentWarning, stacklevel=4)
        return tree, chunks
    embed_images(file, tree, binary)
    return tree, _binary_chunk(bytes(binary)) + chunks[end:]


def _binary_chunk(binary: bytes) -> bytes:
    binary += b"\0" * (-len(binary) % 4)
    return CHUNK.pack(len(binary), BINARY_CHUNK) + binary if binary else b""
