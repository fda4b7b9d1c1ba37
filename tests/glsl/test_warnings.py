"""No stage of any shader gives its compiler reason to warn."""

from __future__ import annotations

import ctypes
import uuid
from collections.abc import Iterator

import pytest

import translucent as tl
from translucent.assets import shader_path
from translucent.gpu.shaders import gather, preprocess

FOLDER = shader_path("README.md").parent
STAGES = {".vert": 0x8B31, ".frag": 0x8B30, ".comp": 0x91B9}
SHADERS = sorted(path.relative_to(FOLDER).as_posix() for path in FOLDER.rglob("*") if path.suffix in STAGES)
#: What is never asked for, in any shader or in one.
SETTLED = {"UNION": 0, "SLOTS": 2}
SETTLED_IN = {
    "shade/backdrop.frag": {"INFINITE": 0},
    "shade/ground_shadows.frag": {"SHADOW_MAPS": 1},
    "shade/layers_over.frag": {"SHARE": 1},
    "transport/shade_ends.comp": {"OPAQUE": 1},
    "volume/light_lists.frag": {"GRADIENT": 1, "SCATTER": 0, "MARCH": 0},
}


class Compiler:
    """The compiler of the current EGL context, asked directly: moderngl keeps remarks on what compiles to itself."""

    def __init__(self) -> None:
        self._gl = ctypes.CDLL("libGL.so.1")

    def remarks(self, text: str, kind: int) -> str:
        # Mesa compiles no text twice that has once compiled, in whatever process: so that none is the same.
        gl, source, done = self._gl, ctypes.c_char_p(f"{text}// {uuid.uuid4()}\n".encode()), ctypes.c_int()
        shader = ctypes.c_uint(gl.glCreateShader(kind))
        gl.glShaderSource(shader, 1, ctypes.byref(source), None)
        gl.glCompileShader(shader)
        gl.glGetShaderiv(shader, 0x8B81, ctypes.byref(done))  # GL_COMPILE_STATUS
        log = ctypes.create_string_buffer(1 << 16)
        gl.glGetShaderInfoLog(shader, len(log), None, log)
        gl.glDeleteShader(shader)
        return log.value.decode() if done.value else f"does not compile: {log.value.decode()}"


@pytest.fixture
def compiler(renderer: tl.Renderer) -> Iterator[Compiler]:
    if renderer.provenance["backend"] != "egl":
        pytest.skip("compilers are reached through libGL, which this backend does without")
    with renderer.gpu.context.current():
        yield Compiler()


@pytest.mark.parametrize("name", SHADERS)
@pytest.mark.parametrize("on", [False, True], ids=["plain", "all"])
def test_no_warning(renderer: tl.Renderer, compiler: Compiler, name: str, on: bool) -> None:
    settled = SETTLED | SETTLED_IN.get(name, {})
    switches = {switch: settled.get(switch, int(on)) for switch in gather(name).switches}
    version = 430 if "std430" in preprocess(name, switches).text else 330
    if version == 430 and not renderer.gpu.capabilities.shader_storage:
        pytest.skip("this OpenGL has no shader storage buffers")
    source = preprocess(name, switches, version)
    assert source.locate(compiler.remarks(source.text, STAGES["." + name.rsplit(".", 1)[1]])) == ""


def test_this_compiler_warns_at_all(renderer: tl.Renderer, compiler: Compiler) -> None:
    if "Mesa" not in renderer.provenance["driver"]:
        pytest.skip("only Mesa is known to warn of what is not set")
    text = "#version 330 core\nvec4 unset;\nvec4 read() { return unset; }\nvoid main() { gl_Position = read(); }\n"
    assert "`unset' used uninitialized" in compiler.remarks(text, STAGES[".vert"])
