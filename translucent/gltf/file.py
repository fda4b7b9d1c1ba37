"""The two containers of glTF 2.0, .gltf (JSON) and .glb (JSON and binary chunks), read without loss.

Only the JSON is looked into; the chunks behind it are kept byte for byte. Source: glTF 2.0, section 4.4 (GLB).
"""

from __future__ import annotations

import binascii
import os
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from translucent.errors import InputError, UnreadableError
from translucent.files.reading import json_value, linked_file, open_file, read_bytes, require_memory, size_text

Json = dict[str, Any]

#: Constants of GLB: magic number, kinds of chunks, header of the file and of a chunk.
MAGIC, GLB_VERSION = b"glTF", 2
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
HEADER, CHUNK = struct.Struct("<4sII"), struct.Struct("<II")

#: Bytes of the longest JSON, with all data in its links, which takes three times as much memory until it is decoded.
MAX_JSON = 1 << 28


@dataclass(frozen=True)
class GltfFile:
    """Contents of a glTF file: its JSON as `tree`, and for .glb the chunks after it as `chunks`, headers included.

    Files that it links to are read from its own folder, and from elsewhere where `allow_outside` says so.
    """

    path: Path
    tree: Json
    chunks: bytes = b""
    allow_outside: bool = False
    #: Lists that have been checked, with their lengths, so that each is checked once.
    _checked: dict[str, tuple[list[Json], int]] = field(default_factory=dict, init=False, repr=False, compare=False)
    _buffers: dict[int, bytes | memoryview] = field(default_factory=dict, init=False, compare=False, repr=False)

    def items(self, key: str) -> list[Json]:
        """The objects of a top-level list such as ``"materials"``; raises `InputError` if it is not one."""
        found: list[Json] = self.tree.get(key, [])
        if (known := self._checked.get(key)) is not None and known[0] is found and known[1] == len(found):
            return known[0]
        if not (isinstance(found, list) and all(isinstance(item, dict) for item in found)):
            raise InputError(f"glTF {str(self.path)!r}", f"{key} is not a list of objects", "export the file again")
        self._checked[key] = found, len(found)
        return found

    def item(self, key: str, index: object) -> Json:
        """Object of such a list by index; raises `InputError` if there is none."""
        found = self.items(key)
        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(found):
            raise InputError(
                f"glTF {str(self.path)!r}", f"{key} {index!r} is not one of {len(found)}", "export the file again"
            )
        return found[index]

    def resource(self, holder: Json) -> bytes:
        """Bytes of a buffer or image: from its data URI, a linked file, its buffer view, or the binary chunk."""
        if "bufferView" in holder and not isinstance(holder.get("uri"), str):
            view = self.item("bufferViews", holder["bufferView"])
            whole = self.buffer(view.get("buffer"))
            start, length = view.get("byteOffset", 0), view.get("byteLength", 0)
            if not (isinstance(start, int) and isinstance(length, int) and 0 <= start <= start + length <= len(whole)):
                raise InputError(
                    f"glTF {str(self.path)!r}", "a buffer view leaves its buffer", "copy or export the file again"
                )
            return bytes(whole[start : start + length])
        return bytes(self._content(holder))

    def buffer(self, index: Any) -> bytes | memoryview:
        """Bytes of a buffer, read when they are first asked for; raises `InputError` like `resource`."""
        entry = self.item("buffers", index)
        if index not in self._buffers:
            self._buffers[index] = self._content(entry)
        return self._buffers[index]

    @property
    def stored(self) -> int:
        """Number of bytes read so far, of the file and of its links, without the JSON."""
        return len(self.chunks) + sum(map(len, self._buffers.values()))

    def _content(self, holder: Json) -> bytes | memoryview:
        if isinstance(uri := holder.get("uri"), str):
            return self._linked(uri)
        if len(self.chunks) < CHUNK.size or CHUNK.unpack_from(self.chunks)[1] != BINARY_CHUNK:
            raise InputError(f"glTF {str(self.path)!r}", "it has no binary chunk", "copy or export the file again")
        return memoryview(self.chunks)[CHUNK.size : CHUNK.size + CHUNK.unpack_from(self.chunks)[0]]

    def _linked(self, uri: str) -> bytes:
        asked = f"glTF {str(self.path)!r}"
        if uri.startswith("data:"):
            try:
                return binascii.a2b_base64(uri.partition(",")[2], strict_mode=True)
            except ValueError as error:
                found = f"{uri[:57]!r}... cannot be read ({error})"
                raise UnreadableError(asked, found, "export the file again") from error
        path = linked_file(self.path.parent, uri, asked, self.allow_outside)
        try:
            return read_bytes(path, "")
        except InputError as error:
            raise UnreadableError(asked, f"{uri!r} cannot be read ({error})", "keep its files together") from None


