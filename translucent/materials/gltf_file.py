"""The two containers of glTF 2.0, .gltf (JSON) and .glb (JSON and binary chunks), read and written without loss.

Only the JSON is looked into; the chunks behind it are kept byte for byte. Source: glTF 2.0, section 4.4 (GLB).
"""

from __future__ import annotations

import base64
import binascii
import copy
import json
import math
import os
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

from translucent.errors import InputError
from translucent.frame import write_atomically
from translucent.materials.gltf_pack import gather
from translucent.paths import require_file, require_place

Json = dict[str, Any]


class UnreadableError(InputError):
    """A file that a glTF file links to is missing or cannot be read."""


_MAGIC, _VERSION = b"glTF", 2
_JSON_CHUNK, _BINARY_CHUNK = 0x4E4F534A, 0x004E4942
_HEADER, _CHUNK = struct.Struct("<4sII"), struct.Struct("<II")
_LONGEST = 2**32 - 1  # bytes: the header states the length with 32 bits
_MOST_DIGITS = 300  # of a whole number that is still in the range of float64
_DATA_URI = "data:application/octet-stream;base64,"


@dataclass(frozen=True)
class GltfFile:
    """A glTF file: its JSON as `tree`, and for .glb what follows it as `chunks`, headers included."""

    path: Path
    tree: Json
    chunks: bytes = b""

    def items(self, key: str) -> list[Json]:
        """The objects of a top-level list such as ``"materials"``; raises `InputError` if it is none."""
        found = self.tree.get(key, [])
        if not (isinstance(found, list) and all(isinstance(item, dict) for item in found)):
            raise InputError(f"glTF {str(self.path)!r}", f"{key} is not a list of objects", "export the file again")
        return found

    def item(self, key: str, index: object) -> Json:
        """One object of such a list; raises `InputError` if the index points at none."""
        found = self.items(key)
        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(found):
            raise InputError(
                f"glTF {str(self.path)!r}", f"{key} {index!r} is not one of {len(found)}", "export the file again"
            )
        return found[index]

    def resource(self, holder: Json) -> bytes:
        """Bytes of a buffer or image: from its data URI, the file beside, its buffer view, or the binary chunk."""
        if isinstance(uri := holder.get("uri"), str):
            return self._linked(uri)
        if "bufferView" in holder:
            view = self.item("bufferViews", holder["bufferView"])
            whole = self.resource(self.item("buffers", view.get("buffer")))
            start, length = view.get("byteOffset", 0), view.get("byteLength", 0)
            if not (isinstance(start, int) and isinstance(length, int) and 0 <= start <= start + length <= len(whole)):
                raise InputError(
                    f"glTF {str(self.path)!r}", "a buffer view leaves its buffer", "copy or export the file again"
                )
            return whole[start : start + length]
        if len(self.chunks) < _CHUNK.size or _CHUNK.unpack_from(self.chunks)[1] != _BINARY_CHUNK:
            raise InputError(f"glTF {str(self.path)!r}", "it has no binary chunk", "copy or export the file again")
        return self.chunks[_CHUNK.size : _CHUNK.size + _CHUNK.unpack_from(self.chunks)[0]]

    def _linked(self, uri: str) -> bytes:
        shown = uri if len(uri) < 60 else f"{uri[:57]}..."
        try:
            if uri.startswith("data:"):
                return base64.b64decode(uri.partition(",")[2], validate=True)
            return (self.path.parent / unquote(uri)).read_bytes()
        except (OSError, ValueError, binascii.Error) as error:
            raise UnreadableError(
                f"glTF {str(self.path)!r}", f"{shown!r} cannot be read ({error})", "keep its files together"
            ) from error


def read_gltf(path: str | Path) -> GltfFile:
    """Read a .gltf or .glb file; which of them it is says its content.

    Raises
    ------
    InputError
        If the file is missing, empty, cut short, or its JSON is broken.
    """
    path = Path(path)
    asked = f"glTF {str(path)!r}"
    require_file(path, asked)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(asked, f"it cannot be read ({error.strerror})", "check its permissions") from error
    if path.suffix.lower() not in (".glb", ".gltf") and data[:4] != _MAGIC:
        raise InputError(asked, f"suffix {path.suffix!r}", "give a .glb or .gltf file")
    if not data:
        raise InputError(asked, "it is empty", "copy or export the file again")
    text, chunks = _split(asked, data) if data[:4] == _MAGIC else (data, b"")
    try:
        tree = json.loads(text.decode("utf-8-sig"), parse_constant=_refuse, parse_float=_finite, parse_int=_whole)
    except (ValueError, RecursionError) as error:
        raise InputError(asked, f"its JSON is broken ({error})", "copy or export the file again") from error
    if not isinstance(tree, dict) or not isinstance(tree.get("asset"), dict):
        raise InputError(asked, "its JSON has no asset, so it is not glTF 2.0", "give a .glb or .gltf file")
    return GltfFile(path, tree, chunks)


