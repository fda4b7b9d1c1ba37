"""Bounding volume hierarchies: what they hold, the orders in which rays visit them, and how they are packed."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import translucent as tl
from tests.rays import parents, sah_cost
from translucent.arrays import Array
from translucent.geometry import bvh
from translucent.geometry.bvh import Hierarchy, build_hierarchy
from translucent.gpu.hierarchies import STEPS, packed_mesh, packed_nodes, packed_normals

OCTANTS = [tuple(bool(octant >> axis & 1) for axis in range(3)) for octant in range(8)]


def lumpy(subdivisions: int = 3) -> Array:
    """(m, 3, 3): corners of a ball with waves, within -1 to 1."""
    made = trimesh.creation.icosphere(subdivisions)
    x, y, z = made.vertices.T
    vertices = made.vertices * (0.8 + 0.2 * np.sin(5 * x) * np.cos(4 * y + z))[:, None]
    return np.asarray(vertices[made.faces], dtype=np.float64)


def soup(rng: np.random.Generator, count: int = 300) -> Array:
    """(m, 3, 3): triangles of all sizes, anywhere."""
    size = 10.0 ** rng.uniform(-4, -0.3, (count, 1, 1))
    return np.clip(rng.uniform(-1, 1, (count, 1, 3)) + size * rng.normal(size=(count, 3, 3)), -1, 1)


def tree_of(corners: Array, **options: int) -> Hierarchy:
    rounded = corners.astype(np.float32)
    return build_hierarchy(rounded.min(axis=1), rounded.max(axis=1), **options)


def degenerate(kind: str, rng: np.random.Generator) -> Array:
    if kind == "equal":
        return np.broadcast_to([[-1.0, 0, 0], [1, 0, 0], [0, 1, 0]], (500, 3, 3)).copy()
    if kind == "collinear":
        return np.linspace(-1, 1, 3 * 500)[:, None].repeat(3, axis=1).reshape(500, 3, 3)
    if kind == "points":
        return rng.uniform(-1, 1, (500, 1, 3)).repeat(3, axis=1)
    if kind == "one point":
        return np.full((500, 3, 3), 0.25)
    if kind == "needles":
        return rng.uniform(-1, 1, (500, 1, 3)) * (1, 1, 0) + np.array([[0, 0, -1], [0, 0, 1], [1e-7, 0, 0]])
    if kind == "growing":  # each box finds the one before it
        return np.cumsum(1.05 ** -np.arange(500.0))[:, None, None] * 0.04 * np.ones((500, 3, 3))
    return soup(rng, {"one": 1, "two": 2, "three": 3, "five": 5}[kind])


DEGENERATE = ["one", "two", "three", "five", "equal", "collinear", "points", "one point", "needles", "growing"]


def check(tree: Hierarchy, corners: Array, leaf_size: int = bvh.LEAF_SIZE) -> None:
    """All that a hierarchy promises."""
    count = len(corners)
    leaf = tree.count > 0
    assert sorted(tree.faces) == list(range(count))
    held = [i for first, n in zip(tree.first[leaf], tree.count[leaf], strict=True) for i in range(first, first + n)]
    assert sorted(held) == list(range(count))
    assert tree.count.max() <= leaf_size
    assert (tree.size[leaf] == 1).all()
    assert tree.size[0] == len(tree.size) < 2 * leaf.sum()
    rounded = corners.astype(np.float32)[tree.faces]
    for node in np.flatnonzero(leaf):
        own = rounded[tree.first[node] : tree.first[node] + tree.count[node]]
        np.testing.assert_array_equal(tree.low[node], own.min(axis=(0, 1)))
        np.testing.assert_array_equal(tree.high[node], own.max(axis=(0, 1)))
    for order in tree.orders:
        check_order(tree, order)


def check_order(tree: Hierarchy, order: np.ndarray) -> None:
    """A permutation, depth-first: behind each inner node its children, whose bounds make up its own."""
    assert sorted(order) == list(range(len(order)))
    at, above = np.argsort(order), parents(tree)
    for place, node in enumerate(at):
        if tree.count[node]:
            continue
        children, behind = [], place + 1
        while behind < place + tree.size[node]:
            children.append(at[behind])
            behind += tree.size[at[behind]]
        assert behind == place + tree.size[node]
        assert 2 <= len(children) <= bvh.MOST_CHILDREN
        assert (above[children] == node).all()
        np.testing.assert_array_equal(tree.low[node], tree.low[children].min(axis=0))
        np.testing.assert_array_equal(tree.high[node], tree.high[children].max(axis=0))


@pytest.mark.parametrize("leaf_size", [1, 4, 8])
def test_hierarchies_of_meshes(leaf_size: int, rng: np.random.Generator) -> None:
    for corners in (lumpy(), soup(rng)):
        check(tree_of(corners, leaf_size=leaf_size), corners, leaf_size)


@pytest.mark.parametrize("kind", DEGENERATE)
def test_hierarchies_of_degenerate_meshes(kind: str, rng: np.random.Generator) -> None:
    corners = degenerate(kind, rng)
    check(tree_of(corners), corners)


@pytest.mark.parametrize("block", [1, 7, 200])
def test_hierarchies_in_blocks_are_hierarchies_and_as_good(
    block: int, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    meshes = lumpy(), soup(rng)
    whole = [sah_cost(tree_of(corners)) for corners in meshes]
    monkeypatch.setattr(bvh, "BLOCK", block)
    for corners, cost in zip(meshes, whole, strict=True):
        tree = tree_of(corners)
        check(tree, corners)
        assert sah_cost(tree) < (1.2 if block == 200 else 3.0) * cost
        way = rng.uniform(-1, 1, 3)
        origin, octant = corners[0].mean(axis=0) - 0.5 * way, int((way < 0) @ (1, 2, 4))
        rounded = corners.astype(np.float32).astype(np.float64)
        assert nearest_by_walk(tree, rounded, octant, origin, way)[0] == distance(rounded, origin, way).min()


@pytest.mark.parametrize("kind", ["equal", "one point", "collinear", "growing"])
def test_clusters_halve_in_few_rounds(kind: str, rng: np.random.Generator) -> None:
    corners = np.tile(degenerate(kind, rng), (40, 1, 1)).astype(np.float32)
    tree = bvh._BinaryTree(np.ascontiguousarray(corners.min(axis=1).T), np.ascontiguousarray(corners.max(axis=1).T))
    # Each but the last merges a share of the clusters: their work adds up to that of a few.
    left = len(corners) - np.cumsum([end - begin for begin, end in tree.rounds])
    work = len(corners) + left.sum()
    assert left[-1] == 1
    assert work <= len(corners) / bvh.LEAST_MERGED
    if kind in ("equal", "one point"):
        assert len(tree.rounds) <= np.log2(len(corners)) + 3


def nearest_by_walk(tree: Hierarchy, corners: Array, octant: int, origin: Array, way: Array) -> tuple[float, int]:
    """Path and leaves tested of a ray that goes through an order as the shader does."""
    at = np.argsort(tree.orders[octant])
    place, path, tested = 0, np.inf, 0
    while place < len(at):
        node = at[place]
        one, other = (tree.low[node] - origin) / way, (tree.high[node] - origin) / way
        near, far = np.minimum(one, other).max(), np.maximum(one, other).min()
        if not max(near, 0.0) <= min(far, path):
            place += tree.size[node]
            continue
        place += 1
        own = tree.faces[tree.first[node] : tree.first[node] + tree.count[node]]
        tested += len(own) > 0
        for triangle in corners[own]:
            path = min(path, distance(triangle[None], origin, way)[0])
    return path, tested


def distance(corners: Array, origin: Array, way: Array) -> Array:
    """(m,): along a ray to triangles, infinite where it misses (Moeller & Trumbore 1997)."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(way, second)
    volume = (first * across).sum(axis=1)
    safe = np.where(volume == 0, 1.0, volume)
    from_corner = origin - corners[:, 0]
    u = (from_corner * across).sum(axis=1) / safe
    turned = np.cross(from_corner, first)
    v = (turned @ way) / safe
    path = (second * turned).sum(axis=1) / safe
    met = (volume != 0) & (u >= 0) & (v >= 0) & (u + v <= 1) & (path > 0)
    return np.where(met, path, np.inf)


