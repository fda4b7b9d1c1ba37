"""Each function in shaders/lib against its float64 twin in Python, over edge-heavy grids."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from tests.probe import run_function, signatures
from tests.twins import ARGUMENTS, MODULES, assert_equals_twin
from translucent.assets import shader_library

#: Functions of these modules that are no formulas of light, and so have no twin.
HOST_ONLY = {
    "bsdf": {"below_coat", "brdf_table", "sampled_branches"},
    "phase": {"parse_phase"},
    "color": {"to_hex"},
    "diffusion": {"in_scattered_shares"},
    "light": {"light_cone"},
    "camera": {"aperture_point", "check_size", "direction_from", "framing_directions"},
    "tone": {"tone_curve"},
    "environment": {"filtered", "ggx_lobe", "parse_radiance", "radiance_harmonics"},
}


def _library_functions() -> list[tuple[str, str]]:
    return [(path.stem, name) for path in shader_library() for name in signatures(path)]


def test_libraries_and_python_define_the_same_names() -> None:
    found: dict[str, set[str]] = {path.stem: set(signatures(path)) for path in shader_library()}
    assert found.keys() == MODULES.keys()
    for library, module in MODULES.items():
        name = module.__name__.rpartition(".")[2]
        functions = {
            key
            for key, value in vars(module).items()
            if callable(value)
            and not key.startswith("_")
            and getattr(value, "__module__", "") == module.__name__
            and not isinstance(value, type)
        }
        assert found[library] == functions - HOST_ONLY.get(name, set()), library
    assert {name for _, name in _library_functions()} == ARGUMENTS.keys()


def test_libraries_are_pure() -> None:
    for path in shader_library():
        code = "\n".join(line.split("//")[0] for line in path.read_text().splitlines())
        for word in ("uniform", "sampler", "gl_", " in vec", " out vec"):
            assert word not in code, f"{path.name} has {word!r}"


@pytest.mark.parametrize(("library", "name"), _library_functions())
def test_function_equals_its_twin(renderer: tl.Renderer, library: str, name: str) -> None:
    arguments = ARGUMENTS[name]
    path = next(p for p in shader_library() if p.stem == library)
    signature = signatures(path)[name]
    with renderer.gpu.context.current() as gl:
        found = run_function(gl, f"lib/{library}.glsl", signature, *arguments)
    assert_equals_twin(library, name, signature.returns, arguments, found)


def test_transmittance_underflows_to_exactly_zero_and_never_to_nan(renderer: tl.Renderer) -> None:
    path = next(p for p in shader_library() if p.stem == "optics")
    depths = np.array([[1e4, 1e30, np.inf], [0.0, 1e-12, 104.0]], np.float32)
    with renderer.gpu.context.current() as gl:
        found = run_function(gl, "lib/optics.glsl", signatures(path)["transmittance"], depths)
    assert found[0].tolist() == [0.0, 0.0, 0.0]
    assert found[1, 0] == 1.0
    assert found[1, 1] == 1.0


def test_the_probe_finds_a_wrong_formula(
    renderer: tl.Renderer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The phase function with a plus where a product belongs, as one public library had it, does not pass."""
    wrong = tmp_path / "phase.glsl"
    text = next(p for p in shader_library() if p.stem == "phase").read_text()
    wrong.write_text(text.replace("4.0 * PI * base", "(4.0 + PI) * base"))
    from translucent.gpu import shaders

    original = shaders.shader_path
    monkeypatch.setattr(shaders, "shader_path", lambda name: wrong if name == "lib/phase.glsl" else original(name))
    with pytest.raises(AssertionError, match="henyey_greenstein"):
        test_function_equals_its_twin(renderer, "phase", "henyey_greenstein")
