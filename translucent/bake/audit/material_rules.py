"""Findings about a material by itself, and about how nodes scale what it fills."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from translucent.arrays import Array
from translucent.bake.audit.body import Body, material_name
from translucent.bake.audit.finding import MaterialFinding, Severity
from translucent.gltf.file import Json
from translucent.gltf.materials import EXCLUDED, TRANSMISSION, VOLUME, GltfMaterial
from translucent.gltf.scattering import DRAFTS
from translucent.media.medium import BLACKEST

#: Largest index of refraction of what is clear: rutile and moissanite have 2.6 to 2.9.
LARGEST_IOR = 3.0

#: Error of a length, by the way in which viewers scale it, that is told.
SCALE_ERROR = 0.05


def material_findings(material: GltfMaterial, entry: Json) -> Iterator[MaterialFinding]:
    """Findings about what a material states by itself."""
    extensions = entry.get("extensions", {})
    for code, severity, text, do in _transport(material, entry, extensions):
        yield MaterialFinding(severity, code, material_name(material), text, do, material.index)
    for code, severity, text, do in _optics(material):
        yield MaterialFinding(severity, code, material_name(material), text, do, material.index)


_Told = tuple[str, Severity, str, str]


def _transport(material: GltfMaterial, entry: Json, extensions: Json) -> Iterator[_Told]:
    """Rules of how light gets in at all."""
    surface = entry.get("pbrMetallicRoughness", {})
    metallic = surface.get("metallicFactor", 1.0)
    if material.transmission > 0 and metallic == 1 and "metallicRoughnessTexture" not in surface:
        told = "is 1" if "metallicFactor" in surface else "is not stated, and 1 by default"
        text = f"metallicFactor {told}: metal transmits nothing, and viewers draw it black or as metal"
        yield "metal", "error", text, "write metallicFactor 0 (--fix does)"
    if material.has_volume and not material.transmits:
        text = f"{VOLUME} without {TRANSMISSION}, or with a factor of 0: no light enters, and it is drawn opaque"
        severity: Severity = "warning" if np.isfinite(material.attenuation_distance) else "note"
        yield "no-light-enters", severity, text, f"add {TRANSMISSION}, or remove the volume"
    if entry.get("doubleSided") is True and material.thickness > 0:
        text = "doubleSided has no effect on the boundary of a volume, and some viewers draw its back, too"
        yield "double-sided", "warning", text, "remove it (--fix does)"
    for name in DRAFTS.values():
        if name in extensions and material.has_volume:
            text = (
                f"{name} is a draft: viewers that do not know it take all extinction for absorption, and show it darker"
            )
            yield "draft-extension", "note", text, "look at it without the extension, too"
    for name in EXCLUDED:
        if name in extensions and material.has_volume:
            yield "excluded-extension", "error", f"{name} must not be used with {VOLUME}", "remove one of them"


def _optics(material: GltfMaterial) -> Iterator[_Told]:
    """Attenuation and index of refraction."""
    black = [c for c, value in zip(("red", "green", "blue"), material.attenuation_color, strict=True) if value == 0]
    if black and np.isfinite(material.attenuation_distance):
        text = (
            f"attenuationColor {' and '.join(black)} is 0, whose logarithm is infinite: viewers show black, clamp it "
            f"at {BLACKEST:g} (Filament), or keep it white where the thickness is 0 (Khronos)"
        )
        yield "attenuation-zero", "warning", text, "write a small value, such as 0.001"
    if not material.transmits:
        return
    if material.ior == 1:
        text = "ior 1: nothing is mirrored and nothing bends, and three.js ignores its roughness in what passes"
        yield "ior-one", "note", text, "write the ior of the matter (water 1.33, glass 1.5), unless this is meant"
    elif material.ior == 0:
        yield "ior-zero", "note", "ior 0 is for materials of another workflow", "write the ior of the matter"
    elif material.ior > LARGEST_IOR:
        text = f"ior {material.ior:g} is more than that of any clear matter"
        yield "ior-large", "warning", text, "check it: diamond has 2.42"


def scale_findings(body: Body) -> Iterator[MaterialFinding]:
    """Findings about nodes that stretch a body unevenly: viewers get its thickness wrong there."""
    if body.material.thickness == 0:
        return
    for placement in body.placements:
        least, most = scale_errors(placement.matrix)
        if max(most, 1.0 / least) <= 1.0 + SCALE_ERROR:
            continue
        where = f"{material_name(body.material)}, mesh {body.name!r}, node {placement.name!r}"
        text = (
            "the node stretches the mesh unevenly: three.js, the Khronos viewer and PlayCanvas, which scale directions "
            f"of the world by the lengths of the matrix's columns, take {least:.2f} to {most:.2f} of the length"
        )
        do = "apply the scale to the vertices"
        yield MaterialFinding("warning", "scale-uneven", where, text, do, body.material.index, body.key)


def scale_errors(matrix: Array) -> tuple[float, float]:
    """Smallest and largest ratio of a world length as viewers scale it to the true one, over all directions.

    They take |s * v| for a world direction v, with s the lengths of the matrix's columns; true is 1 / |M^-1 v|.
    """
    linear = np.asarray(matrix, dtype=np.float64)[:3, :3]
    if np.linalg.matrix_rank(linear) < 3:
        return 1.0, 1.0
    directions = np.random.default_rng(0).normal(size=(512, 3))
    directions = np.concatenate([directions, linear.T, np.eye(3), np.linalg.svd(linear)[0].T])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    taken = np.linalg.norm(directions * np.linalg.norm(linear, axis=0), axis=1)
    ratio = taken * np.linalg.norm(np.linalg.solve(linear, directions.T), axis=0)
    return float(ratio.min()), float(ratio.max())
