"""Promises of the source about itself: no import circles, docstrings, public names, one class for each name."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections import Counter
from graphlib import TopologicalSorter
from importlib import import_module
from pathlib import Path

import pytest

import translucent as tl

PACKAGE = Path(tl.__file__).parent
FILES = sorted(PACKAGE.rglob("*.py"))
CLASS = re.compile(r"^ *class (\w+)", re.MULTILINE)


def name(path: Path) -> str:
    return str(path.relative_to(PACKAGE))


#: Module and names of an import from it, in parentheses or not; or modules.
IMPORT = re.compile(r"^ *(?:from ([\w.]+) import (\([^)]*\)|.+)|import (.+))", re.MULTILINE)
NAME = re.compile(r"([\w.]+)(?: as \w+)?")


def imported(path: Path) -> set[str]:
    """Dotted names of all modules of the package that a file imports, wherever it does; of names in them, theirs."""
    found = set()
    for module, names, modules in IMPORT.findall(path.read_text(encoding="utf-8")):
        listed = NAME.findall(re.sub("#.*", "", names or modules))
        found |= {f"{module}.{one}" for one in listed} if module else set(listed)
    return {whole if whole in MODULES else whole.rpartition(".")[0] for whole in found} & set(MODULES)


MODULES = {".".join(("translucent", *path.relative_to(PACKAGE).with_suffix("").parts)): path for path in FILES}
MODULES = {module.removesuffix(".__init__"): path for module, path in MODULES.items()}


def test_no_module_imports_itself_through_others() -> None:
    """Imports for types and those within functions counted; the front door apart, which everybody may come through.

    By text, for parsing all files takes long.
    """
    graph = {module: imported(path) - {"translucent"} for module, path in MODULES.items()}
    ordered = list(TopologicalSorter(graph).static_order())  # raises CycleError, which names the circle
    assert sorted(ordered) == sorted(graph)


def test_a_module_says_what_it_is_for() -> None:
    # A shebang may come before.
    silent = [name(path) for path in FILES if not re.match(r'(#.*\n)*"""\S', path.read_text(encoding="utf-8"))]
    assert silent == []


def test_a_class_has_a_name_of_its_own() -> None:
    """Each name stands for one class, in whichever module; by text, for parsing all files takes long."""
    classes = Counter(found for path in FILES for found in CLASS.findall(path.read_text(encoding="utf-8")))
    assert [one for one, count in classes.items() if count > 1] == []


def test_a_public_name_exists_and_is_documented() -> None:
    texts = {public: (getattr(tl, public).__doc__ or "").strip() for public in tl.__all__}
    # A dataclass without a docstring gets its signature for one.
    assert [public for public, text in texts.items() if not text or text.startswith(f"{public}(")] == []


def test_the_public_names_are_sorted_and_unique() -> None:
    assert sorted(set(tl.__all__)) == tl.__all__


def test_checkers_know_the_public_names() -> None:
    """Names imported for checkers alone are those there are, from the same modules."""
    tree = ast.parse((PACKAGE / "__init__.py").read_text())
    (known,) = [node.body for node in tree.body if isinstance(node, ast.If)]
    told = {node.names[0].name: node.module for node in known if isinstance(node, ast.ImportFrom)}
    assert sorted(told) == sorted({*tl.__all__, "bench"})
    for public, module in told.items():
        assert getattr(tl, public) is getattr(import_module(module), public)


def test_a_scene_needs_neither_scipy_nor_trimesh_nor_opengl() -> None:
    code = """
import sys
import translucent as tl
assert "numpy" not in sys.modules  # every public name is imported when it is first asked for
mesh = tl.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
camera = tl.Camera.look_at((0, 0, 9), (0, 0, 0))
tl.Scene([tl.Object(mesh, tl.Medium.from_color("#7b1e3a", 0.01))], camera, [tl.PointLight((0, 0, 9), 1.0)])
found = {"scipy", "trimesh", "moderngl", "pyrender"} & set(sys.modules)
assert not found, found
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("module", "unneeded"),
    [
        ("translucent.preview.app", {"scipy", "trimesh", "translucent.reference", "translucent.diffusion.cache"}),
        ("translucent.cli", {"scipy", "trimesh", "moderngl", "translucent.geometry", "translucent.gpu"}),
    ],
)
def test_windows_and_the_command_line_start_without(module: str, unneeded: set[str]) -> None:
    code = f"""
import sys
import {module}
found = {unneeded!r} & set(sys.modules)
assert not found, found
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'translucent' has no attribute 'Rendrer'"):
        _ = tl.Rendrer
