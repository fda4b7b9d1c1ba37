"""The README and the pages of the site: what they say works."""

from __future__ import annotations

import glob
import itertools
import re
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import translucent as tl
from translucent.assets import web_path
from translucent.bake import atlas
from translucent.cli import cli, main
from translucent.planning.methods import METHODS

ROOT = Path(__file__).resolve().parents[2]
#: Made by the build of the site.
MADE = ("docs/generated/", "docs/gallery_of_examples/")

PAGES = {
    name: path.read_text(encoding="utf-8")
    for path in (ROOT / "README.md", *sorted(ROOT.glob("docs/**/*.md")))
    if not (name := path.relative_to(ROOT).as_posix()).startswith(MADE)
}
SNIPPETS = {
    page: found for page, text in PAGES.items() if (found := re.findall(r"```python\n(.*?)```", text, re.DOTALL))
}


def make_models() -> None:
    """The files that pages speak of."""
    import trimesh

    trimesh.creation.icosphere(subdivisions=2).export("model.glb")
    trimesh.creation.icosphere(subdivisions=2).export("model.stl")
    Image.fromarray(np.arange(32 * 24, dtype=np.uint16).astype(np.uint8).reshape(24, 32)).save("photo.jpg")
    # White at 10,10,60,60, and from 90,10 steps of 100 pixels, behind which ever less light is left.
    steps = np.repeat(np.array([250, 200, 160, 110, 60], dtype=np.uint8), [90, 100, 100, 100, 110])
    Image.fromarray(np.broadcast_to(steps[None, :, None], (80, 500, 3)).copy()).save("steps.jpg")


def little(snippet: str) -> str:
    """The snippet with pictures of 80 x 60 pixels: the pages show some of a useful size, tests need none."""
    return re.sub(r"\((?:640, 480|320, 240|160, 120)\)", "(80, 60)", snippet)


NEW_UV = atlas._new_uv


def new_uv(mesh: tl.Mesh, size: int) -> Any:
    """Texture coordinates: pages need some, not the best.

    xatlas takes seconds for a bear. So each face of a large mesh has a cell of its own instead.
    """
    count = len(mesh.faces)
    if count < 2000:
        return NEW_UV(mesh, size)
    side = int(np.ceil(np.sqrt(count)))
    cell = np.stack(np.divmod(np.arange(count), side), axis=1)[:, None]
    uv = (cell + np.array([[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]])) / side
    vertex = mesh.faces.ravel().astype(np.int64)
    faces = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    return tl.Mesh(mesh.vertices[vertex], faces, uv.reshape(-1, 2), mesh.name, mesh.repairs), vertex


@pytest.fixture
def small(
    monkeypatch: pytest.MonkeyPatch,
    few_shadows: None,
    coarse_light: None,
    without_processes: Callable[[], None],
    one_renderer: None,
) -> None:
    """One renderer, which keeps its programs, for all; few shadows, coarse light, and no processes."""
    without_processes()
    monkeypatch.setattr(atlas, "_new_uv", new_uv)


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("page", SNIPPETS)
def test_python_snippets_run(page: str, tmp_path: Path, in_tmp_path: Path) -> None:
    make_models()
    names = {"__name__": "__main__"}
    for snippet in SNIPPETS[page]:
        exec(compile(little(snippet), page, "exec"), names)
        for saved in re.findall(r'\.save\("([^"]+)"', snippet):
            assert (tmp_path / saved).stat().st_size > 1000, saved


@pytest.fixture
def one_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    """A report of one scene besides the model: all of them take a minute. Pictures of no stated size are small."""
    from translucent.bench import run

    for option in (option for command in cli.commands.values() for option in command.params):
        if option.default == "1280x720":
            monkeypatch.setattr(option, "default", "320x180")
    monkeypatch.setattr(run, "QUICK", run.Effort(0.0, 0.0, 0.3))
    monkeypatch.setattr(run, "QUICK_SIZE", (64, 64))

    def few(quick: bool, extra: Any = (), methods: Any = ()) -> Any:
        return (run.MethodComparison((*extra, run.CASES[0]), methods, quick),)

    monkeypatch.setattr(run, "experiments", few)


def commands(text: str) -> list[str]:
    return [line.removeprefix("$ translucent ") for line in text.splitlines() if line.startswith("$ translucent ")]


#: Each once, whatever number of pages show it.
COMMANDS = list(dict.fromkeys(command for text in PAGES.values() for command in commands(text)))

#: Needs a display: its tests are in tests/preview.
WINDOWED = "preview"

#: Needs a scheduler: tests/bake has one.
ON_A_FARM = "--dask"


#: Of an option that is given twice, the last counts: the pages show pictures of a useful size, tests need none.
SMALL = {
    "render": ["--size", "96x72", "--samples", "2"],
    "page": ["--poster", "none", "--stage", "none"],
    "bake": ["--size", "64", "--rays", "16"],
    "lithophane": ["--pitch", "2mm"],
}

#: Likewise of `bake --mode scatter`.
SMALL_SCATTER = ["--size", "64", "--resolution", "12"]


def runs_here(command: str) -> bool:
    verb = command.split()[0]
    return verb != WINDOWED and ON_A_FARM not in command and (verb != "page" or is_built("page.js"))


def is_built(script: str) -> bool:
    """True if a script for browsers is there: it is built with npm."""
    try:
        return web_path(script).is_file()
    except tl.InputError:
        return False


