"""Every way to store triangles in a glTF file, and what loading mends."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import translucent as tl
from tests.gltf.gltf_writer import BOX, TYPES, Writer, box_file, load


def triangles(mesh: tl.Mesh) -> set[tuple[tuple[float, ...], ...]]:
    """The faces of a mesh by the positions of their corners, each from its smallest corner on."""
    found = set()
    for corners in mesh.vertices[mesh.faces].round(6).tolist():
        points = [tuple(corner) for corner in corners]
        first = points.index(min(points))
        found.add(tuple(points[first:] + points[:first]))
    return found


def test_seams_are_welded_so_that_a_box_is_closed(tmp_path: Path) -> None:
    writer = Writer()
    split = trimesh.Trimesh(BOX.triangles.reshape(-1, 3), np.arange(36).reshape(-1, 3), process=False)
    writer.mesh(writer.primitive(split))
    writer.add("nodes", mesh=0, name="Box")
    mesh = load(writer, tmp_path).objects[0].mesh
    assert mesh.diagnosis.solid
    assert (len(mesh.vertices), mesh.volume) == (8, pytest.approx(48.0, rel=1e-12))
    assert mesh.repairs == ("welded 28 of 36 vertices (within 1e-06 of the diagonal)",)


def test_a_repair_is_a_warning_as_it_is_of_load_mesh(tmp_path: Path) -> None:
    writer = Writer()
    inverted = trimesh.Trimesh(BOX.vertices, BOX.faces[:, ::-1], process=False)
    writer.mesh(writer.primitive(inverted))
    writer.add("nodes", mesh=0, name="Box")
    with pytest.warns(tl.TranslucentWarning, match=r"mesh 'Box': flipped 1 closed part outwards"):
        assert load(writer, tmp_path).objects[0].mesh.volume > 0


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
@pytest.mark.parametrize(
    "stored", ["u1", "u2", "u4", "plain", "shared", "strided", "sparse", "sparse from zeros", "i2", "i2 normalized"]
)
def test_every_way_to_store_a_box_gives_the_box(tmp_path: Path, stored: str, suffix: str) -> None:
    writer, expected = Writer(), triangles(tl.Mesh(BOX.vertices, BOX.faces))
    corners, scale, fields = BOX.vertices, 1.0, {}
    positions = None
    if stored in TYPES and stored != "i2":
        fields["indices"] = writer.accessor(BOX.faces.ravel(), stored)
    elif stored == "plain":
        corners = BOX.triangles.reshape(-1, 3)
    else:
        fields["indices"] = writer.accessor(BOX.faces.ravel(), "u2")
    if stored == "shared":  # with the vertices of another primitive, and offsets into one view
        data = np.vstack([corners + 100, corners]).astype("<f4").tobytes()
        view = writer.view(data)
        positions = writer.add("accessors", bufferView=view, byteOffset=96, componentType=5126, count=8, type="VEC3")
    elif stored == "strided":
        rows = np.hstack([corners, np.full((8, 2), 7.0)]).astype("<f4").tobytes()
        view = writer.view(rows[:-8], byteStride=20)  # the last element need not fill its stride
        positions = writer.add("accessors", bufferView=view, componentType=5126, count=8, type="VEC3")
    elif stored.startswith("sparse"):
        zeros = stored.endswith("zeros")
        changed = np.arange(8) if zeros else np.array([1, 6])
        wrong = corners.copy()
        wrong[changed] = 55.0
        sparse = {
            "count": len(changed),
            "indices": {"bufferView": writer.view(changed.astype("u1").tobytes()), "componentType": 5121},
            "values": {"bufferView": writer.view(corners[changed].astype("<f4").tobytes())},
        }
        positions = writer.accessor(wrong, sparse=sparse)
        if zeros:
            del writer.tree["accessors"][positions]["bufferView"]
    elif stored.startswith("i2"):
        # Halves of the sides are 1, 2 and 3: as integers, or as shares of the largest one.
        full = 32767 if stored.endswith("normalized") else 3
        positions = writer.accessor(np.rint(corners / 3 * full), "i2", normalized=stored.endswith("normalized"))
        scale = 3.0 if stored.endswith("normalized") else 1.0
    attributes = {"POSITION": writer.accessor(corners) if positions is None else positions}
    writer.mesh({"attributes": attributes, **fields})
    writer.add("nodes", mesh=0, scale=[scale] * 3)
    (box,) = load(writer, tmp_path, suffix).objects
    if scale == 1.0:
        assert triangles(box.mesh) == expected
    else:  # to half a step of 1/32767
        world = np.sort(box.mesh.vertices * scale, axis=0)
        np.testing.assert_allclose(world, np.sort(BOX.vertices, axis=0), atol=3 * 0.5 / 32767)
        assert box.mesh.diagnosis.solid


def test_buffers_may_be_several_and_lie_beside_the_file(tmp_path: Path) -> None:
    writer = box_file(tmp_path)
    (tmp_path / "two words.bin").write_bytes(writer.data)
    writer.tree["buffers"] = [
        {"byteLength": 3, "uri": "data:;base64,AAAA"},
        {"byteLength": len(writer.data), "uri": "two%20words.bin"},
    ]
    for view in writer.tree["bufferViews"]:
        view["buffer"] = 1
    (box,) = load(writer, tmp_path, ".gltf").objects
    assert box.mesh.volume == pytest.approx(48.0, rel=1e-12)


@pytest.mark.parametrize(
    ("mode", "corners", "faces"),
    [
        (4, [0, 1, 2, 2, 1, 3], [(0, 1, 2), (2, 1, 3)]),
        (5, [0, 1, 2, 3, 4], [(0, 1, 2), (1, 3, 2), (2, 3, 4)]),
        (5, [0, 1, 2, 2, 3, 3, 4, 0], [(0, 1, 2), (3, 0, 4)]),  # two strips, joined without area
        (6, [0, 1, 2, 3, 4], [(1, 2, 0), (2, 3, 0), (3, 4, 0)]),
    ],
)
def test_lists_strips_and_fans_have_the_winding_of_the_specification(
    tmp_path: Path, mode: int, corners: list[int], faces: list[tuple[int, ...]]
) -> None:
    # No faces share an edge twice the wrong way, so that nothing is turned on the way.
    points = np.array([[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [1.5, 1.5, 0.5], [-1, 2, 1]], dtype=np.float64)
    writer = Writer()
    writer.mesh(
        {"attributes": {"POSITION": writer.accessor(points)}, "indices": writer.accessor(corners, "u1")}
        | {"mode": mode}
    )
    writer.add("nodes", mesh=0)
    (item,) = load(writer, tmp_path).objects
    assert triangles(item.mesh) == triangles(tl.Mesh(points, faces))


def test_points_and_lines_are_left_out_and_texture_coordinates_count_upwards(tmp_path: Path) -> None:
    writer = Writer()
    box = writer.primitive()
    box["attributes"]["TEXCOORD_0"] = writer.accessor(np.tile([[0.25, 0.0]], (8, 1)))
    box["attributes"]["COLOR_0"] = writer.accessor(np.ones((8, 3)))
    writer.mesh(box, writer.primitive(mode=1))
    writer.add("nodes", mesh=0, name="Box")
    with pytest.warns(tl.TranslucentWarning, match=r"left out: points and lines \('Box\[1\]'\)"):
        (item,) = load(writer, tmp_path).objects
    assert item.mesh.uv is not None
    assert set(map(tuple, item.mesh.uv.tolist())) == {(0.25, 1.0)}