@pytest.mark.parametrize("octant", range(8))
def test_walks_find_the_nearest_surface_in_every_octant(octant: int, rng: np.random.Generator) -> None:
    hits = 0
    for made in (lumpy(2), soup(rng, 100)):
        corners = made.astype(np.float32).astype(np.float64)
        tree = tree_of(corners)
        for _ in range(25):
            way = np.where(OCTANTS[octant], -1, 1) * rng.uniform(1e-3, 1, 3)
            origin = rng.choice(corners).mean(axis=0) - way * rng.uniform(-0.2, 1)
            expected = distance(corners, origin, way).min()
            # Whatever the order, the surface is the same; only how much is tested differs.
            for order in (octant, 7 - octant):
                assert nearest_by_walk(tree, corners, order, origin, way)[0] == expected
            hits += np.isfinite(expected)
    assert hits > 20


def test_the_order_of_an_octant_tests_less_than_the_opposite_one(rng: np.random.Generator) -> None:
    corners = lumpy(3)
    tree = tree_of(corners)
    tested = np.zeros(2)
    for octant, signs in enumerate(OCTANTS):
        for _ in range(8):
            way = np.where(signs, -1, 1) * rng.uniform(0.3, 1, 3)
            origin = rng.uniform(-0.3, 0.3, 3) - 2 * way
            for i, order in enumerate((octant, 7 - octant)):
                tested[i] += nearest_by_walk(tree, corners, order, origin, way)[1]
    assert tested[0] < 0.6 * tested[1]


