"""The two containers of glTF 2.0, .gltf (JSON) and .glb (JSON and binary chunks), read and written without loss.

Only the JSON is looked into; the chunks behind it are kept byte for byte.

A .glb has room for one buffer. Where a .gltf becomes one, buffers with bytes, linked or embedded, are laid one behind
the other, and the views of them move along, those of mesh compression, too; a buffer without bytes (the fallback of a
compressed one) stays. Images in data URIs and in files become views of that buffer, so that a .glb is whole wherever it
is copied to. Lost: names and extras of all buffers but the first.

Source: glTF 2.0, sections 3.6 (buffers) and 4.4 (GLB).
"""

from __future__ import annotations

import base64
import binascii
import copy
import json
import math
import os
import struct
import warnings
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, cast
from urllib.parse import quote, unquote

from translucent.errors import InputError, TranslucentWarning, UnreadableError
from translucent.files.paths import require_output, write_atomically
from translucent.files.reading import json_value, linked_file, open_file, read_bytes, require_memory, size_text

Json = dict[str, Any]

#: Constants of GLB: magic number, kinds of chunks, header of the file and of a chunk.
MAGIC, GLB_VERSION = b"glTF", 2
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
HEADER, CHUNK = struct.Struct("<4sII"), struct.Struct("<II")

#: Extensions that compress vertices, which are not read.
COMPRESSIONS = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")

#: Bytes of the longest JSON, with all data in its links, which takes three times as much memory until it is decoded.
MAX_JSON = 1 << 28


_ALIGNMENT = 4  # bytes: the size of the largest component of an accessor

#: Magic numbers of the image formats of glTF and its extensions; nothing else is copied into a file.
_PICTURES = {b"\x89PNG\r\n": "image/png", b"\xff\xd8\xff": "image/jpeg", b"\xabKTX 20\xbb": "image/ktx2"}

_LONGEST = 2**32 - 1  # bytes: the header states the length with 32 bits

_DATA_URI = "data:application/octet-stream;base64,"


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

    def refused(self, found: str, do: str = "export the file again") -> InputError:
        """Error for a glTF file with invalid content."""
        return InputError(f"glTF {str(self.path)!r}", found, do)

    def items(self, key: str) -> list[Json]:
        """The objects of a top-level list such as ``"materials"``; raises `InputError` if it is not one."""
        found: list[Json] = self.tree.get(key, [])
        if (known := self._checked.get(key)) is not None and known[0] is found and known[1] == len(found):
            return known[0]
        if not (isinstance(found, list) and all(isinstance(item, dict) for item in found)):
            raise self.refused(f"{key} is not a list of objects")
        self._checked[key] = found, len(found)
        return found

    def item(self, key: str, index: object) -> Json:
        """Object of a top-level list by index; raises `InputError` if the index is invalid."""
        found = self.items(key)
        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(found):
            raise self.refused(f"{key} {index!r} does not exist: the file has {len(found)}", "export the file again")
        return found[index]

    def resource(self, holder: Json) -> bytes:
        """Bytes of a buffer or image: from its data URI, a linked file, its buffer view, or the binary chunk."""
        if "bufferView" in holder and not isinstance(holder.get("uri"), str):
            view = self.item("bufferViews", holder["bufferView"])
            whole = self.buffer(view.get("buffer"))
            start, length = view.get("byteOffset", 0), view.get("byteLength", 0)
            if not (isinstance(start, int) and isinstance(length, int) and 0 <= start <= start + length <= len(whole)):
                raise self.refused("a buffer view exceeds its buffer", "copy or export the file again")
            return bytes(whole[start : start + length])
        return bytes(self._content(holder))

    def buffer(self, index: Any) -> bytes | memoryview:
        """Bytes of a buffer, read when they are first requested; raises `InputError` like `resource`."""
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
            raise self.refused("the file has no binary chunk", "copy or export the file again")
        return memoryview(self.chunks)[CHUNK.size : CHUNK.size + CHUNK.unpack_from(self.chunks)[0]]

    def _linked(self, uri: str) -> bytes:
        requested = f"glTF {str(self.path)!r}"
        if uri.startswith("data:"):
            try:
                return binascii.a2b_base64(uri.partition(",")[2], strict_mode=True)
            except ValueError as error:
                found = f"{uri[:57]!r}... cannot be read ({error})"
                raise UnreadableError(requested, found, "export the model again") from error
        path = linked_file(self.path.parent, uri, requested, self.allow_outside)
        try:
            return read_bytes(path, "")
        except InputError as error:
            raise UnreadableError(
                requested, f"the linked file {uri!r} cannot be read ({error})", "keep all files of the model together"
            ) from None