def _split(asked: str, data: bytes) -> tuple[bytes, bytes]:
    """The JSON of a .glb, and all that follows it."""
    cut = InputError(asked, f"cut short at {len(data)} bytes", "copy or export the file again")
    if len(data) < _HEADER.size + _CHUNK.size:
        raise cut
    _, version, length = _HEADER.unpack_from(data)
    if version != _VERSION:
        raise InputError(asked, f"GLB version {version}", "export it as glTF 2.0")
    if length > len(data):
        raise cut
    start, parts = _HEADER.size, []
    while start < length:
        if start + _CHUNK.size > length:
            raise cut
        size, kind = _CHUNK.unpack_from(data, start)
        if start + _CHUNK.size + size > length:
            raise cut
        parts.append((kind, start, start + _CHUNK.size + size))
        start = parts[-1][2]
    if not parts or parts[0][0] != _JSON_CHUNK:
        raise InputError(asked, "its first chunk is not JSON", "copy or export the file again")
    return data[parts[0][1] + _CHUNK.size : parts[0][2]], data[parts[0][2] : length]


def _refuse(word: str) -> None:
    raise ValueError(f"{word} is no JSON number")


def _finite(text: str) -> float:
    if math.isinf(value := float(text)):
        raise ValueError(f"{text} is beyond the range of numbers")
    return value


def _whole(text: str) -> int:
    if len(text) > _MOST_DIGITS:
        raise ValueError("a whole number is too long")
    return int(text)


def write_gltf(file: GltfFile, path: str | Path) -> None:
    """Write a file as .glb or .gltf, by its suffix; the file is complete or not there.

    A .glb turned into .gltf holds its binary chunk as a data URI; a .gltf turned into .glb has its buffers in one, see
    `translucent.materials.gltf_pack`. Links to files beside are made relative to the new folder.

    Raises
    ------
    InputError
        If the suffix is another one, or a .gltf has buffers that cannot be read.
    RenderError
        If the file cannot be written.
    """
    path = Path(path)
    check_gltf_output(path)
    tree = _relocated(file, path)
    if path.suffix.lower() == ".gltf":
        content = (json.dumps(_unpacked(file, tree), indent=2, ensure_ascii=False) + "\n").encode()
    else:
        content = _packed(file, tree)
    write_atomically(path, lambda temporary: _fill(temporary, content))


def _fill(path: Path, content: bytes) -> None:
    path.write_bytes(content)


def check_gltf_output(path: Path) -> None:
    """Raise `InputError` if `path` is no name for a glTF file in an existing folder."""
    if path.suffix.lower() not in (".glb", ".gltf"):
        raise InputError(f"output {str(path)!r}", f"suffix {path.suffix!r}", "use .glb or .gltf")
    require_place(path, f"output {str(path)!r}")


def _is_link(holder: Json) -> bool:
    uri = holder.get("uri")
    return isinstance(uri, str) and not uri.startswith("data:") and "://" not in uri


def _relocated(file: GltfFile, path: Path) -> Json:
    """The JSON with links that hold in the folder of `path`."""
    old, new = file.path.parent.resolve(), path.parent.resolve()
    if old == new:
        return file.tree
    tree = copy.deepcopy(file.tree)
    moved = GltfFile(file.path, tree)
    for holder in [*moved.items("buffers"), *moved.items("images")]:
        if _is_link(holder):
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
        if binary:
            binary += b"\0" * (-len(binary) % 4)
            chunks = _CHUNK.pack(len(binary), _BINARY_CHUNK) + binary
    text = json.dumps(tree, separators=(",", ":"), ensure_ascii=False).encode()
    text += b" " * (-len(text) % 4)
    length = _HEADER.size + _CHUNK.size + len(text) + len(chunks)
    if length > _LONGEST:
        raise InputError(f"output .glb of {str(file.path)!r}", "more than 4 GiB, which no .glb holds", "write a .gltf")
    return _HEADER.pack(_MAGIC, _VERSION, length) + _CHUNK.pack(len(text), _JSON_CHUNK) + text + chunks
