"""Variants of materials: KHR_materials_variants, by which primitives have another material.

A primitive without a mapping for a variant keeps its own material. Source: the extension's specification.
"""

from __future__ import annotations

from translucent.errors import InputError, close_names, did_you_mean
from translucent.gltf.fields import extension, refused
from translucent.gltf.file import GltfFile, Json

VARIANTS = "KHR_materials_variants"


def variant_names(file: GltfFile) -> tuple[str, ...]:
    """Names of the variants of a file, in its order; raises `InputError` if they are not a list of named objects."""
    listed = extension(file, "the file", file.tree, VARIANTS).get("variants", [])
    if not (isinstance(listed, list) and all(isinstance(one, dict) for one in listed)):
        raise refused(file, f"{VARIANTS}: variants is not a list of objects")
    return tuple(str(one.get("name", f"variant {i}")) for i, one in enumerate(listed))


def variant_index(file: GltfFile, name: str | None) -> int | None:
    """Index of a variant by its name; None for None, the file's own materials.

    Raises
    ------
    InputError
        If there is no such variant.
    """
    if name is None:
        return None
    names = variant_names(file)
    if name in names:
        return names.index(name)
    asked = f"variant {name!r} of {str(file.path)!r}"
    if not names:
        raise InputError(asked, f"it has no variants ({VARIANTS})", "leave the variant out")
    near = close_names(name, names)
    do = f"use one of {', '.join(names)}"
    raise InputError(asked, "no such variant", f"{did_you_mean(near)} {do}" if near else do)


def material_index(file: GltfFile, primitive: Json, variant: int | None) -> int | None:
    """Index of the material that a primitive has in a variant, if it has any.

    Raises
    ------
    InputError
        If its mappings are not a list of materials with lists of variants.
    """
    own: int | None = primitive.get("material")
    if variant is None:
        return own
    mappings = extension(file, "a primitive", primitive, VARIANTS).get("mappings", [])
    if not (isinstance(mappings, list) and all(isinstance(one, dict) for one in mappings)):
        raise refused(file, f"{VARIANTS}: mappings is not a list of objects")
    for mapping in mappings:
        users = mapping.get("variants")
        if not isinstance(users, list):
            raise refused(file, f"{VARIANTS}: a mapping has no list of variants")
        if variant in users:
            file.item("materials", mapping.get("material"))
            return int(mapping["material"])
    return own
