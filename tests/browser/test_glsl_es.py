"""GLSL ES 3.00 in a browser: it compiles there, and functions give what their float64 twins give."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.browser.pages import WebPage, decoded, encoded
from tests.probe import feedback_program, signatures
from tests.twins import ARGUMENTS, assert_equals_twin
from translucent.assets import shader_library, shader_names
from translucent.errors import InputError
from translucent.gpu.lifting import lift, switches

COMPILE = """(texts) => {
  const gl = document.createElement("canvas").getContext("webgl2");
  return texts.map(([name, is_vertex, text]) => {
    const shader = gl.createShader(is_vertex ? gl.VERTEX_SHADER : gl.FRAGMENT_SHADER);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    const log = gl.getShaderParameter(shader, gl.COMPILE_STATUS) ? "" : `${name}: ${gl.getShaderInfoLog(shader)}`;
    gl.deleteShader(shader);
    return log;
  }).filter(Boolean);
}"""

# Points in, transform feedback out.
FEEDBACK = """(jobs) => {
  const gl = document.createElement("canvas").getContext("webgl2");
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const shader = (kind, text) => {
    const made = gl.createShader(kind);
    gl.shaderSource(made, text);
    gl.compileShader(made);
    if (!gl.getShaderParameter(made, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(made));
    return made;
  };
  gl.enable(gl.RASTERIZER_DISCARD);
  const nothing = shader(gl.FRAGMENT_SHADER, "#version 300 es\\nvoid main() {}\\n");
  return jobs.map(({ name, text, inputs, count, width }) => {
    const program = gl.createProgram();
    gl.attachShader(program, shader(gl.VERTEX_SHADER, text));
    gl.attachShader(program, nothing);
    gl.transformFeedbackVaryings(program, ["result"], gl.SEPARATE_ATTRIBS);
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(`${name}: ${gl.getProgramInfoLog(program)}`);
    gl.useProgram(program);
    gl.bindVertexArray(gl.createVertexArray());
    for (const input of inputs) {
      const place = gl.getAttribLocation(program, input.name);
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, bytes(input.data), gl.STATIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, input.width, gl.FLOAT, false, 0, 0);
    }
    const output = gl.createBuffer();
    gl.bindBuffer(gl.TRANSFORM_FEEDBACK_BUFFER, output);
    gl.bufferData(gl.TRANSFORM_FEEDBACK_BUFFER, 4 * width * count, gl.STREAM_READ);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, output);
    gl.beginTransformFeedback(gl.POINTS);
    gl.drawArrays(gl.POINTS, 0, count);
    gl.endTransformFeedback();
    const found = new Uint8Array(4 * width * count);
    gl.getBufferSubData(gl.TRANSFORM_FEEDBACK_BUFFER, 0, found);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, null);
    return btoa(String.fromCharCode(...found));
  });
}"""

#: Switches without which these shaders have no result, or ask for what others declare.
ASKED = {"shade/layers_over.frag": {"RADIANCE"}}
#: Those that a shader has for cameras without a far end, which orthographic ones are not.
APART = {"shade/backdrop.frag": {"INFINITE"}}
#: Times what float32 allows. Sine and cosine are good to 2^-11 there (Vulkan asks for no more), not to 2^-22.
SLACK = {
    "ggx_visible_normal": 2.0**11,
    "sphere_point": 2.0**12 / 12.0,  # is allowed twelve roundings of 2^-23 to begin with
    # Slopes of phase functions up to about a hundred, times those cosines, over 64 roundings.
    "mean_first_events_excess": 2.0**12 / 12.0,
    "microfacet_normal": 2.0**11 / 10.0,  # turns the former, and is allowed ten times as much to begin with
    "film_interference": 64.0,
    "thin_film_reflectance": 64.0,
}


def test_all_stages_and_libraries_compile(web_page: WebPage) -> None:
    """Without switches, with all of them, and of all but the largest with each alone."""
    texts: dict[str, tuple[str, bool, str]] = {}
    for name in shader_names():
        if name.endswith(".glsl") and not name.startswith("lib/"):
            continue
        asked = switches(name)
        least = {key: int(key == "SLOTS" or key in ASKED.get(name, ())) for key in asked}
        every = {key: int(key not in APART.get(name, ())) for key in asked}
        alone = [] if name.startswith("transport/") else [{**least, key: 1} for key in asked]
        for given in (least, every, *alone):
            try:
                text = lift(name, given, "webgl2").text
            except InputError:  # buffers, or values that the shader refuses
                continue
            main = "\nvoid main() { gl_Position = vec4(0.0); }\n" if name.startswith("lib/") else ""
            texts[text] = (f"{name} {given}", not name.endswith(".frag"), text + main)
    assert len(texts) > 130
    assert web_page.run(COMPILE, list(texts.values())) == []


def test_library_functions_equal_their_twins(web_page: WebPage) -> None:
    cases: list[tuple[str, Any, list[np.ndarray]]] = []
    jobs = []
    for path in shader_library():
        text = lift(f"lib/{path.name}", {}, "webgl2").text
        for name, signature in signatures(path).items():
            if "[" in signature.returns or any(length for *_, length in signature.parameters):
                continue  # WebGL captures no arrays, and takes none
            arguments = [argument[:: max(len(argument) // 300, 1)] for argument in ARGUMENTS[name]]
            inputs = [
                {"name": f"argument_{key}", "width": array[0].size, "data": encoded(array, "f4")}
                for (_, key, _), array in zip(signature.parameters, arguments, strict=True)
            ]
            width = {"float": 1, "vec2": 2, "vec3": 3, "vec4": 4}[signature.returns]
            jobs.append(
                {
                    "name": name,
                    "text": feedback_program(text, signature),
                    "inputs": inputs,
                    "count": len(arguments[0]),
                    "width": width,
                }
            )
            cases.append((path.stem, signature, arguments))
    assert len(jobs) == 78
    for (library, signature, arguments), job, text in zip(cases, jobs, web_page.run(FEEDBACK, jobs), strict=True):
        found = decoded(text)
        found = found if job["width"] == 1 else found.reshape(-1, job["width"])
        slack = SLACK.get(signature.name, 1.0)
        assert_equals_twin(library, signature.name, signature.returns, arguments, found, slack)
