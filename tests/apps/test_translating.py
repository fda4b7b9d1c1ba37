"""Shaders in other languages: translators take them, and what runs here gives the numbers of the float64 reference."""

from __future__ import annotations

import dataclasses
import functools
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import translucent as tl
from tests import webgpu
from tests.hosts import BODY, RESOLVE, SUM, Host
from tests.probe import signatures
from tests.twins import ARGUMENTS, assert_equals_twin
from translucent.assets import shader_library, shader_names
from translucent.commands.shader import NAGA, Language, translate
from translucent.gpu import lifting
from translucent.gpu.layout import BLOCKS
from translucent.gpu.lifting import WITH_STORAGE, lift, valid_sets

#: The passes that make thickness of faces, and transmittance of thickness: whose texts an engine needs.
STAGES = {
    "body": ("geometry/body.vert", BODY),
    "sum": ("thickness/signed_depth.frag", SUM),
    "full": ("geometry/fullscreen.vert", {}),
    "picture": (
        "shade/transmittance.vert",
        {key: RESOLVE[key] for key in ("MAP", "SEEN_KIND", "SPECTRAL", "SURFACES")},
    ),
    "metres": ("thickness/signed_thickness.frag", {"SPECTRAL": 0}),
    "resolve": ("shade/transmittance.frag", RESOLVE),
}
#: Libraries that have between them all that the language has to say: loops, branches, arrays, powers and angles.
LIBRARY = [f"lib/{name}.glsl" for name in ("optics", "interface", "environment", "spherical_harmonics", "tone")]
MESHES, DOCS = (Path(__file__).parents[2] / name for name in ("meshes", "docs"))


@functools.cache
def _kept(name: str, defines: tuple[tuple[str, int], ...], language: Language) -> str:
    return translate(name, dict(defines), language).text


def text_of(key: str, language: Language) -> str:
    """Text of one of the stages, or of a library."""
    name, defines = STAGES.get(key, (key, {}))
    return _kept(name, tuple(defines.items()), language)


def glslang() -> str:
    found = shutil.which("glslangValidator")
    if found is None or shutil.which("spirv-cross") is None:
        pytest.skip("glslang or SPIRV-Cross is absent: apt-get install glslang-tools spirv-cross")
    return found


@pytest.fixture(scope="module")
def naga() -> None:
    try:
        text_of("lib/optics.glsl", "wgsl")
    except tl.InputError as error:
        if "not installed" not in str(error):
            raise
        pytest.skip(f"naga is absent: npm install {NAGA}, and set NODE_PATH")


@pytest.fixture(scope="module")
def device(naga: None) -> Any:
    wgpu = pytest.importorskip("wgpu", reason="the package wgpu is absent")
    try:
        adapter = wgpu.gpu.request_adapter_sync()
    except RuntimeError as error:
        pytest.skip(f"there is no Vulkan for wgpu (apt-get install mesa-vulkan-drivers): {error}")
    if "float32-blendable" not in adapter.features:
        pytest.skip("this device does not blend 32-bit floats")
    return adapter.request_device_sync(required_features=["float32-blendable"])


