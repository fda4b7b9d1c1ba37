"""The diagnosis of random broken meshes, held against counting one by one; what makes it fast, against brute force."""

from __future__ import annotations

import itertools
import pickle
import warnings
from collections import Counter, defaultdict
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

import translucent as tl
from tests.values.handmade import CORNERS, CUBE, ball, changed, cube, inverted, joined, moebius
from translucent.geometry import grouping, repair, winding
from translucent.geometry.diagnosis import FIRST, Finding, diagnose
from translucent.geometry.grouping import connected, equal_rows, extent, side_blocks, sorted_pairs, sorted_sides
from translucent.geometry.mesh import Mesh, mended
from translucent.geometry.repair import near_points, spread_winding
from translucent.geometry.solids import Torus
from translucent.geometry.winding import line_crossings, part_volumes

FACES = arrays.arrays(np.int32, st.tuples(st.integers(1, 25), st.just(3)), elements=st.integers(0, 8))


def broken(seed: int) -> Mesh:
    """Some bodies, broken in a few ways, with faces and vertices in any order."""
    rng = np.random.default_rng(seed)
    bodies = [cube(), inverted(cube(low=0.25, size=0.5)), ball(1), Torus().tessellate(8), moebius(), cube(low=1.0)]
    mesh = joined(*(bodies[i] for i in rng.integers(len(bodies), size=rng.integers(1, 4))))
    vertices, faces = mesh.vertices.copy(), mesh.faces.copy()
    for way in rng.integers(7, size=rng.integers(0, 6)):
        one, other = rng.integers(len(faces), size=2)
        if way == 0:
            faces = np.delete(faces, one, axis=0)
        elif way == 1:
            faces[one] = faces[one, ::-1]
        elif way == 2:
            faces = np.vstack([faces, np.roll(faces[one], rng.integers(3))[:: rng.choice([1, -1])]])
        elif way == 3:
            vertices[faces[one, 0]] = vertices[faces[other, 0]]
        elif way == 4:
            vertices[faces[one, 0]] = vertices[faces[one, 1:]].mean(axis=0)
        elif way == 5:
            vertices, faces = vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
        else:
            faces = np.vstack([faces, rng.integers(len(vertices), size=(2, 3))])
    order = rng.permutation(len(vertices))
    return Mesh(vertices[order], np.argsort(order)[rng.permutation(faces)])


def counted(mesh: Mesh) -> dict[str, object]:
    """Defects of a mesh, counted face by face and edge by edge."""
    first: dict[bytes, int] = {}
    ids = [first.setdefault((position + 0.0).tobytes(), i) for i, position in enumerate(mesh.vertices)]
    uses: defaultdict[tuple[int, int], list[int]] = defaultdict(list)
    seen: set[frozenset[int]] = set()
    duplicates, degenerate = [], []
    neighbors: defaultdict[int, set[int]] = defaultdict(set)
    for f, face in enumerate(mesh.faces.tolist()):
        a, b, c = mesh.vertices[face]
        if not np.any(np.cross(b - a, c - a)):
            degenerate.append(f)
        corners = [ids[i] for i in face]
        if len(set(corners)) < 3:
            continue
        if frozenset(corners) in seen:
            duplicates.append(f)
        seen.add(frozenset(corners))
        for start, end in zip(corners, corners[1:] + corners[:1], strict=True):
            uses[min(start, end), max(start, end)].append(1 if start < end else -1)
            neighbors[start].add(end)
            neighbors[end].add(start)
    edges = sorted(uses)
    parts, reached = 0, set[int]()
    for start in neighbors:
        parts += start not in reached
        stack = [start]
        while stack:
            if (corner := stack.pop()) not in reached:
                reached.add(corner)
                stack += neighbors[corner]
    used = set(mesh.faces.ravel().tolist())
    return {
        "open_edges": _found([edge for edge in edges if len(uses[edge]) % 2]),
        "mixed_edges": _found([edge for edge in edges if len(uses[edge]) % 2 == 0 and sum(uses[edge])]),
        "nonmanifold_edges": _found([edge for edge in edges if len(uses[edge]) > 2]),
        "duplicate_faces": _found(duplicates),
        "degenerate_faces": _found(degenerate),
        "unreferenced_vertices": _found([i for i in range(len(mesh.vertices)) if i not in used]),
        "components": parts,
    }


