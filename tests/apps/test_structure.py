"""What the source promises about itself: rings, docstrings, sizes. Each test lists all that break its promise."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import translucent as tl

PACKAGE = Path(tl.__file__).parent
TREES = {
    path.relative_to(PACKAGE): ast.parse(path.read_text(encoding="utf-8")) for path in sorted(PACKAGE.rglob("*.py"))
}
#: Rooms that may load OpenGL: the ring that owns it, and all to its right.
BEYOND_VALUES = {
    "gpu",
    "interop",
    "bake",
    "bench",
    "preview",
    "commands",
    "renderer.py",
    "doctor.py",
    "cli.py",
    "__main__.py",
}
VALUES = {path for path in TREES if path.parts[0] not in BEYOND_VALUES}
GPU = {"moderngl", "glcontext", "OpenGL"}


def imports(tree: ast.AST) -> set[str]:
    """Dotted names of all that a module imports, wherever it does."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{alias.name}" for alias in node.names} | {str(node.module)}
    return found


def gpu_imports(path: Path) -> set[str]:
    return {
        module for module in imports(TREES[path]) if module.split(".")[0] in GPU or module.startswith("translucent.gpu")
    }


def test_the_package_is_there() -> None:
    assert {path.parts[0] for path in TREES} >= BEYOND_VALUES
    assert {"optics.py", "mesh.py", "plan.py", "render.py"} <= {path.name for path in VALUES}
    assert any(gpu_imports(path) for path in TREES if path.parts[0] == "gpu")


def test_the_values_import_no_gpu() -> None:
    assert {str(path): found for path in sorted(VALUES) if (found := gpu_imports(path))} == {}


def test_a_module_says_what_it_is_for() -> None:
    assert [str(path) for path, tree in TREES.items() if not ast.get_docstring(tree)] == []


def test_a_module_is_short() -> None:
    lengths = {path: len((PACKAGE / path).read_text(encoding="utf-8").splitlines()) for path in TREES}
    assert {str(path): length for path, length in lengths.items() if length > 400} == {}


def test_a_public_name_exists_and_is_documented() -> None:
    texts = {public: (getattr(tl, public).__doc__ or "").strip() for public in tl.__all__}
    # A dataclass without a docstring gets its signature for one.
    assert [public for public, text in texts.items() if not text or text.startswith(f"{public}(")] == []


def test_the_public_names_are_sorted_and_unique() -> None:
    assert sorted(set(tl.__all__)) == tl.__all__


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'translucent' has no attribute 'Rendrer'"):
        _ = tl.Rendrer
