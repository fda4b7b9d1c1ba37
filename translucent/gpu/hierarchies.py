"""Hierarchies on the GPU: those of the meshes of a scene, and one of its objects, as textures that rays walk through.

One 16-byte texel is a node: six bounds of 16 bits, and a link. Triangles lie in the order of the leaves, three texels
each, with the corners' smooth normals as 2 x 16 bits on an octahedron (Cigolle et al. 2014).
"""

from __future__ import annotations

import warnings
import weakref
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers
from translucent.errors import RenderError, TranslucentWarning
from translucent.files.reading import size_text
from translucent.geometry.bvh import LEAF_SIZE, Floats, Hierarchy, build_hierarchy
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import drawn_normals
from translucent.gpu.body_uniforms import bounded_extinction
from translucent.gpu.constants import HIERARCHY_WIDTH_BITS
from translucent.gpu.layout import TRACED_BODY
from translucent.gpu.ledger import before_making
from translucent.media.medium import VACUUM, Medium
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import SMOOTH

Words = npt.NDArray[np.uint32]

#: Steps of the grid on which bounds lie, between the ends of a hierarchy.
STEPS = 65535

_WIDTH = 1 << HIERARCHY_WIDTH_BITS

#: Bits of a leaf's link that hold its first triangle; three others hold how many follow it, the highest tells a leaf.
_FIRST_BITS = 28

#: Rows of texels up to which the numbers of nodes and triangles fit into links.
_MOST_ROWS = 1 << (_FIRST_BITS - HIERARCHY_WIDTH_BITS)

#: Bytes for each triangle that are kept, with the copy in OpenGL, and those that building takes for a while.
_PACKED_BYTES = 300
_BUILD_BYTES = 650

#: Bytes of memory that nobody expects a picture to take.
MUCH_MEMORY = 4 << 30


@dataclass(frozen=True, eq=False)
class PackedMesh:
    """Hierarchy of one mesh as texels, in coordinates from -1 to 1 along its longest side.

    Attributes
    ----------
    nodes : (8, n, 4) uint32
        Of `packed_nodes`; triangles count from the first of the mesh.
    triangles : (3 m, 4) uint32
    faces : (m,) int32
        Faces of the mesh in the order of the triangles.
    center : (3,) float64
    scale : float
        Of coordinates of the mesh, less the center.
    """

    nodes: Words
    triangles: Words
    faces: npt.NDArray[np.int32]
    center: Array
    scale: float


_packed: WeakKeyDictionary[Mesh, PackedMesh] = WeakKeyDictionary()


def packed_mesh(mesh: Mesh) -> PackedMesh:
    """The hierarchy of a mesh as texels, made once for each mesh."""
    if (found := _packed.get(mesh)) is None:
        center, scale = _frame(*mesh.bounds)
        with np.errstate(under="ignore", over="ignore"):  # vertices that no face uses may be anywhere
            corners = ((mesh.vertices - center) * scale).astype(np.float32)[mesh.faces]
        tree = build_hierarchy(corners.min(axis=1), corners.max(axis=1))
        triangles = np.empty((*mesh.faces.shape, 4), np.uint32)
        triangles[..., :3] = corners[tree.faces].view(np.uint32)
        triangles[..., 3] = packed_normals(drawn_normals(mesh)[tree.faces])
        found = _packed[mesh] = PackedMesh(packed_nodes(tree), triangles.reshape(-1, 4), tree.faces, center, scale)
    return found


def _frame(low: Array, high: Array) -> tuple[Array, float]:
    """Middle of bounds, and the scale by which their longest side reaches from -1 to 1."""
    return 0.5 * low + 0.5 * high, 1.0 / max(float((high - low).max()) / 2, float(np.finfo(np.float64).tiny))


