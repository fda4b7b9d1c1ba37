"""Findings of an audit: the rules about materials, meshes, and stated thickness, and the colors that viewers show.

A stated factor is right where it is near some honest measure of the body: the median along normals, around them (what
a bake of mode cone holds), or along views. Between the smallest and the largest of them nothing is found.

Colors are means over views from all sides, of white light straight behind the body, without refraction and reflection.
The lengths and the formulas, per viewer, with their sources; versions move, and these were read, not run:

- three.js (`transmission_pars_fragment.glsl.js`, revision 08e1c55) and the Khronos glTF sample renderer (`ibl.glsl`,
  `punctual.glsl`): the stated thickness along the ray, whatever its angle, times the lengths of the columns of the
  node's matrix; sigma_t = -ln(c) / d.
- Filament (`surface_light_indirect.fs`): thickness times the cosine of the refracted ray, the chord of a ball of that
  diameter; c is clamped at 1e-5.
- Blender (glTF-Blender-IO, `KHR_materials_volume` of its importer, and the node Volume Absorption): Cycles traces the
  true length and ignores the thickness; the importer writes density 1 / d, and the node absorbs (1 - c) / d, not
  -ln(c) / d.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from pathlib import Path
from typing import Any, Literal

import numpy as np

from translucent.arrays import Array
from translucent.bake.audit.body import Body, Placement, material_name
from translucent.formulas import optics
from translucent.formulas.color import to_hex
from translucent.gltf.accessors import Accessors, raw_mesh
from translucent.gltf.file import GltfFile, Json
from translucent.gltf.materials import DRAFTS, EXCLUDED, TRANSMISSION, VOLUME, GltfMaterial
from translucent.gltf.nodes import primitives
from translucent.media.medium import BLACKEST, Medium, extinction_at
from translucent.units import length_text

Severity = Literal["error", "warning", "note"]
_Told = tuple[str, Severity, str, str]

#: From the worst to the mildest.
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")

#: Largest index of refraction of what is clear: rutile and moissanite have 2.6 to 2.9.
LARGEST_IOR = 3.0

#: Smallest reported error of a length as viewers scale it.
SCALE_ERROR = 0.05

#: Fraction of rays without an exit from which on a hole is an error.
LEAKS = 0.02

#: Points of each of two bodies whose boxes overlap, and the most winding numbers, times triangles, to work out.
POINTS, MOST_WORK = 48, 5e7

#: Winding numbers between these are those of points on a surface; fractions of points inside that make bodies cross.
ON_SURFACE, CROSSING = (0.2, 0.8), 0.05

#: Ratios of stated to true thickness from which on it is a warning, and an error.
SUSPECT, WRONG = 1.5, 3.0

#: Largest wall, as a fraction of the body's smallest side; the thickness of the body is within this factor of it.
WALL_SHARE, OF_THE_BODY = 0.3, 2.0

#: Rank correlation below which a map is dark where the body is thick, and the least spread that has a meaning.
INVERTED, SPREAD = -0.3, 1.5

#: Fraction of the true thickness below which a map has no value, and of the surface from which on that is a finding.
NO_VALUE, MUCH = 0.01, 0.1

#: Fraction of the surface from which on a map that is off there by more than `WRONG` is a finding.
MUCH_OFF = 0.25

#: Transmittance that an 8-bit picture shows as black, and the one that it shows as white.
BLACK, WHITE = 1.0 / 255.0, 254.0 / 255.0

#: A medium in a body of the right size passes light between these.
PLAUSIBLE = (0.05, 0.95)

#: Units that files are written in by mistake, by their length in metres.
UNITS = (("centimetres", 0.01), ("millimetres", 0.001), ("inches", 0.0254))

#: Thickness in metres, along views, between which translucent bodies usually are.
USUAL = (1e-5, 0.5)


@dataclass(frozen=True)
class MaterialFinding:
    """Finding about a material, or about a body that it fills.

    Attributes
    ----------
    severity : {"error", "warning", "note"}
        Error: viewers or ray tracers show something else than what is meant. Warning: they disagree, or it is likely a
        mistake. Note: worth a look.
    code : str
        Kind of finding, such as ``"thickness-too-large"``; all of them are in ``docs/gltf.md``.
    where : str
        Material, mesh with primitive, and node, by name or index.
    text : str
        What was found, with numbers.
    do : str
        What to change.
    material : int
        Index of the material in the file.
    place : (int, int), optional
        Indices of the mesh, and of the primitive in it; None of what is of the material alone.
    """

    severity: Severity
    code: str
    where: str
    text: str
    do: str
    material: int
    place: tuple[int, int] | None = None

    def __str__(self) -> str:
        return f"{self.severity} {self.code}: {self.where}: {self.text}; {self.do}"


@dataclass(frozen=True, eq=False)
class MaterialCheck:
    """Result of the audit of a glTF file, from `translucent.check_materials`.

    Attributes
    ----------
    path : Path
    findings : tuple of MaterialFinding
        Errors first.
    bodies : tuple of dict
        What was measured of each body, as values that JSON can hold: lengths in metres of the world, colors linear.
    """

    path: Path
    findings: tuple[MaterialFinding, ...]
    bodies: tuple[dict[str, Any], ...]

    @property
    def errors(self) -> tuple[MaterialFinding, ...]:
        """Findings of severity error."""
        return tuple(found for found in self.findings if found.severity == "error")

    @property
    def codes(self) -> tuple[str, ...]:
        """Kinds of findings, each once."""
        return tuple(dict.fromkeys(found.code for found in self.findings))

    def summary(self) -> dict[str, Any]:
        """Findings and measurements as values that JSON can hold."""
        return {
            "model": str(self.path),
            "findings": [asdict(found) for found in self.findings],
            "counts": {name: sum(found.severity == name for found in self.findings) for name in SEVERITIES},
            "bodies": list(self.bodies),
        }

    def __str__(self) -> str:
        return "\n".join(map(str, self.findings)) or "no findings"


def material_findings(material: GltfMaterial, entry: Json) -> Iterator[MaterialFinding]:
    """Findings about a material alone, without its meshes."""
    extensions = entry.get("extensions", {})
    for code, severity, text, do in (*_transport(material, entry, extensions), *_optics(material)):
        yield MaterialFinding(severity, code, material_name(material), text, do, material.index)


def _transport(material: GltfMaterial, entry: Json, extensions: Json) -> Iterator[_Told]:
    """Rules about transmission: whether light enters the material at all."""
    surface = entry.get("pbrMetallicRoughness", {})
    metallic = surface.get("metallicFactor", 1.0)
    if material.transmission > 0 and metallic == 1 and "metallicRoughnessTexture" not in surface:
        reported = "is 1" if "metallicFactor" in surface else "is missing, so it is 1 by default"
        text = f"metallicFactor {reported}: metals transmit no light, so viewers draw this material as metal or black"
        yield "metal", "error", text, "set metallicFactor to 0 (--fix does)"
    if material.has_volume and not material.transmits:
        text = f"{VOLUME} without {TRANSMISSION}, or with a factor of 0: no light enters, so the material is opaque"
        severity: Severity = "warning" if np.isfinite(material.attenuation_distance) else "note"
        yield "no-light-enters", severity, text, f"add {TRANSMISSION}, or remove the volume"
    if entry.get("doubleSided") is True and material.thickness > 0:
        text = "doubleSided has no effect on the boundary of a volume, but some viewers also draw the back faces"
        yield "double-sided", "warning", text, "remove doubleSided (--fix does)"
    for name in DRAFTS.values():
        if name in extensions and material.has_volume:
            text = f"{name} is a draft: viewers without it treat scattering as absorption, and show darker colors"
            yield "draft-extension", "note", text, "also check the material in a viewer without this extension"
    for name in EXCLUDED:
        if name in extensions and material.has_volume:
            yield "excluded-extension", "error", f"{name} must not be used with {VOLUME}", "remove one of them"


def _optics(material: GltfMaterial) -> Iterator[_Told]:
    """Rules about attenuation and the index of refraction."""
    black = [c for c, value in zip(("red", "green", "blue"), material.attenuation_color, strict=True) if value == 0]
    if black and np.isfinite(material.attenuation_distance):
        text = (
            f"attenuationColor {' and '.join(black)} is 0, so the extinction is infinite: some viewers show black, "
            f"Filament uses {BLACKEST:g}, and the Khronos viewer shows white where the thickness is 0"
        )
        yield "attenuation-zero", "warning", text, "use a small value, such as 0.001"
    if not material.transmits:
        return
    if material.ior == 1:
        text = "ior is 1: nothing is reflected or refracted, and three.js ignores the roughness in transmission"
        yield "ior-one", "note", text, "set the real ior (water 1.33, glass 1.5), unless 1 is intended"
    elif material.ior == 0:
        yield "ior-zero", "note", "ior 0 is for specular-glossiness materials", "set the real ior"
    elif material.ior > LARGEST_IOR:
        text = f"ior {material.ior:g} is higher than that of any transparent material"
        yield "ior-large", "warning", text, "check the ior: even diamond has only 2.42"


def scale_findings(body: Body) -> Iterator[MaterialFinding]:
    """Findings about nodes with a non-uniform scale, for which viewers compute a wrong thickness."""
    if body.material.thickness == 0:
        return
    for placement in body.placements:
        least, most = scale_errors(placement.matrix)
        if max(most, 1.0 / least) <= 1.0 + SCALE_ERROR:
            continue
        where = f"{material_name(body.material)}, mesh {body.name!r}, node {placement.name!r}"
        text = (
            f"the node has a non-uniform scale: three.js, the Khronos viewer and PlayCanvas then use {least:.2f} to "
            f"{most:.2f} times the true length"
        )
        yield _found(body, "warning", "scale-uneven", text, "apply the scale to the vertices", where)


def scale_errors(matrix: Array) -> tuple[float, float]:
    """Smallest and largest ratio of the length that viewers compute to the true length, over all directions.

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