@pytest.mark.parametrize("name", LIBRARY)
def test_library_functions_in_wgsl_equal_their_twins(name: str, device: Any) -> None:
    text = text_of(name, "wgsl")
    path = next(path for path in shader_library() if f"lib/{path.name}" == name)
    for function, signature in signatures(path).items():
        # Of grids that run through all combinations, as many as cost little.
        arguments = [argument[:: max(len(argument) // 300, 1)] for argument in ARGUMENTS[function]]
        found = webgpu.run_function(device, text, signature, arguments)
        assert_equals_twin(path.stem, function, signature.returns, arguments, found)


def test_thickness_in_wgsl_equals_the_reference(device: Any) -> None:
    """By the pass that gives metres, with rows as WebGPU has them, and by the one that gives pictures, from below."""
    texts = {key: text_of(key, "wgsl") for key in STAGES}
    host = Host.of(tl.load_mesh(MESHES / "knot.ply"), (96, 72))
    (metres,) = webgpu.draw(device, host, {**texts, "resolve": texts["metres"]}, webgpu.TOGETHER, upside_down=False)
    thickness, count, valid, covered = np.moveaxis(metres, 2, 0)
    assert (count == 0).all()
    host.check(thickness, covered + 2 * valid)
    picture = {**texts, "full": texts["picture"]}
    *_, thickness, flags = webgpu.draw(device, host, picture, webgpu.APART, upside_down=True)
    host.check(thickness[..., 0], flags[..., 0])


def test_what_docs_say_that_the_passes_take_is_what_the_renderer_gives_them() -> None:
    """docs/lifting.md, "What they take", followed by hand."""
    mesh, size = tl.load_mesh(MESHES / "bear.ply"), (96, 72)
    host = Host.of(mesh, size)
    camera, diagonal = host.scene.camera, host.scene.diagonal
    assert camera.fov_y is not None
    tan_y = np.tan(np.radians(camera.fov_y) / 2)
    tan_x = tan_y * size[0] / size[1]
    view = np.eye(4)
    view[:3, :3] = [camera.right, camera.up, -camera.forward]
    view[:3, 3] = view[:3, :3] @ -camera.eye
    projection = np.diag([1 / tan_x, 1 / tan_y, 0.0, 0.0])
    projection[3, 2] = -1.0
    center = np.eye(4)
    center[:3, 3] = mesh.center
    expected: dict[str, dict[str, npt.ArrayLike]] = {
        "Body": {
            "clip_from_offset": projection @ view @ center,
            "axis": [*camera.forward, 0.0],
            "axial_start": -1e30,
            "count_weight": 1.0,
            "count_offset": 0.0,
            "snapping_share": 2.0**-8 / diagonal,
        },
        "View": {
            "frame_size": [*size, 0, 0],
            "ray_right": [*(camera.right * tan_x), 0.0],
            "ray_up": [*(camera.up * tan_y), 0.0],
            "ray_forward": [*camera.forward, 0.0],
        },
        "Shade": {
            "expected_count": [0.0, 0.0],
            "rounding": 1e-5 * diagonal,
            "count_share": diagonal,
            "coverage_floor": 2e-7 * diagonal,
        },
    }
    for name, members in expected.items():
        record = np.frombuffer(host.blocks[name], BLOCKS[name].dtype)[0]
        page = (DOCS / "lifting.md").read_text(encoding="utf-8")
        for member, value in members.items():
            near = 1e-6 * np.abs(value).max()
            np.testing.assert_allclose(record[member], value, 0.0, near, err_msg=f"{name}.{member}")
            fields = BLOCKS[name].dtype.fields
            assert fields is not None
            row = next(line for line in page.splitlines() if line.startswith("|") and f"`{member}`" in line)
            assert re.search(rf"\b{fields[member][1]}\b", row.split("|")[2]), row


@pytest.mark.parametrize("name", [*STAGES, *LIBRARY])
def test_hlsl_compiles(name: str, tmp_path: Path) -> None:
    compiler = glslang()
    file, _ = STAGES.get(name, (name, {}))
    text = text_of(name, "hlsl")
    if name in LIBRARY:
        text += "float4 main() : SV_Target0 { return 0.0; }\n"
    stage = "vert" if file.endswith(".vert") else "frag"
    written = tmp_path / "shader.hlsl"
    written.write_text(text)
    command = [compiler, "-D", "-V", "-e", "main", "-S", stage, "-o", str(tmp_path / "shader.spv"), str(written)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("language", ["hlsl", "msl", "wgsl"])
def test_a_library_has_all_its_functions_and_nothing_else(language: Language, request: pytest.FixtureRequest) -> None:
    if language == "wgsl":
        request.getfixturevalue("naga")
    else:
        glslang()
    for name in ("lib/optics.glsl", "lib/spherical_harmonics.glsl"):
        text = text_of(name, language)
        assert text.startswith(f"// translucent: shaders/{name}; ")
        path = next(path for path in shader_library() if f"lib/{path.name}" == name)
        for function in signatures(path):
            assert len(re.findall(rf"^(?:fn |[a-z][\w<>, ]* ){function}\(", text, re.MULTILINE)) == 1, function
        assert "main" not in text
        assert "_call" not in text


def test_what_a_stage_takes_and_gives_has_the_same_name_and_place_in_every_language(naga: None) -> None:
    """No compiler for Metal runs here: its text is held against the interface of the others."""
    glslang()
    members = re.findall(r"^    (?:float|int|vec4|mat4) (\w+);", lift(*STAGES["body"], "vulkan").text, re.MULTILINE)
    assert {"axis", "axial_start", "count_weight", "snapping_share"} <= set(members)
    hlsl, msl, wgsl = (text_of("body", language) for language in ("hlsl", "msl", "wgsl"))
    assert re.findall(r" body_(\w+) : packoffset", hlsl) == members
    assert re.findall(r"^    (?:float|int|float4|float4x4) (\w+);", msl.split("};")[0], re.MULTILINE) == members
    assert re.findall(r"^    (\w+): ", wgsl.split("}")[0], re.MULTILINE) == members
    assert "constant Body& body [[buffer(0)]]" in msl
    hlsl, msl, wgsl = (text_of("sum", language) for language in ("hlsl", "msl", "wgsl"))
    assert "layout(location = 0) in float axial;" in lift(*STAGES["sum"], "vulkan").text
    assert "float axial : TEXCOORD0;" in hlsl
    assert "float axial [[user(locn0)]];" in msl
    assert "@location(0) axial: f32" in wgsl
    assert "float2 path_and_count : SV_Target0;" in hlsl
    assert "float2 path_and_count [[color(0)]];" in msl
    assert "@location(0) path_and_count: vec2<f32>" in wgsl
    hlsl, msl, wgsl = (text_of("body", language) for language in ("hlsl", "msl", "wgsl"))
    assert "precise float4 gl_Position : SV_Position;" in hlsl
    assert "float4 gl_Position [[position, invariant]];" in msl
    assert "@builtin(position) @invariant" in wgsl


@pytest.mark.parametrize(
    ("present", "language", "message"),
    [
        ((), "hlsl", r"--target hlsl; glslang and SPIRV-Cross are not installed; install them: apt-get install "),
        (("glslang",), "msl", r"--target msl; SPIRV-Cross is not installed; install them: .* spirv-cross"),
        ((), "wgsl", r"--target wgsl; naga is not installed; install Node.js, then run 'npm install naga-wasm@"),
    ],
)
def test_a_translator_that_is_absent_is_told(
    present: tuple[str, ...], language: Language, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: name if name in present else None)
    with pytest.raises(tl.InputError, match=message):
        translate("lib/ray.glsl", {}, language)


def test_a_package_that_node_does_not_find_is_told(
    naga: None, monkeypatch: pytest.MonkeyPatch, in_tmp_path: Path, tmp_path: Path
) -> None:
    monkeypatch.delenv("NODE_PATH")
    with pytest.raises(tl.InputError, match="naga is not installed"):
        translate("lib/ray.glsl", {}, "wgsl")


@pytest.mark.parametrize(("language", "said"), [("hlsl", "glslang.*: .*nothing"), ("wgsl", "naga: .*nothing")])
def test_what_a_translator_refuses_is_told_in_its_words(
    language: Language, said: str, naga: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    glslang()
    wrong = dataclasses.replace(lift(*STAGES["full"], "vulkan"), text="#version 450 core\nvoid main() { nothing(); }\n")
    monkeypatch.setattr(lifting, "lift", lambda *_: wrong)
    with pytest.raises(tl.InputError, match=f"'a.frag' in (HLSL|WGSL); {said}.*; choose another target"):
        translate("a.frag", {}, language)


def test_a_part_of_stages_is_refused() -> None:
    with pytest.raises(
        tl.InputError, match=r"part of other shaders, .*; choose a complete shader \(.vert, .frag\), a file"
    ):
        translate("transport/hierarchy.glsl", {"ONE_OBJECT": 1}, "hlsl")


def test_all_stages_compile_for_vulkan_with_their_switches_off_or_as_few_on_as_they_need(tmp_path: Path) -> None:
    """And some with each value of each switch: functions of theirs took samplers, or one needed another.

    One process compiles all: to start one takes 25 times as long as to compile. It then links them as if they were one
    program, which fails and says nothing. So a function that is declared and not defined is looked for in the text.
    """
    compiler = glslang()
    every = ("present/compare.frag", "shade/layers_over.frag", "shade/ground_shadows.frag")
    asked = {}
    for name in (name for name in shader_names() if not name.endswith(".glsl")):
        sets = valid_sets(name)
        for values in sets if name in every else sets[:1]:
            if lift(name, values).version == WITH_STORAGE:
                continue
            file = tmp_path / f"{len(asked)}{Path(name).suffix}"
            file.write_text(lift(name, values, "vulkan").text, encoding="utf-8")
            asked[file.name] = (name, *values.items())
    # Compiled as well, with an error, or nobody would know whether errors are found.
    (tmp_path / "wrong.frag").write_text("#version 450\nvoid main() { nothing(); }\n")
    command = [compiler, "--client", "vulkan100", *asked, "wrong.frag"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, encoding="utf-8")
    refused = {
        found: asked.get(found) for found in re.findall(r"^ERROR: (?:\./)?([\w.]+):\d+:", done.stdout, re.MULTILINE)
    }
    assert refused == {"wrong.frag": None}, done.stdout
    for file, shader in asked.items():
        text = (tmp_path / file).read_text(encoding="utf-8")
        assert "void main()" in text, shader
        for declared in re.findall(r"^(?!return)[a-z]\w* (\w+\([^){;]*\));", text, re.MULTILINE):
            assert re.search(rf"{declared.partition('(')[0]}\([^){{;]*\)\s*\{{", text), (shader, declared)
