"""Run a function of ``shaders/lib`` over arrays, by transform feedback: used to test GLSL against NumPy."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.gpu.shaders import DeferredSignals, preprocess

_SIGNATURE = re.compile(r"^((?:float|vec[234])(?:\[\d+\])?)\s+(\w+)\s*\(([^)]*)\)\s*\{", re.MULTILINE)
_PARAMETER = re.compile(r"(\w+)\s+(\w+)(?:\[(\d+)\])?")
_WIDTH = {"float": 1, "vec2": 2, "vec3": 3, "vec4": 4}


@dataclass(frozen=True)
class Signature:
    """Signature of a GLSL function: its name, the type it returns, and its parameters as (type, name, length).

    The length is that of an array, 0 of what is none.
    """

    name: str
    returns: str
    parameters: tuple[tuple[str, str, int], ...]


def signatures(path: Path) -> dict[str, Signature]:
    """The functions of numbers that a library file defines, by name: those of structures are left out."""
    found = {}
    for returns, name, parameters in _SIGNATURE.findall(path.read_text(encoding="utf-8")):
        if re.search(r"\b[A-Z]\w* \w+", parameters):
            continue
        parts = tuple((kind, part, int(length or 0)) for kind, part, length in _PARAMETER.findall(parameters))
        found[name] = Signature(name, returns, parts)
    return found


def run_function(
    gl: moderngl.Context, library: str, signature: Signature, *arguments: npt.ArrayLike
) -> npt.NDArray[np.float32]:
    """Evaluate a GLSL function over arrays.

    Parameters
    ----------
    gl : moderngl.Context
    library : str
        File under ``shaders/`` that defines it.
    signature : Signature
    arguments : array_like
        One for each parameter: (n,) for a float, (n, k) for a vector, (n, m, k) for an array of m vectors.

    Returns
    -------
    (n,) or (n, k) float32
    """
    arrays = [np.ascontiguousarray(argument, dtype=np.float32) for argument in arguments]
    count, width = len(arrays[0]), _width(signature.returns)
    source = feedback_program(preprocess(library).text, signature)
    with DeferredSignals():
        program = gl.program(vertex_shader=source, varyings=["result"])
    content: list[tuple[moderngl.Buffer, str, str]] = []
    tables: list[moderngl.Texture] = []
    for array, (kind, name, length) in zip(arrays, signature.parameters, strict=True):
        if not length:
            content.append((gl.buffer(array), f"{_WIDTH[kind]}f", f"argument_{name}"))
            continue
        tables.append(gl.texture((length, count), _WIDTH[kind], array, dtype="f4"))
        tables[-1].use(len(tables))
        program[f"argument_{name}"] = len(tables)
    output = gl.buffer(reserve=4 * count * width)
    vertex_array = gl.vertex_array(program, content)
    # Nothing is drawn, yet OpenGL asks for a complete framebuffer, which a context without a window lacks.
    texture = gl.texture((1, 1), 1)
    framebuffer = gl.framebuffer([texture])
    framebuffer.use()
    vertex_array.transform(output, moderngl.POINTS, count)
    values = np.frombuffer(output.read(), dtype=np.float32).copy()
    buffers = [buffer for buffer, _, _ in content]
    for resource in (vertex_array, program, output, framebuffer, texture, *tables, *buffers):
        resource.release()
    return values if width == 1 else values.reshape(count, width)


def _width(kind: str) -> int:
    """Numbers in a value of a type, such as vec3 or float[9]."""
    name, _, length = kind.rstrip("]").partition("[")
    return _WIDTH[name] * int(length or 1)


def feedback_program(source: str, signature: Signature) -> str:
    """Vertex shader that calls the function: each array is a row of a texture of its own."""
    inputs: list[str] = []
    before: list[str] = []
    for kind, name, length in signature.parameters:
        if not length:
            inputs.append(f"in {kind} argument_{name};")
            continue
        inputs.append(f"uniform sampler2D argument_{name};")
        components = "xyzw"[: _WIDTH[kind]]
        fetched = f"texelFetch(argument_{name}, ivec2(i, gl_VertexID), 0).{components}"
        before.append(f"{kind} row_{name}[{length}]; for (int i = 0; i < {length}; i++) row_{name}[i] = {fetched};")
    call = ", ".join(f"{'row' if length else 'argument'}_{name}" for _, name, length in signature.parameters)
    body = " ".join([*before, f"result = {signature.name}({call});"])
    returns, bracket, rest = signature.returns.partition("[")
    inputs.append(f"out {returns} result{bracket}{rest};")
    return source + "\n" + "\n".join(inputs) + f"\nvoid main() {{ {body} }}\n"