def mesh_findings(file: GltfFile, body: Body) -> Iterator[MaterialFinding]:
    """Findings about holes and winding of a body with a thickness."""
    if body.material.thickness == 0:
        return
    found = body.mesh.diagnosis
    if not found.closed:
        count = found.open_edges.count
        text = (
            f"the mesh has holes ({count} open edge{'s' if count != 1 else ''}), and {body.escaped:.1%} of the rays "
            "find no exit: a volume must be closed, or ray tracers show errors"
        )
        do = "close the mesh; for a thin sheet, set thicknessFactor to 0 and color it by baseColorFactor"
        severity: Severity = "error" if body.escaped > LEAKS else "warning"
        yield _found(body, severity, "open-mesh", text, do)
    elif body.escaped > LEAKS:
        text = f"{body.escaped:.1%} of the rays find no exit, although the mesh is closed: parts of it are inside out"
        do = "flip these parts, or split the mesh where it intersects itself"
        yield _found(body, "warning", "inside-out", text, do)
    yield from _winding(file, body)


def _winding(file: GltfFile, body: Body) -> Iterator[MaterialFinding]:
    """Findings about the winding of faces in the file, before any repair."""
    primitive = primitives(file, file.item("meshes", body.key[0]))[body.key[1]]
    plain = {**primitive, "attributes": {"POSITION": primitive["attributes"].get("POSITION")}}
    raw = raw_mesh(Accessors(file), plain, body.name)
    if raw is None:
        return
    found, do = raw.diagnosis, "make the winding consistent, with all normals outwards"
    if found.mixed_edges:
        text = f"faces have inconsistent winding at {found.mixed_edges.count} edges: viewers cull some of these faces"
    elif found.inverted:
        text = "all faces point inwards: viewers show the far side, or nothing"
    elif found.inside_out_parts:
        text = f"{found.inside_out_parts} closed parts have faces that point inwards"
    else:
        return
    yield _found(body, "error", "winding", text, do)


