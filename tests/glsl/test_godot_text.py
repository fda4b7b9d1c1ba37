"""The shader for Godot, compiled and run as GLSL: its language is GLSL's but for hints and built-in names."""

from __future__ import annotations

import re

import numpy as np
import pytest

import translucent as tl
from tests.values.media import COLOR, JADE
from translucent.materials import text_block

#: What Godot's spatial shaders are given and give.
BUILT_IN = """#version 330
uniform vec3 normal;
#define SCREEN_UV vec2(0.5)
#define NORMAL normal
#define VIEW vec3(0.0, 0.0, 1.0)
vec3 ALBEDO, EMISSION;
float ROUGHNESS, SPECULAR;
out vec4 color;
"""
CORNERS = (
    "#version 330\nvoid main() { gl_Position = vec4(4 * (gl_VertexID & 1) - 1, 2 * (gl_VertexID & 2) - 1, 0, 1); }"
)


def as_glsl(text: str) -> str:
    """The text without what is Godot's own."""
    text = text.replace("shader_type spatial;", "").replace("void fragment()", "void fragment_()")
    text = re.sub(r"(uniform \w+ \w+) : [^;=]*", r"\1 ", text)
    return f"{BUILT_IN}{text}\nvoid main() {{ fragment_(); color = vec4(EMISSION, SPECULAR); }}\n"


@pytest.mark.parametrize(("cosine", "exact"), [(1.0, False), (1.0, True), (0.5, False)])
def test_it_dims_what_is_behind_as_beer_and_lambert_say(renderer: tl.Renderer, cosine: float, exact: bool) -> None:
    fragment = as_glsl(text_block("godot", JADE, COLOR, 0.02, 0.0))
    behind, metres = np.array([0.8, 0.6, 0.4, 1.0], "f4"), np.array([0.05, 0, 0, 0], "f4")
    with renderer.gpu.context.current() as gl:
        program = gl.program(vertex_shader=CORNERS, fragment_shader=fragment)
        program["normal"] = (0.0, np.sqrt(1 - cosine**2), cosine)
        program["exact"] = exact
        textures = {"behind": behind, "metres": metres}
        held = [gl.texture((1, 1), 4, value.tobytes(), dtype="f4") for value in textures.values()]
        for unit, (name, texture) in enumerate(zip(textures, held, strict=True)):
            texture.use(unit)
            if name in program:
                program[name] = unit
        target = gl.framebuffer([gl.renderbuffer((1, 1), 4, dtype="f4")])
        target.use()
        gl.vertex_array(program, []).render(gl.TRIANGLES, vertices=3)
        found = np.frombuffer(target.read(components=4, dtype="f4"), "f4")
    f0 = (0.6 / 2.6) ** 2
    reflected = f0 + (1 - f0) * (1 - cosine) ** 5
    expected = behind[:3] * JADE.transmittance(0.05 if exact else 0.02) * (1 - reflected)
    np.testing.assert_allclose(found[:3], expected, rtol=1e-5)
    assert found[3] == pytest.approx(np.sqrt(f0 / 0.16), rel=1e-5)


def test_without_a_surface_nothing_is_reflected(renderer: tl.Renderer) -> None:
    clear = tl.Medium.from_color(COLOR, 0.02)
    text = as_glsl(text_block("godot", clear, COLOR, 0.02, 0.5))
    assert "uniform float ior = 1.0;" in text
    with renderer.gpu.context.current() as gl:
        gl.program(vertex_shader=CORNERS, fragment_shader=text)
