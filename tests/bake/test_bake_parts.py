"""Maps of glTF files as images: one for each primitive, in its own UVs, as thick as the body that it is a part of."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import translucent as tl
from tests.command_line import Run, one_error_line
from tests.gltf.gltf_writer import Writer, glass
from translucent.bake.batch import asset_line, run_job
from translucent.bake.check import check_output, look_up
from translucent.bake.jobs import bake_file
from translucent.bake.record import read_record
from translucent.gltf.accessors import Accessors
from translucent.gltf.file import read_gltf

QUICK = ("--size", "64", "--rays", "16", "--padding", "2")
SETTINGS = {"size": 64, "rays": 16, "padding": 2}
#: Mean over the cosine-weighted directions of the lengths inside a ball of radius 1.
MEAN = 4 / 3

Vase = Callable[..., Path]


@pytest.fixture
def run(run: Run) -> Run:
    return partial(run, "bake")


@pytest.fixture
def vase(make_ball: Callable[..., trimesh.Trimesh], tmp_path: Path) -> Vase:
    """A ball of radius 1 whose mesh is split into four primitives, each with UVs that use the whole of a map."""
    ball = make_ball(3)
    corners, height = np.asarray(ball.triangles), ball.triangles_center[:, 2]

    def _make(*materials: dict[str, Any] | None, uv: bool = True, **node: Any) -> Path:
        writer, parts = Writer(), []
        for part, material in enumerate(materials):
            low, high = np.array([part, part + 1]) * 2 / len(materials) - 1
            positions = corners[(height >= low) & (height < high)]
            count = len(positions)
            side = int(np.ceil(np.sqrt(count)))
            cell = np.stack(np.divmod(np.arange(count), side), axis=1)[:, None]
            coordinates = (cell + np.array([[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]])) / side
            attributes = {"POSITION": writer.accessor(positions.reshape(-1, 3))}
            if uv:
                attributes["TEXCOORD_0"] = writer.accessor(coordinates.reshape(-1, 2))
            chosen = {} if material is None else {"material": writer.material(**material)}
            parts.append({"attributes": attributes, "indices": writer.accessor(np.arange(3 * count), "u2")} | chosen)
        writer.mesh(*parts, name="Vase")
        writer.add("nodes", mesh=0, **node)
        return writer.save(tmp_path / "vase.glb")

    return _make


def lit(*names: str) -> list[dict[str, Any]]:
    return [{"name": name, "extensions": glass()} for name in names]


def raw_uv(path: Path, primitive: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions, and UVs with v upwards, as they stand in a file."""
    file = read_gltf(path)
    attributes = file.items("meshes")[0]["primitives"][primitive]["attributes"]
    names = [name for name in attributes if name.startswith("TEXCOORD")]
    uv = Accessors(file).vectors(attributes[names[-1]], "VEC2")
    return Accessors(file).vectors(attributes["POSITION"], "VEC3"), np.column_stack([uv[:, 0], 1 - uv[:, 1]])


def values_on(path: Path, primitive: int, values: np.ndarray) -> np.ndarray:
    """A map at the middles of the faces of a primitive, by the UVs in a file."""
    positions, uv = raw_uv(path, primitive)
    file = read_gltf(path)
    faces = Accessors(file).indices(file.items("meshes")[0]["primitives"][primitive]["indices"]).reshape(-1, 3)
    mesh = tl.Mesh(positions, faces.astype(np.int32), uv=uv)
    return look_up(mesh, values, uv[faces].mean(axis=1))


