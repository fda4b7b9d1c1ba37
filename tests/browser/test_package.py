"""The npm package: what `npm pack` puts into it, and the page that takes it by an import map, without a build."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import tarfile
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from tests.browser.pages import MILLISECONDS
from translucent.cli import cli

WEB = Path(__file__).resolve().parents[2] / "web"
GENERATED = WEB / "src" / "generated" / "shaders.ts"

#: Where the page is served from, which no network knows.
ORIGIN = "https://pages.test"
_KINDS = {".html": "text/html", ".js": "text/javascript"}


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy of web/ without what was built, with its installed modules."""
    if shutil.which("npm") is None:
        pytest.skip("npm is not here")
    if not GENERATED.is_file() or not (WEB / "node_modules" / "typescript").is_dir():
        pytest.skip("the shaders and modules of web/ are not there: run `make web`")
    copy = tmp_path / "web"
    shutil.copytree(WEB, copy, ignore=shutil.ignore_patterns("node_modules", "dist"))
    (copy / "node_modules").symlink_to((WEB / "node_modules").resolve())
    return copy


def packed(package: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["npm", "pack", "--offline"], cwd=package, capture_output=True, encoding="utf-8", check=False)


@pytest.fixture
def contents(package: Path) -> dict[str, bytes]:
    """Files of the tarball, by name."""
    done = packed(package)
    assert done.returncode == 0, done.stderr
    with tarfile.open(next(package.glob("*.tgz"))) as archive:
        return {
            member.name.removeprefix("package/"): archive.extractfile(member).read()  # type: ignore[union-attr]
            for member in archive
            if member.isfile()
        }


#: A page of somebody who has the package and three.js alone.
STRANGER = """<!doctype html>
<script type="importmap">
{ "imports": { "three": "/three/three.module.js", "translucent-three": "/package/dist/translucent-three.js" } }
</script>
<script type="module">
import * as THREE from "three";
import { ExactThicknessPass, TranslucentMaterial } from "translucent-three";
const renderer = new THREE.WebGLRenderer();
renderer.setSize(64, 64);
document.body.append(renderer.domElement);
const camera = new THREE.PerspectiveCamera(30, 1, 0.1, 10);
camera.position.z = 5;
const scene = new THREE.Scene().add(new THREE.DirectionalLight());
const pass = new ExactThicknessPass(renderer);
const jade = new TranslucentMaterial({ pass, ior: 1.5, attenuationColor: "#2e8b57", attenuationDistance: 0.5 });
scene.add(new THREE.Mesh(new THREE.SphereGeometry(1, 64, 32), jade));
pass.render(scene, camera);
renderer.render(scene, camera);
globalThis.thickness = pass.at(32, 32);
</script>
"""


def test_the_tarball_is_all_that_a_page_needs(chromium: Any, contents: dict[str, bytes]) -> None:
    described = json.loads(contents["package.json"])
    for entry in described["exports"].values():
        if isinstance(entry, dict):
            assert {path.removeprefix("./") for path in entry.values()} <= set(contents)
    assert {"README.md", "LICENSE", "src/index.ts", "src/generated/shaders.ts"} <= set(contents)
    maps = [name for name in contents if name.endswith(".js.map")]
    assert len(maps) == 4
    for name in maps:
        sources = [source.removeprefix("../") for source in json.loads(contents[name])["sources"]]
        assert [source for source in sources if source not in contents] == []
    assert described["author"] == "the translucent authors"
    assert not [name for name in contents if "viewer" in name or name.startswith("node_modules")]

    def serve(route: Any) -> None:
        path = route.request.url.removeprefix(f"{ORIGIN}/")
        if path == "":
            return route.fulfill(body=STRANGER, content_type="text/html")
        room, _, name = path.partition("/")
        three = WEB / "node_modules" / "three" / "build" / name
        body = contents[name] if room == "package" else three.read_bytes()
        return route.fulfill(body=body, content_type="text/javascript")

    context = chromium.new_context(viewport={"width": 64, "height": 64})
    try:
        page = context.new_page()
        page.set_default_timeout(MILLISECONDS)
        page.route(f"{ORIGIN}/**", serve)
        page.goto(f"{ORIGIN}/")
        page.wait_for_function("() => globalThis.thickness")
        assert page.evaluate("thickness") == pytest.approx(2.0, abs=0.01)
    finally:
        context.close()


def test_a_pack_without_shaders_says_what_makes_them(package: Path) -> None:
    shutil.rmtree(package / "src" / "generated")
    done = packed(package)
    assert done.returncode != 0
    assert "src/generated/shaders.ts is not there; run `make web` in the checkout" in done.stderr
    assert not list(package.glob("*.tgz"))


def printed_shader(name: str) -> str:
    """Shader that a command in the docs writes into a file of this name."""
    page = (WEB.parent / "docs" / "engines" / "three-js.md").read_text(encoding="utf-8")
    (command,) = re.findall(rf"^translucent (shader .*) > {re.escape(name)}$", page, re.MULTILINE)
    return CliRunner().invoke(cli, shlex.split(command)).output


@pytest.mark.parametrize("example", ["import-map", "webgpu", "by-hand"])
def test_an_import_map_needs_no_build(chromium: Any, web_dist: Path, example: str) -> None:
    if not (WEB / "node_modules" / "three" / "build" / "three.module.js").is_file():
        pytest.skip("three is not there: run `make web`")

    def serve(route: Any) -> None:
        path = WEB / route.request.url.removeprefix(f"{ORIGIN}/")
        if path.suffix in _KINDS:
            route.fulfill(body=path.read_bytes(), content_type=_KINDS[path.suffix])
        else:
            route.fulfill(body=printed_shader(path.name))

    context = chromium.new_context(viewport={"width": 200, "height": 160})
    errors: list[str] = []
    try:
        page = context.new_page()
        page.set_default_timeout(MILLISECONDS)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.route(f"{ORIGIN}/**", serve)
        page.goto(f"{ORIGIN}/examples/{example}/index.html")
        if example == "webgpu" and not page.evaluate("async () => Boolean(await navigator.gpu?.requestAdapter())"):
            pytest.skip("this Chromium has no WebGPU adapter")
        page.wait_for_function("() => globalThis.metres || globalThis.pass?.texture")
        thickest = page.evaluate(
            "async () => (globalThis.metres ? await metres() : pass.read()).thickness"
            ".reduce((a, b) => Math.max(a, b), 0)"
        )
        # The tube of the knot is 12 mm thick, and rays cross it several times at most.
        assert 0.011 < thickest < 0.06
        assert errors == []
    finally:
        context.close()
