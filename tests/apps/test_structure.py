"""What the source promises about itself: rings, docstrings, sizes."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import translucent as tl

PACKAGE = Path(tl.__file__).parent
FILES = sorted(PACKAGE.rglob("*.py"))
APPS = {PACKAGE / name for name in ("cli.py", "doctor.py", "renderer.py", "__main__.py")}
VALUES = sorted(set(PACKAGE.glob("*.py")) - APPS)
for folder in ("reference", "materials", "gltf", "cpu"):
    VALUES += sorted((PACKAGE / folder).glob("*.py"))
GPU = {"moderngl", "glcontext", "OpenGL"}


def name(path: Path) -> str:
    return str(path.relative_to(PACKAGE))


def imports(tree: ast.AST) -> set[str]:
    """Dotted names of all that a module imports, wherever it does."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{alias.name}" for alias in node.names} | {str(node.module)}
    return found


def is_gpu(module: str) -> bool:
    return module.split(".")[0] in GPU or module.startswith("translucent.gpu")


def test_the_package_is_there() -> None:
    assert {"optics.py", "mesh.py", "plan.py"} <= {name(path) for path in VALUES}
    assert any(
        is_gpu(module) for path in (PACKAGE / "gpu").rglob("*.py") for module in imports(ast.parse(path.read_text()))
    )


@pytest.mark.parametrize("path", VALUES, ids=name)
def test_the_values_import_no_gpu(path: Path) -> None:
    found = {module for module in imports(ast.parse(path.read_text(encoding="utf-8"))) if is_gpu(module)}
    assert not found


@pytest.mark.parametrize("path", FILES, ids=name)
def test_a_module_says_what_it_is_for(path: Path) -> None:
    assert ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))


@pytest.mark.parametrize("path", FILES, ids=name)
def test_a_module_is_short(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 400


@pytest.mark.parametrize("public", tl.__all__)
def test_a_public_name_exists_and_is_documented(public: str) -> None:
    assert (getattr(tl, public).__doc__ or "").strip()
    # A dataclass without a docstring gets its signature for one.
    assert not getattr(tl, public).__doc__.startswith(f"{public}(")


def test_the_public_names_are_sorted_and_unique() -> None:
    assert sorted(set(tl.__all__)) == tl.__all__


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'translucent' has no attribute 'Rendrer'"):
        _ = tl.Rendrer