def swept_cost(low: Array, high: Array) -> float:
    """Cost of a tree by a full sweep of the surface area heuristic along each axis, times the area of its root."""
    count = len(low)
    whole = area(low.min(axis=0), high.max(axis=0))
    if count == 1:
        return float(whole)
    splits = []
    for axis in range(3):
        order = np.argsort((low + high)[:, axis])
        ahead = area(np.minimum.accumulate(low[order]), np.maximum.accumulate(high[order]))
        turned = order[::-1]
        behind = area(np.minimum.accumulate(low[turned]), np.maximum.accumulate(high[turned]))[::-1]
        costs = ahead[:-1] * np.arange(1, count) + behind[1:] * np.arange(count - 1, 0, -1)
        best = int(costs.argmin())
        splits.append((costs[best], order[: best + 1], order[best + 1 :]))
    _, left, right = min(splits, key=lambda split: split[0])
    split = 2 * bvh.BOX_COST * whole + swept_cost(low[left], high[left]) + swept_cost(low[right], high[right])
    return float(min(split, whole * count) if count <= bvh.LEAF_SIZE else split)


def area(low: Array, high: Array) -> Array:
    size = high - low
    return np.asarray(size[..., 0] * size[..., 1] + (size[..., 0] + size[..., 1]) * size[..., 2])


def test_trees_are_as_good_as_those_of_the_surface_area_heuristic(rng: np.random.Generator) -> None:
    for corners in (lumpy(3), soup(rng, 1000)):
        low, high = corners.min(axis=1), corners.max(axis=1)
        swept = swept_cost(low, high) / area(low.min(axis=0), high.max(axis=0))
        assert sah_cost(tree_of(corners)) < 1.1 * swept


