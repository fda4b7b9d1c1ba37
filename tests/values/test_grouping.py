"""Equal rows of a mesh, held against sorting whole rows."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from translucent.geometry.grouping import Groups, equal_rows, position_ids, shared_edges, used_vertices

ROWS = arrays.arrays(np.int64, st.tuples(st.integers(1, 30), st.integers(1, 3)), elements=st.integers(-3, 3))
FACES = arrays.arrays(np.int32, st.tuples(st.integers(1, 20), st.just(3)), elements=st.integers(0, 6))


def agree(found: Groups, rows: npt.NDArray[np.int64]) -> None:
    _, first, of, sizes = np.unique(rows, axis=0, return_index=True, return_inverse=True, return_counts=True)
    order = np.argsort(found.first)
    np.testing.assert_array_equal(found.first[order], np.sort(first))
    np.testing.assert_array_equal(found.sizes[order], sizes[np.argsort(first)])
    # The same partition, whatever its groups are called.
    np.testing.assert_array_equal(found.first[found.of], first[of.ravel()])


@given(ROWS)
def test_equal_rows_are_those_of_a_sort(rows: npt.NDArray[np.int64]) -> None:
    agree(equal_rows(rows), rows)
    agree(equal_rows(rows.astype(np.float32)), rows)


@given(FACES)
def test_shared_edges_are_unordered_pairs(faces: npt.NDArray[np.int32]) -> None:
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    assert [(start[3 * f + i], end[3 * f + i]) for f in range(len(faces)) for i in range(3)] == [
        (faces[f, i], faces[f, (i + 1) % 3]) for f in range(len(faces)) for i in range(3)
    ]
    agree(shared_edges(faces), np.sort(np.stack([start, end], axis=1), axis=1))


@given(FACES)
def test_used_vertices(faces: npt.NDArray[np.int32]) -> None:
    np.testing.assert_array_equal(used_vertices(faces), np.unique(faces))


def test_zeros_of_both_signs_are_one_position_and_what_is_no_number_is_itself() -> None:
    vertices = np.array([[0.0, 1.0, np.nan], [-0.0, 1.0, np.nan], [0.0, 1.0, 2.0], [5e-324, 1.0, 2.0]])
    np.testing.assert_array_equal(position_ids(vertices), [0, 0, 2, 3])


def test_numbers_of_vertices_beyond_32_bits_of_their_square() -> None:
    largest = np.iinfo(np.int32).max - 1
    faces = np.array([[largest, 0, 1], [1, 0, largest], [largest - 1, 0, 1]], dtype=np.int32)
    assert len(shared_edges(faces).first) == 5


@pytest.mark.parametrize("rows", [np.empty((0, 3)), np.empty((0, 3), np.int32)])
def test_nothing_has_no_groups(rows: npt.NDArray[np.float64]) -> None:
    assert len(equal_rows(rows).first) == len(equal_rows(rows).of) == 0
    assert len(used_vertices(rows.astype(np.int32))) == len(shared_edges(rows.astype(np.int32)).first) == 0