def test_each_primitive_has_a_map_in_its_own_uvs(run: Run, vase: Vase, tmp_path: Path) -> None:
    """None is closed; together they are a ball, whose thickness all have."""
    model, out = vase(*lit("Clay", "Glaze/../é", "", "Clay")), tmp_path / "maps" / "t.npy"
    out.parent.mkdir()
    result = run(model, "-o", out, *QUICK)
    assert (result.code, result.err) == (0, "")
    names = ["t-Clay_Vase_0.npy", "t-Glaze_.._é.npy", "t-material_2.npy", "t-Clay_Vase_3.npy"]
    files = {*names, *(f"{name}.json" for name in names), "t.npy.json"}
    assert {path.name for path in out.parent.iterdir()} == files
    lines = [line for line in result.out.splitlines() if not line.startswith("advice")]
    assert [line.split(":")[0] for line in lines[::2]] == [str(out.with_name(name)) for name in names]
    for primitive, name in enumerate(names):
        found = values_on(model, primitive, tl.load_thickness_map(out.with_name(name)))
        assert np.abs(found / MEAN - 1).max() < 0.03
        assert read_record(out.with_name(name))["report"]["uv_from"] == "mesh"
    told = read_record(out)
    assert [part["file"] for part in told["maps"]] == names
    assert [part["place"] for part in told["maps"]] == [[0, 0], [0, 1], [0, 2], [0, 3]]
    assert max(part["escaped"] for part in told["maps"]) == 0


def test_all_maps_have_to_be_there_to_be_done(vase: Vase, tmp_path: Path) -> None:
    job = {"model": str(vase(*lit("A", "B"))), "output": str(tmp_path / "t.npy"), "settings": SETTINGS}
    statuses = []
    for name in ("t-A.npy", "none", "t-B.npy", "none"):
        entry = run_job(job)
        statuses.append(entry["status"])
        (tmp_path / name).unlink(missing_ok=True)
    assert statuses == ["baked", "baked", "skipped", "baked"]
    assert [Path(file).name for file in entry["files"]] == ["t-A.npy", "t-B.npy"]
    assert ", 2 parts" in asset_line(entry)


def test_uvs_without_a_material_stay(run: Run, vase: Vase, tmp_path: Path) -> None:
    model = vase(None)
    assert run(model, "-o", tmp_path / "t.npz", *QUICK).code == 0
    positions, uv = raw_uv(model, 0)
    mesh = tl.Mesh(positions, np.arange(len(positions)).reshape(-1, 3), uv=uv)
    truth = tl.bake_thickness(mesh, 64, rays=16, padding=2)
    with np.load(tmp_path / "t.npz") as file:
        np.testing.assert_array_equal(file["coverage"], truth.coverage)
        np.testing.assert_allclose(file["values"][truth.coverage], truth.values[truth.coverage], rtol=0.05)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["t.npz", "t.npz.json", "vase.glb"]


def test_opaque_parts_are_left_out_and_told(run: Run, vase: Vase, tmp_path: Path) -> None:
    """They close the body all the same."""
    model = vase(*lit("Glass"), {"name": "Lid"})
    result = run(model, "-o", tmp_path / "t.npy", *QUICK)
    assert result.code == 0, result.err
    assert "left out, opaque: Vase[1]" in result.out.splitlines()
    assert read_record(tmp_path / "t.npy")["left_out"] == ["opaque: Vase[1]"]
    assert np.abs(values_on(model, 0, np.load(tmp_path / "t.npy")) / MEAN - 1).max() < 0.03


def test_what_is_closed_by_itself_is_a_body_of_its_own(tmp_path: Path) -> None:
    """A cube inside another one, whose sides are two primitives."""
    pytest.importorskip("xatlas", reason="xatlas makes the UVs")
    outer, inner = (trimesh.creation.box((size, size, size)) for size in (2.0, 1.0))
    halves = [trimesh.Trimesh(outer.vertices, outer.faces[rows], process=False) for rows in (slice(6), slice(6, 12))]
    writer = Writer()
    names = [writer.material(name=name, extensions=glass()) for name in ("Left", "Right", "Wine")]
    writer.mesh(*(writer.primitive(m, material=name) for m, name in zip([*halves, inner], names, strict=True)))
    writer.add("nodes", mesh=0)
    job = {"model": str(writer.save(tmp_path / "a.glb")), "output": str(tmp_path / "t.npy")}
    _, results = bake_file({**job, "settings": {**SETTINGS, "mode": "normal", "rays": 1}})
    assert [result.values.max() for result in results.values()] == pytest.approx([2, 2, 1])


