"""The npm package: what `npm pack` puts into it, and the page that takes it by an import map, without a build."""

from __future__ import annotations

import json
import shutil
import subprocess
import tarfile
from pathlib import Path
from typing import Any

import pytest

WEB = Path(__file__).resolve().parents[2] / "web"
GENERATED = WEB / "src" / "generated" / "shaders.ts"

#: Where the page is served from, which no network knows.
ORIGIN = "http://pages.test"
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


def test_a_pack_builds_and_holds_bundle_map_sources_and_types(package: Path) -> None:
    done = packed(package)
    assert done.returncode == 0, done.stderr
    with tarfile.open(next(package.glob("*.tgz"))) as archive:
        files = {
            member.name.removeprefix("package/"): archive.extractfile(member) for member in archive if member.isfile()
        }
        described = json.load(files["package.json"])  # type: ignore[arg-type]
        mapped = json.load(files["dist/translucent-three.js.map"])  # type: ignore[arg-type]
    assert {described["types"].removeprefix("./"), described["exports"]["."]["default"].removeprefix("./")} <= set(
        files
    )
    assert {"README.md", "LICENSE", "dist/types/TranslucentMaterial.d.ts", "dist/types/ExactThicknessPass.d.ts"} <= set(
        files
    )
    sources = {Path("dist", source) for source in mapped["sources"]}
    assert {"src/index.ts", "src/options.ts", "src/generated/shaders.ts"} <= set(files)
    assert [one for one in sources if one.as_posix().replace("dist/../", "") not in files] == []
    assert described["author"] == "the translucent authors"
    assert not [name for name in files if "viewer" in name or name.startswith("node_modules")]


def test_a_pack_without_shaders_says_what_makes_them(package: Path) -> None:
    shutil.rmtree(package / "src" / "generated")
    done = packed(package)
    assert done.returncode != 0
    assert "src/generated/shaders.ts is not there; run `make web` in the checkout" in done.stderr
    assert not list(package.glob("*.tgz"))


def test_an_import_map_needs_no_build(chromium: Any, web_dist: Path) -> None:
    if not (WEB / "node_modules" / "three" / "build" / "three.module.js").is_file():
        pytest.skip("three is not there: run `make web`")

    def serve(route: Any) -> None:
        path = WEB / route.request.url.removeprefix(f"{ORIGIN}/")
        route.fulfill(body=path.read_bytes(), content_type=_KINDS[path.suffix])

    context = chromium.new_context(viewport={"width": 200, "height": 160})
    errors: list[str] = []
    try:
        page = context.new_page()
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.route(f"{ORIGIN}/**", serve)
        page.goto(f"{ORIGIN}/examples/import-map/index.html")
        page.wait_for_function("() => globalThis.pass?.texture")
        thickest = page.evaluate("() => pass.read().thickness.reduce((a, b) => Math.max(a, b), 0)")
        # The tube of the knot is 12 mm thick, and rays cross it several times at most.
        assert 0.011 < thickest < 0.06
        assert errors == []
    finally:
        context.close()
