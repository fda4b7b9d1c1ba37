"""``translucent bake``: files, errors of one line, progress, and going on after an interruption."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import translucent as tl
from tests.command_line import Result, Run, one_error_line
from translucent.bake import batch
from translucent.bake.gltf_builder import GlbBuilder
from translucent.bake.record import sidecar_of
from translucent.cli import main
from translucent.commands import bake as command
from translucent.gltf.file import read_gltf
from translucent.gltf.materials import read_materials
from translucent.gltf.nodes import thickness_at, thickness_map

QUICK = ("--size", "32", "--rays", "4", "--padding", "2")


@pytest.fixture
def run(run: Run) -> Run:
    return partial(run, "bake")


@pytest.fixture
def ball(make_ball: Callable[..., trimesh.Trimesh], tmp_path: Path) -> Path:
    """A ball of 2 cm with UVs; its file is in cm."""
    make_ball(2, 1.0).export(tmp_path / "ball.obj")
    return tmp_path / "ball.obj"


def refused(result: Result, message: str, code: int = 2) -> None:
    assert re.search(message, one_error_line(result, code)), result.err


@pytest.mark.parametrize("suffix", ["exr", "png", "npy", "npz"])
def test_a_map_is_what_python_bakes(suffix: str, run: Run, ball: Path, tmp_path: Path) -> None:
    path = tmp_path / f"t.{suffix}"
    result = run(ball, "-o", path, *QUICK, "--unit", "cm", "--seed", 3, "--spread", 120, "--weighting", "uniform")
    assert result.code == 0, result.err
    mesh = tl.load_mesh(ball, unit="cm")
    truth = tl.bake_thickness(mesh, 32, rays=4, spread=120.0, seed=3, padding=2, weighting="uniform")
    step = truth.values.max() / 65535 if suffix == "png" else 0
    np.testing.assert_allclose(tl.load_thickness_map(path), truth.values, atol=0.51 * step, rtol=0)
    assert re.match(rf"{re.escape(str(path))}: 32x32, cone, \S+ to 0\.0\d+ m\n", result.out)
    assert "million rays in" in result.out
    record = json.loads(sidecar_of(path).read_text())
    assert (record["model"], record["model_unit"]) == (str(ball), "cm")
    assert record["settings"]["weighting"] == "uniform"


def test_all_options_reach_the_bake(run: Run, ball: Path, tmp_path: Path) -> None:
    options = ("--mode", "transmittance", "--color", "#7b1e3a", "--distance", "1cm", "--supersample", 2, "--seed", 5)
    more = ("--gaps", "total", "--max-distance", "1.5cm", "--ignore-back-faces", "--tolerance", "10%", "--unit", "cm")
    result = run(ball, "-o", tmp_path / "t.npy", *QUICK, *options, *more, "--json")
    assert result.code == 0, result.err
    told = json.loads(result.out)
    mesh = tl.load_mesh(ball, unit="cm")
    assert told["record"]["settings"] == {
        "mode": "transmittance", "size": 32, "rays": 4, "spread": 180.0, "weighting": "cosine", "gaps": "total",
        "max_distance": 0.015, "ignore_back_faces": True, "supersample": 2, "padding": 2, "seed": 5,
        "tolerance": pytest.approx(0.1 * mesh.diagonal), "tile": None, "high_distance": None,
        "extinction": pytest.approx(tl.Medium.from_color("#7b1e3a", 0.01).extinction.tolist()),
    }  # fmt: skip
    assert told["rays"] > 0
    assert told["output"] == str(tmp_path / "t.npy")


def test_inverted_and_normalized(run: Run, ball: Path, tmp_path: Path) -> None:
    assert run(ball, "-o", tmp_path / "n.npy", *QUICK, "--normalize").code == 0
    assert run(ball, "-o", tmp_path / "i.npy", *QUICK, "--invert").code == 0
    shares, inverted = np.load(tmp_path / "n.npy"), np.load(tmp_path / "i.npy")
    assert shares.max() == 1
    np.testing.assert_allclose(inverted, 1 - shares, atol=1e-6)


def test_a_fine_mesh_is_baked_to_a_coarse_one(run: Run, ball: Path, tmp_path: Path) -> None:
    fine = trimesh.creation.icosphere(4, 1.0)
    fine.export(tmp_path / "fine.ply")
    result = run(ball, "-o", tmp_path / "t.npy", *QUICK, "--mode", "normal", "--high", tmp_path / "fine.ply")
    assert result.code == 0, result.err
    found = np.load(tmp_path / "t.npy")
    # The coarse ball is up to 5 % thinner than the fine one, whose own facets take 0.2 %.
    assert found[found > 0].min() > 2 * (1 - 0.005)


def test_the_fine_mesh_may_be_one_of_the_toolkit(run: Run, make_ball: Any, tmp_path: Path) -> None:
    coarse = make_ball(3, 0.02)
    coarse.apply_translation((0.0, 0.02, 0.0)).export(tmp_path / "coarse.obj")
    options = (*QUICK, "--mode", "normal", "--high", "sphere", "--high-distance", "5mm")
    result = run(tmp_path / "coarse.obj", "-o", tmp_path / "t.npy", *options)
    assert result.code == 0, result.err
    values = np.load(tmp_path / "t.npy")
    np.testing.assert_allclose(values[values > 0.0], 0.04, rtol=2e-3)


def test_vertices(run: Run, ball: Path, ball_glb: Path, tmp_path: Path) -> None:
    assert run(ball, "-o", tmp_path / "t.ply", "--vertices", "--mode", "normal", "--unit", "cm").code == 0
    data = trimesh.load(tmp_path / "t.ply", process=False).metadata["_ply_raw"]["vertex"]["data"]
    assert ((data["thickness"] > 0.0185) & (data["thickness"] <= 0.02001)).all()
    assert run(ball_glb, "-o", tmp_path / "t.glb", "--vertices", "--mode", "normal").code == 0
    attributes = read_gltf(tmp_path / "t.glb").tree["meshes"][0]["primitives"][0]["attributes"]
    assert "_THICKNESS" in attributes
    refused(run(ball, "-o", tmp_path / "x.ply", "--vertices", "--high", ball), "high applies only to thickness maps")
    refused(run(ball, "-o", tmp_path / "x.ply", "--vertices", "--invert"), "invert applies only to thickness maps")
    refused(run(ball, "-o", tmp_path / "x.exr", "--vertices"), r"use \.ply, \.glb or \.npy")
    refused(run(ball, "-o", tmp_path / "x.ply"), r"suffix '\.ply'")


def test_a_gltf_file_keeps_its_unit(run: Run, ball_glb: Path, tmp_path: Path) -> None:
    result = run(ball_glb, "-o", tmp_path / "t.glb", *QUICK, "--mode", "normal", "--unit", "mm")
    assert result.code == 0, result.err
    (material,) = read_materials(tmp_path / "t.glb")
    assert 1.85 < material.thickness <= 2.00001  # in the file's unit
    record = json.loads(sidecar_of(tmp_path / "t.glb").read_text())
    assert 0.00185 < record["maps"][0]["range"]["max"] <= 0.00200001  # in metres
    assert "steps of" in result.out


def test_new_uvs_on_request(run: Run, ball_glb: Path, tmp_path: Path) -> None:
    pytest.importorskip("xatlas", reason="xatlas makes the UVs")
    assert run(ball_glb, "-o", tmp_path / "t.glb", *QUICK, "--unwrap").code == 0
    primitive = read_gltf(tmp_path / "t.glb").tree["meshes"][0]["primitives"][0]
    assert {"TEXCOORD_0", "TEXCOORD_1"} <= set(primitive["attributes"])
    assert read_materials(tmp_path / "t.glb")[0].thickness_transform.tex_coord == 1


def test_the_medium_of_the_material_is_that_of_the_mode(run: Run, ball_glb: Path, tmp_path: Path) -> None:
    wine = ("material", "apply", str(ball_glb), "--color", "#7b1e3a", "--distance", "1m", "-o", str(tmp_path / "w.glb"))
    assert main([*wine]) == 0
    mode = ("--mode", "transmittance", *QUICK)
    assert run(tmp_path / "w.glb", "-o", tmp_path / "t.glb", *mode).code == 0
    record = json.loads(sidecar_of(tmp_path / "t.glb").read_text())
    wanted = tl.Medium.from_color("#7b1e3a", 1.0).extinction
    np.testing.assert_allclose(record["settings"]["extinction"], wanted, rtol=1e-9)
    refused(run(ball_glb, "-o", tmp_path / "x.glb", *mode), "mode 'transmittance'; this mode needs a medium")


# Errors


@pytest.mark.parametrize(
    ("arguments", "message", "code"),
    [
        (["bear"], "neither is given; one of these two options is required", 2),
        (["bear", "-o", "{}/t.exr", "--out-dir", "{}"], "both are given", 2),
        (["bear", "leaf", "-o", "{}/t.exr"], "2 models are given; use --out-dir", 2),
        (["bear", "-o", "{}/t.tif"], r"suffix '\.tif'", 2),
        (["bear", "-o", "{}/no/t.exr"], "the folder .* does not exist", 2),
        (["bear", "-o", "{}/t.exr", "--size", "0"], "size 0; not a whole number in 1", 2),
        (["bear", "-o", "{}/t.exr", "--rays", "1"], "rays 1; not a whole number in 2", 2),
        (["bear", "-o", "{}/t.exr", "--rays", "0", "--mode", "normal"], "rays 0; not a whole number in 1", 2),
        (["bear", "-o", "{}/t.exr", "--spread", "0"], "spread 0.0; the angle must satisfy 0 < spread", 2),
        (["bear", "-o", "{}/t.exr", "--max-distance", "far"], "--max-distance 'far'; length 'far'", 2),
        (
            ["bear", "-o", "{}/t.exr", "--max-distance", "-1cm"],
            "--max-distance '-1cm'; .*the length must be positive",
            2,
        ),
        (["bear", "-o", "{}/t.exr", "--max-distance", "x%"], "max_distance 'x%'; the value is not a percentage", 2),
        (["bear", "-o", "{}/t.exr", "--tolerance", "0"], "--tolerance '0'", 2),
        (["bear", "-o", "{}/t.exr", "--mode", "thick"], "'thick' is not one of", 2),
        (
            ["bear", "-o", "{}/t.exr", "--mode", "transmittance"],
            "mode 'transmittance'; this mode needs a medium.* --color",
            2,
        ),
        (
            ["bear", "-o", "{}/t.exr", "--cage", "bear"],
            "--cage bear; this option works only with --high",
            2,
        ),
        (
            ["bear", "-o", "{}/t.exr", "--high-distance", "1%"],
            "--high-distance 1%; this option works only with --high; add",
            2,
        ),
        (["bear", "-o", "{}/t.exr", "--unit", "furlong"], "is a built-in mesh, whose coordinates are in metres", 2),
        (["none.obj", "-o", "{}/t.exr"], "no file has this path", 2),
        (
            ["slab", "-o", "{}/t.exr"],
            "mesh 'slab'; no file and no built-in mesh has this name; give .* amber, ",
            2,
        ),
        (["none.obj", "-o", "{}/t.exr", "--unit", "furlong"], "unit 'furlong'", 2),
        (["bear", "-o", "{}/t.exr", "--high", "none.obj"], "no file has this path", 2),
        (
            ["bear", "-o", "{}/t.glb", "--mode", "local"],
            "mode 'local' bakes a fraction, which glTF cannot store as a thickness",
            2,
        ),
        (["bear", "-o", "{}/t.glb", "--tile", "1001"], "a glTF file cannot hold UDIM tiles", 2),
        (["bear", "-o", "{}/t.exr", "--jobs", "2"], "--jobs 2; this option works only with several models", 2),
        (
            ["bear", "-o", "{}/t.exr", "--max-escaped", "2%"],
            "--max-escaped 2%; this option works only with several models",
            2,
        ),
        (["bear", "--out-dir", "{}/maps", "--max-escaped", "2"], "--max-escaped '2'; the value is not a percentage", 2),
        (
            ["bear", "--out-dir", "{}/maps", "--max-escaped", "few"],
            "--max-escaped 'few'; the value is not a percentage",
            2,
        ),
        (["bear", "--out-dir", "{}/maps/deep", "--jobs", "0", "--format", "npy"], "0 worker processes", 2),
        (["bear", "--out-dir", "{}", "--check"], "--check works with one model", 2),
        (["bear", "--out-dir", "{}", "--dask", "tcp://x:1", "--jobs", "2"], "--dask already chooses the workers", 2),
        (
            ["bear", "-o", "{}/t.ply", "--vertices", "--check"],
            "--check works only with thickness maps, not with thickness per vertex",
            2,
        ),
        (["bear", "-o", "{}/t.npy", "--mode", "local", "--check"], "does not bake a length", 2),
    ],
)
def test_a_mistake_is_one_line_and_leaves_no_file(
    arguments: list[str], message: str, code: int, run: Run, tmp_path: Path
) -> None:
    refused(run(*(argument.format(tmp_path) for argument in arguments)), message, code)
    assert not list(tmp_path.iterdir())


def test_the_old_map_stays_when_the_bake_fails(run: Run, ball: Path, tmp_path: Path) -> None:
    path = tmp_path / "t.npy"
    assert run(ball, "-o", path, *QUICK).code == 0
    before = path.read_bytes(), sidecar_of(path).read_bytes()
    ball.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert run(ball, "-o", path, "--size", "0").code == 2
    assert (path.read_bytes(), sidecar_of(path).read_bytes()) == before


@pytest.mark.filterwarnings("always::translucent.TranslucentWarning")
def test_an_open_mesh_is_baked_with_a_warning(run: Run, tmp_path: Path, make_ball: Any) -> None:
    opened = make_ball(1)
    opened.faces = opened.faces[4:]
    opened.export(tmp_path / "open.obj")
    result = run(tmp_path / "open.obj", "-o", tmp_path / "t.npy", *QUICK)
    assert result.code == 0
    assert "% of the rays found no exit" in result.err
    assert json.loads(sidecar_of(tmp_path / "t.npy").read_text())["escaped"] > 0.01


# Many


def test_many_models_and_a_bad_one(
    run: Run, make_ball: Any, tmp_path: Path, without_processes: Callable[[], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    models = [tmp_path / f"{name}.obj" for name in ("a", "b", "c")]
    for model in models:
        make_ball(1).export(model)
    models[1].write_text("nothing")
    out = tmp_path / "maps" / "of today"
    without_processes()
    processes: list[int] = []
    here: Any = batch.in_processes

    def counted(task: Any, items: list[Any], workers: int, lost: Any) -> Any:
        processes.append(workers)
        return here(task, items, workers, lost)

    monkeypatch.setattr(batch, "in_processes", counted)
    arguments = ("nobody", *models, "--out-dir", out, "--format", "png", *QUICK, "--jobs", 2)
    result = run(*arguments)
    assert result.code == 1
    assert processes == [2]
    assert result.err.startswith("error: 2 of 4 models failed; the others are done")
    *rows, total = result.out.splitlines()
    assert [row.split()[0] for row in rows] == ["1/4", "2/4", "3/4", "4/4"]
    assert all("left" in row for row in rows[:3])
    assert "left" not in rows[3]
    told = sorted(row.split()[1:3] for row in rows)
    assert told == [["a.obj", "baked"], ["b.obj", "failed"], ["c.obj", "baked"], ["nobody", "failed"]]
    assert "mesh 'nobody'; no file and no built-in mesh has this name" in rows[3]
    assert total.startswith("2 baked, 0 suspect, 0 skipped, 2 failed in ")
    assert sorted(path.name for path in out.iterdir()) == ["a.png", "a.png.json", "c.png", "c.png.json"]
    models[1].unlink()
    make_ball(1).export(models[1])
    result = run(*arguments[1:-1], 1, "--json")
    found = json.loads(result.out)
    assert [asset["status"] for asset in found["assets"]] == ["skipped", "baked", "skipped"]
    assert (found["failed"], result.code) == (0, 0)
    assert [line.split()[0] for line in result.err.splitlines()] == ["1/3", "2/3", "3/3"]
    refused(run(*models, ball_twin(tmp_path), "--out-dir", out), "give each output a different name")


@pytest.mark.filterwarnings("ignore::translucent.TranslucentWarning")  # of the holes
def test_maps_that_cannot_be_right_are_suspect(
    run: Run, make_ball: Any, tmp_path: Path, without_processes: Callable[[], None]
) -> None:
    """Twice: a map that is there already is as suspect as it was."""
    without_processes()
    whole, opened, sheet = make_ball(1), make_ball(1), make_ball(1)
    opened.faces, sheet.faces = opened.faces[8:], sheet.faces[:1]
    for name, mesh in (("whole", whole), ("opened", opened), ("sheet", sheet)):
        mesh.export(tmp_path / f"{name}.obj")
    models = [tmp_path / f"{name}.obj" for name in ("whole", "opened", "sheet")]
    arguments = (*models, "--out-dir", tmp_path / "maps", "--format", "npy", *QUICK, "--jobs", 1)
    for again in ("baked", "skipped"):
        result = run(*arguments)
        assert result.code == 0, result.err
        rows = {row.split()[1]: row for row in result.out.splitlines()[:3]}
        assert [rows[f"{name}.obj"].split()[2] for name in ("whole", "opened", "sheet")] == [again, *2 * ["suspect"]]
        assert re.search(r"\d+% of the rays found no exit, more than 5\.0%", rows["opened.obj"])
        assert "the thickness is 0 everywhere" in rows["sheet.obj"]
    found = json.loads(run(*arguments, "--max-escaped", "100%", "--json").out)
    assert [asset["status"] for asset in found["assets"]] == ["skipped", "skipped", "suspect"]
    assert found["suspect"] == 1


def test_lines_come_one_by_one(
    run: Run, ball: Path, tmp_path: Path, without_processes: Callable[[], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each is there, for a pipe as well, when the next asset is not done yet."""
    without_processes()
    flushed = []
    monkeypatch.setattr("sys.stdout.flush", lambda: flushed.append(True), raising=False)
    assert run(ball, "none.obj", "--out-dir", tmp_path / "maps", "--format", "npy", *QUICK, "--jobs", 1).code == 1
    assert len(flushed) >= 2


