"""Packing of the buffers and data URIs of a .gltf into the one binary chunk of a .glb.

A .glb has room for one buffer. Buffers with bytes, linked or embedded, are laid one behind the other, and the views of
them move along, those of mesh compression, too; a buffer without bytes (the fallback of a compressed one) stays. Images
in data URIs and in files become views of that buffer, so that a .glb is whole wherever it is copied to.

Lost: names and extras of all buffers but the first. Source: glTF 2.0, sections 3.6 (buffers) and 4.4 (GLB).
"""

from __future__ import annotations

import copy
import warnings

from translucent.errors import InputError, TranslucentWarning
from translucent.gltf.file import GltfFile, Json

_ALIGNMENT = 4  # bytes: the size of the largest component of an accessor

#: Magic numbers of the image formats of glTF and its extensions; nothing else is copied into a file.
_PICTURES = {b"\x89PNG\r\n": "image/png", b"\xff\xd8\xff": "image/jpeg", b"\xabKTX 20\xbb": "image/ktx2"}


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
    images = _embedded_images(file, binary)
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
    for index, (start, length, kind) in images.items():
        del tree["images"][index]["uri"]
        tree["images"][index] |= {"bufferView": len(views), "mimeType": kind}
        views.append({"buffer": 0, "byteOffset": start, "byteLength": length})
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
        raise InputError(
            f"glTF {str(file.path)!r}",
            f"buffer {index} should have {length!r} bytes and has {len(data)}",
            "copy or export the file again",
        )
    return data[:length]


def _embedded_images(file: GltfFile, binary: bytearray) -> dict[int, tuple[int, int, str]]:
    """Start, length and kind of images in data URIs, by their index, now at the end of the binary.

    One whose kind is stated nowhere stays in its data URI: glTF wants it stated of a view.
    """
    found = {}
    for index, image in enumerate(file.items("images")):
        uri = image.get("uri")
        if isinstance(uri, str) and uri.startswith("data:"):
            kind = str(image.get("mimeType", uri[len("data:") :].partition(",")[0].partition(";")[0]))
            if kind.startswith("image/"):
                data = file.resource(image)
                found[index] = (_append(binary, data), len(data), kind)
    return found


def is_link(holder: Json) -> bool:
    """True if a buffer or an image is a file beside the glTF file."""
    uri = holder.get("uri")
    return isinstance(uri, str) and not uri.startswith("data:") and "://" not in uri


def _picture_kind(data: bytes) -> str | None:
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return "image/webp"
    return next((kind for start, kind in _PICTURES.items() if data.startswith(start)), None)


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
            warnings.warn(f"{error}; the image stays a link", TranslucentWarning, stacklevel=4)
            continue
        if (kind := _picture_kind(data)) is None:
            told = f"glTF {str(file.path)!r}: {image['uri']!r} is no picture that glTF knows; it stays a link"
            warnings.warn(told, TranslucentWarning, stacklevel=4)
            continue
        start, views = _append(binary, data), tree.setdefault("bufferViews", [])
        del tree["images"][index]["uri"]
        tree["images"][index] |= {"bufferView": len(views), "mimeType": kind}
        views.append({"buffer": 0, "byteOffset": start, "byteLength": len(data)})
    if binary:
        buffers = tree.setdefault("buffers", [{}])
        buffers[0]["byteLength"] = len(binary)


def _move(file: GltfFile, old: Json, new: Json, places: dict[int, tuple[int, int]]) -> None:
    """Move a buffer view to the new offset of its buffer."""
    index, offset = old.get("buffer"), old.get("byteOffset", 0)
    if not (isinstance(index, int) and index in places and isinstance(offset, int)):
        raise InputError(f"glTF {str(file.path)!r}", f"a buffer view of buffer {index!r}", "export the file again")
    new["buffer"], start = places[index]
    if start:
        new["byteOffset"] = start + offset