def read_gltf(path: str | Path, allow_outside: bool = False) -> GltfFile:
    """Read a .gltf or .glb file; its content tells which of them it is.

    Parameters
    ----------
    path : path
    allow_outside : bool
        Whether files that it links to may lie outside its folder.

    Raises
    ------
    InputError
        If the file is missing, empty, cut short, or its JSON is broken.
    """
    path = Path(path)
    asked = f"glTF {str(path)!r}"
    with open_file(path, asked) as stream:
        binary, size = stream.read(len(MAGIC)) == MAGIC, os.fstat(stream.fileno()).st_size
    if path.suffix.lower() not in (".glb", ".gltf") and not binary:
        raise InputError(asked, f"suffix {path.suffix!r}", "give a .glb or .gltf file")
    if not size:
        raise InputError(asked, "it is empty", "copy or export the file again")
    if not binary:
        _require_short(asked, size)
    data, chunks = _split(asked, read_bytes(path, asked)) if binary else (read_bytes(path, asked), b"")
    try:
        text = data.decode("utf-8-sig")
        del data  # half of the memory
        tree = json_value(text)
    except ValueError as error:
        raise InputError(asked, f"its JSON is broken ({error})", "copy or export the file again") from error
    if not isinstance(tree, dict) or not isinstance(tree.get("asset"), dict):
        raise InputError(asked, "its JSON has no asset, so it is not glTF 2.0", "give a .glb or .gltf file")
    return GltfFile(path, tree, chunks, allow_outside)


def _split(asked: str, data: bytes) -> tuple[bytes, bytes]:
    """Split a .glb into its JSON and everything after it."""
    cut = InputError(asked, f"cut short at {len(data)} bytes", "copy or export the file again")
    if len(data) < HEADER.size + CHUNK.size:
        raise cut
    _, version, length = HEADER.unpack_from(data)
    if version != GLB_VERSION:
        raise InputError(asked, f"GLB version {version}", "export it as glTF 2.0")
    if length > len(data):
        raise cut
    start, parts = HEADER.size, []
    while start < length:
        if start + CHUNK.size > length:
            raise cut
        size, kind = CHUNK.unpack_from(data, start)
        if start + CHUNK.size + size > length:
            raise cut
        parts.append((kind, start, start + CHUNK.size + size))
        start = parts[-1][2]
    if not parts or parts[0][0] != JSON_CHUNK:
        raise InputError(asked, "its first chunk is not JSON", "copy or export the file again")
    _require_short(asked, parts[0][2] - parts[0][1])
    return data[parts[0][1] + CHUNK.size : parts[0][2]], data[parts[0][2] : length]


def _require_short(asked: str, size: int) -> None:
    """Raise `InputError` where a JSON of so many bytes takes too much memory, most of it for data in its links."""
    do = "save it as .glb, or keep its data in files beside it"
    if size > MAX_JSON:
        raise InputError(asked, f"its JSON has {size_text(size)}, more than {size_text(MAX_JSON)}", do)
    require_memory(asked, f"its {size_text(size)} of JSON", 3 * size, do)
