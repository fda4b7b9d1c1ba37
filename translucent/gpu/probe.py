"""Run a function of ``shaders/lib`` over arrays, by transform feedback: used to test GLSL against NumPy."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.gpu.shaders import preprocess

_SIGNATURE = re.compile(r"^(float|vec[234])\s+(\w+)\s*\(([^)]*)\)\s*\{", re.MULTILINE)
_WIDTH = {"float": 1, "vec2": 2, "vec3": 3, "vec4": 4}


@dataclass(frozen=True)
class Signature:
    """Signature of a GLSL function: its name, the type it returns, and its parameters as (type, name)."""

    name: str
    returns: str
    parameters: tuple[tuple[str, str], ...]


def signatures(path: Path) -> dict[str, Signature]:
    """The functions that a library file defines, by name."""
    found = {}
    for returns, name, parameters in _SIGNATURE.findall(path.read_text(encoding="utf-8")):
        pairs = tuple(tuple(part.split()) for part in parameters.split(","))
        found[name] = Signature(name, returns, pairs)
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
        One for each parameter: (n,) for a float, (n, k) for a vector.

    Returns
    -------
    (n,) or (n, k) float32
    """
    inputs = "".join(f"in {kind} argument_{name};\n" for kind, name in signature.parameters)
    call = ", ".join(f"argument_{name}" for _, name in signature.parameters)
    source = preprocess(library).text
    text = f"{source}\n{inputs}out {signature.returns} result;\nvoid main() {{ result = {signature.name}({call}); }}\n"
    program = gl.program(vertex_shader=text, varyings=["result"])
    arrays = [np.ascontiguousarray(argument, dtype=np.float32) for argument in arguments]
    count, width = len(arrays[0]), _WIDTH[signature.returns]
    buffers = [gl.buffer(array) for array in arrays]
    output = gl.buffer(reserve=4 * count * width)
    content = [
        (buffer, f"{_WIDTH[kind]}f", f"argument_{name}")
        for buffer, (kind, name) in zip(buffers, signature.parameters, strict=True)
    ]
    vertex_array = gl.vertex_array(program, content)
    # Nothing is drawn, yet OpenGL asks for a complete framebuffer, which a context without a window lacks.
    texture = gl.texture((1, 1), 1)
    framebuffer = gl.framebuffer([texture])
    framebuffer.use()
    vertex_array.transform(output, moderngl.POINTS, count)
    values = np.frombuffer(output.read(), dtype=np.float32).copy()
    for resource in (vertex_array, program, output, framebuffer, texture, *buffers):
        resource.release()
    return values if width == 1 else values.reshape(count, width)