def overlap_findings(bodies: Sequence[Body]) -> Iterator[MaterialFinding]:
    """Findings about bodies that cross each other, or lie in one another."""
    placed = [(body, one) for body in bodies if body.material.thickness > 0 for one in body.placements]
    vertices = [body.placed(one) for body, one in placed]
    boxes = [(points.min(axis=0), points.max(axis=0)) for points in vertices]
    work = 0.0
    for i, j in combinations(range(len(placed)), 2):
        if (boxes[i][0] >= boxes[j][1]).any() or (boxes[i][1] <= boxes[j][0]).any():
            continue
        if placed[i][0].mesh is placed[j][0].mesh and placed[i][1] is placed[j][1]:
            continue  # primitives that bound one body
        work += POINTS * (len(placed[i][0].mesh.faces) + len(placed[j][0].mesh.faces))
        if work > MOST_WORK:
            text = "too many bodies or triangles are close to each other, so some pairs were not tested for overlaps"
            yield _found(placed[i][0], "note", "overlap-unchecked", text, "to test all pairs, split the file")
            return
        yield from _pair(*placed[i], *placed[j])


def _pair(one: Body, at: Placement, other: Body, there: Placement) -> Iterator[MaterialFinding]:
    """Finding about two bodies whose boxes share space."""
    mine, theirs = _inside(one, at, other, there), _inside(other, there, one, at)
    where = f"{material_name(one.material)}, node {at.name!r}, and {material_name(other.material)}, node {there.name!r}"
    if mine > 1 - CROSSING or theirs > 1 - CROSSING:
        inner, outer = (at.name, there.name) if mine > theirs else (there.name, at.name)
        text = (
            f"{inner!r} lies inside {outer!r}: three.js and Filament do not show one transmissive body through another"
        )
        do = "for viewers, give one of the two bodies alphaMode BLEND, or no transmission; ray tracers need no change"
        yield _found(one, "note", "nested", text, do, where)
    elif mine > CROSSING and theirs > CROSSING:
        text = f"the bodies overlap ({mine:.0%} and {theirs:.0%} of their surfaces lie inside the other body): in the "
        text += "overlap, some renderers use both media, others one of them"
        do = "separate the bodies, or choose which medium fills the overlap (tl.Object(priority=...))"
        yield _found(one, "warning", "overlap", text, do, where)