@pytest.mark.parametrize("kind", ["lumpy", "soup", *DEGENERATE])
def test_packed_bounds_hold_those_of_all_nodes(kind: str, rng: np.random.Generator) -> None:
    corners = {"lumpy": lumpy, "soup": lambda: soup(rng)}.get(kind, lambda: degenerate(kind, rng))()
    corners = corners / np.abs(corners).max()
    tree = tree_of(corners)
    step = 2 / STEPS
    for signs, order, nodes in zip(OCTANTS, tree.orders, packed_nodes(tree), strict=True):
        x, y, z, link = nodes[order].T.astype(np.int64)
        near = np.stack([x & 0xFFFF, x >> 16, y & 0xFFFF], axis=1) * step - 1
        far = np.stack([y >> 16, z & 0xFFFF, z >> 16], axis=1) * step - 1
        low, high = np.where(signs, far, near), np.where(signs, near, far)
        # At least a step outwards, but for the walls of the grid, beyond which there is nothing.
        assert (np.minimum(tree.low - step, 1) >= low)[low > -1].all()
        assert (tree.high + step <= high)[high < 1].all()
        assert (tree.low - low).max() <= 2.001 * step
        assert (high - tree.high).max() <= 2.001 * step
        leaf = link >> 31 == 1
        np.testing.assert_array_equal(leaf, tree.count > 0)
        np.testing.assert_array_equal(link[~leaf], (order + tree.size)[~leaf])
        np.testing.assert_array_equal((link & 0x0FFFFFFF)[leaf], tree.first[leaf])
        np.testing.assert_array_equal((link >> 28 & 7)[leaf] + 1, tree.count[leaf])


@pytest.mark.parametrize("extent", [1e-17, 1e-6, 1.0, 1e6, 1e17])
def test_packing_is_the_same_for_meshes_of_all_sizes(extent: float) -> None:
    made = trimesh.creation.icosphere(2)
    one = packed_mesh(tl.Mesh(made.vertices, made.faces))
    other = packed_mesh(tl.Mesh(made.vertices * extent, made.faces))
    corners = [part.triangles[:, :3].view(np.float32) for part in (one, other)]
    assert np.abs(corners[0]).max() == 1
    np.testing.assert_allclose(*corners, atol=2e-7)
    assert other.scale * extent == pytest.approx(one.scale)
    assert len(other.nodes[0]) == pytest.approx(len(one.nodes[0]), abs=20)


def test_meshes_of_extremely_different_sides_are_packed() -> None:
    made = trimesh.creation.icosphere(2)
    packed = packed_mesh(tl.Mesh(made.vertices * (1e-30, 1.0, 1e15), made.faces))
    assert np.isfinite(packed.triangles[:, :3].view(np.float32)).all()
    assert sorted(packed.faces) == list(range(len(made.faces)))


def test_meshes_that_are_not_finite_never_come_here() -> None:
    for bad in (np.nan, np.inf):
        mesh = tl.Mesh([[0, 0, 0], [1, 0, 0], [0, bad, 0]], [[0, 1, 2]])
        with pytest.raises(tl.InputError, match="1 vertices are not finite"):
            tl.Object(mesh, tl.Medium())


def unpacked(words: np.ndarray) -> Array:
    """As ``unpacked_normal`` in the shader."""
    at = np.stack([words & 0xFFFF, words >> 16], axis=-1) / 32767.5 - 1
    normal = np.concatenate([at, 1 - np.abs(at).sum(axis=-1, keepdims=True)], axis=-1)
    below = np.maximum(-normal[..., 2:], 0)
    normal[..., :2] += np.where(normal[..., :2] >= 0, -below, below)
    return np.asarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True))


def test_packed_normals(rng: np.random.Generator) -> None:
    random = rng.normal(size=(100_000, 3))
    signs = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z])
    near = (signs[:, None] + 1e-5 * rng.normal(size=(26, 40, 3))).reshape(-1, 3)
    normals = np.concatenate([random, signs, near])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    angle = np.linalg.norm(np.cross(normals, unpacked(packed_normals(normals.astype(np.float32)))), axis=1)
    assert angle.max() < np.sqrt(18) / STEPS + 1e-6
    assert (np.einsum("ki,ki->k", normals, unpacked(packed_normals(normals))) > 0).all()
    # Without area there is no normal; any will do that is one.
    assert np.isfinite(unpacked(packed_normals(np.zeros((1, 3), np.float32)))).all()