def read_gltf(path: str | Path, allow_outside: bool = False) -> GltfFile:
    """Read a .gltf or .glb file; its content decides the format.

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
    requested = f"glTF {str(path)!r}"
    with open_file(path, requested) as stream:
        binary, size = stream.read(len(MAGIC)) == MAGIC, os.fstat(stream.fileno()).st_size
    if path.suffix.lower() not in (".glb", ".gltf") and not binary:
        raise InputError(requested, f"suffix {path.suffix!r}", "give a .glb or .gltf file")
    if not size:
        raise InputError(requested, "the file is empty", "copy or export the file again")
    if not binary:
        _require_short(requested, size)
    return gltf_of(path, read_bytes(path, requested), allow_outside)


def gltf_of(path: Path, content: bytes, allow_outside: bool = False) -> GltfFile:
    """Parse the content of a .gltf or .glb file; the path is what messages call it, and where its links begin.

    Raises
    ------
    InputError
        If it is cut short, or its JSON is broken.
    """
    requested = f"glTF {str(path)!r}"
    data, chunks = _split(requested, content) if content.startswith(MAGIC) else (content, b"")
    try:
        text = data.decode("utf-8-sig")
        del data  # half of the memory
        tree = json_value(text)
    except ValueError as error:
        raise InputError(
            requested, f"the JSON of the file is broken ({error})", "copy or export the file again"
        ) from error
    if not isinstance(tree, dict) or not isinstance(tree.get("asset"), dict):
        raise InputError(
            requested, "the JSON of the file has no 'asset', so the file is not glTF 2.0", "give a .glb or .gltf file"
        )
    return GltfFile(path, tree, chunks, allow_outside)


def _split(requested: str, data: bytes) -> tuple[bytes, bytes]:
    """Split a .glb into its JSON and everything after it."""
    cut = InputError(requested, f"the file is cut off after {len(data)} bytes", "copy or export the file again")
    if len(data) < HEADER.size + CHUNK.size:
        raise cut
    _, version, length = HEADER.unpack_from(data)
    if version != GLB_VERSION:
        raise InputError(requested, f"the file has GLB version {version}", "export the model as glTF 2.0")
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
        raise InputError(requested, "the first chunk of the file is not JSON", "copy or export the file again")
    _require_short(requested, parts[0][2] - parts[0][1])
    return data[parts[0][1] + CHUNK.size : parts[0][2]], data[parts[0][2] : length]


def _require_short(requested: str, size: int) -> None:
    """Raise `InputError` where a JSON of so many bytes takes too much memory, most of it for data in its links."""
    do = "save the model as .glb, or keep the data in separate files"
    if size > MAX_JSON:
        raise InputError(
            requested, (f"the JSON of the file has {size_text(size)}, more than the limit of {size_text(MAX_JSON)}"), do
        )
    require_memory(requested, f"{size_text(size)} of JSON", 3 * size, do)


def gather(file: GltfFile, tree: Json) -> tuple[Json, bytes]:
    """Gather buffers: JSON whose first buffer is the binary chunk, and its bytes; without any, the JSON as it is.

    Parameters
    ----------
    file : GltfFile
        As it was read: its links hold in its own folder.
    tree : dict
        Its JSON, perhaps with links for another folder.

    Raises
    ------
    InputError
        If a buffer cannot be read or is shorter than it says, or a view has no buffer.
    """
    tree, binary, buffers = copy.deepcopy(tree), bytearray(), file.items("buffers")
    starts = {i: _append(binary, _content(file, i, one)) for i, one in enumerate(buffers) if "uri" in one}
    # An image whose kind is stated nowhere stays in its data URI: glTF wants it stated of a view.
    images = {}
    for i, image in enumerate(file.items("images")):
        uri = image.get("uri")
        if isinstance(uri, str) and uri.startswith("data:"):
            kind = str(image.get("mimeType", uri[len("data:") :].partition(",")[0].partition(";")[0]))
            if kind.startswith("image/"):
                data = file.resource(image)
                images[i] = (_append(binary, data), len(data), kind)
    if not binary:
        return tree, b""
    empty = [i for i in range(len(buffers)) if i not in starts]
    places = {i: (0, start) for i, start in starts.items()} | {i: (n, 0) for n, i in enumerate(empty, 1)}
    views = tree["bufferViews"] = tree.get("bufferViews", [])
    for index, view in enumerate(file.items("bufferViews")):
        _move(file, view, views[index], places)
        extensions = view.get("extensions")
        for name, extension in extensions.items() if isinstance(extensions, dict) else ():
            if isinstance(extension, dict) and "buffer" in extension:
                _move(file, extension, views[index]["extensions"][name], places)
    for index, place in images.items():
        _make_view(tree, index, *place)
    first = {key: value for key, value in (buffers[min(starts)] if starts else {}).items() if key != "uri"}
    tree["buffers"] = [{**first, "byteLength": len(binary)}, *(buffers[i] for i in empty)]
    return tree, bytes(binary)


def _append(binary: bytearray, data: bytes) -> int:
    """Append data to the binary; returns their offset."""
    binary += b"\0" * (-len(binary) % _ALIGNMENT)
    start = len(binary)
    binary += data
    return start


def _content(file: GltfFile, index: int, buffer: Json) -> bytes:
    data, length = file.resource(buffer), buffer.get("byteLength")
    if not (isinstance(length, int) and 0 < length <= len(data)):
        raise file.refused(
            f"buffer {index} has {len(data)} bytes, but should have {length!r}",
            "copy or export the file again",
        )
    return data[:length]


def is_link(holder: Json) -> bool:
    """True if a buffer or an image is a file beside the glTF file."""
    uri = holder.get("uri")
    return isinstance(uri, str) and not uri.startswith("data:") and "://" not in uri


def embed_images(file: GltfFile, tree: Json, binary: bytearray) -> None:
    """Embed linked images in the binary, as buffer views in the JSON.

    What cannot be read, or is no picture, stays a link, with a `TranslucentWarning`.

    Parameters
    ----------
    file : GltfFile
        As it was read: its links hold in its own folder.
    tree : dict
        Its JSON, whose first buffer is the binary; it is changed.
    binary : bytearray
        It grows.
    """
    for index, image in enumerate(file.items("images")):
        if not is_link(image):
            continue
        try:
            data = file.resource(image)
        except InputError as error:
            warnings.warn(f"{error}; the image stays a link", TranslucentWarning, stacklevel=5)
            continue
        kind = next((kind for start, kind in _PICTURES.items() if data.startswith(start)), None)
        if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
            kind = "image/webp"
        if kind is None:
            text = f"glTF {str(file.path)!r}: glTF does not support the format of {image['uri']!r}; it stays a link"
            warnings.warn(text, TranslucentWarning, stacklevel=5)
            continue
        _make_view(tree, index, _append(binary, data), len(data), kind)
    if binary:
        buffers = tree.setdefault("buffers", [{}])
        buffers[0]["byteLength"] = len(binary)


def _make_view(tree: Json, index: int, start: int, length: int, kind: str) -> None:
    """Turn an image that is a link into a view of the first buffer."""
    views, image = tree.setdefault("bufferViews", []), tree["images"][index]
    del image["uri"]
    image |= {"bufferView": len(views), "mimeType": kind}
    views.append({"buffer": 0, "byteOffset": start, "byteLength": length})


def _move(file: GltfFile, old: Json, new: Json, places: dict[int, tuple[int, int]]) -> None:
    """Move a buffer view to the new offset of its buffer."""
    index, offset = old.get("buffer"), old.get("byteOffset", 0)
    if not (isinstance(index, int) and index in places and isinstance(offset, int)):
        raise file.refused(f"a buffer view refers to buffer {index!r}, which does not exist, or has no valid offset")
    new["buffer"], start = places[index]
    if start:
        new["byteOffset"] = start + offset


def write_gltf(file: GltfFile, path: str | Path) -> None:
    """Write a file as .glb or .gltf, by its suffix, atomically.

    A .glb turned into .gltf holds its binary chunk as a data URI; a .gltf turned into .glb has its buffers in one, and
    every .glb holds its images, see `translucent.gltf.file`. What links there are in a .gltf is made relative
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
    """Write a glTF file to a temporary path, with links as its final place needs them."""
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