def packed_nodes(tree: Hierarchy) -> Words:
    """(8, n, 4): nodes of a hierarchy within -1 to 1, in the orders of all octants.

    Bounds are rounded outwards by one to two steps: first those that rays of the octant come to first, x, y and z, then
    the others. Links count from the first node of their order.
    """
    half = STEPS / 2
    low = np.clip(np.floor((tree.low.astype(np.float64) + 1) * half) - 1, 0, STEPS).astype(np.uint32)
    high = np.clip(np.ceil((tree.high.astype(np.float64) + 1) * half) + 1, 0, STEPS).astype(np.uint32)
    leaf = tree.count > 0
    held = np.uint32(1 << 31) | (tree.count - 1).astype(np.uint32) << _FIRST_BITS | tree.first.astype(np.uint32)
    nodes = np.empty((8, len(leaf), 4), np.uint32)
    for octant, (order, found) in enumerate(zip(tree.orders, nodes, strict=True)):
        turned = (octant >> np.arange(3) & 1).astype(bool)
        near, far = np.where(turned, high, low).T, np.where(turned, low, high).T
        bounds = [near[0] | near[1] << 16, near[2] | far[0] << 16, far[1] | far[2] << 16]
        link = np.where(leaf, held, (order + tree.size).astype(np.uint32))
        found[order] = np.stack([*bounds, link], axis=1)
    return nodes


def packed_normals(normals: npt.NDArray[np.floating]) -> Words:
    """(...,): unit vectors (..., 3) as 2 x 16 bits on an octahedron; 6.5e-5 rad off at most.

    Half a step in each coordinate moves a point of the octahedron by sqrt(6) / 65535, at a distance of 1 / sqrt(3).
    """
    size = np.abs(normals).sum(axis=-1, keepdims=True)
    at = normals / np.where(size > 0, size, 1.0)
    folded = (1 - np.abs(at[..., 1::-1])) * np.where(at[..., :2] >= 0, 1.0, -1.0)
    steps = np.rint((np.where(at[..., 2:] < 0, folded, at[..., :2]) + 1) * (STEPS / 2)).astype(np.uint32)
    return np.asarray(steps[..., 0] | steps[..., 1] << 16)


@dataclass(frozen=True, eq=False)
class _Span:
    """One mesh in the textures: its first node, how many there are in each of eight orders, and its first triangle."""

    first: int
    count: int
    triangle: int


