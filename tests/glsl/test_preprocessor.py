"""Includes, switches, compiler messages and uniform blocks."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from translucent.gpu import shaders
from translucent.gpu.layout import BLOCKS, TABLES, PackedTable, UniformBlock
from translucent.gpu.shaders import build_program, preprocess, set_uniform


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Shader files of a test's own, in place of the toolkit's."""
    (tmp_path / "full.vert").write_text("void main() { gl_Position = vec4(0.0); }\n")

    def path(name: str) -> Path:
        if not (tmp_path / name).is_file():
            raise tl.InputError(f"shader {name!r}", "no such file")
        return tmp_path / name

    monkeypatch.setattr(shaders, "shader_path", path)
    return tmp_path


def test_includes_are_recursive_and_happen_once(files: Path) -> None:
    (files / "a.glsl").write_text('#include "b.glsl"\n#include "c.glsl"\nfloat a() { return b() + c(); }\n')
    (files / "b.glsl").write_text('#include "c.glsl"\nfloat b() { return c(); }\n')
    (files / "c.glsl").write_text("float c() { return PI; }\n")
    source = preprocess("a.glsl")
    assert source.files == ("a.glsl", "b.glsl", "c.glsl")
    assert source.text.count("float c()") == 1
    assert source.text.index("float c()") < source.text.index("float b()") < source.text.index("float a()")


def test_circles_and_missing_includes_are_named(files: Path) -> None:
    (files / "a.glsl").write_text('#include "b.glsl"\n')
    (files / "b.glsl").write_text('#include "a.glsl"\n')
    with pytest.raises(tl.RenderError, match=r"circle: a.glsl -> b.glsl -> a.glsl"):
        preprocess("a.glsl")
    (files / "b.glsl").write_text('#include "nowhere.glsl"\n')
    with pytest.raises(tl.InputError, match=r"nowhere.glsl"):
        preprocess("a.glsl")
    (files / "b.glsl").write_text("#include <Nothing>\n")
    with pytest.raises(tl.RenderError, match=r"<Nothing>, which does not exist; include one of View"):
        preprocess("a.glsl")


def test_precise_values_are_asked_for_where_they_are_used(files: Path, renderer: tl.Renderer) -> None:
    (files / "plain.frag").write_text("out vec4 color;\nvoid main() { color = vec4(1.0); }\n")
    (files / "exact.frag").write_text(
        "out vec4 color;\nvoid main() {\n    precise vec4 sum = gl_FragCoord * 3.0 - 1.0;\n    color = sum;\n}\n"
    )
    assert "gpu_shader5" not in preprocess("plain.frag").text
    exact = preprocess("exact.frag").text
    assert exact.index("#extension GL_ARB_gpu_shader5") < exact.index("out vec4")
    with renderer.gpu.context.current() as gl:
        build_program(gl, "full.vert", "exact.frag").release()


def test_switches_must_match_in_both_directions(files: Path) -> None:
    (files / "a.glsl").write_text("#if FAST && !EXACT\nfloat a;\n#endif\n")
    with pytest.raises(tl.RenderError, match=r"\['EXACT'\], which the code does not define"):
        preprocess("a.glsl", {"FAST": 1})
    with pytest.raises(tl.RenderError, match=r"the code defines \['FASTER'\], which the shader does not use"):
        preprocess("a.glsl", {"FAST": 1, "EXACT": 0, "FASTER": 1})
    assert "#define FAST 1" in preprocess("a.glsl", {"FAST": True, "EXACT": 0}).text


def test_a_compile_error_names_file_and_line(renderer: tl.Renderer, files: Path) -> None:
    (files / "good.glsl").write_text("// one\n// two\nfloat good() { return 1.0; }\n")
    (files / "bad.glsl").write_text("// one\n\nfloat bad() { return missing; }\n")
    (files / "main.frag").write_text(
        '#include "good.glsl"\n\n#include "bad.glsl"\nout vec4 c;\nvoid main() { c = vec4(oops); }\n'
    )
    with renderer.gpu.context.current() as gl, pytest.raises(tl.RenderError) as caught:
        build_program(gl, "full.vert", "main.frag")
    assert "shaders/bad.glsl:3" in str(caught.value)
    assert "shaders/main.frag:5" in str(caught.value)


def test_unknown_uniforms_and_defines_are_errors(renderer: tl.Renderer, files: Path) -> None:
    (files / "main.frag").write_text("uniform float stops;\nout vec4 c;\nvoid main() { c = vec4(stops); }\n")
    with renderer.gpu.context.current() as gl:
        program = build_program(gl, "full.vert", "main.frag")
        set_uniform(program, "stops", 1.0)
        with pytest.raises(tl.RenderError, match="uniform 'stop'; the program only has the uniforms stops"):
            set_uniform(program, "stop", 1.0)
        with pytest.raises(tl.RenderError, match=r"neither shader uses \['FAST'\]"):
            build_program(gl, "full.vert", "main.frag", {"FAST": 1})
        with pytest.raises(tl.RenderError, match="uniform 'pictur'"):
            build_program(gl, "full.vert", "main.frag", pictur=0)


