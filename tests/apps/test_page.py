"""Pages without a browser: what is written, and what is refused."""

from __future__ import annotations

import base64
import dataclasses
import gzip
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
from PIL import Image

import translucent as tl
from tests.command_line import Run, one_error_line, strict_json
from tests.textured import TEXTURED
from translucent.gpu.recording import FrameRecorder
from translucent.page.container import MAGIC, Container
from translucent.page.plans import TEXTURE_UNITS, plan_page, simplified, triangles
from translucent.planning.passes import NoteKind
from translucent.planning.request import RenderRequest
from translucent.scene.showcase import showcase

_SAMPLER = re.compile(r"^uniform [iu]?sampler\w+ (\w+)", re.MULTILINE)


@pytest.fixture
def little_script(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A script in place of the viewer's, which is built with npm."""
    script = tmp_path / "page.js"
    script.write_text("'</script>';", encoding="utf-8")
    monkeypatch.setattr("translucent.page.write.web_path", lambda _: script)


@pytest.fixture
def run(run: Run, little_script: None) -> Run:
    return partial(run, "page")


def contents(path: Path) -> tuple[dict[str, Any], bytes]:
    text = re.search(r'id="scene">([^<]*)<', path.read_text(encoding="utf-8"))
    assert text is not None
    content = gzip.decompress(base64.b64decode(text[1]))
    assert content.startswith(MAGIC)
    length = int.from_bytes(content[8:16], "little")
    return json.loads(content[16 : 16 + length]), content[16 + length :]


def ball(**more: Any) -> tl.Object:
    made = trimesh.creation.icosphere(2, 0.02)
    mesh = tl.Mesh(made.vertices, made.faces, name="ball.ply")
    return tl.Object(mesh, **{"medium": tl.Medium.from_color((0.5, 0.8, 0.6), 0.02, ior=1.5), **more})


def scene_of(*objects: tl.Object, **more: Any) -> tl.Scene:
    return tl.Scene(objects, tl.Camera.look_at((0.03, 0.03, 0.09), (0, 0, 0), fov_y=30), **more)


def test_a_page_is_one_file_that_fetches_nothing(run: Run, cube: Path, tmp_path: Path) -> None:
    out = tmp_path / "cube.html"
    told = strict_json(run(str(cube), "-o", str(out), "--poster", "none", "--stage", "none", "--json").out)
    assert told["bytes"] == out.stat().st_size < 1_500_000
    text = out.read_text(encoding="utf-8")
    assert "default-src 'none'" in text
    assert not re.search(r'(src|href)="(?!data:)', text)
    script = re.search(r'id="viewer-script">([^<]*)<', text)  # packed: no text of it ends the element
    assert script is not None
    assert gzip.decompress(base64.b64decode(script[1])) == b"'</script>';"
    header, _ = contents(out)
    assert header["name"] == "cube"
    assert header["scene"]["size"] == [1280, 800]
    assert [medium["editable"] for medium in header["scene"]["media"]] == [True]
    assert len(header["shifts"]) == header["samples"] == 16
    assert header["notes"] == told["notes"]
    shaders = [text for program in header["programs"] for text in program] + list(header["present"].values())
    assert not any("//" in text or "\n\n" in text for text in shaders)


def test_positions_are_those_of_the_mesh(run: Run, cube: Path, tmp_path: Path) -> None:
    out = tmp_path / "cube.html"
    assert run(str(cube), "-o", str(out), "--poster", "none", "--stage", "none").code == 0
    header, data = contents(out)
    mesh = tl.load_mesh(cube)
    section = header["sections"][header["meshes"][0]["offsets"]]
    count = int(np.prod(section["shape"]))
    planes = np.frombuffer(data, np.uint8, 4 * count, section["offset"]).reshape(4, count).astype(np.uint32)
    folded = sum(planes[i] << np.uint32(8 * i) for i in range(4))
    steps = (folded >> 1) ^ (0 - (folded & 1)).astype(np.uint32)
    words = np.cumsum(steps.reshape(section["shape"]), axis=0, dtype=np.uint32)
    np.testing.assert_array_equal(words.view(np.float32), (mesh.vertices - mesh.center).astype(np.float32))


def test_light_is_rounded_by_less_than_told() -> None:
    rng = np.random.default_rng(3)
    light = rng.lognormal(size=(5, 7, 3)).astype(np.float32)
    into = Container()
    into.add(light, "picture", 13)
    content = gzip.decompress(into.packed({}))
    length = int.from_bytes(content[8:16], "little")
    planes = np.frombuffer(content, np.uint8, 4 * light.size, 16 + length).reshape(4, -1).astype(np.uint32)
    folded = sum(planes[i] << np.uint32(8 * i) for i in range(4))
    steps = ((folded >> 1) ^ (0 - (folded & 1)).astype(np.uint32)).reshape(light.shape)
    words = np.cumsum(np.cumsum(steps, axis=1, dtype=np.uint32), axis=0, dtype=np.uint32)
    found = (words << np.uint32(10)).view(np.float32)
    np.testing.assert_allclose(found, light, rtol=2.0**-14)


def test_sections_of_the_same_bytes_share_them() -> None:
    into, values = Container(), np.arange(5, dtype=np.float32)
    for one in (values, values + 1, values):
        into.add(one)
    first, other, again = into.sections
    assert first == again
    assert other["offset"] > first["offset"]
    content = gzip.decompress(into.packed({}))
    assert len(content) == 16 + int.from_bytes(content[8:16], "little") + 2 * 24  # 20 bytes each, padded to 24


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["-o", "cube.png"], ["the name must end in .html", "viewer.html"]),
        (["-o", "nowhere/cube.html"], ["does not exist"]),
        (["--method", "fragment-lists"], ["WebGL2", "SignedDepth"]),
        (["--method", "path-traced"], ["random paths", "PathTraced"]),
        (["--poster", "absent.png"], ["absent.png", "no file has this path"]),
        (["--samples", "0"], ["samples 0", "1 to 256"]),
        (["--simplify", "3"], ["--simplify 3"]),
        (["--size", "4"], ["--size"]),
        (["--size", "99999x99999"], ["99999x99999", "8192"]),
    ],
    ids=lambda v: " ".join(v),
)
def test_bad_input_is_told_and_leaves_nothing(
    run: Run, cube: Path, tmp_path: Path, in_tmp_path: Path, more: list[str], words: list[str]
) -> None:
    before = sorted(tmp_path.iterdir())
    output = [] if "-o" in more else ["-o", "cube.html"]
    line = one_error_line(run(str(cube), *output, "--poster", "none", *more))
    assert all(word in line for word in words), line
    assert sorted(tmp_path.iterdir()) == before