def ball_twin(folder: Path) -> Path:
    (folder / "twin").mkdir()
    (folder / "twin" / "A.ply").write_text("")
    return folder / "twin" / "A.ply"


# On a terminal


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_terminal_shows_rate_and_time_left(ball: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Terminal()
    monkeypatch.setattr("sys.stderr", screen)
    assert main(["bake", str(ball), "-o", str(tmp_path / "t.npy"), "--size", "256", "--rays", "16"]) == 0
    shown = screen.getvalue()
    assert "ball.obj" in shown
    assert re.search(r"100%.*Mrays/s", shown)


def test_a_pipe_shows_no_bar(run: Run, ball: Path, tmp_path: Path) -> None:
    assert run(ball, "-o", tmp_path / "t.npy", *QUICK).err == ""


@pytest.mark.usefixtures("checkpoints_at_once")
def test_an_interrupted_bake_goes_on(run: Run, ball: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from contextlib import contextmanager

    path, kept = tmp_path / "t.npy", tmp_path / "t.npy.resume.npz"
    arguments = (ball, "-o", path, "--size", 320, "--rays", 8)
    assert run(*arguments).code == 0
    whole = path.read_bytes()
    path.unlink(), sidecar_of(path).unlink()

    @contextmanager
    def interrupt(_: str) -> Any:
        def tell(share: float, rays: int) -> None:
            if share > 0.3:
                raise KeyboardInterrupt

        yield tell

    with monkeypatch.context() as patch:
        patch.setattr(command, "_progress", interrupt)
        result = run(*arguments, "--resume")
    assert (result.code, result.err.strip()) == (130, "error: interrupted")
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith("t.")] == [kept.name]
    result = run(*arguments, "--resume", "--json")
    assert result.code == 0, result.err
    assert path.read_bytes() == whole
    assert not kept.exists()


def test_interrupted_without_resume_nothing_stays(
    run: Run, ball: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from contextlib import contextmanager

    @contextmanager
    def interrupt(_: str) -> Any:
        def tell(share: float, rays: int) -> None:
            raise KeyboardInterrupt

        yield tell

    monkeypatch.setattr(command, "_progress", interrupt)
    before = sorted(tmp_path.iterdir())
    assert run(ball, "-o", tmp_path / "t.npy", "--size", 256).code == 130
    assert sorted(tmp_path.iterdir()) == before


# The maps of others, and ours


@pytest.fixture(scope="module")
def attenuation(assets: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """AttenuationTest.glb with baked maps: distances along the normal."""
    path = tmp_path_factory.mktemp("attenuation") / "out.glb"
    options = ("--mode", "normal", "--size", "64", "--padding", "2")
    assert main(["bake", str(assets / "gltf" / "AttenuationTest.glb"), "-o", str(path), *options]) == 0
    return path


def test_their_map_is_read_by_its_green_channel(assets: Path) -> None:
    file = read_gltf(assets / "gltf" / "AttenuationTest.glb")
    (material,) = [one for one in read_materials(file.path) if one.has_thickness_texture]
    values = np.unique(thickness_map(file, material))
    # Blocks of 0.25, 0.5, 1, 1.5 and 2, in steps of 2 / 255.
    for wanted in (0.25098, 0.50196, 1.00392, 1.49804, 2.0):
        assert np.abs(values - wanted).min() < 1e-5


def test_our_maps_agree_with_what_its_authors_wrote(assets: Path, attenuation: Path) -> None:
    """Cubes, whose thickness along the normal is their edge: by a texture in one row, by factors in others."""
    from translucent.bake.gltf_targets import find_targets

    source, baked = read_gltf(assets / "gltf" / "AttenuationTest.glb"), read_gltf(attenuation)
    theirs = {one.index: one for one in read_materials(source.path)}
    ours = {one.index: one for one in read_materials(attenuation)}
    textures = 0
    for target in find_targets(GlbBuilder(source)):
        mesh, primitive = target.key
        index = source.items("meshes")[mesh]["primitives"][primitive]["material"]
        assert ours[index].thickness == pytest.approx(theirs[index].thickness, rel=1e-6)
        if theirs[index].has_thickness_texture:
            middle = target.mesh.uv[target.mesh.faces].mean(axis=1)
            uv = np.column_stack([middle[:, 0], 1 - middle[:, 1]])
            # 32, 64, 128, 191 and 255 of 255, in both; in theirs by hand.
            wanted = thickness_at(source, theirs[index], uv)
            np.testing.assert_allclose(thickness_at(baked, ours[index], uv), wanted, rtol=1e-6)
            textures += len(np.unique(wanted.round(4)))
    assert textures == 5


def test_the_validator_accepts_their_file_with_our_maps(validate: Any, attenuation: Path) -> None:
    issues = validate(attenuation)
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues


@pytest.mark.parametrize("name", ["GlassHurricaneCandleHolder", "IridescenceSuzanne", "TransmissionRoughnessTest"])
@pytest.mark.filterwarnings("ignore::translucent.TranslucentWarning")  # overlapping UVs, and holes
def test_the_validator_accepts_other_files(name: str, validate: Any, assets: Path, tmp_path: Path, run: Run) -> None:
    path = tmp_path / "out.glb"
    assert run(assets / "gltf" / f"{name}.glb", "-o", path, "--size", 64, "--rays", 4).code == 0
    before, after = validate(assets / "gltf" / f"{name}.glb"), validate(path)
    assert after["numErrors"] == before["numErrors"]
    assert after["numWarnings"] <= before["numWarnings"], after