def _found(offenders: list[Any]) -> Finding:
    return Finding(len(offenders), tuple(offenders[:FIRST]))


@pytest.mark.parametrize("seed", range(60))
def test_a_diagnosis_is_what_counting_finds(seed: int) -> None:
    raw = broken(seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tl.TranslucentWarning)
        for mesh in (raw, mended(raw)):
            found = counted(mesh)
            assert {name: getattr(mesh.diagnosis, name) for name in found} == found
            # What loading has found out changes nothing.
            assert diagnose(mesh.vertices, mesh.faces) == mesh.diagnosis


def test_what_loading_has_found_out_spares_work_and_is_true(monkeypatch: pytest.MonkeyPatch) -> None:
    clean = mended(ball(2))
    expected = diagnose(clean.vertices, clean.faces)
    monkeypatch.setattr("translucent.geometry.diagnosis.equal_rows", None)
    assert clean.diagnosis == expected
    assert pickle.loads(pickle.dumps(clean)).diagnosis == expected
    with pytest.raises(TypeError):
        _ = ball(2).diagnosis


def test_seams_of_texture_coordinates_are_no_edges() -> None:
    uv = np.repeat(np.arange(12.0), 3)[:, None] * [1.0, 0.5]
    split = mended(Mesh(CORNERS[CUBE].reshape(-1, 3), np.arange(36).reshape(-1, 3), uv))
    assert len(split.vertices) == 36
    assert split.diagnosis == diagnose(split.vertices, split.faces)
    assert split.diagnosis.convex


def test_a_clean_mesh_is_mended_without_a_copy() -> None:
    mesh = ball(1)
    assert mended(mesh) is mesh


def test_arrays_that_a_caller_holds_are_copied() -> None:
    vertices, faces = CORNERS.copy(), CUBE.astype(np.int32)
    mesh = Mesh(vertices, faces)
    vertices[:], faces[:] = 7.0, 0
    assert mesh.volume == 1.0
    assert not mesh.vertices.flags.writeable


# Sorting


@given(FACES, st.integers(1, 20))
def test_blocks_of_sides_hold_all_sides_of_each_edge(faces: npt.NDArray[np.int32], most: int) -> None:
    whole, blocks = sorted_sides(faces), list(side_blocks(faces, most))
    assert np.concatenate([block.edge for block in blocks]).tolist() == whole.edge.tolist()
    together = [set(zip(block.edge.tolist(), block.side.tolist(), strict=True)) for block in blocks]
    assert set().union(*together) == set(zip(whole.edge.tolist(), whole.side.tolist(), strict=True))
    assert all(not {edge for edge, _ in a} & {edge for edge, _ in b} for a, b in itertools.combinations(together, 2))


@given(FACES)
def test_parts_by_blocks_are_those_of_all_sides_at_once(faces: npt.NDArray[np.int32]) -> None:
    part, flip = spread_winding(faces)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(repair, "side_blocks", lambda faces: side_blocks(faces, 6))
        again, flip_again = spread_winding(faces)
    assert (again.tolist(), flip_again.tolist()) == (part.tolist(), flip.tolist())


@given(FACES)
def test_paired_sides_are_those_of_a_closed_surface_that_agrees(faces: npt.NDArray[np.int32]) -> None:
    ends = [(int(face[i]), int(face[(i + 1) % 3])) for face in faces for i in range(3)]
    directed = Counter(ends)
    assert sorted_sides(faces).paired == all(directed[a, b] == directed[b, a] == 1 and a != b for a, b in set(ends))


def test_paired_sides_of_a_cube_and_of_one_that_lacks_a_face() -> None:
    assert sorted_sides(CUBE).paired
    assert not sorted_sides(CUBE[1:]).paired
    assert not sorted_sides(changed(CUBE, flip=4)).paired


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 2**40 - 1)), unique=True, min_size=1, max_size=30))
def test_pairs_that_fit_into_no_integer_are_sorted_all_the_same(pairs: list[tuple[int, int]]) -> None:
    for shift in (0, 58):
        key, tail = (np.array(column, dtype=np.uint64) for column in zip(*pairs, strict=True))
        found = sorted_pairs(key << np.uint64(shift), tail, 3 + shift)
        expected = sorted((a << shift, b) for a, b in pairs)
        assert list(zip(*(column.tolist() for column in found), strict=True)) == expected