def test_a_viewer_that_was_not_built_is_told_before_anything_is_rendered(
    run: Run, cube: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(name: str) -> Path:
        raise tl.InputError(f"the script {name!r} for browsers", "not there", "run `make web`")

    monkeypatch.setattr("translucent.page.write.web_path", missing)
    monkeypatch.setattr("translucent.page.write.poster_of", lambda *_: pytest.fail("a poster was rendered"))
    line = one_error_line(run(str(cube), "-o", tmp_path / "cube.html", "--preset", "gummy"))
    assert line.endswith("run `make web`")


def test_colors_are_told_at_the_distance_of_the_panel(run: Run, cube: Path, tmp_path: Path) -> None:
    plain = ("-o", str(tmp_path / "cube.html"), "--poster", "none", "--stage", "none", "--verbose")
    told = run(str(cube), *plain, "--color", "#7b1e3a", "--distance", "7mm").out
    assert "white light is #7b1e3a after 0.007 m" in told
    header, _ = contents(tmp_path / "cube.html")
    assert header["scene"]["media"][0]["distance"] == 0.007


@pytest.mark.parametrize("method", [None, tl.DepthPeeling(), tl.DepthPeeling(8)])
def test_peeled_pages_tell_one_number_of_surfaces(method: tl.DepthPeeling | None) -> None:
    bodies = [ball(medium=tl.Medium((1, 2, 3), emission=(n, 1, 1)), priority=n) for n in (1, 2)]
    made = trimesh.creation.torus(0.02, 0.008, major_sections=8, minor_sections=6)
    bodies += [ball(medium=bodies[0].medium)]
    bodies = [dataclasses.replace(body, mesh=tl.Mesh(made.vertices, made.faces)) for body in bodies]
    planned = plan_page(scene_of(*bodies), RenderRequest(method))
    most = 16 if method is None else min(method.max_layers, 16)
    (told,) = [str(note) for note in planned.notes if note.kind is NoteKind.LAYER_LIMIT]
    assert str(most) in told
    assert planned.most_layers == most
    assert ("requested" in planned.plan.passes[0].reason) == (method is not None)


def test_a_poster_is_a_picture(run: Run, cube: Path, tmp_path: Path) -> None:
    out = tmp_path / "cube.html"
    assert run(str(cube), "-o", str(out), "--poster", str(cube)).code == 2
    picture = tmp_path / "poster.png"
    picture.write_bytes(b"\x89PNG rest")
    assert run(str(cube), "-o", str(out), "--poster", str(picture), "--stage", "none").code == 0
    assert 'src="data:image/png;base64,' in out.read_text(encoding="utf-8")


def test_many_triangles_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("translucent.page.plans.MANY_TRIANGLES", 300)
    monkeypatch.setattr("translucent.page.plans.MOST_TRACED", 300)
    planned = plan_page(scene_of(ball()))
    assert planned.plan.interfaces == tl.FrontInterface()
    kinds = [note.kind for note in planned.notes]
    assert NoteKind.MANY_TRIANGLES in kinds
    assert triangles(planned.scene) == 320


def test_pages_say_that_they_show_no_caustics() -> None:
    """The page says it, and advises nothing that pages do not have."""
    ground = tl.Object(ball().mesh, None, transform=np.diag([9.0, 0.1, 9.0, 1.0]))
    glass, light = ball(medium=tl.Medium(1.0, ior=1.5)), tl.DirectionalLight((0, -1, 0), 1.0)
    planned = plan_page(scene_of(glass, ground, lights=[light]))
    (own,) = [note for note in planned.own_notes if note.kind is NoteKind.CAUSTICS]
    assert [note for note in planned.notes if note.kind is NoteKind.CAUSTICS] == [own]
    assert "pages show no caustics" in str(own)
    assert "--caustics" not in str(own)
    assert not any(note.kind is NoteKind.CAUSTICS for note in plan_page(scene_of(glass, lights=[light])).notes)


def test_pages_say_that_rays_read_no_textures_there(tmp_path: Path) -> None:
    scene = TEXTURED["painted cube in glass"]
    planned = plan_page(scene)
    assert not planned.plan.textured
    assert [note.kind for note in planned.notes].count(NoteKind.TEXTURES) == 1
    page = tmp_path / "cube.html"
    tl.write_page(scene, page, size=(40, 30))
    assert "texture_at_hit" not in page.read_text(encoding="utf-8")


@pytest.mark.parametrize("overlap", ["add", "priority"])
def test_no_shader_reads_more_textures_than_webgl2_promises(overlap: str) -> None:
    """A scene with all that traced interfaces read: shadows, light that diffuses, a picture as environment."""
    milk = tl.preset("skim_milk").medium
    scene = showcase(ball().mesh, milk, (64, 40))
    bodies = [*scene.objects, ball(transform=np.diag([0.4, 0.4, 0.4, 1.0]), priority=1)]
    scene = dataclasses.replace(scene, objects=bodies, overlap=overlap)
    planned = plan_page(scene, RenderRequest(scattering=tl.Diffusion(resolution=8), shadows=tl.ShadowMaps(64)))
    recorder = FrameRecorder(4, planned.most_layers, planned.texture_units)
    frame = recorder.record(planned.plan)
    assert planned.plan.traced is False
    assert frame.single
    assert frame.averaged
    for vertex, fragment in recorder.gl.programs:
        assert len(set(_SAMPLER.findall(vertex + fragment))) <= TEXTURE_UNITS


def test_queries_are_not_drawn() -> None:
    """WebGL2 refuses draws by shaders without outputs, as those of the query that ends depth peeling."""
    scene = scene_of(ball(), ball(medium=None, color=(0.5, 0.5, 0.5)))
    planned = plan_page(scene, RenderRequest(tl.DepthPeeling(8)))
    recorder = FrameRecorder(4, planned.most_layers, planned.texture_units)
    recorder.record(planned.plan)
    fragments = [fragment for _, fragment in recorder.gl.programs]
    assert any("previous" in text for text in fragments)
    assert not any("found" in text and "discard" in text and not re.search(r"\bout vec", text) for text in fragments)


def test_a_coarser_copy_has_the_same_volume() -> None:
    pytest.importorskip("fast_simplification", reason="fast-simplification is not installed")
    scene = scene_of(ball())
    coarse = simplified(scene, 200)
    assert triangles(coarse) <= 210
    mesh = coarse.objects[0].mesh
    assert mesh.diagnosis.solid
    assert mesh.volume == pytest.approx(scene.objects[0].mesh.volume, rel=0.05)


def test_without_the_package_a_coarser_copy_is_told_how(uninstalled: Callable[[str], None]) -> None:
    uninstalled("fast_simplification")
    with pytest.raises(tl.InputError, match="pip install fast-simplification"):
        simplified(scene_of(ball()), 200)


@pytest.mark.usefixtures("little_script")
def test_a_frame_writes_the_page_of_its_scene(
    renderer: tl.Renderer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As `write_page` does with the same choices, and the frame's own picture before."""
    scene = scene_of(ball(medium=tl.Medium((1, 2, 3), emission=(1, 0, 0), ior=1.5)))
    choices: dict[str, Any] = {"interfaces": tl.FrontInterface()}
    frame = renderer.render(scene, (40, 30), tl.BackFaceDepth(), **choices)
    text = frame.to_html(1.0, "agx", name="Ball")
    picture = re.search(r"data:image/jpeg;base64,([^\"]+)", text)
    assert picture is not None
    poster = base64.b64decode(picture[1])
    with Image.open(io.BytesIO(poster)) as seen:
        assert np.abs(np.asarray(seen, float) - frame.to_srgb8(1.0, "agx")).mean() < 3
    path = tmp_path / "page.html"
    look = {"name": "Ball", "exposure": 1.0, "tone": "agx", "poster": poster}
    tl.write_page(scene, path, size=(40, 30), method=tl.BackFaceDepth(), **choices, **look)
    assert text == path.read_text(encoding="utf-8")
    monkeypatch.setattr("translucent.page.write.page_html", lambda *_, poster, **__: poster)
    assert dataclasses.replace(frame, alpha=np.ones((30, 40))).to_html() is None


def test_what_has_no_page_says_what_to_do(renderer: tl.Renderer) -> None:
    scene = scene_of(ball(medium=tl.Medium((1, 2, 3))))
    frame = tl.reference.render(scene, (4, 3))
    with tl.Renderer("cpu") as cpu:
        assert frame.scene is cpu.render(scene, (4, 3)).scene is scene  # these have one
    with pytest.raises(tl.InputError, match=r"to_html name 3; it is of type int"):
        frame.to_html(name=3)  # type: ignore[arg-type]
    with pytest.raises(tl.InputError, match=r"to_html exposure 'Wine'; it is of type str"):
        frame.to_html("Wine")  # type: ignore[arg-type]
    with pytest.raises(tl.InputError, match=r"caustics.*render without"):
        dataclasses.replace(
            frame, plan=dataclasses.replace(frame.plan, request=RenderRequest(caustics=tl.Caustics(100)))
        ).to_html()
    behind = tl.Backdrop(np.zeros((3, 4, 3)), np.full((3, 4), np.inf))
    with pytest.raises(tl.InputError, match=r"the frame has no scene.*tl.write_page"):
        renderer.render(scene, (4, 3), backdrop=behind).to_html()
