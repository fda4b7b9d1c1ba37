"""Build what runs in browsers: GLSL out of shaders/ into web/src/generated/, and the bundles of web/ into web/dist/.

Run by .venv/bin/python: ``python tools/build_web.py``; needs npm. With ``--if-npm`` it says so and ends well where npm,
or what it should install, is not to be had. Every formula stays in shaders/: nothing in web/ is a copy of one.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import trimesh

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout, whichever is installed

from translucent.assets import mesh_path
from translucent.errors import InputError
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.lifting import lift
from translucent.gpu.placement import COVERAGE_FLOOR, NEAR_SURFACE, OPEN_WEIGHTS, ROUNDING

ROOT = Path(__file__).resolve().parents[1]
WEB = ROOT / "web"
GENERATED = WEB / "src" / "generated"
STAMP = WEB / "node_modules" / ".package-lock.sha256"

HEAD = "// Generated from shaders/ by tools/build_web.py; do not edit.\n"

#: What misses it.
MISSED = "`translucent page` and `tl.view` have no viewer, and tests in a browser skip"

#: What web/src imports from generated/shaders.ts: a shader with its switches decided.
SHADERS: dict[str, tuple[str, dict[str, int]]] = {
    "bodyVertex": ("geometry/body.vert", {"WITH_NORMAL": 0, "WITH_POSITION": 0}),
    "bodyVertexWithNormal": ("geometry/body.vert", {"WITH_NORMAL": 1, "WITH_POSITION": 0}),
    "signedDepth": ("thickness/signed_depth.frag", {"OPAQUE": 0, "SPECTRAL": 0}),
    "signedDepthBeforeOpaque": ("thickness/signed_depth.frag", {"OPAQUE": 1, "SPECTRAL": 0}),
    "spectralDepth": ("thickness/signed_depth.frag", {"OPAQUE": 0, "SPECTRAL": 1}),
    "spectralDepthBeforeOpaque": ("thickness/signed_depth.frag", {"OPAQUE": 1, "SPECTRAL": 1}),
    "opaqueDepth": (
        "shade/opaque.frag",
        {"DEPTH_ONLY": 1, "PROJECTED_DEPTH": 0, "SURFACE": 0, "LIGHT_MAP": 0, "SHADOW_MAPS": 0, "DIFFUSED": 0},
    ),
    "recentered": ("thickness/recentered.glsl", {}),
    "thickness": ("thickness/signed_thickness.frag", {"SPECTRAL": 0}),
    "spectralThickness": ("thickness/signed_thickness.frag", {"SPECTRAL": 1}),
}

#: Pure functions of the library, as one text `library`.
LIBRARY = ("lib/optics.glsl", "lib/interface.glsl")

#: Functions that web/src/webgpu imports from generated/nodes.ts, of these shaders.
NODES: dict[str, tuple[str, ...]] = {
    "thickness/signed_depth.frag": ("root_or_more", "count_with_fraction"),
    "thickness/recentered.glsl": ("recentered",),
    "thickness/signed_thickness.frag": (
        "view_ray",
        "whole_count",
        "fraction_of_count",
        "is_balanced",
        "misplaced_length",
        "is_length",
    ),
    "lib/optics.glsl": ("fresnel_dielectric",),
    "lib/interface.glsl": ("refracted_direction", "reflected_direction"),
}

#: Switches of these, all off.
SWITCHED = {"thickness/signed_depth.frag": ("OPAQUE", "SPECTRAL"), "thickness/signed_thickness.frag": ("SPECTRAL",)}

#: Numbers that it takes from there.
NUMBERS = {
    "NOTHING": float(CONSTANTS["NOTHING"]),
    "ROUNDING": ROUNDING,
    "COVERAGE_FLOOR": COVERAGE_FLOOR,
    "NEAR_SURFACE": NEAR_SURFACE,
    "OPEN_WEIGHTS": OPEN_WEIGHTS,
}

_BLOCK = re.compile(r"^layout\(std140, row_major\) uniform \w+ \{\n(.*?)^\};\n", re.M | re.S)
_HEAD = re.compile(r"^#version .*\n|^precision .*\n", re.M)
_INPUT = re.compile(r"^in \w+ (\w+);\n", re.M)
_COMMENT = re.compile(r"[ \t]*//.*$", re.M)
_DEFINE = re.compile(r"^#define (\w+) (.+)\n", re.M)
_FUNCTION = re.compile(r"^\w+ (\w+)\([^;{]*\) \{\n.*?^\}\n", re.M | re.S)
_UNIFORM = re.compile(r"^uniform (\w+) (\w+);\n", re.M)


def for_three(text: str) -> str:
    """A lifted shader as three.js takes it: without the head that it writes itself, and uniforms one by one."""
    code = _COMMENT.sub("", _HEAD.sub("", text))
    code = _BLOCK.sub(lambda block: "".join(f"uniform {field}\n" for field in _fields(block[1], code)), code)
    # Inputs that this variant does not use have no vertex stage to come from.
    code = _INPUT.sub(lambda found: found[0] if len(re.findall(rf"\b{found[1]}\b", code)) > 1 else "", code)
    return re.sub(r"\n{2,}", "\n", code).strip() + "\n"


def _fields(block: str, code: str) -> list[str]:
    fields = [line.strip() for line in block.splitlines()]
    names = {field: re.sub(r"\[.*", "", field.rstrip(";").split()[1]) for field in fields}
    return [field for field in fields if len(re.findall(rf"\b{names[field]}\b", code)) > 1]


def generate() -> None:
    """Write web/src/generated/shaders.ts, where it differs from what is there."""
    texts = {name: for_three(lift(file, switches, "webgl2").text) for name, (file, switches) in SHADERS.items()}
    values = {**NUMBERS, **texts, "library": library()}
    script = "".join(f"export const {name} = {json.dumps(value)};\n" for name, value in values.items())
    _write(GENERATED / "shaders.ts", HEAD + script)


def library() -> str:
    """The functions of the library, each once, called tl_NAME: three.js has an `opacity` of its own."""
    texts = [for_three(lift(file, {}, "webgl2").text) for file in LIBRARY]
    parts = [part for text in texts for part in re.split(r"(?<=^}\n)|(?=^#)", text, flags=re.M) if part]
    text = "".join(part for part in dict.fromkeys(parts) if not part.startswith("#define PI "))
    names = re.findall(r"^\w+ (\w+)\(", text, flags=re.M)
    return re.sub(rf"\b({'|'.join(names)})\b(?=\()", r"tl_\1", text)


def functions(file: str, names: tuple[str, ...]) -> str:
    """Some functions of a shader, pure: constants are spelled out, and uniforms are parameters."""
    text = for_three(lift(file, dict.fromkeys(SWITCHED.get(file, ()), 0), "webgl2").text)
    for name, value in _DEFINE.findall(text):
        text = re.sub(rf"\b{name}\b", value, _DEFINE.sub("", text))
    found = {one[1]: one[0] for one in _FUNCTION.finditer(text)}
    for type_, uniform in _UNIFORM.findall(text):
        for name, code in found.items():
            if re.search(rf"\b{uniform}\b", code):
                found[name] = code.replace(") {", f", {type_} {uniform}) {{", 1)
    return "".join(found[name] for name in names)


def generate_nodes() -> None:
    """Write web/src/generated/nodes.ts: functions of shaders/ as nodes of three, which its transpiler makes."""
    code = "".join(functions(file, names) for file, names in NODES.items())
    done = subprocess.run(
        ["node", "nodes.mjs"], cwd=WEB, input=code, stdout=subprocess.PIPE, encoding="utf-8", check=False
    )
    if done.returncode:
        raise InputError("nodes of web/src/generated", f"the transpiler ended with code {done.returncode}", "see above")
    text = re.sub(r"^(?:export )?const (\w+) =", r"export const \1: any =", done.stdout, flags=re.M)
    text = re.sub(r"^// Three.js Transpiler.*\n+", "", text).replace("'three/tsl'", '"three/tsl"')
    _write(GENERATED / "nodes.ts", f"// @ts-nocheck\n{HEAD}{text}")


def _write(path: Path, text: str) -> None:
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def install() -> None:
    """Bring web/node_modules up to date with the lock file."""
    lock = hashlib.sha256((WEB / "package-lock.json").read_bytes()).hexdigest()
    if not STAMP.is_file() or STAMP.read_text(encoding="utf-8") != lock:
        _run("npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error")
        STAMP.write_text(lock, encoding="utf-8")


def write_example() -> None:
    """The model of the example page, which has no other."""
    path = WEB / "dist" / "knot.glb"
    if not path.is_file():
        path.write_bytes(trimesh.load_mesh(mesh_path("knot")).export(file_type="glb", include_normals=True))


def _run(*command: str) -> None:
    done = subprocess.run(command, cwd=WEB, check=False)
    if done.returncode:
        told = " ".join(command)
        raise InputError(f"`{told}` in web/", f"it ended with code {done.returncode}", "see its message above")


def main() -> None:
    parser = argparse.ArgumentParser(description="Build the bundles of web/ into web/dist/.")
    parser.add_argument("--if-npm", action="store_true", help="do nothing where npm is not installed")
    parser.add_argument("--types", action="store_true", help="check types and write declarations, too")
    arguments = parser.parse_args()
    try:
        generate()
        if shutil.which("npm") is None:
            if arguments.if_npm:
                return print(f"web/dist is not built: npm is not here, so that {MISSED}")
            raise InputError("make web", "npm is not here", "install Node.js 20 or newer")
        try:
            install()
        except InputError as error:
            if arguments.if_npm:
                return print(f"web/dist is not built, so that {MISSED}: {error}")
            raise
        generate_nodes()
        _run("node", "build.mjs")
        write_example()
        if arguments.types:
            _run("npx", "tsc", "-p", ".")
        else:
            print("web/dist has no declarations of types: `make web` writes them, and `npm pack` in web/ does")
    except InputError as error:
        raise SystemExit(f"error: {error}") from None


if __name__ == "__main__":
    main()
