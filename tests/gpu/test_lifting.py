"""Shaders written out for other engines: they compile, draw what they drew, and hold nothing that is unused."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
import pytest

import translucent as tl
from translucent.assets import shader_library, shader_names, shader_path
from translucent.frames.frame import ARRAYS
from translucent.geometry.solids import Box, Sphere
from translucent.gpu import shaders
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.lifting import ES, PLAIN, VULKAN, WITH_STORAGE, Dialect, find_shader, lift, switches, valid_sets
from translucent.gpu.shaders import Gathered, ShaderSource

SIZE = (24, 18)
BALL, BOX = Sphere().tessellate(12), Box((-0.4, -0.3, -0.6), (0.5, 0.7, 0.2)).tessellate()
CAMERA = tl.Camera.look_at((1.5, 1.2, 2.0), (0.0, 0.1, 0.0))
WINE, RUBY = tl.Medium(absorption=(1.0, 2.0, 3.0)), tl.Medium(absorption=(0.1, 3.0, 2.0))
GLASS = tl.Medium(absorption=(0.5, 0.1, 2.0), ior=1.5)
MIST, EMITS = tl.Medium(scattering=(1.0, 1.0, 2.0)), tl.Medium(absorption=1.0, emission=(3.0, 2.0, 0.0))
LAMP = tl.PointLight((2.0, 3.0, 1.0), (5.0, 5.0, 5.0))


def moved(x: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[0, 3] = x
    return matrix


def values(name: str) -> dict[str, int]:
    """All switches off, as far as the shader allows that."""
    return valid_sets(name)[0]


# Of each kind of shader one: sums, lists with lights, peeling, and interfaces before an opaque body.
SCENES: Mapping[str, tuple[tl.Scene, tl.SignedDepth | tl.DepthPeeling | None]] = {
    "sum": (tl.Scene([tl.Object(BALL, WINE), tl.Object(BOX, RUBY, moved(0.7))], CAMERA), tl.SignedDepth()),
    "lists": (tl.Scene([tl.Object(BALL, MIST), tl.Object(BOX, WINE)], CAMERA, [LAMP], overlap="union"), None),
    "peeling": (tl.Scene([tl.Object(BALL, EMITS), tl.Object(BOX, WINE, moved(0.5))], CAMERA), tl.DepthPeeling()),
    "interfaces": (tl.Scene([tl.Object(BALL, GLASS), tl.Object(BOX, color=(0.9, 0.5, 0.1))], CAMERA, [LAMP]), None),
}


@pytest.mark.parametrize(
    ("name", "target"), [*((name, "glsl") for name in SCENES), ("sum", "webgl2"), ("peeling", "webgl2")]
)
def test_a_picture_is_the_same_with_lifted_shaders(
    name: str, target: Dialect, renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, method = SCENES[name]
    lifted: set[str] = set()
    with renderer.gpu.context.current() as gl:
        if target == "webgl2" and "GL_ARB_ES3_compatibility" not in gl.extensions:
            pytest.skip("this OpenGL does not compile GLSL ES 3.00: no GL_ARB_ES3_compatibility")

    def text_of(file: str, gathered: Gathered, defines: Mapping[str, int], version: int) -> ShaderSource:
        found = lift(file, {key: int(value) for key, value in defines.items()}, target)
        assert found.version <= version
        lifted.add(file)
        # Whoever builds a program wants to know which stage asks for a switch and which declares a sampler.
        declared = re.findall(r"^uniform .*", "\n".join(gathered.lines), re.MULTILINE)
        told = "".join(f"// {line}\n" for line in [*(f"#define {key} " for key in found.defines), *declared])
        return ShaderSource(found.text.replace("#version 330", f"#version {version}") + told, (file,))

    expected = renderer.render(scene, SIZE, method)
    monkeypatch.setattr(shaders, "_with_switches", text_of)
    monkeypatch.setattr(shaders, "used_code", lambda name, gathered, source, defines: source.text)
    with tl.Renderer() as other:
        frame = other.render(scene, SIZE, method)
    assert len(lifted) >= 3
    for array in ARRAYS:
        np.testing.assert_array_equal(getattr(frame, array), getattr(expected, array), err_msg=array)


@pytest.mark.parametrize("name", [f"lib/{path.name}" for path in shader_library()])
def test_a_library_compiles_whole(name: str, renderer: tl.Renderer) -> None:
    text = lift(name, {}).text
    with renderer.gpu.context.current() as gl:
        gl.program(vertex_shader=f"{text}\nvoid main() {{ gl_Position = vec4(0.0); }}\n").release()
    functions = re.findall(r"^\w+ (\w+)\(", shaders.shader_path(name).read_text(), re.MULTILINE)
    assert functions
    assert [function for function in functions if f" {function}(" not in text] == []


@pytest.mark.parametrize("name", shader_names())
def test_nothing_is_left_that_is_not_used(name: str) -> None:
    text = lift(name, values(name)).text
    code = re.sub(r"//.*", "", text)
    names = re.findall(r"\w+", code)
    defined = re.findall(r"^#define (\w+)", code, re.MULTILINE)
    its_own = re.findall(r"^#define (\w+)", shader_path(name).read_text(), re.MULTILINE)
    assert [key for key in defined if names.count(key) < 2 and key not in its_own] == []
    assert "#if" not in code
    assert "#include" not in code
    assert "#line" not in code
    if "void main()" in code:
        functions = re.findall(r"^(?:float|int|uint|bool|void|[ui]?vec[234]) (\w+)\(", code, re.MULTILINE)
        assert [one for one in functions if one != "main" and names.count(one) < 2] == []


def test_a_lifted_shader_is_much_shorter_and_keeps_what_its_files_say() -> None:
    name = find_shader("signed_depth")
    lifted = lift(name, values(name))
    assert lifted.text.startswith("#version 330 core\n// translucent: shaders/thickness/signed_depth.frag\n")
    assert "// Signed depth (Baker & Boyd 2001)" in lifted.text
    assert not [key for key in CONSTANTS if key in lifted.text]
    assert len(lifted.text.splitlines()) < 60
    with_opaque = lift(name, {"OPAQUE": 1, "SPECTRAL": 0})
    assert "float last_axial()" in with_opaque.text
    assert "intervals/last_axial.glsl" in with_opaque.files
    assert "last_axial" not in lifted.text


def test_the_version_is_that_which_the_text_needs() -> None:
    lists = "intervals/fragment_lists.frag"
    assert lift(lists, values(lists)).version == WITH_STORAGE
    assert lift("lib/optics.glsl", {}).version == PLAIN


@pytest.mark.parametrize("name", shader_names())
def test_all_but_shaders_with_buffers_are_there_in_glsl_es(name: str) -> None:
    given = values(name)
    plain = lift(name, given)
    if plain.version == WITH_STORAGE:
        with pytest.raises(
            tl.InputError, match=r"writes to buffers, .*; use a method without such shaders.*signed_depth"
        ):
            lift(name, given, "webgl2")
        return
    lifted = lift(name, given, "webgl2")
    assert lifted.version == ES
    assert lifted.text.startswith("#version 300 es\n")
    kinds = set(re.findall(r"\b[iu]?sampler\w+", re.sub(r"//.*", "", lifted.text)))
    assert {kind for kind in kinds if f"precision highp {kind};" not in lifted.text} == set()
    # But for the lines that say what it is, it is what desktops get.
    own = ("#version", "#extension", "precision highp", "#define precise")
    texts = (lifted.text, plain.text)
    code = [[line for line in text.splitlines() if not line.startswith(own)] for text in texts]
    assert code[0] == code[1]


def test_a_target_that_is_none_is_told() -> None:
    with pytest.raises(tl.InputError, match="target 'metal'; no target has this name; use one of glsl, webgl2, vulkan"):
        lift("lib/optics.glsl", {}, "metal")  # type: ignore[arg-type]
    with pytest.raises(
        tl.InputError, match="for other languages; the shader writes to buffers, which are not translated"
    ):
        lift("intervals/k_buffer.frag", values("intervals/k_buffer.frag"), "vulkan")


@pytest.mark.parametrize("name", [name for name in shader_names() if not name.endswith(".glsl")])
def test_every_stage_is_there_for_vulkan(name: str) -> None:
    if lift(name, values(name)).version == WITH_STORAGE:
        return
    code = re.sub(r"//.*", "", lift(name, values(name), "vulkan").text)
    assert re.findall(r"^(?:flat )?(?:uniform|in|out) .*", code, re.MULTILINE) == []
    places = re.findall(r"binding = (\d+)\)", code)
    assert len(places) == len(set(places))


def test_for_vulkan_everything_has_its_place() -> None:
    name = "shade/receiver.frag"
    text = lift(name, dict.fromkeys(switches(name), 1), "vulkan").text
    assert text.startswith(f"#version {VULKAN} core\n")
    code = re.sub(r"//.*", "", text)
    assert re.findall(r"^(?:flat )?(?:uniform|in|out) .*", code, re.MULTILINE) == []
    places = re.findall(r"set = 0, binding = (\d+)", code)
    assert len(places) == len(set(places)) >= 3
    assert "row_major" not in code
    # What stages hand on is at the same place in both.
    handed = dict(re.findall(r"layout\(location = (\d+)\) out \w+ (\w+);", lift_stage("geometry/interface.vert")))
    taken = dict(re.findall(r"layout\(location = (\d+)\) in \w+ (\w+);", code))
    assert taken
    assert taken.items() <= handed.items()


def lift_stage(name: str) -> str:
    return lift(name, dict.fromkeys(switches(name), 1), "vulkan").text


def test_only_switches_that_decide_something_are_asked_for() -> None:
    resolve = "intervals/fragment_lists_resolve.frag"
    given = values(resolve)
    del given["SHADOWS"]  # of light that is scattered, which is off
    assert lift(resolve, given).text == lift(resolve, values(resolve)).text
    with pytest.raises(tl.InputError, match="the shader needs 1 switch more switches; add --define SHADOWS=0"):
        lift(resolve, {**given, "SCATTER": 1, "GRAY": 1})


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("lib/optics.glsl", "lib/optics.glsl"),
        ("optics.glsl", "lib/optics.glsl"),
        ("signed_depth", "thickness/signed_depth.frag"),
    ],
)
def test_a_shader_is_found_by_its_name_alone(name: str, found: str) -> None:
    assert find_shader(name) == found


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("opticz", "no shader has this name; did you mean optics?"),
        ("zzz", "no shader has this name; 'translucent shader' lists all"),
        (
            "interface",
            "several shader files have this name; use one of geometry/interface.vert, lib/interface.glsl,",
        ),
    ],
)
def test_a_shader_that_is_none_is_told(name: str, message: str) -> None:
    with pytest.raises(tl.InputError, match=re.escape(message)):
        find_shader(name)