def test_maps_are_in_metres_of_the_scene(vase: Vase, run: Run, tmp_path: Path) -> None:
    """Small ones, and mirrored."""
    model = vase(*lit("A", "B"), scale=[-0.01, 0.01, 0.01], translation=[5, 0, 0])
    assert run(model, "-o", tmp_path / "t.npy", *QUICK, "--check").code == 0
    for primitive, name in enumerate("AB"):
        found = values_on(model, primitive, np.load(tmp_path / f"t-{name}.npy"))
        assert np.abs(found / (0.01 * MEAN) - 1).max() < 0.03


def test_nodes_that_differ_in_size_are_told(vase: Vase, tmp_path: Path) -> None:
    model = vase(None)
    file = read_gltf(model)
    file.tree["nodes"] += [{"mesh": 0, "scale": [0, 0, 0]}, {"mesh": 0, "rotation": [0, 0.6, 0, 0.8]}]
    (tmp_path / "data.bin").write_bytes(file.resource({}))
    file.tree["buffers"][0]["uri"] = "data.bin"
    job = {"model": str(tmp_path / "a.gltf"), "output": str(tmp_path / "t.npy"), "settings": SETTINGS}
    (tmp_path / "a.gltf").write_text(json.dumps(file.tree))
    bake_file(job)  # a node that hides it, and one that turns it
    file.tree["nodes"].append({"mesh": 0, "scale": [1, 1, 2]})
    (tmp_path / "a.gltf").write_text(json.dumps(file.tree))
    with pytest.warns(tl.TranslucentWarning, match="nodes use 'Vase' in several sizes; the map fits only the first"):
        bake_file(job)


# New UVs


@pytest.mark.parametrize("unwrap", [False, True], ids=["none", "asked"])
def test_new_uvs_are_written_beside_the_map(unwrap: bool, run: Run, vase: Vase, tmp_path: Path) -> None:
    pytest.importorskip("xatlas", reason="xatlas makes the UVs")
    model, out = vase(*lit("A", "B"), uv=unwrap), tmp_path / "t.npy"
    result = run(model, "-o", out, *QUICK, "--check", *(["--unwrap"] if unwrap else []))
    assert result.code == 0, result.err
    beside = tmp_path / "t.npy.uv.glb"
    assert f"{beside}: the model with new UVs for this map\n" in result.out
    for primitive, name in enumerate("AB"):
        found = values_on(beside, primitive, np.load(tmp_path / f"t-{name}.npy"))
        assert np.abs(found / MEAN - 1).max() < 0.03
    assert len(tl.load_scene(beside).objects) == 2


def test_a_mesh_file_with_new_uvs_is_beside_the_map(run: Run, tmp_path: Path) -> None:
    pytest.importorskip("xatlas", reason="xatlas makes the UVs")
    model, out = tmp_path / "ball.stl", tmp_path / "t.png"
    trimesh.creation.icosphere(3, 10.0).export(model)
    arguments = (model, "-o", out, *QUICK, "--unit", "mm")
    result = run(*arguments, "--json", "--check")
    assert result.code == 0, result.err
    beside = tmp_path / "t.png.uv.glb"
    assert json.loads(result.out)["uv_file"] == str(beside)
    found = values_on(beside, 0, tl.load_thickness_map(out))
    assert np.abs(found / (0.01 * MEAN) - 1).max() < 0.03
    job = {"model": str(model), "output": str(tmp_path / "again.npy"), "unit": "mm", "settings": SETTINGS}
    assert [run_job(job)["status"] for _ in range(2)] == ["baked", "skipped"]
    (tmp_path / "again.npy.uv.glb").unlink()
    assert run_job(job)["status"] == "baked"


