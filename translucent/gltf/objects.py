"""Objects of a glTF scene: the primitives that its nodes place, as bodies, thin walls, or opaque objects.

=================================================  ==================================================================
material                                           object
=================================================  ==================================================================
transmissionFactor > 0 and thicknessFactor > 0     body: the medium of attenuationColor at attenuationDistance, and
                                                   the ior; its thickness is the true one of the mesh, along each
                                                   ray, and thicknessFactor and thicknessTexture are not needed. Its
                                                   surface is tinted by baseColorFactor, once
diffuseTransmissionFactor > 0 and a volume         body, too: the rest is diffuse reflection and transmission
transmissionFactor > 0, no volume or thickness 0   thin wall without an inside, which light crosses once per
                                                   face, tinted by baseColorFactor. It is infinitely thin by the
                                                   specification; here a pane that hardly adds to the thickness
everything else                                    opaque: metal, or a coat over a diffuse base, may emit, have holes,
                                                   and may let light of the other side through. A volume alone, or
                                                   with transmissionFactor 0, lets no light in
KHR_materials_unlit                                opaque: has its base color everywhere, and mirrors nothing
alphaMode BLEND, with an alpha below 1 somewhere   layer: a sheet that shows what the opaque object would, with alpha as
                                                   this much, over what is behind it with the rest (the specification's
                                                   ``over``), whatever the angle. Layers are painted object by object,
                                                   far ones first, as viewers do. What lies behind a body is dimmed by
                                                   all that its ray crosses, and seen straight, not bent
=================================================  ==================================================================

The tint of a wall is that of a straight view. A slanted view has it deeper, as in a pane with the wall's ior: at most
by the 1.34th power with the ior of 1.5 that materials have by default. A wall that transmits a fraction of the light
has its tint whatever the view, like its diffuse reflection.

alphaMode MASK makes holes in opaque objects and walls; a body with holes would have no inside, and is drawn closed.
Colors of vertices multiply the base color, and a mesh with them and without a material is matt. Emission adds its
radiance where a ray first enters a body, and occlusion dims the light of the environment.

Of all that, textures are read as far as `translucent.gltf.textures` does; normals are those of the mesh, smooth but at
creases, and not the file's. `LeftOut` lists what has no meaning here.
Source: glTF 2.0, section 3.9, and the extensions KHR_materials_transmission (infinitely thin), _volume, _ior,
_dispersion, _diffuse_transmission, _iridescence, _clearcoat, _emissive_strength and _unlit.

Positions are as morph targets and skins move them. A morph target adds its displacements, times a weight, to the
positions (section 3.7.2.2). A skin then moves each vertex by a weighted mean of matrices: those of its joints in the
world, after their inverse bind matrices (section 3.7.3). The transform of the node with the mesh has no effect on a
skinned one. Displacements of normals are not read: normals are those of the moved mesh, and thickness is exact.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from itertools import count
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.geometry.mesh import MIN_DIAGONAL, Mesh
from translucent.gltf.accessors import Accessors, primitive_mesh
from translucent.gltf.file import GltfFile, Json, JsonFields, LeftOut, label
from translucent.gltf.materials import (
    CLEARCOAT,
    DEFAULT_IOR,
    DIFFUSE_TRANSMISSION,
    IRIDESCENCE,
    TRANSMISSION,
    GltfMaterial,
    materials_of,
)
from translucent.gltf.nodes import material_index, node_transforms, primitives, variant_index
from translucent.gltf.textures import Textures
from translucent.media.medium import MAX_IOR, Medium, extinction_at
from translucent.scene.scene import OPAQUE_COLOR, Object
from translucent.scene.surface import MAX_DISPERSION, MAX_FILM, TEXTURE_FIELDS, Surface
from translucent.scene.texture import Texture

UNLIT = "KHR_materials_unlit"

#: Textures of extensions that are not read, and their names in messages.
UNREAD_TEXTURES = {
    CLEARCOAT: (("clearcoatTexture", "clearcoatRoughnessTexture", "clearcoatNormalTexture"), "textures of clear coats"),
    IRIDESCENCE: (("iridescenceTexture", "iridescenceThicknessTexture"), "textures of iridescence"),
    DIFFUSE_TRANSMISSION: (
        ("diffuseTransmissionTexture", "diffuseTransmissionColorTexture"),
        "textures of diffuse transmission",
    ),
}


#: Thickness of a thin wall as a fraction of the scene's diagonal: too little to see, enough to count as covered.
WALL_SHARE = 1e-5

#: Medium of a partly transparent layer: empty.
_CLEAR = Medium()

#: Message about alphaMode BLEND.
BLENDED = (
    "alphaMode BLEND: partly transparent layers, sorted by object as in viewers, without shadows, and not visible "
    "to refracted rays"
)

#: Smallest fraction of metal in a texture that is not taken for noise.
_METAL = 0.1


@dataclass(frozen=True, eq=False)
class SceneMaterial:
    """Material of objects in a scene: surface, medium, and whether it makes a thin wall.

    Attributes
    ----------
    color : (3,)
        baseColorFactor, linear: what an opaque object reflects, and by which a wall tints.
    medium : Medium or None
        What fills a body.
    wall_ior : float or None
        Index of refraction of a thin wall; None if it is none.
    surface : Surface or None
        What its interface does to light; None for an object without a material.
    hidden : bool
        Whether its alpha makes it one hole.
    blends : bool
        Whether alpha is the opacity of a layer over what is behind.
    opacity : float
        That of baseColorFactor.
    unlit : bool
        Whether nothing lights it.
    name : str
        Of the material, as messages call it.
    """

    color: npt.ArrayLike = OPAQUE_COLOR
    medium: Medium | None = None
    wall_ior: float | None = None
    surface: Surface | None = None
    hidden: bool = False
    blends: bool = False
    opacity: float = 1.0
    unlit: bool = False
    name: str = "none"

    @property
    def translucent(self) -> bool:
        """True if light passes the object."""
        return self.medium is not None or self.wall_ior is not None

    def wall_medium(self, thickness: float) -> Medium:
        """Medium with the tint of the wall in a sheet of this thickness in metres."""
        tints = self.surface is None or (np.asarray(self.surface.color) == 1).all()
        color = self.color if tints else np.ones(3)
        return Medium(absorption=extinction_at(color, thickness), ior=self.wall_ior or DEFAULT_IOR)


#: Material of a mesh with vertex colors and no material: matte.
VERTEX_COLORED = SceneMaterial((1.0, 1.0, 1.0), surface=Surface(roughness=1.0, ior=1.0))


def material_reader(
    file: GltfFile, metres: float, left_out: LeftOut, draft_extensions: bool = False
) -> Callable[[int | None], SceneMaterial]:
    """Function from a material index to the material of the scene, each read once; None is the default material.

    Parameters
    ----------
    file : GltfFile
    metres : float
        Per unit of the file, in which attenuation distances are.
    left_out : LeftOut
        Gets what the objects do not hold.
    draft_extensions : bool
        Whether extensions that are drafts count.
    """
    materials, entries = materials_of(file, draft_extensions=draft_extensions), file.items("materials")
    textures = Textures(file, left_out)

    @cache
    def read(index: int | None) -> SceneMaterial:
        if index is None:
            return SceneMaterial()
        name = label(entries, index)
        return _Reader(file, name, materials[index], entries[index], textures, left_out).read(metres)

    return read


class _Reader:
    """Reader of one material of a file."""

    def __init__(
        self, file: GltfFile, name: str, material: GltfMaterial, entry: Json, textures: Textures, left_out: LeftOut
    ) -> None:
        self.file, self.name, self.material, self.entry = file, name, material, entry
        self.textures, self.left_out = textures, left_out
        self.fields = JsonFields(file, f"material {name}", entry)
        self.base = self.fields.section("pbrMetallicRoughness")
        *color, self.opacity = self.base.numbers("baseColorFactor", (1.0, 1.0, 1.0, 1.0), 0.0, 1.0)
        self.color = np.array(color)
        self.diffuse = self.fields.extension(DIFFUSE_TRANSMISSION)
        self.alpha_mode = entry.get("alphaMode", "OPAQUE")
        if self.alpha_mode not in ("OPAQUE", "MASK", "BLEND"):
            self.fields.refuse(f"alphaMode {self.alpha_mode!r} is not defined in glTF 2.0")
        self.alpha_cutoff = self.fields.number("alphaCutoff", 0.5, 0.0) if self.alpha_mode == "MASK" else 0.0

    def read(self, metres: float) -> SceneMaterial:
        """Material of its objects; `metres` are per unit of the file."""
        found = self._without_alpha(metres)
        if found.surface is not None and not found.unlit:
            for name, (keys, what) in UNREAD_TEXTURES.items():
                if any(key in self.fields.extension(name).values for key in keys):
                    self.left_out.add(what, self.name)
        return dataclasses.replace(
            found,
            hidden=self.opacity < self.alpha_cutoff,
            blends=self.alpha_mode == "BLEND",
            opacity=self.opacity,
            name=self.name,
        )

    def _without_alpha(self, metres: float) -> SceneMaterial:
        passes = self.diffuse.number("diffuseTransmissionFactor", 0.0, 0.0, 1.0) > 0
        medium, transmission = self.material.medium(), self.material.transmission
        if UNLIT in self.fields.section("extensions").values:
            return SceneMaterial(self.color, surface=self._unlit(), unlit=True)
        if medium is not None and (transmission > 0 or passes):
            absorption, scattering = np.asarray(medium.absorption), np.asarray(medium.scattering)
            medium = dataclasses.replace(medium, absorption=absorption / metres, scattering=scattering / metres)
            return SceneMaterial(self.color, medium, surface=self._translucent(self.color))
        ior = self.material.ior or DEFAULT_IOR
        if transmission > 0:
            whole = transmission == 1 and "transmissionTexture" not in self.fields.extension(TRANSMISSION).values
            surface = self._translucent(np.ones(3) if whole else self.color)
            return SceneMaterial(self.color, wall_ior=ior, surface=surface)
        opaque = dataclasses.replace(self._with_sides(self._common()), color=self.color, ior=ior)
        return SceneMaterial(self.color, surface=opaque)

    def _unlit(self) -> Surface:
        texture, cutoff = self._color_texture(), self._texture_cutoff()
        black = Surface(color=(0, 0, 0), ior=1.0, emissive=self.color, color_texture=texture, alpha_cutoff=cutoff)
        return self._with_sides(dataclasses.replace(black, emissive_texture=texture))

    def _translucent(self, color: Array) -> Surface:
        if (dispersion := self.material.dispersion) > MAX_DISPERSION:
            self.left_out.add(f"dispersion above {MAX_DISPERSION:g}", self.name)
        return dataclasses.replace(
            self._common(),
            color=color,
            transmission=self.material.transmission,
            transmission_texture=self.textures.read(
                self.name, self.fields.extension(TRANSMISSION).values, "transmissionTexture"
            ),
            dispersion=min(dispersion, MAX_DISPERSION),
        )

    def _common(self) -> Surface:
        """Surface parameters common to all kinds of objects."""
        steep = self.fields.section("normalTexture").number("scale", 1.0)
        strength = self.fields.section("occlusionTexture").number("strength", 1.0, 0.0, 1.0)
        return Surface(
            roughness=self.base.number("roughnessFactor", 1.0, 0.0, 1.0),
            iridescence=self.material.iridescence,
            iridescence_ior=min(self.material.iridescence_ior, MAX_IOR),
            iridescence_thickness=min(self.material.iridescence_thickness, MAX_FILM),
            clearcoat=self.material.clearcoat,
            clearcoat_roughness=self.material.clearcoat_roughness,
            metallic=self.base.number("metallicFactor", 1.0, 0.0, 1.0),
            diffuse_transmission=self.diffuse.number("diffuseTransmissionFactor", 0.0, 0.0, 1.0),
            diffuse_transmission_color=self.diffuse.numbers(
                "diffuseTransmissionColorFactor", (1.0, 1.0, 1.0), 0.0, 1.0
            ),
            alpha_cutoff=self._texture_cutoff(),
            emissive=self.material.emissive,
            emissive_texture=self.textures.read(self.name, self.entry, "emissiveTexture", srgb=True),
            occlusion_texture=self.textures.read(self.name, self.entry, "occlusionTexture", strength=strength),
            color_texture=self._color_texture(),
            roughness_texture=self.textures.read(self.name, self.base.values, "metallicRoughnessTexture"),
            normal_texture=self.textures.read(self.name, self.entry, "normalTexture", normal_scale=steep),
        )

    def _color_texture(self) -> Texture | None:
        return self.textures.read(self.name, self.base.values, "baseColorTexture", srgb=True)

    def _with_sides(self, surface: Surface) -> Surface:
        """Surface of an opaque object with its visible sides."""
        double_sided = self.entry.get("doubleSided", False)
        if not isinstance(double_sided, bool):
            self.fields.refuse(f"doubleSided is {double_sided!r}, not true or false")
        return dataclasses.replace(surface, double_sided=double_sided)

    def _texture_cutoff(self) -> float:
        """Alpha of texture and vertices below which there is a hole: the rest of alpha is a factor."""
        return min(self.alpha_cutoff / max(self.opacity, 1e-9), 1.0)


def scene_objects(
    file: GltfFile,
    transforms: dict[int, Array],
    metres: float,
    left_out: LeftOut,
    draft_extensions: bool = False,
    variant: str | None = None,
) -> list[Object]:
    """Objects of a scene, one per node and primitive, with their materials.

    Parameters
    ----------
    file : GltfFile
    transforms : dict
        Node to world (4x4) of the nodes of the scene.
    metres : float
        Per unit of the file.
    left_out : LeftOut
        Gets what the objects do not hold.
    variant : str, optional
        Name of the variant whose materials they have.
    draft_extensions : bool
        Whether extensions that are drafts count.

    Raises
    ------
    InputError
        If there is no object or no such variant, or something about one is wrong.
    """
    material_of = material_reader(file, metres, left_out, draft_extensions)
    scale = np.diag([metres, metres, metres, 1.0])
    objects: list[Object] = []
    materials: list[SceneMaterial] = []
    for mesh, index, place in _placed_meshes(file, transforms, left_out, variant_index(file, variant)):
        material, surface = _fitted(material_of(index), mesh, left_out)
        if material.hidden:
            left_out.add("objects with an alpha of 0", repr(mesh.name))
            continue
        objects.append(Object(mesh, None, scale @ place, color=material.color, surface=surface))
        materials.append(material)
    if not objects:
        raise file.refused("the scene of the file has no triangles", "give a file with a mesh")
    boxes = np.stack([item.bounds for item in objects])
    diagonal = float(np.linalg.norm(boxes[:, 1].max(axis=0) - boxes[:, 0].min(axis=0)))
    wall = max(WALL_SHARE * diagonal, MIN_DIAGONAL)
    return [_with_medium(item, material, wall) for item, material in zip(objects, materials, strict=True)]


def _fitted(material: SceneMaterial, mesh: Mesh, left_out: LeftOut) -> tuple[SceneMaterial, Surface | None]:
    """Material as a mesh has it, and the part of its surface that the mesh supports."""
    if material.surface is None and mesh.colors is not None:
        material = VERTEX_COLORED
    if material.unlit and mesh.colors is not None and (mesh.colors[:, :3] < 1).any():
        left_out.add("vertex colors of unlit objects", repr(mesh.name))
    if (surface := material.surface) is None:
        return material, None
    if mesh.uv is None and any(surface.textures):
        left_out.add("textures of meshes without TEXCOORD_0", repr(mesh.name))
        without: dict[str, Any] = dict.fromkeys(TEXTURE_FIELDS)
        surface = dataclasses.replace(surface, **without)
    if material.blends:
        material = _blended(material, surface, mesh, left_out)
    if material.medium is not None and not material.hidden:
        if surface.alpha_cutoff > _alpha(surface, mesh):
            what = "alphaMode MASK on solids: the holes are drawn closed, because a solid with holes has no inside"
            left_out.add(what, material.name)
        surface = dataclasses.replace(surface, alpha_cutoff=0.0)
    # A metallicFactor alone decides nothing, since its default is 1 for glass, too.
    metals = surface.roughness_texture if material.translucent and surface.metallic > 0 else None
    if metals is not None and mesh.uv is not None and (metals.sample(mesh.uv)[:, 2] > _METAL).any():
        left_out.add("metal parts of translucent objects", repr(mesh.name))
    return material, surface


def _blended(material: SceneMaterial, surface: Surface, mesh: Mesh, left_out: LeftOut) -> SceneMaterial:
    """Material with alphaMode BLEND on a mesh: opaque where its alpha is 1 all over, and hidden where it is 0."""
    least = material.opacity * _alpha(surface, mesh)
    if material.translucent:
        if least < 1:
            left_out.add("alphaMode BLEND of translucent objects", material.name)
        return material
    if material.opacity == 0:
        return dataclasses.replace(material, hidden=True)
    if least == 1:
        return dataclasses.replace(material, blends=False)
    left_out.add(BLENDED, material.name)
    return material


def _alpha(surface: Surface, mesh: Mesh) -> float:
    """Smallest alpha of texture and vertices."""
    pixels = None if surface.color_texture is None else surface.color_texture.pixels
    least = 1.0 if pixels is None or pixels.shape[2] < 4 else float(pixels[..., 3].min())
    return least * (1.0 if mesh.colors is None else float(mesh.colors[:, 3].min()))


def _with_medium(item: Object, material: SceneMaterial, wall: float) -> Object:
    if item.surface is not None and material.blends and not material.translucent:
        surface = dataclasses.replace(item.surface, opacity=material.opacity)
        return dataclasses.replace(item, medium=_CLEAR, sheet_thickness=wall, surface=surface)
    if material.wall_ior is not None:
        return dataclasses.replace(item, medium=material.wall_medium(wall), sheet_thickness=wall)
    return dataclasses.replace(item, medium=material.medium)


def _placed_meshes(
    file: GltfFile, transforms: dict[int, Array], left_out: LeftOut, variant: int | None
) -> Iterator[tuple[Mesh, int | None, Array]]:
    """Mesh, material and transform of every primitive that a node places; each mesh that nothing moves is read once."""
    nodes = file.items("nodes")
    accessors = Accessors(file)
    deformer = Deformer(file, accessors)
    placed = {node: nodes[node]["mesh"] for node in transforms if "mesh" in nodes[node]}
    users = Counter(index for index in placed.values() if isinstance(index, int))
    known: dict[tuple[int, int, int | None], Mesh | None] = {}
    for node, index in placed.items():
        entry = file.item("meshes", index)
        place = np.eye(4) if deformer.skins(nodes[node]) else transforms[node]
        if not place[:3, :3].any():
            # "This provides a mechanism to animate visibility" (glTF 2.0, section on transformations).
            left_out.add("objects with a scale of 0", label(nodes, node))
            continue
        for i, primitive in enumerate(listed := primitives(file, entry)):
            moves = deformer.moves(nodes[node], primitive)
            key = index, i, node if moves else None
            if key not in known:
                name = _mesh_name(nodes[node], entry, index, shared=users[index] > 1) + (
                    f"[{i}]" if len(listed) > 1 else ""
                )
                moved = deformer.positions(nodes[node], entry, primitive) if moves else None
                known[key] = primitive_mesh(accessors, primitive, name, moved)
                if known[key] is None:
                    left_out.add("points and lines", repr(name))
            if (mesh := known[key]) is not None:
                yield mesh, material_index(file, primitive, variant), place


def _mesh_name(node: Json, entry: Json, index: int, *, shared: bool) -> str:
    """Name of an object: that of the only node that uses its mesh, or of the mesh, or of its first node."""
    names = [node.get("name"), entry.get("name")]
    for name in names[::-1] if shared else names:
        if isinstance(name, str) and name:
            return name
    return f"mesh {index}"


class Deformer:
    """Deformer of meshes by skins and morph targets, for the current pose of the nodes.

    Parameters
    ----------
    file : GltfFile
    accessors : Accessors
        Of that file.
    """

    def __init__(self, file: GltfFile, accessors: Accessors) -> None:
        self._file, self._accessors = file, accessors
        self._world: dict[int, Array] | None = None

    def skins(self, node: Json) -> bool:
        """True if a skin moves the mesh of a node, so its positions are in world space."""
        return "skin" in node

    def moves(self, node: Json, primitive: Json) -> bool:
        """True if morph targets or a skin move a primitive of the mesh of a node."""
        return self.skins(node) or bool(primitive.get("targets"))

    def positions(self, node: Json, mesh: Json, primitive: Json) -> Array:
        """(n, 3): positions of the vertices of a primitive, in the file's unit.

        Raises
        ------
        InputError
            If weights, joints or matrices are missing, of a wrong kind, or too few.
        """
        found = self._accessors.vectors(primitive["attributes"].get("POSITION"), "VEC3")
        if targets := primitive.get("targets"):
            found = self._morphed(found, targets, node.get("weights", mesh.get("weights")))
        return self._skinned(found, primitive["attributes"], node["skin"]) if self.skins(node) else found

    def _morphed(self, positions: Array, targets: object, weights: object) -> Array:
        if not (isinstance(targets, list) and all(isinstance(one, dict) for one in targets)):
            raise self._file.refused("the morph targets of a primitive are not a list of objects")
        given = [0.0] * len(targets) if weights is None else weights
        try:
            numbers = np.array(given, dtype=np.float64)
        except (TypeError, ValueError):
            numbers = np.zeros(0)
        if numbers.shape != (len(targets),) or not np.isfinite(numbers).all():
            raise self._file.refused(f"the weights are {given!r}, but the mesh has {len(targets)} morph targets")
        moved = positions.copy()
        for weight, target in zip(numbers.tolist(), targets, strict=True):
            if weight and "POSITION" in target:
                offsets = self._accessors.vectors(target["POSITION"], "VEC3")
                if offsets.shape != positions.shape:
                    raise self._file.refused(f"a morph target has {len(offsets)} of {len(positions)} positions")
                moved += weight * offsets
        return moved

    def _skinned(self, positions: Array, attributes: Json, index: object) -> Array:
        matrices = self._joint_matrices(self._file.item("skins", index), index)
        blended, total = np.zeros((len(positions), 4, 4)), np.zeros(len(positions))
        for number in count():
            if f"JOINTS_{number}" not in attributes:
                break
            joints = self._accessors.vectors(attributes[f"JOINTS_{number}"], "VEC4").astype(np.int64)
            weights = self._accessors.vectors(attributes.get(f"WEIGHTS_{number}"), "VEC4")
            if len(joints) != len(positions) or weights.shape != joints.shape:
                raise self._file.refused(f"JOINTS_{number} or WEIGHTS_{number} has another length than the vertices")
            if joints.min(initial=0) < 0 or (joints[weights != 0] >= len(matrices)).any():
                raise self._file.refused(f"skin {index}: a vertex refers to a joint beyond its {len(matrices)} joints")
            for joint, weight in zip(joints.T, weights.T, strict=True):
                blended += weight[:, None, None] * matrices[np.minimum(joint, len(matrices) - 1)]
                total += weight
        if not (total > 0).all():
            raise self._file.refused(f"skin {index}: a vertex has no weight")
        blended /= total[:, None, None]
        return np.asarray(np.einsum("nij,nj->ni", blended[:, :3, :3], positions) + blended[:, :3, 3])

    def _joint_matrices(self, skin: Json, index: object) -> Array:
        """(j, 4, 4): what moves vertices of the bind pose to the world, for each joint of a skin."""
        if self._world is None:
            self._world = node_transforms(self._file)
        joints = skin.get("joints")
        if not isinstance(joints, list) or not joints:
            raise self._file.refused(f"skin {index}: joints is {joints!r}, not a list of nodes")
        for joint in joints:
            self._file.item("nodes", joint)
        world = np.stack([self._world[joint] for joint in joints])
        if "inverseBindMatrices" not in skin:
            return world
        inverse = self._accessors.vectors(skin["inverseBindMatrices"], "MAT4")
        if len(inverse) < len(joints):
            raise self._file.refused(f"skin {index} has {len(inverse)} inverse bind matrices, but {len(joints)} joints")
        return np.asarray(world @ inverse[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1))


def animation_end(file: GltfFile) -> float | None:
    """Time in seconds of the last key of all animations of a file; None if it has none that can be read."""
    accessors, ends = Accessors(file), list[float]()
    for animation in file.items("animations"):
        samplers = animation.get("samplers", [])
        for sampler in samplers if isinstance(samplers, list) else ():
            with suppress(InputError):  # which is raised where somebody asks for a time
                times = accessors.vectors(sampler.get("input") if isinstance(sampler, dict) else None, "SCALAR")
                ends += [float(times.max())] if np.isfinite(times).all() else []
    return max(ends, default=None)