def _inside(body: Body, at: Placement, other: Body, there: Placement) -> float:
    """Fraction of a body's surface inside another body; points on the surface of the other body do not count."""
    step = max(1, len(body.points) // POINTS)
    world = body.points[::step] @ at.matrix[:3, :3].T + at.matrix[:3, 3]
    local = np.linalg.solve(there.matrix[:3, :3], (world - there.matrix[:3, 3]).T).T
    low, high = other.mesh.bounds
    boxed = ((local > low) & (local < high)).all(axis=1)
    winding = np.zeros(len(local))
    winding[boxed] = [abs(other.mesh.winding_number(point)) for point in local[boxed]]
    clear = (winding <= ON_SURFACE[0]) | (winding >= ON_SURFACE[1])
    return float(np.mean(winding[clear] >= ON_SURFACE[1])) if clear.any() else 0.0


def thickness_findings(body: Body) -> Iterator[MaterialFinding]:
    """Findings about the thickness that a body's material states."""
    if body.texture_problem:
        do = "export the mesh with these texture coordinates, or let --fix bake a texture"
        yield _found(body, "error", "thickness-texture-unreadable", body.texture_problem, do)
    if body.material.thickness == 0:
        yield from _without_thickness(body)
        return
    yield from _against_truth(body)
    if body.material.has_thickness_texture and not body.texture_problem:
        yield from _map_findings(body)


def attenuation_findings(body: Body) -> Iterator[MaterialFinding]:
    """Findings about the color that a body transmits, and about its size."""
    lengths = body.chords * body.world_views()
    thick = float(np.median(lengths[np.isfinite(lengths)])) if np.isfinite(lengths).any() else 0.0
    if thick == 0 or body.material.medium() is None:
        return
    extinction = extinction_of(body)
    passed = Medium(absorption=extinction).transmittance(thick)
    at = f"at the true thickness of {length_text(thick)} (median along view rays)"
    reported = False
    if extinction.any() and passed.max() < BLACK:
        do = "raise attenuationDistance, or brighten attenuationColor"
        yield _found(body, "warning", "attenuation-black", f"{at}, no light passes: the body is black", do)
        reported = yield from _units(body, thick, extinction, UNITS)
    elif extinction.any() and passed.min() > WHITE:
        text = f"{at}, white light becomes {to_hex(passed)}: the attenuation is not visible"
        yield _found(body, "warning", "attenuation-none", text, "lower attenuationDistance")
        reported = yield from _units(body, thick, extinction, [(name, 1.0 / size) for name, size in UNITS[:2]])
    if not reported and not USUAL[0] <= thick <= USUAL[1]:
        scale = 0.01 if thick > USUAL[1] else 100.0
        text = f"the body is {length_text(thick)} thick along view rays, an unusual size for a translucent body"
        do = f"check the unit: glTF is in metres; for {length_text(scale * thick)}, scale the node by {scale:g}"
        yield _found(body, "note", "size-unusual", text, do)


def extinction_of(body: Body) -> Array:
    """(3,): extinction that the material states, in 1/m of the world."""
    return extinction_at(body.material.attenuation_color, body.material.attenuation_distance)


def _without_thickness(body: Body) -> Iterator[MaterialFinding]:
    material = body.material
    if not material.has_volume or not extinction_of(body).any():
        return
    text = "thicknessFactor is 0, but the material has an attenuation: viewers draw a thin wall without it"
    if body.mesh.diagnosis.closed:
        thick = length_text(float(np.nanmedian(np.where(np.isfinite(body.beneath), body.beneath, np.nan))))
        do = f"set it to the thickness of the mesh, {thick} along the normals in mesh space (--fix bakes it)"
        yield _found(body, "error", "thickness-zero", text, do)
    else:
        yield _found(body, "warning", "thickness-zero", text, "remove the attenuation, or close the mesh")


def _against_truth(body: Body) -> Iterator[MaterialFinding]:
    known = [value for value in body.typical if np.isfinite(value) and value > 0]
    stated = float(np.median(body.stated))
    if not known or stated <= 0:
        return
    low, high = min(known), max(known)
    ratio = stated / high if stated > high else low / stated if stated < low else 1.0
    if ratio <= SUSPECT:
        return
    side = float(np.ptp(body.mesh.bounds, axis=0).min())
    beneath = body.typical[0]
    if stated > high and beneath < WALL_SHARE * side and side / OF_THE_BODY <= stated <= OF_THE_BODY * side * 1.5:
        text = (
            f"the mesh is a shell with walls of {beneath:.3g}, but the stated thickness {stated:.3g} is the "
            "thickness of the whole body (mesh space)"
        )
        do = f"set thicknessFactor to the wall thickness, {beneath:.3g} (--fix bakes it), or remove the inner surface"
        yield _found(body, "error", "shell-as-solid", text, do)
        return
    severity: Severity = "error" if ratio >= WRONG and extinction_of(body).any() else "warning"
    code = f"thickness-too-{'large' if stated > high else 'small'}"
    yield _found(body, severity, code, _compared(body, stated, ratio), _advice(body, code, low, high))


def _compared(body: Body, stated: float, ratio: float) -> str:
    beneath, around, chords = body.typical
    ends = [np.percentile(values[np.isfinite(values)], 95) for values in (body.beneath, body.chords)]
    per_metre = float(np.median(body.world_normals()))
    text = (
        f"the stated thickness is {stated:.3g} (median), but the true thickness is {beneath:.3g} along normals (p95 "
        f"{ends[0]:.3g}), {chords:.3g} along view rays (p95 {ends[1]:.3g}) and {around:.3g} around normals, in mesh "
        f"space, where 1 is {length_text(per_metre)}: wrong by a factor of {ratio:.3g}"
    )
    if not extinction_of(body).any():
        return f"{text}; the medium is clear, so only the refraction is wrong"
    shown, true = mean_colors(body)
    return f"{text}; viewers show {to_hex(shown)} in place of {to_hex(true)}"


def _advice(body: Body, code: str, low: float, high: float) -> str:
    span = f"{low:.3g}" if high < 1.05 * low else f"{low:.3g} to {high:.3g}"
    do = f"set thicknessFactor to {span}" + (" (--fix bakes a map)" if body.mesh.diagnosis.closed else "")
    if code == "thickness-too-small":
        return f"{do}; for a hollow body, add its inner surface: ray tracers treat this body as solid"
    return do


def mean_colors(body: Body) -> tuple[Array, Array]:
    """Mean transmitted colors over all views: for the stated thickness, and for the true thickness."""
    medium, world = Medium(absorption=extinction_of(body)), body.world_views()
    finite = np.isfinite(body.chords)
    if not finite.any():
        return np.ones(3), np.ones(3)
    with np.errstate(under="ignore"):
        stated, true = (
            medium.transmittance(part[finite] * world[finite]).mean(axis=0) for part in (body.seen_stated, body.chords)
        )
    return stated, true


def _map_findings(body: Body) -> Iterator[MaterialFinding]:
    from scipy.stats import rankdata

    finite = np.isfinite(body.around) & (body.around > 0)
    stated, true = body.stated[finite], body.around[finite]
    if len(true) < 2:
        return
    empty = float(np.mean(stated < NO_VALUE * true))
    if empty > MUCH:
        text = f"the thickness texture is black on {empty:.0%} of the surface; viewers show no attenuation there"
        yield _found(body, "warning", "thickness-map-empty", text, "bake the texture again (--fix)")
    low, high = np.percentile(true, [10, 90])
    if high > SPREAD * low and np.ptp(stated) > 0:
        correlation = float(np.corrcoef(rankdata(stated), rankdata(true))[0, 1])
        if correlation < INVERTED:
            text = f"the thickness texture is dark where the mesh is thick (rank correlation {correlation:.2f})"
            yield _found(body, "error", "thickness-map-inverted", text, "invert it: white is thick (--fix bakes it)")
            return
    below, above = np.minimum(body.beneath[finite], true), np.maximum(body.beneath[finite], true)
    off = float(np.mean((stated > WRONG * above) | (WRONG * stated < below)))
    if off > MUCH_OFF and off > empty:
        text = f"on {off:.0%} of the surface, the thickness texture is wrong by a factor of more than {WRONG:g}"
        yield _found(body, "warning", "thickness-map-off", text, "bake it again (--fix): it may be of another mesh")


def _units(
    body: Body, thick: float, extinction: Array, units: Sequence[tuple[str, float]]
) -> Generator[MaterialFinding, None, bool]:
    """Yield a finding, and return True, if the medium would suit a body of another size."""
    for name, scale in units:
        passed = Medium(absorption=extinction).transmittance(scale * thick)
        if passed.max() > PLAUSIBLE[0] and passed.min() < PLAUSIBLE[1]:
            small = scale < 1
            meant = "the lengths were in" if small else "the attenuation was meant for"
            text = (
                f"at a thickness of {length_text(thick)}, the body is {'black' if small else 'clear'}; at "
                f"{length_text(scale * thick)}, it would be {to_hex(passed)}, as if {meant} {name}"
            )
            do = f"glTF is in metres: scale the node by {scale:g}, or attenuationDistance by {1 / scale:g}"
            yield _found(body, "warning", "units-suspect", text, do)
            return True
    return False


def _found(body: Body, severity: Severity, code: str, text: str, do: str, where: str | None = None) -> MaterialFinding:
    return MaterialFinding(severity, code, where or body.where, text, do, body.material.index, body.key)


def viewer_colors(body: Body) -> dict[str, Array]:
    """Mean linear color (3,) that a body transmits in each viewer, and the true one."""
    finite = np.isfinite(body.chords)
    if not finite.any():
        return {}
    material, matrix = body.material, body.placements[0].matrix[:3, :3]
    world = body.world_views()[finite]
    directions = body.views[finite] @ matrix.T / world[:, None]
    stated = body.seen_stated[finite]
    by_columns = stated * np.linalg.norm(directions * np.linalg.norm(matrix, axis=0), axis=1)
    ior = material.ior or 1.5
    refracted = optics.refracted_cosine(body.cosines[finite], ior)
    color, distance = np.asarray(material.attenuation_color), material.attenuation_distance
    sigma = extinction_of(body)
    absorbed = np.zeros(3) if np.isinf(distance) else (1.0 - np.maximum(color, BLACKEST)) / distance
    lengths = {
        "true": (sigma, body.chords[finite] * world),
        "three.js": (sigma, by_columns),
        "Khronos sample viewer": (sigma, by_columns),
        "Filament": (sigma, by_columns * refracted),
        "Blender (Cycles)": (absorbed, body.chords[finite] * world),
    }
    with np.errstate(under="ignore"):
        return {name: Medium(absorption=s).transmittance(length).mean(axis=0) for name, (s, length) in lengths.items()}