class SceneHierarchies:
    """Textures of the hierarchies of a set of meshes; bodies may move without a new upload of them.

    Attributes
    ----------
    nodes, triangles : moderngl.Texture
    object_nodes : int
        Nodes of the hierarchy of objects, in each of eight orders.
    """

    def __init__(self, gl: moderngl.Context, meshes: Sequence[Mesh], objects: int) -> None:
        before_making(gl)
        _require_room(gl, meshes)
        self._rows = -(-8 * 2 * objects // _WIDTH)
        self._spans: dict[int, _Span] = {}
        packed = [packed_mesh(mesh) for mesh in meshes]
        nodes = _texels(gl, self._rows * _WIDTH + sum(8 * part.nodes.shape[1] for part in packed))
        triangles = _texels(gl, sum(len(part.triangles) for part in packed))
        first, triangle = self._rows * _WIDTH, 0
        for mesh, part in zip(meshes, packed, strict=True):
            count, texels = part.nodes.shape[1], len(part.triangles)
            self._spans[id(mesh)] = _Span(first, count, triangle)
            triangles[3 * triangle : 3 * triangle + texels] = part.triangles
            for order in part.nodes:
                own = nodes[first : first + count]
                own[:] = order
                own[:, 3] += np.where(order[:, 3] >= 1 << 31, triangle, first).astype(np.uint32)
                first += count
            triangle += texels // 3
        self.nodes, self.triangles = _texture(gl, nodes), _texture(gl, triangles)
        self.object_nodes = 0
        self._placed: tuple[Hashable, npt.NDArray[np.float32], tuple[float, float, float, float]] | None = None

    def place(
        self, scene: Scene, center: Array, sheets: Mapping[int, float]
    ) -> tuple[npt.NDArray[np.float32], tuple[float, float, float, float]]:
        """Write the hierarchy of objects where they are.

        `sheets`: thickness in metres of those objects that are drawn without an inside, by their numbers.

        Returns
        -------
        rows : (objects, texels, 4) float32
            A `TRACED_BODY` of each object.
        frame : (4,) floats
            Center and scale of the coordinates of the hierarchy of objects; positions count from `center`.
        """
        asked = weakref.ref(scene), center.tobytes(), tuple(sheets.items())
        if self._placed is None or self._placed[0] != asked:  # else as for the last sample of the frame
            self._placed = asked, *self._place(scene, center, sheets)
        return self._placed[1:]

    def _place(
        self, scene: Scene, center: Array, sheets: Mapping[int, float]
    ) -> tuple[npt.NDArray[np.float32], tuple[float, float, float, float]]:
        boxes = scene.boxes - center
        low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
        middle, scale = _frame(low, high)
        with np.errstate(under="ignore"):
            local: Floats = ((boxes - middle) * scale).astype(np.float32)
        tree = build_hierarchy(local[:, 0], local[:, 1], leaf_size=1)
        nodes = packed_nodes(tree)
        self.object_nodes = nodes.shape[1]
        nodes[..., 3] += (np.arange(8)[:, None] * self.object_nodes * (nodes[..., 3] < 1 << 31)).astype(np.uint32)
        nodes = nodes.reshape(-1, 4)
        leaf = nodes[:, 3] >= 1 << 31
        nodes[leaf, 3] = np.uint32(1 << 31) | tree.faces[nodes[leaf, 3] & 0x0FFFFFFF].astype(np.uint32)
        reserved = np.zeros((self._rows * _WIDTH, 4), np.uint32)
        reserved[: len(nodes)] = nodes
        self.nodes.write(reserved, viewport=(0, 0, _WIDTH, self._rows))
        ranks = np.unique([body.priority for body in scene.objects], return_inverse=True)[1] + 1.0
        media = _media_numbers(scene)
        rows = []
        for i, body in enumerate(scene.objects):
            decides = i not in sheets and _decides(scene, body)
            own = {"rank": ranks[i] if decides else 0.0, "slot": media[i]}
            rows.append({**self._row(scene, body, center, sheets.get(i)), **own})
        return TRACED_BODY.pack(rows), (*middle, scale)

    def faces(self, scene: Scene, objects: Integers, triangles: npt.NDArray[np.integer]) -> Integers:
        """(n,): faces of the meshes of objects (n,), by the numbers of their triangles; -1 where the object is -1."""
        found = np.full(len(objects), -1, np.int64)
        for number, body in enumerate(scene.objects):
            own = objects == number
            found[own] = packed_mesh(body.mesh).faces[triangles[own] - self._spans[id(body.mesh)].triangle]
        return found

    def _row(self, scene: Scene, body: Object, center: Array, sheet: float | None) -> Mapping[str, npt.ArrayLike]:
        packed, span = packed_mesh(body.mesh), self._spans[id(body.mesh)]
        linear = body.matrix[:3, :3]
        middle = linear @ packed.center + (body.matrix[:3, 3] - center)
        rows = np.column_stack([packed.scale * np.linalg.inv(linear), middle])
        medium, surface = body.medium or VACUUM, body.surface or SMOOTH
        metres = 1.0 if sheet is None else sheet
        opaque = body.medium is None
        extinction = bounded_extinction(medium, scene.diagonal)
        with np.errstate(under="ignore"):
            albedo = medium.scattering / np.where(medium.extinction > 0, medium.extinction, 1.0)
        return {
            "local_x": rows[0],
            "local_y": rows[1],
            "local_z": rows[2],
            "first_node": divmod(span.first, 1 << 12),
            "node_count": divmod(span.count, 1 << 12),
            "extinction": metres * extinction,
            "scattering": metres * extinction * albedo,
            "anisotropy": medium.anisotropy,
            "outwards": -1.0 if body.mesh.diagnosis.inverted else 1.0,
            "emission": metres * np.asarray(medium.emission),
            "kind": _kind(body, sheet),
            "color": body.base_color if opaque else np.asarray(surface.color),
            "transmission": surface.transmission,
            "ior": surface.ior if opaque else medium.ior,
            "dispersion": surface.dispersion,
            "roughness": surface.roughness,
            "plain": float(body.surface is None if opaque else body.plain),
            "passed": surface.diffuse_transmission * np.asarray(surface.diffuse_transmission_color),
            "passed_share": surface.diffuse_transmission,
            "emissive": np.asarray(surface.emissive),
            "metallic": surface.metallic,
            "one_sided": float(not surface.double_sided),
            "film": (surface.iridescence, surface.iridescence_ior, surface.iridescence_thickness),
            "clearcoat": surface.clearcoat,
            "clearcoat_roughness": surface.clearcoat_roughness,
        }

    def release(self) -> None:
        """Free the textures."""
        self.nodes.release()
        self.triangles.release()


class HierarchyCache:
    """Cache of the hierarchies of the last scene, kept as long as the meshes are the same."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._held: SceneHierarchies | None = None
        self._meshes: tuple[Mesh, ...] = ()
        self._objects = 0

    def of(self, scene: Scene) -> SceneHierarchies:
        """The hierarchies of a scene."""
        meshes = tuple(dict.fromkeys(body.mesh for body in scene.objects))
        if self._held is None or self._meshes != meshes or self._objects != len(scene.objects):
            self.release()
            self._held = SceneHierarchies(self._gl, meshes, len(scene.objects))
            self._meshes, self._objects = meshes, len(scene.objects)
        return self._held

    def release(self) -> None:
        """Free the textures."""
        if self._held is not None:
            self._held.release()
            self._held = None


def _kind(body: Object, sheet: float | None) -> float:
    """Kind of an object, as ``shaders/transport/traced_interfaces.frag`` numbers them."""
    if body.medium is None:
        return 2.0
    if body.covers:
        return 3.0
    return 0.0 if sheet is None else 1.0 if body.has_interface else 4.0


def _decides(scene: Scene, body: Object) -> bool:
    """Whether a body determines the index of refraction of the rays in it."""
    return body.medium is not None and (body.has_interface or scene.overlap == "priority")


def _media_numbers(scene: Scene) -> list[float]:
    """A number for each object, the same for those of one medium."""
    numbers: dict[Medium | None, int] = {}
    return [float(numbers.setdefault(body.medium, len(numbers))) for body in scene.objects]


def _require_room(gl: moderngl.Context, meshes: Sequence[Mesh]) -> None:
    """Raise `RenderError` before anything is built if the textures cannot fit; warn if much memory is needed."""
    faces = [len(mesh.faces) for mesh in meshes]
    least_nodes = sum(8 * (2 * -(-count // LEAF_SIZE) - 1) for count in faces)
    for texels in (least_nodes, 3 * sum(faces)):
        _check_texels(gl, texels)
    new = [len(mesh.faces) for mesh in meshes if mesh not in _packed]
    needed = _PACKED_BYTES * sum(faces) + _BUILD_BYTES * max(new, default=0)
    if needed > MUCH_MEMORY:
        warnings.warn(
            TranslucentWarning(
                f"tracing rays through {sum(faces):,} triangles takes up to {size_text(needed)} of memory; "
                "use interfaces=tl.ScreenInterfaces(), or coarser meshes, for less"
            ),
            stacklevel=2,
        )


def _check_texels(gl: moderngl.Context, texels: int) -> None:
    """Raise `RenderError` if a texture of this OpenGL does not hold so many texels."""
    limit = int(gl.info["GL_MAX_TEXTURE_SIZE"])
    if limit < _WIDTH:
        found, do = f"this OpenGL's textures end at {limit} texels a side, and hierarchies take {_WIDTH}", ""
    elif texels > (room := min(limit, _MOST_ROWS) * _WIDTH):
        found, do = f"at least {texels:,} texels, and this OpenGL holds {room:,}", ", or coarser meshes"
    else:
        return
    raise RenderError("tracing rays through the meshes", found, f"use interfaces=tl.ScreenInterfaces(){do}")


def _texels(gl: moderngl.Context, count: int) -> Words:
    """Whole rows of texels, 0 yet, for so many."""
    _check_texels(gl, count)
    return np.zeros((-(-count // _WIDTH) * _WIDTH, 4), np.uint32)


def _texture(gl: moderngl.Context, texels: Words) -> moderngl.Texture:
    try:
        texture = gl.texture((_WIDTH, len(texels) // _WIDTH), 4, texels, dtype="u4")
    except moderngl.Error as error:
        raise RenderError(
            "tracing rays through the meshes",
            f"OpenGL has no room for {size_text(texels.nbytes)} of them ({error})",
            "use interfaces=tl.ScreenInterfaces(), or coarser meshes",
        ) from error
    texture.filter = moderngl.NEAREST, moderngl.NEAREST
    return texture
