"""Repair of what an audit finds, as far as it can be told from the file: thickness is baked, slips of factors mended.

Baked, into a material of its own, is each primitive whose thickness is wrong; metallicFactor of what transmits
becomes 0, and doubleSided of volumes goes. Everything else stays as it is: what the file holds keeps its bytes and its
index, and new images are put behind. Holes, windings, units and attenuations are not touched: only who made the file
knows what was meant.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

from translucent.bake.audit.check import check_file, check_materials
from translucent.bake.audit.finding import MaterialCheck
from translucent.bake.bake import bake_thickness
from translucent.bake.gltf.builder import GlbBuilder
from translucent.bake.gltf.maps import write_maps
from translucent.bake.gltf.targets import Target, find_targets
from translucent.bake.jobs import ON_SURFACE
from translucent.bake.settings import BakeSettings
from translucent.bake.thickness_map import ThicknessMap
from translucent.bake.writing import check_map_output
from translucent.errors import InputError
from translucent.gltf.file import GltfFile, read_gltf
from translucent.gltf.write_file import write_gltf

#: Findings that a bake mends, and those that a change of the material does.
BAKED = frozenset(
    {
        "thickness-too-large",
        "thickness-too-small",
        "thickness-zero",
        "thickness-map-empty",
        "thickness-map-inverted",
        "thickness-map-off",
        "thickness-texture-unreadable",
        "shell-as-solid",
    }
)
WRITTEN = frozenset({"metal", "double-sided"})


def fix_materials(
    path: str | Path,
    output: str | Path,
    *,
    size: int = 512,
    rays: int = 64,
    threads: int | None = None,
    allow_outside: bool = False,
) -> MaterialCheck:
    """Write a copy of a glTF file with the thickness of its meshes baked where what it states is wrong.

    Parameters
    ----------
    path : path
        A .glb or .gltf file.
    output : path
        A .glb file. Of what is right it is a copy; without anything to mend, of all.
    size : int
        Texels along each side of a baked map.
    rays : int
        From each of them, around its normal; see `bake_thickness`.
    threads : int, optional
        Default: as many as there are processors.
    allow_outside : bool
        As for `check_materials`.

    Returns
    -------
    MaterialCheck
        Of the file that was written: what is left to do.

    Raises
    ------
    InputError
        If the file or a setting is wrong, or the output is no .glb; if a mesh has no UVs and xatlas is missing.
    RenderError
        If the file cannot be written, or embreex is missing.
    """
    output, settings = Path(output), BakeSettings(size=size, rays=rays)
    if output.suffix.lower() != ".glb":
        raise InputError(f"output {str(output)!r}", f"suffix {output.suffix!r}", "use .glb, which holds the maps, too")
    check_map_output(output)
    file = read_gltf(path, allow_outside)
    found = check_file(file)
    builder = GlbBuilder(file)
    closed = {(body["mesh"], body["primitive"]) for body in found.bodies if body["closed"]}
    for material in {one.material for one in found.findings if one.code in WRITTEN}:
        _mend(builder, material)
    keys = {one.place for one in found.findings if one.code in BAKED and one.place in closed}
    if keys:
        targets = {target.key: target for target in find_targets(builder, size=size, only=keys)}
        results = {key: _bake(target, settings, threads) for key, target in targets.items()}
        write_maps(builder, output, results, targets=targets, about={"model": str(path), "model_unit": "m"})
    else:
        write_gltf(builder.file(), output)
    return check_materials(output)


def _mend(builder: GlbBuilder, index: int) -> None:
    """Let a material transmit, without its back sides."""
    material = GltfFile(Path(), builder.tree).item("materials", index)
    extensions = material.get("extensions", {})
    if extensions.get("KHR_materials_transmission", {}).get("transmissionFactor", 0) > 0:
        surface = material.setdefault("pbrMetallicRoughness", {})
        if "metallicRoughnessTexture" not in surface:
            surface["metallicFactor"] = 0
    if "KHR_materials_volume" in extensions:
        material.pop("doubleSided", None)


def _bake(target: Target, settings: BakeSettings, threads: int | None) -> ThicknessMap:
    around = target.around
    if around is None:
        return bake_thickness(target.mesh, settings, threads=threads)
    near = dataclasses.replace(settings, high_distance=ON_SURFACE * around.diagonal)
    return bake_thickness(target.mesh, near, high=around, threads=threads)