@pytest.mark.parametrize("block", BLOCKS.values(), ids=BLOCKS)
def test_block_layout_is_what_the_driver_uses(renderer: tl.Renderer, block: UniformBlock) -> None:
    """Write every field, read every component back through a shader that sums them with distinct weights."""
    assert block.dtype.itemsize % 16 == 0
    rng = np.random.default_rng(1)
    values = {name: rng.integers(1, 9, size=shape) for name, _, shape in block.fields}
    terms, expected = [], 0.0
    weight = 1.0
    for name, _, shape in block.fields:
        for index in np.ndindex(*shape):
            if len(index) == 2 and 16 < index[0] < shape[0] - 4:
                continue  # of long arrays, elements at both ends tell the stride
            weight = round(weight * 1.25 % 7 + 0.5, 6)
            # GLSL indexes a matrix by column first, an array by element.
            element = "".join(f"[{i}]" for i in (index[::-1] if shape == (4, 4) else index))
            terms.append(f"{weight!r} * float({name}{element})")
            expected += weight * float(np.asarray(values[name])[index])
    code = f"#version 330 core\n{block.glsl}out float total;\nvoid main() {{ total = {' + '.join(terms)}; }}\n"
    with renderer.gpu.context.current() as gl:
        program = gl.program(vertex_shader=code, varyings=["total"])
        program[block.name].binding = block.binding
        uniforms, output = gl.buffer(block.pack(**values)), gl.buffer(reserve=4)
        uniforms.bind_to_uniform_block(block.binding)
        gl.framebuffer([gl.texture((1, 1), 1)]).use()
        gl.vertex_array(program, []).transform(output, vertices=1)
        total = np.frombuffer(output.read(), np.float32)[0]
    assert total == pytest.approx(expected, rel=1e-5)


def test_a_block_wants_all_its_fields_and_no_others() -> None:
    with pytest.raises(KeyError, match="frame_size"):
        BLOCKS["View"].pack(frame=1.0)


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
def test_a_record_of_a_table_reads_as_it_was_packed(renderer: tl.Renderer, table: PackedTable) -> None:
    """Read every component of the second of three records back, each into an output of its own."""
    rng = np.random.default_rng(2)
    records = [{name: rng.random(shape) for name, _, shape in table.fields} for _ in range(3)]
    sizes = [int(np.prod(shape)) for _, _, shape in table.fields]
    elements = [
        f"row.{name}" + (f"[{i}]" if shape else "")
        for (name, _, shape), size in zip(table.fields, sizes, strict=True)
        for i in range(size)
    ]
    choices = "".join(f"if (gl_VertexID == {i}) {{ value = {element}; }}\n" for i, element in enumerate(elements))
    read = f"{table.name} row = {table.sampler}_row(1);\nvalue = 0.0;\n{choices}"
    code = f"#version 330 core\n{table.glsl}out float value;\nvoid main() {{\n{read}}}\n"
    packed = table.pack(records)
    with renderer.gpu.context.current() as gl:
        program = gl.program(vertex_shader=code, varyings=["value"])
        texture, output = gl.texture(packed.shape[1::-1], 4, packed, dtype="f4"), gl.buffer(reserve=4 * len(elements))
        texture.use(0)
        gl.framebuffer([gl.texture((1, 1), 1)]).use()
        gl.vertex_array(program, []).transform(output, vertices=len(elements))
        found = np.frombuffer(output.read(), np.float32)
    assert (found == np.concatenate([np.ravel(value) for value in records[1].values()]).astype(np.float32)).all()


def test_a_record_wants_all_its_fields() -> None:
    with pytest.raises(KeyError, match=r"packed table ObjectRow: .*'extinction'"):
        TABLES["ObjectRow"].pack([{"ior": 1.5}])


def test_no_function_of_a_shader_is_long() -> None:
    """At most 80 lines: a formula, or a step of an algorithm."""
    for path in sorted((Path(__file__).parents[2] / "shaders").rglob("*.*")):
        for found in re.finditer(r"^\w+ (\w+)\([^)]*\) \{\n(.*?)^\}", path.read_text(), re.MULTILINE | re.DOTALL):
            assert found[2].count("\n") < 79, f"{path.name}: {found[1]}"


def test_compilers_get_the_used_code_alone(files: Path) -> None:
    (files / "a.frag").write_text(
        "out vec4 color;\nuniform float scale;\nuniform float other;\n"
        "float inner() { return PI * scale; }\nfloat used() { return inner(); }\nfloat unused() { return other; }\n"
        "#if SWITCH\nfloat switched() { return unused(); }\n#else\nfloat switched() { return used(); }\n#endif\n"
        "void main() { color = vec4(switched()); }\n"
    )
    source, gathered = preprocess("a.frag", {"SWITCH": 0}), shaders.gather("a.frag")
    text = shaders.used_code("a.frag", gathered, source, {"SWITCH": 0})
    assert all(word in text for word in ("#version 330", "#define PI ", "out vec4 color", "scale;", "inner()"))
    assert not any(word in text for word in ("unused", "other", "#if"))
    assert "float unused()" in shaders.used_code("a.frag", gathered, source, {"SWITCH": 1})
