"""Maps of a glTF file as separate images, one for each primitive that light enters, in its own UVs.

Of one map ``thickness.exr`` is the file; of several it is ``thickness-NAME.exr`` for each, NAME being that of its
material (and of its mesh where that is not enough), each with its record. ``thickness.exr.json`` is the record of all.

Where UVs were made, the mesh that has them is beside the map, as ``thickness.exr.uv.glb``.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from translucent.bake.baked import BakedMap
from translucent.bake.gltf.bodies import PrimitiveKey, primitive_name
from translucent.bake.gltf.builder import GlbBuilder
from translucent.bake.gltf.targets import Target
from translucent.bake.record import Record, add_record, shared
from translucent.bake.writing import add_map, add_uv_file
from translucent.files.paths import OutputFiles
from translucent.gltf.file import GltfFile

#: Largest length of the name of a map, and the characters besides letters and digits that are safe in file names.
_LONGEST, _SAFE = 60, "._-"


def save_maps(
    builder: GlbBuilder,
    output: Path,
    results: Mapping[PrimitiveKey, BakedMap],
    targets: Mapping[PrimitiveKey, Target],
    *,
    normalize: bool = False,
    invert: bool = False,
    about: Record,
) -> Record:
    """Write the maps of a file, and their record beside them.

    Parameters
    ----------
    builder : GlbBuilder
        The file, with the UVs that were made for it.
    output : Path
        As for one map.
    results, targets : mapping of (mesh, primitive)
    normalize, invert : bool
        As for `save_map`.
    about : dict
        More for the records.

    Returns
    -------
    dict
        The record of the only map, or that of all of them under ``maps``.

    Raises
    ------
    InputError, RenderError
        As `save_map`.
    """
    file = builder.file()
    told: list[Record] = []
    paths = _paths(file, output, list(results)) if len(results) > 1 else dict.fromkeys(results, output)
    with OutputFiles() as files:
        if any(target.made_uv for target in targets.values()):
            about = {**about, "uv_file": add_uv_file(files, file, output)}
        for key, result in results.items():
            one: Record = {**about, "place": list(key), "tex_coord": targets[key].tex_coord}
            told.append(add_map(files, result, paths[key], normalize=normalize, invert=invert, about=one))
        if len(told) == 1:
            return told[0]
        return add_record(files, output, {**about, **shared(told), "maps": told})


def _paths(file: GltfFile, output: Path, keys: list[PrimitiveKey]) -> dict[PrimitiveKey, Path]:
    """Path of each of several maps; names differ by more than case."""
    materials = {key: _material_name(file, key) for key in keys}
    count = Counter(materials.values())
    taken: set[str] = set()
    paths = {}
    for key, material in materials.items():
        unique = bool(material) and count[material] == 1
        name = _safe(material if unique else f"{material} {primitive_name(file, key)}")
        number = 2
        while (free := name if name.casefold() not in taken else f"{name}_{number}").casefold() in taken:
            number += 1
        taken.add(free.casefold())
        paths[key] = output.with_name(f"{output.stem}-{free}{output.suffix}")
    return paths


def _material_name(file: GltfFile, key: PrimitiveKey) -> str:
    index = file.item("meshes", key[0])["primitives"][key[1]].get("material")
    return "" if index is None else str(file.item("materials", index).get("name") or f"material {index}")


def _safe(name: str) -> str:
    """Name made safe as part of a file name."""
    kept = "".join(character if character.isalnum() or character in _SAFE else " " for character in name)
    return "_".join(kept.split())[:_LONGEST].strip("._-") or "map"
