"""Bounding volume hierarchies on the GPU: one per mesh and one over all objects, stored in textures.

One 16-byte texel is a node: six bounds of 16 bits, and a link. Triangles lie in the order of the leaves, three texels
each, with the corners' smooth normals as 2 x 16 bits on an octahedron (Cigolle et al. 2014). Packing needs no OpenGL:
any process can do it.

Behind the triangles lies the table of the textures that shaders read wherever a ray hits a surface
(``shaders/transport/textured_hit.glsl``), so that they need no further sampler: first a record for each object, then
the corners of the triangles of textured objects, in the order of the triangles, then the texels of the textures with
their mipmaps, two in each 16 bytes.
"""

from __future__ import annotations

import warnings
import weakref
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers
from translucent.errors import RenderError, TranslucentWarning
from translucent.files.reading import size_text
from translucent.geometry.bvh import BLOCK, LEAF_SIZE, Floats, Hierarchy, build_hierarchy
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import drawn_normals
from translucent.gpu.constants import HIERARCHY_WIDTH_BITS
from translucent.gpu.shaders import before_making
from translucent.gpu.textures import unlike_powers
from translucent.gpu.uniforms import Fields
from translucent.planning.bodies import halvings, has_more, textures_at_hits, varies_at_hits
from translucent.scene.scene import Object, Scene
from translucent.scene.texture import Falloff, Texture

Words = npt.NDArray[np.uint32]

#: Steps of the grid on which bounds lie, between the ends of a hierarchy.
STEPS = 65535

#: Bits of a leaf's link that hold its first triangle; three others hold how many follow it, the highest marks a leaf.
FIRST_BITS = 28

#: Triangles that are packed at a time.
_CHUNK = 1 << 15

_WIDTH = 1 << HIERARCHY_WIDTH_BITS

#: Rows of texels up to which the numbers of nodes and triangles fit into links.
_MOST_ROWS = 1 << (FIRST_BITS - HIERARCHY_WIDTH_BITS)

#: Bytes for each triangle: kept, with the copy in OpenGL; and taken while the hierarchy is built.
_PACKED_BYTES = 300

_BUILD_BYTES = 650

#: Bytes that building takes for each triangle beyond the first `BLOCK` of a mesh.
_BLOCK_BYTES = 100

#: Rows of texels that are written at a time.
_MOST_WRITTEN = 256

#: Bytes of memory that nobody expects a picture to take.
MUCH_MEMORY = 4 << 30

#: Words of 16 bytes of a record: where corners begin and what there is, then three for each of four textures.
RECORD = 13

#: Largest value of a channel.
_ONE = 65535

#: Diagonals of a scene by which bounds of objects are larger where these may touch: twice as far as surfaces count as
#: in one place, on a ray that grazes them.
_CONTACT_REACH = 2e-4


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
        found = _packed[mesh] = pack_mesh(mesh, drawn_normals(mesh))
    return found


def keep_packed(mesh: Mesh, packed: PackedMesh) -> None:
    """Cache this `packed_mesh`, which has been made elsewhere."""
    _packed[mesh] = packed


def has_packed(mesh: Mesh) -> bool:
    """True if `packed_mesh` has been made."""
    return mesh in _packed


def pack_mesh(mesh: Mesh, normals: npt.NDArray[np.float32]) -> PackedMesh:
    """Build the hierarchy of a mesh with these `drawn_normals`."""
    center, scale = frame(*mesh.bounds)
    with np.errstate(under="ignore", over="ignore"):  # vertices that no face uses may be anywhere
        vertices = ((mesh.vertices - center) * scale).astype(np.float32)
    count = len(mesh.faces)
    low, high = np.empty((2, count, 3), np.float32)
    for part in _chunks(count):
        corners = vertices[mesh.faces[part]]
        low[part], high[part] = corners.min(axis=1), corners.max(axis=1)
    tree = build_hierarchy(low, high)
    del low, high
    nodes = packed_nodes(tree)
    triangles = np.empty((count, 3, 4), np.uint32)
    for part in _chunks(count):
        faces = tree.faces[part]
        triangles[part, :, :3] = vertices[mesh.faces[faces]].view(np.uint32)
        triangles[part, :, 3] = packed_normals(normals[faces])
    return PackedMesh(nodes, triangles.reshape(-1, 4), tree.faces, center, scale)