@given(arrays.arrays(np.int64, st.tuples(st.integers(1, 30), st.just(2)), elements=st.integers(-2, 2)))
def test_rows_are_told_apart_where_their_hashes_are_equal(rows: npt.NDArray[np.int64]) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(grouping, "_hashes", lambda rows: np.abs(rows[:, 0]).astype(np.uint64) << np.uint64(62))
        found = equal_rows(rows)
    _, first, of = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    assert found.first[found.of].tolist() == first[of.ravel()].tolist()
    assert sorted(found.first.tolist()) == sorted(first.tolist())


@given(st.integers(1, 20), st.lists(st.tuples(st.integers(0, 19), st.integers(0, 19)), max_size=25))
def test_components_are_numbered_by_their_first_nodes(count: int, pairs: list[tuple[int, int]]) -> None:
    one, other = (np.array([pair[i] % count for pair in pairs], dtype=np.int32) for i in range(2))
    graph = coo_array((np.ones(len(one)), (one, other)), shape=(count, count))
    assert connected(count, one, other).tolist() == connected_components(graph, directed=False)[1].tolist()


def test_a_long_chain_is_one_component_however_its_nodes_are_numbered() -> None:
    for order in (np.arange(5000), np.arange(5000)[::-1], np.random.default_rng(1).permutation(5000)):
        assert not connected(5000, order[:-1], order[1:]).any()
    leaves = np.arange(4999)  # of a star whose center is the highest node: each has no lower neighbor
    assert not connected(5000, leaves, np.full_like(leaves, 4999)).any()


# Places


@pytest.mark.parametrize("seed", range(4))
def test_near_points_are_those_of_all_distances(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.random((400, 3)) * rng.choice([[1, 1, 1], [1, 1, 0], [1, 0, 0]]) + rng.choice([0.0, 1e3])
    points[rng.integers(400, size=5)] = points[rng.integers(400, size=5)]
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    for distance in (0.0, 1e-3, 0.02):
        assert near_points(points, distance).tolist() == np.flatnonzero((apart <= distance).any(axis=1)).tolist()


def test_too_many_near_points_are_all_points() -> None:
    points = np.zeros((500, 3))
    points[:, 0] = np.linspace(0, 1e-9, 500)
    assert near_points(points, 1.0).tolist() == list(range(500))


@pytest.mark.parametrize("count", [1, 255, 256, 1000])
def test_the_extent_of_points_is_told_row_by_row(count: int) -> None:
    points = np.random.default_rng(count).normal(size=(count, 3))
    assert extent(points).tolist() == [points.min(axis=0).tolist(), points.max(axis=0).tolist()]
    points[count // 2, 1] = np.nan
    assert np.isnan(extent(points)).tolist() == [[False, True, False]] * 2


def test_the_volumes_of_parts_are_those_of_each_alone() -> None:
    bodies = [cube(), inverted(cube(low=1e3, size=0.5)), cube(low=-7.0, size=2.0)]
    mesh = joined(*bodies)
    volumes = part_volumes(mesh.vertices, mesh.faces, np.repeat([2, 0, 1], 12), 3)
    assert volumes == pytest.approx([-0.125, 8.0, 1.0], rel=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_faces_that_are_left_out_meet_no_line(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Corners on lines, between them, and beyond all of them."""
    monkeypatch.setattr(winding, "_FEW", 0)
    rng = np.random.default_rng(seed)
    scaled, faces = rng.integers(-6, 16, size=(300, 2)) / 2.0, rng.integers(300, size=(400, 3))
    scaled[150:] += rng.uniform(-0.4, 0.4, size=(150, 2))
    heights = rng.random(300)
    near = winding._near_lines(scaled, faces, 5)
    found = [
        np.concatenate([np.stack(part) for part in line_crossings(scaled, heights, chosen, (5, 5))], axis=1)
        for chosen in (faces, faces[near])
    ]
    assert found[0].tolist() == found[1].tolist()
    assert found[0].size > 0
    assert len(near) < len(faces)