def glb_bytes(tree: Json, binary: bytes) -> bytes:
    """Contents of a .glb file of a JSON and its one buffer."""
    return _packed(GltfFile(Path("scene.glb"), tree, _binary_chunk(binary)), tree)


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
        raise InputError(
            f"writing {str(file.path)!r}",
            "the file would be larger than 4 GiB, the limit of the .glb format",
            "write a .gltf instead",
        )
    return HEADER.pack(MAGIC, GLB_VERSION, length) + CHUNK.pack(len(text), JSON_CHUNK) + text + chunks


def _with_images(file: GltfFile, tree: Json, chunks: bytes) -> tuple[Json, bytes]:
    """JSON and chunks with the images embedded in the binary chunk."""
    size, kind = CHUNK.unpack_from(chunks) if len(chunks) >= CHUNK.size else (0, None)
    end = CHUNK.size + size if kind == BINARY_CHUNK else 0
    binary = bytearray(chunks[CHUNK.size : end])
    if not binary and tree.get("buffers"):
        text = f"glTF {str(file.path)!r}: the first buffer is a link, so the images also stay links"
        warnings.warn(text, TranslucentWarning, stacklevel=5)
        return tree, chunks
    embed_images(file, tree, binary)
    return tree, _binary_chunk(bytes(binary)) + chunks[end:]