def _chunks(count: int) -> Iterator[slice]:
    """Slices of so many, some of them each, so that little memory is taken meanwhile."""
    return (slice(begin, begin + _CHUNK) for begin in range(0, count, _CHUNK))


def frame(low: Array, high: Array) -> tuple[Array, float]:
    """Center of a bounding box, and the scale that maps its longest side to -1 .. 1."""
    return 0.5 * low + 0.5 * high, 1.0 / max(float((high - low).max()) / 2, float(np.finfo(np.float64).tiny))


def packed_nodes(tree: Hierarchy) -> Words:
    """(8, n, 4): nodes of a hierarchy within -1 to 1, in the orders of all octants.

    Bounds are rounded outwards by one to two steps: first the bounds where rays of the octant enter, x, y and z, then
    the others. Links count from the first node of their order.
    """
    half = STEPS / 2
    nodes = np.empty((8, len(tree.size), 4), np.uint32)
    for part in _chunks(len(tree.size)):
        low = np.clip(np.floor((tree.low[part].astype(np.float64) + 1) * half) - 1, 0, STEPS).astype(np.uint32)
        high = np.clip(np.ceil((tree.high[part].astype(np.float64) + 1) * half) + 1, 0, STEPS).astype(np.uint32)
        count, first = tree.count[part], tree.first[part].astype(np.uint32)
        held = np.uint32(1 << 31) | (count - 1).astype(np.uint32) << FIRST_BITS | first
        for octant, (order, found) in enumerate(zip(tree.orders[:, part], nodes, strict=True)):
            turned = (octant >> np.arange(3) & 1).astype(bool)
            near, far = np.where(turned, high, low).T, np.where(turned, low, high).T
            bounds = [near[0] | near[1] << 16, near[2] | far[0] << 16, far[1] | far[2] << 16]
            link = np.where(count > 0, held, (order + tree.size[part]).astype(np.uint32))
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
    first_triangles : (objects,) int32
        Number of the first triangle of the mesh of each object that has been placed.
    surface_table : int
        Texel behind the triangles at which the table of the textures of surfaces begins, if the scene has any.
    contacts : (2, 3) float64
        Bounds of all places in which surfaces of two objects that have been placed may lie together.
    traced_rays : int
        Rays that have been traced by generations.
    horizons : moderngl.Buffer, optional
        Horizon of each triangle of a single mesh, once it is known; see ``shaders/transport/horizons.comp``.
    """

    def __init__(
        self, gl: moderngl.Context, meshes: Sequence[Mesh], objects: int, textured: Scene | None = None
    ) -> None:
        _require_room(gl, meshes)
        for mesh in meshes:
            if not has_packed(mesh):
                before_making(gl)
                packed_mesh(mesh)
        before_making(gl)
        self._rows = -(-8 * 2 * objects // _WIDTH)
        self._spans: dict[int, _Span] = {}
        packed = [packed_mesh(mesh) for mesh in meshes]
        first, triangle = self._rows * _WIDTH, 0
        nodes, triangles = list[_Piece](), list[_Piece]()
        for mesh, part in zip(meshes, packed, strict=True):
            count = part.nodes.shape[1]
            self._spans[id(mesh)] = _Span(first, count, triangle)
            triangles.append(_Piece(3 * triangle, part.triangles))
            nodes += [
                _Piece(first + i * count, order, (first + i * count, triangle)) for i, order in enumerate(part.nodes)
            ]
            first += 8 * count
            triangle += len(part.triangles) // 3
        self.surface_table = end = 3 * triangle
        if textured is not None:
            table = surface_table(
                textured, end, lambda mesh: self._spans[id(mesh)].triangle, lambda mesh: packed_mesh(mesh).faces
            )
            triangles.append(_Piece(end, table))
            end += len(table)
        for texels in (first, end):
            _check_texels(gl, texels)
        self.nodes, self.triangles = _texture(gl, first, nodes), _texture(gl, end, triangles)
        self.object_nodes = 0
        self.contacts: Array = np.zeros((2, 3))
        self.first_triangles = np.zeros(0, np.int32)
        self.traced_rays = 0
        self.horizons: moderngl.Buffer | None = None
        self._placed: tuple[Hashable, tuple[Fields, ...], tuple[float, float, float, float]] | None = None

    def place(self, scene: Scene, center: Array) -> tuple[tuple[Fields, ...], tuple[float, float, float, float]]:
        """Write the hierarchy of objects at their current transforms.

        Returns
        -------
        placements : tuple of dict
            Placement of each object, for the table of objects.
        frame : (4,) floats
            Center and scale of the coordinates of the hierarchy of objects; positions count from `center`.
        """
        key = weakref.ref(scene), center.tobytes()
        if self._placed is None or self._placed[0] != key:  # else as for the last sample of the frame
            self._placed = key, *self._place(scene, center)
        return self._placed[1:]

    def _place(self, scene: Scene, center: Array) -> tuple[tuple[Fields, ...], tuple[float, float, float, float]]:
        boxes = scene.boxes - center
        low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
        middle, scale = frame(low, high)
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
        self.first_triangles = np.array([self._spans[id(body.mesh)].triangle for body in scene.objects], np.int32)
        self.contacts = _contacts(boxes, _CONTACT_REACH * scene.diagonal)
        return tuple(self._placement(body, center) for body in scene.objects), (*middle, scale)

    def faces(self, scene: Scene, objects: Integers, triangles: npt.NDArray[np.integer]) -> Integers:
        """(n,): faces of the meshes of objects (n,), by the numbers of their triangles; -1 where the object is -1."""
        found = np.full(len(objects), -1, np.int64)
        for number, body in enumerate(scene.objects):
            own = objects == number
            found[own] = packed_mesh(body.mesh).faces[triangles[own] - self._spans[id(body.mesh)].triangle]
        return found

    def _placement(self, body: Object, center: Array) -> Fields:
        packed, span = packed_mesh(body.mesh), self._spans[id(body.mesh)]
        linear = body.matrix[:3, :3]
        middle = linear @ packed.center + (body.matrix[:3, 3] - center)
        rows = np.column_stack([packed.scale * np.linalg.inv(linear), middle])
        return {
            "local_x": rows[0],
            "local_y": rows[1],
            "local_z": rows[2],
            "first_node": divmod(span.first, 1 << 12),
            "node_count": divmod(span.count, 1 << 12),
            "fading": _fading(body, packed.scale) if body.medium is None else (0.0, 0.0, 0.0),
        }

    def release(self) -> None:
        """Free the textures."""
        self.nodes.release()
        self.triangles.release()
        if self.horizons is not None:
            self.horizons.release()


class HierarchyCache:
    """Cache of the hierarchies of the last scene, kept as long as the meshes and textures are the same."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._held: SceneHierarchies | None = None
        self._key: tuple[object, ...] = ()

    def of(self, scene: Scene, *, textured: bool = False) -> SceneHierarchies:
        """The hierarchies of a scene, with the table of its textures if these are to be read."""
        meshes = tuple(dict.fromkeys(body.mesh for body in scene.objects))
        surfaces = surface_key(scene) if textured else ()
        if self._held is None or self._key != (meshes, len(scene.objects), surfaces):
            self.release()
            self._held = SceneHierarchies(self._gl, meshes, len(scene.objects), scene if surfaces else None)
            self._key = meshes, len(scene.objects), surfaces
        return self._held

    def release(self) -> None:
        """Free the textures."""
        if self._held is not None:
            self._held.release()
            self._held = None