# The check


def test_the_check_notices_a_map_of_other_uvs(vase: Vase, make_ball: Any, tmp_path: Path) -> None:
    job = {"model": str(vase(*lit("A", "B"))), "output": str(tmp_path / "t.npy"), "settings": SETTINGS}
    record, results = bake_file(job)
    assert set(check_output(job, record, results)) == {"Vase[0]", "Vase[1]"}
    path = Path(job["model"])
    data, (_, uv) = path.read_bytes(), raw_uv(path, 1)
    own = np.column_stack([uv[:, 0], 1 - uv[:, 1]]).astype("<f4")
    path.write_bytes(data.replace(own.tobytes(), (0.25 + 0.5 * own).astype("<f4").tobytes()))
    with pytest.raises(tl.RenderError, match=r"'Vase\[1\]'; \d+% of the vertices have other texture coordinates in"):
        check_output(job, record, results)


def test_the_check_notices_a_map_of_other_uvs_of_a_mesh(make_ball: Any, tmp_path: Path) -> None:
    ball = make_ball(2)
    ball.export(tmp_path / "a.obj")
    job = {"model": str(tmp_path / "a.obj"), "output": str(tmp_path / "t.npy"), "settings": SETTINGS}
    record, results = bake_file(job)
    (found,) = check_output(job, record, results).values()
    assert found is not None
    assert found.empty == 0
    ball.visual.uv = 1 - ball.visual.uv
    ball.export(tmp_path / "a.obj")
    with pytest.raises(
        tl.RenderError, match="the thickness map was not baked for this file; bake it again with --unwrap"
    ):
        check_output(job, record, results)
    trimesh.Trimesh(ball.vertices, ball.faces, process=False).export(tmp_path / "a.obj")
    with pytest.raises(tl.RenderError, match="has no texture coordinates"):
        check_output(job, record, results)


def test_faces_that_no_texel_shows_are_told(run: Run, vase: Vase, tmp_path: Path) -> None:
    model = vase(None)
    _, uv = raw_uv(model, 0)
    own = np.column_stack([uv[:, 0], 1 - uv[:, 1]]).astype("<f4")
    squeezed = np.where(np.arange(len(own))[:, None] < len(own) // 2, own, 0.001 * own)
    model.write_bytes(model.read_bytes().replace(own.tobytes(), squeezed.astype("<f4").tobytes()))
    with pytest.warns(tl.TranslucentWarning, match=r"faces, \d+% of the surface, have no texel"):
        bake_file({"model": str(model), "output": str(tmp_path / "t.npy"), "settings": {**SETTINGS, "size": 128}})


def test_a_high_mesh_is_for_one_part(run: Run, vase: Vase, tmp_path: Path) -> None:
    result = run(vase(*lit("A", "B")), "-o", tmp_path / "t.npy", *QUICK, "--high", "bear")
    assert (
        "2 objects of the model get a thickness map, but a detailed mesh belongs to one object; bake these objects"
        in one_error_line(result)
    )


# The files of others


@pytest.mark.filterwarnings("ignore::translucent.TranslucentWarning")  # holes
@pytest.mark.parametrize("name", ["GlassHurricaneCandleHolder", "IridescenceSuzanne"])
def test_maps_belong_to_the_uvs_of_their_files(name: str, assets: Path, tmp_path: Path) -> None:
    model = assets / "gltf" / f"{name}.glb"
    job = {"model": str(model), "output": str(tmp_path / "t.npy"), "settings": {"size": 64, "rays": 2}}
    record, results = bake_file(job)
    assert (len(results), "uv_file" in record) == (1, False)
    assert record["left_out"]
    checks = [check for check in check_output(job, record, results).values() if check is not None]
    assert checks
    assert all(check.empty < 0.01 for check in checks)