def _binary_chunk(binary: bytes) -> bytes:
    binary += b"\0" * (-len(binary) % 4)
    return CHUNK.pack(len(binary), BINARY_CHUNK) + binary if binary else b""


Triple = tuple[float, float, float]
Numbers = TypeVar("Numbers", bound=tuple[float, ...])

_COUNTS = {2: "two", 3: "three", 4: "four"}

#: Largest number of names in a line.
FIRST = 3


def label(items: list[Json], index: int) -> str:
    """Label of a list's item in messages: its name in quotes, or its index."""
    name = items[index].get("name")
    return repr(name) if isinstance(name, str) and name else f"number {index}"


class JsonFields:
    """Checked values of one JSON object of a file, with defaults.

    Parameters
    ----------
    file : GltfFile
    where : str
        The object, as errors call it.
    values : dict
    problems : list of str, optional
        Gets what is wrong, and a wrong value has its default. Without it, an `InputError` is raised.
    """

    def __init__(self, file: GltfFile, where: str, values: Json, problems: list[str] | None = None) -> None:
        self.file, self.where, self.values, self.problems = file, where, values, problems

    def refuse(self, found: str, do: str = "export the file again") -> None:
        """Raise `InputError` for a value, or add it to the problems."""
        if self.problems is None:
            raise self.file.refused(f"{self.where}: {found}", do)
        self.problems.append(found)

    def section(self, key: str) -> JsonFields:
        """Nested JSON object; empty if it is absent."""
        found = self.values.get(key, {})
        if not isinstance(found, dict):
            self.refuse(f"{key} is {found!r}, not an object")
            found = {}
        return JsonFields(self.file, self.where, found, self.problems)

    def extension(self, name: str) -> JsonFields:
        """Object of an extension; empty if it is absent."""
        return self.section("extensions").section(name)

    def number(
        self,
        key: str,
        default: float | None = None,
        low: float = -math.inf,
        high: float = math.inf,
        *,
        above: bool = False,
    ) -> float:
        """A number in `low`..`high`, excluding `low` itself with `above`; without a default, it must be there."""
        value, default = self.values.get(key, default), default or 0.0
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.refuse(f"{key} is {value!r}, not a number")
            return default
        if not low <= value <= high or (above and value == low):
            allowed = f"above {low:g}" if above else f"{low:g} or more" if math.isinf(high) else f"in {low:g}..{high:g}"
            self.refuse(f"{key} {value:g} is not {allowed}", "correct the file")
            return default
        return float(value)

    def numbers(self, key: str, default: Numbers, low: float = -math.inf, high: float = math.inf) -> Numbers:
        """As many numbers as the default has, each in `low`..`high`."""
        found = self.values.get(key, list(default))
        if not isinstance(found, list) or len(found) != len(default):
            self.refuse(f"{key} is {found!r}, not {_COUNTS[len(default)]} numbers")
            return default
        parts = JsonFields(self.file, self.where, {f"{key}[{i}]": one for i, one in enumerate(found)}, self.problems)
        checked = (parts.number(f"{key}[{i}]", one, low, high) for i, one in enumerate(default))
        return cast(Numbers, tuple(checked))

    def whole(self, key: str, default: int | None = None) -> int:
        """A whole number of 0 or more; without a default, it must be there."""
        value = self.values.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            self.refuse(f"{key} is {value!r}, not a whole number of 0 or more")
            return default or 0
        return value


class LeftOut:
    """Record of features left out: one line per kind, with the names of the objects concerned."""

    def __init__(self) -> None:
        self._names: dict[str, dict[str, None]] = {}

    def add(self, what: str, name: str) -> None:
        """Record a part of the file that is left out; equal entries count once."""
        self._names.setdefault(what, {})[name] = None

    def lines(self) -> tuple[str, ...]:
        """Lines of text such as ``base color textures ('Label', 'Table', 'Wall' and 2 more)``."""
        lines = []
        for what, names in self._names.items():
            more = f" and {len(names) - FIRST} more" if len(names) > FIRST else ""
            lines.append(f"{what} ({', '.join(list(names)[:FIRST])}{more})")
        return tuple(lines)