def _contacts(boxes: Array, reach: float) -> Array:
    """(2, 3): bounds of all places within a reach of the boxes (n, 2, 3) of two objects; empty if none are."""
    low, high = boxes[:, 0] - reach, boxes[:, 1] + reach
    found = np.array([np.full(3, 1e30), np.full(3, -1e30)])
    for i in range(len(boxes) - 1):
        below, above = np.maximum(low[i], low[i + 1 :]), np.minimum(high[i], high[i + 1 :])
        shared = (below <= above).all(axis=1)
        if shared.any():
            found[0] = np.minimum(found[0], below[shared].min(axis=0))
            found[1] = np.maximum(found[1], above[shared].max(axis=0))
    return found


def _fading(body: Object, scale: float) -> tuple[float, float, float]:
    """Radii in coordinates of the hierarchy between which the base color loses a fraction, and this fraction."""
    falloff, mesh = body.surface and body.surface.color_texture, body.mesh
    if not isinstance(falloff, Falloff) or mesh.uv is None:
        return 0.0, 0.0, 0.0
    one, other = mesh.faces[0, :2]
    unit = scale * float(np.linalg.norm(mesh.vertices[one] - mesh.vertices[other]))
    unit /= float(np.linalg.norm(mesh.uv[one] - mesh.uv[other]))
    return falloff.start * unit, 0.5 * unit, 1.0 - falloff.far