def options_of(command: str) -> tuple[str, ...]:
    """Options and arguments of a command line, without their values."""
    verb, *words = shlex.split(command)
    return (verb, *sorted(word for word in words if word.startswith("--")))


#: Of pictures with the same options, the first: others differ in values, which are looked up and not drawn.
DRAWN = list({options_of(command): command for command in reversed(COMMANDS)}.values())


@pytest.mark.parametrize("command", [c for c in COMMANDS if c not in DRAWN and c.startswith("render ")])
def test_commands_like_others_are_understood(command: str) -> None:
    """A picture with the options of one that is drawn: its values are of their types, and its preset is known."""
    render, (_, *words) = cli.commands["render"], shlex.split(command)
    given = render.make_context("render", words, resilient_parsing=False).params
    if (name := given.get("preset")) is not None:
        tl.preset(name)


@pytest.mark.usefixtures("one_scene", "small")
@pytest.mark.parametrize(
    "command", [c for c in COMMANDS if runs_here(c) and (c in DRAWN or not c.startswith("render "))]
)
def test_commands_run(command: str, tmp_path: Path, in_tmp_path: Path) -> None:
    import trimesh

    make_models()
    trimesh.creation.icosphere(subdivisions=2).export("model.obj")
    (tmp_path / "models").mkdir()
    trimesh.creation.icosphere(subdivisions=1).export("models/ball.glb")
    trimesh.creation.icosphere(subdivisions=1).export("out.glb")
    # As a shell would.
    arguments = [name for word in shlex.split(command) for name in ("*" in word and sorted(glob.glob(word))) or [word]]
    small = SMALL_SCATTER if "scatter" in arguments else SMALL.get(arguments[0], [])
    few = ["--turntable", "3"] if "--turntable" in arguments else []
    assert main([*arguments, *small, *few]) == 0


def test_all_verbs_are_shown() -> None:
    assert {command.split()[0] for command in commands(PAGES["docs/commands.md"])} == set(cli.commands)


def test_all_methods_are_in_the_table() -> None:
    rows = re.findall(r"^\| `(\w+)\(\w*\)` \|", PAGES["docs/methods.md"], re.MULTILINE)
    assert sorted(rows) == sorted(method.__name__ for method in METHODS.values())


def test_all_public_names_are_in_the_reference() -> None:
    listed = set(re.findall(r"^   (\w+)(?:\.\w+)?$", PAGES["docs/api.md"], re.MULTILINE))
    assert listed | {method.__name__ for method in METHODS.values()} == set(tl.__all__)


def headings(page: str) -> list[tuple[int, str]]:
    """Level and anchor of each heading, as MyST and code hosts make them."""
    text = re.sub(r"(?ms)^ *```.*?^ *```", "", PAGES[page])
    found = re.findall(r"(?m)^(#+) (.*)$", text)
    return [(len(level), re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")) for level, title in found]


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page: str) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", PAGES[page]):
        path, _, anchor = target.partition("#")
        if "://" in target or path.startswith("gallery_of_examples/"):
            continue
        file = ((ROOT / page).parent / path).resolve() if path else ROOT / page
        assert file.exists(), target
        assert page == "README.md" or file.is_relative_to(ROOT / "docs"), f"{target} is not a part of the site"
        if anchor:
            assert anchor in [name for _, name in headings(file.relative_to(ROOT).as_posix())], target


@pytest.mark.parametrize("page", PAGES)
def test_headings_are_nested(page: str) -> None:
    levels = [level for level, _ in headings(page)]
    assert levels[:1] in ([1], [])  # the changelog is included
    assert levels.count(1) <= 1
    assert all(after <= before + 1 for before, after in itertools.pairwise(levels))


@pytest.mark.parametrize("page", PAGES)
def test_pages_are_short(page: str) -> None:
    if page == "README.md":
        assert len(PAGES[page].splitlines()) <= 100
    elif page != "docs/api.md":
        assert len(PAGES[page].split()) <= (900 if page.startswith("docs/guides/") else 1800)


def test_all_pages_are_in_the_contents() -> None:
    trees = re.findall(r"```\{toctree\}\n(.*?)```", PAGES["docs/index.md"], re.DOTALL)
    listed = [f"docs/{name}.md" for tree in trees for name in re.findall(r"(?m)^([\w/-]+)$", tree)]
    assert len(listed) == len(set(listed))
    assert set(listed) - {"docs/gallery_of_examples/index.md"} == set(PAGES) - {"README.md", "docs/index.md"}


@pytest.mark.parametrize("page", PAGES)
def test_pictures_have_a_text_and_a_command(page: str) -> None:
    for text, target in re.findall(r"!\[([^\]]*)\]\(([^)\s]+)\)", PAGES[page]):
        assert len(text.split()) >= 3, target
        if "pictures/" in target:  # tools/gallery.py runs it
            assert any(f"-o {Path(target).stem}.png" in command for command in commands(PAGES[page])), target


@pytest.mark.usefixtures("one_scene", "small")
def test_examples_in_the_help_run(tmp_path: Path, in_tmp_path: Path) -> None:
    import trimesh

    trimesh.creation.icosphere(subdivisions=1).export("model.glb")
    trimesh.creation.icosphere(subdivisions=1).export("model.stl")
    for name, command in cli.commands.items():
        assert command.epilog is not None
        example = command.epilog.removeprefix("Example: translucent ")
        # Those of the pages run above, and a report of another name would say no more.
        if not runs_here(example) or example in COMMANDS or name == "report":
            continue
        assert main([*shlex.split(example), *SMALL.get(name, [])]) == 0, example
