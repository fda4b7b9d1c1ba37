"""Conditions of every test: floating-point errors raise, seeds are fixed, and no OpenGL is a failure, not a skip."""

from __future__ import annotations

import contextlib
import gc
import gzip
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import settings

import translucent as tl
from tests.command_line import Result, Run
from translucent.bake import batch
from translucent.cli import main
from translucent.page import container, write
from translucent.planning.caustics import Caustics
from translucent.planning.scattering import Diffusion
from translucent.planning.shadow_maps import ShadowMaps
from translucent.scene import stages

ASSETS = Path(__file__).parents[2] / "shared" / "assets"

VALIDATE = """
const v = require(process.argv[1]), fs = require('fs'), path = require('path');
const file = process.argv[2];
const external = uri => Promise.resolve(new Uint8Array(fs.readFileSync(path.join(path.dirname(file), uri))));
v.validateBytes(new Uint8Array(fs.readFileSync(file)), {externalResourceFunction: external})
  .then(r => console.log(JSON.stringify(r.issues)));
"""

# What help and tracebacks look like does not depend on who runs the tests.
os.environ["COLUMNS"] = "80"
os.environ.pop("FORCE_COLOR", None)

settings.register_profile("project", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("project")


def pytest_collection(session: pytest.Session) -> None:
    """Have every second process of a whole run import the test files from the last one on.

    All processes collect all files. In a fresh clone, pytest rewrites the asserts of each file for that, which takes
    longer than the rest. So two processes share this work through the cache of bytecode.
    """
    number = os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")
    if int(number) % 2 and session.config.args_source is pytest.Config.ArgsSource.TESTPATHS:
        files = sorted(Path(__file__).parent.rglob("test_*.py"), reverse=True)
        for file in files[: len(files) // 2]:
            # A file that cannot be imported, or is skipped as a whole, is reported when it is collected.
            with contextlib.suppress(Exception, pytest.skip.Exception):
                importlib.import_module(".".join(("tests", file.parent.name, file.stem)))


def pytest_collection_finish() -> None:
    """Keep what lasts as long as the session, thousands of tests among it, from every later garbage collection."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def floating_point_errors_raise() -> Iterator[None]:
    before = np.seterr(all="raise")
    yield
    np.seterr(**before)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20240611)


@pytest.fixture
def in_tmp_path(tmp_path: Path) -> Iterator[Path]:
    """The test's own folder, as the working folder."""
    with contextlib.chdir(tmp_path):
        yield tmp_path


@pytest.fixture
def own_config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The test's own folder, where settings of a user are looked for."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    return tmp_path


@pytest.fixture
def uninstalled(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Makes a module of this name look as if it were not installed."""
    return lambda module: monkeypatch.setitem(sys.modules, module, None)


@pytest.fixture
def few_shadows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Maps of shadows of 128 texels a side, where no size is stated, and of 8 directions on stages."""
    # What `checked` has wrapped: the wrapper has no defaults.
    monkeypatch.setattr(ShadowMaps.__init__.__wrapped__, "__defaults__", (128, None))  # type: ignore[attr-defined]
    monkeypatch.setattr(stages, "ENVIRONMENT_SHADOWS", 8)
    assert ShadowMaps().size == 128


@pytest.fixture
def coarse_light(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cells of a 12th of a body for light that diffuses, and 20,000 photons, where no numbers are stated."""
    monkeypatch.setattr(Diffusion.__init__.__wrapped__, "__defaults__", (12,))  # type: ignore[attr-defined]
    monkeypatch.setattr(Caustics.__init__.__wrapped__, "__defaults__", (20_000, 0))  # type: ignore[attr-defined]
    assert (Diffusion().resolution, Caustics().photons) == (12, 20_000)


@pytest.fixture
def quick_packing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages are packed quickly, and are larger for it: what is unpacked is the same."""
    quick = SimpleNamespace(compress=lambda data, *_, **__: gzip.compress(data, 1), decompress=gzip.decompress)
    monkeypatch.setattr(container, "gzip", quick)
    monkeypatch.setattr(write, "gzip", quick)


@pytest.fixture
def without_processes(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Has batches bake in this process, once called: each of theirs takes most of a second to start."""

    def here(task: Callable[[Any], Any], items: list[Any], *_: Any) -> Iterator[Any]:
        for item in items:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # as in the processes
                result = task(item)
            yield result

    return lambda: monkeypatch.setattr(batch, "in_processes", here)


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    """Runs ``translucent`` in this process; a suite about one verb puts that before its arguments."""
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)  # the command line sets its own

    def _run(*arguments: object) -> Result:
        code = main([str(argument) for argument in arguments])
        return Result(code, *capsys.readouterr())

    return _run


@pytest.fixture(scope="session")
def assets() -> Path:
    """Third-party test data, which is not part of the project."""
    if not ASSETS.is_dir():
        pytest.skip(f"third-party test data is absent: no folder {ASSETS}")
    return ASSETS


@pytest.fixture(scope="session")
def transport(assets: Path) -> ModuleType:
    """Scenes with path-traced truth images: `make`, `load` and `errors`."""
    if not (file := assets / "transport" / "scenes.py").is_file():
        pytest.skip(f"truth images are absent: no file {file}")
    spec = importlib.util.spec_from_file_location("transport_scenes", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def renderer() -> Iterator[tl.Renderer]:
    from translucent.gpu.context import NoContextError

    try:
        made = tl.Renderer()
    except NoContextError as error:
        pytest.fail(f"these tests need OpenGL 3.3: {error}", pytrace=False)
    with made:
        yield made


@pytest.fixture
def one_renderer(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """Have commands and scripts draw with the renderer of all tests: a new one for each compiles its programs anew.

    It is not theirs where they name a backend, or where a machine without OpenGL is tested.
    """
    if "no_opengl" not in request.fixturenames:
        own, shared = tl.Renderer, request.getfixturevalue("renderer")
        monkeypatch.setattr(
            tl, "Renderer", lambda backend=None: own(backend) if backend else contextlib.nullcontext(shared)
        )


@pytest.fixture(scope="session")
def validate() -> Callable[[Path], dict[str, Any]]:
    """Issues that gltf-validator finds; the module is looked for from the working folder, and by NODE_PATH."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is absent, so gltf-validator cannot run")
    where = subprocess.run(
        [node, "-p", "require.resolve('gltf-validator')"], capture_output=True, text=True, check=False
    )
    if where.returncode:
        pytest.skip("the node module gltf-validator is absent: npm install gltf-validator, and set NODE_PATH")

    def _validate(path: Path) -> dict[str, Any]:
        done = subprocess.run(
            [node, "-e", VALIDATE, where.stdout.strip(), str(path)], capture_output=True, text=True, check=True
        )
        issues = json.loads(done.stdout)
        assert isinstance(issues, dict)
        return issues

    return _validate