def _require_room(gl: moderngl.Context, meshes: Sequence[Mesh]) -> None:
    """Raise `RenderError` before anything is built if the textures cannot fit; warn if much memory is needed."""
    faces = [len(mesh.faces) for mesh in meshes]
    least_nodes = sum(8 * (2 * -(-count // LEAF_SIZE) - 1) for count in faces)
    for texels in (least_nodes, 3 * sum(faces)):
        _check_texels(gl, texels)
    new = [len(mesh.faces) for mesh in meshes if not has_packed(mesh)]
    largest = max(new, default=0)
    building = _BUILD_BYTES * min(largest, BLOCK) + _BLOCK_BYTES * max(largest - BLOCK, 0)
    needed = _PACKED_BYTES * sum(faces) + building
    if needed > MUCH_MEMORY:
        warnings.warn(
            TranslucentWarning(
                f"ray tracing through {sum(faces):,} triangles takes up to {size_text(needed)} of memory; "
                "to save memory, use interfaces=tl.ScreenInterfaces(), or meshes with fewer triangles"
            ),
            stacklevel=2,
        )


def _check_texels(gl: moderngl.Context, texels: int) -> None:
    """Raise `RenderError` if a texture of this OpenGL does not hold so many texels."""
    limit = int(gl.info["GL_MAX_TEXTURE_SIZE"])
    if limit < _WIDTH:
        found, do = f"this OpenGL allows {limit} texels along a side, but ray tracing needs {_WIDTH}", ""
    elif texels > (room := min(limit, _MOST_ROWS) * _WIDTH):
        found, do = f"this needs at least {texels:,} texels, but this OpenGL allows {room:,}", ", or coarser meshes"
    else:
        return
    raise RenderError("ray tracing through the meshes", found, f"use interfaces=tl.ScreenInterfaces(){do}")


@dataclass(frozen=True, eq=False)
class _Piece:
    """Texels at an offset, whose node and leaf links are shifted."""

    first: int
    texels: Words
    raised: tuple[int, int] | None = None


def _rows(pieces: Sequence[_Piece], begin: int, end: int) -> Words:
    """Texels of a range of rows, filled with 0 between the pieces."""
    found = np.zeros((end - begin, 4), np.uint32)
    for piece in pieces:
        low, high = max(piece.first, begin), min(piece.first + len(piece.texels), end)
        if low < high:
            own = found[low - begin : high - begin]
            own[:] = piece.texels[low - piece.first : high - piece.first]
            if piece.raised is not None:
                node, triangle = piece.raised
                own[:, 3] += np.where(own[:, 3] >= 1 << 31, triangle, node).astype(np.uint32)
    return found


def _texture(gl: moderngl.Context, count: int, pieces: Sequence[_Piece]) -> moderngl.Texture:
    """Texture with so many texels, in whole rows, which are made some at a time."""
    rows, step = -(-count // _WIDTH), _MOST_WRITTEN
    rows = unlike_powers(rows) if rows < step else rows
    try:
        content = _rows(pieces, 0, rows * _WIDTH) if rows <= step else None
        texture = gl.texture((_WIDTH, rows), 4, content, dtype="u4")
        for row in range(0, rows, step) if content is None else ():
            height = min(step, rows - row)
            part = _rows(pieces, row * _WIDTH, (row + height) * _WIDTH)
            texture.write(part, viewport=(0, row, _WIDTH, height))
    except moderngl.Error as error:
        raise RenderError(
            "ray tracing through the meshes",
            f"OpenGL does not have enough memory for {size_text(16 * rows * _WIDTH)} of mesh data ({error})",
            "use interfaces=tl.ScreenInterfaces(), or meshes with fewer triangles",
        ) from error
    texture.filter = moderngl.NEAREST, moderngl.NEAREST
    return texture


def surface_key(scene: Scene) -> tuple[object, ...]:
    """Key of the table of a scene: equal for scenes with equal tables."""
    objects = enumerate(scene.objects)
    return tuple((i, body.mesh, has_more(body), *textures_at_hits(body)) for i, body in objects if varies_at_hits(body))


def surface_table(
    scene: Scene, first: int, first_triangle: Callable[[Mesh], int], faces: Callable[[Mesh], npt.NDArray[np.int32]]
) -> Words:
    """(n, 4): the table of a scene, which begins at a texel.

    Parameters
    ----------
    scene : Scene
    first : int
        Texel at which it begins.
    first_triangle : callable
        Number of the first triangle of a mesh.
    faces : callable
        Faces of a mesh in the order of its triangles.
    """
    records = np.zeros((len(scene.objects), RECORD, 4), np.uint32)
    parts: list[Words] = []
    end = first + len(scene.objects) * RECORD

    def place(words: Words) -> int:
        nonlocal end
        parts.append(words)
        end += len(words)
        return end - len(words)

    corners = dict[Mesh, int]()
    texels = dict[Texture, int]()
    times = halvings(scene)
    for body, record in zip(scene.objects, records, strict=True):
        if not varies_at_hits(body):
            continue
        if body.mesh not in corners:
            corners[body.mesh] = place(_corners(body.mesh, faces(body.mesh)))
        record[0, :2] = (corners[body.mesh] - 3 * first_triangle(body.mesh)) % (1 << 32), 2 if has_more(body) else 1
        for number, texture in enumerate(textures_at_hits(body)):
            if texture is None:
                continue
            if texture not in texels:
                texels[texture] = place(_mipmaps(texture, times[texture]))
            height, width = (max(side >> times[texture], 1) for side in texture.pixels.shape[:2])
            repeats = sum(1 << i for i, wrap in enumerate(texture.wrap) if wrap == "repeat")
            own = record[1 + 3 * number : 4 + 3 * number]
            own[0] = texels[texture], width, height, repeats
            own[1:, :3] = texture.rows.astype(np.float32).view(np.uint32)
    return np.concatenate([records.reshape(-1, 4), *parts])


def _corners(mesh: Mesh, faces: npt.NDArray[np.int32]) -> Words:
    """(3 m, 4): texture coordinates and colors at the corners of triangles."""
    corners = mesh.faces[faces].reshape(-1)
    found = np.zeros((len(corners), 4), np.uint32)
    if mesh.uv is not None:
        found[:, :2] = mesh.uv[corners].astype(np.float32).view(np.uint32)
    found[:, 2:] = _words(np.ones((len(corners), 4)) if mesh.colors is None else mesh.colors[corners])
    return found


def _words(values: npt.NDArray[np.floating]) -> Words:
    """(..., 2): numbers (..., 4) of 0 to 1 in 16 bits each."""
    steps = np.rint(values * _ONE).astype(np.uint32)
    return np.asarray(steps[..., ::2] | steps[..., 1::2] << 16)


def _mipmaps(texture: Texture, times: int) -> Words:
    """(n, 4): texels of a texture that is halved so often, and of its mipmaps, row by row."""
    pixels = np.ones((*texture.pixels.shape[:2], 4), np.float32)
    pixels[..., : texture.pixels.shape[2]] = texture.pixels
    for _ in range(times):
        pixels = _halved(pixels)
    levels = [pixels]
    while levels[-1].shape[:2] != (1, 1):
        levels.append(_halved(levels[-1]))
    return np.concatenate([_level(level) for level in levels])


def _level(pixels: npt.NDArray[np.float32]) -> Words:
    words = _words(pixels.reshape(-1, 4))
    return np.concatenate([words, np.zeros((len(words) % 2, 2), np.uint32)]).reshape(-1, 4)


def _halved(pixels: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """A picture with half as many rows and columns, rounded down: means over areas."""
    for axis in (0, 1):
        count = pixels.shape[axis]
        if count % 2 == 0:
            even, odd = (pixels[first::2] if axis == 0 else pixels[:, first::2] for first in (0, 1))
            pixels = np.float32(0.5) * (even + odd)
            continue
        edges = np.linspace(0.0, count, max(count >> 1, 1) + 1)
        low = np.minimum(edges.astype(np.int64), count - 1)
        sums = np.cumsum(pixels, axis=axis, dtype=np.float64)
        before = np.concatenate([np.zeros_like(sums.take([0], axis)), sums], axis=axis)
        part = np.expand_dims(edges - low, 1 - axis)[..., None]
        until = before.take(low, axis) + part * pixels.take(low, axis)
        pixels = (np.diff(until, axis=axis) / (edges[1] - edges[0])).astype(np.float32)
    return pixels
