"""``translucent shader``: the shaders of the toolkit as one text, also in languages of other engines.

Translators are programs that others keep, glslang and SPIRV-Cross, and naga: whoever lifts a shader has them installed;
nothing that renders needs them.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click
import numpy as np

from translucent.commands.console import echo
from translucent.commands.verbs import common_options
from translucent.errors import InputError

if TYPE_CHECKING:
    from translucent.gpu.layout import UniformBlock
    from translucent.gpu.lifting import Dialect, Lifted


_NAME, _TYPE_POINTER, _VARIABLE = 5, 32, 59

_HEADER = 5  # words

#: Languages that are not GLSL.
Language = Literal["hlsl", "msl", "wgsl"]

#: The npm package that has naga: its major version is naga's.
NAGA = "naga-wasm@30.1.0"

#: What engines call the inputs of vertex shaders in HLSL.
_SEMANTICS = {
    "offset": "POSITION",
    "normal": "NORMAL",
    "corner_normal": "NORMAL",
    "uv": "TEXCOORD0",
    "corner_color": "COLOR0",
}

_LANGUAGES: Mapping[Language, str] = {"hlsl": "HLSL", "msl": "Metal's language", "wgsl": "WGSL"}

_SPIRV_CROSS: Mapping[Language, Sequence[str]] = {
    "hlsl": [
        *("--hlsl", "--shader-model", "50", "--hlsl-auto-binding", "all"),
        *(word for pair in _SEMANTICS.items() for word in ("--set-hlsl-named-vertex-input-semantic", *pair)),
    ],
    "msl": ["--msl", "--msl-version", "20100"],
}

_MADE_BY: Mapping[Language, str] = {
    "hlsl": "shader model 5.0, by glslang and SPIRV-Cross",
    "msl": "Metal 2.1, by glslang and SPIRV-Cross",
    "wgsl": "by naga",
}

#: What a library's own main begins with in the translation.
_MAIN = {"hlsl": "\nvoid frag_main()", "msl": "\nfragment void main0(", "wgsl": "\nfn main_1("}

_FUNCTION = re.compile(r"^[\w\[\]]+ (\w+)\(([^)]*)\) \{", re.MULTILINE)

#: Reads {source, stage}; writes {text} or {error}. Modules are looked for as CommonJS does, also in NODE_PATH.
_NAGA = """
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";
import { readFileSync } from "node:fs";
let found;
try { found = createRequire(process.cwd() + "/").resolve("naga-wasm"); } catch { process.exit(3); }
const naga = await import(pathToFileURL(found).href);
const { source, stage } = JSON.parse(readFileSync(0, "utf8"));
let answer;
try { answer = { text: naga.translate({ from: "glsl", to: "wgsl", source, parse: { stage } }) }; }
catch (error) { answer = { error: String(error.formatted ?? error.message) }; }
process.stdout.write(JSON.stringify(answer));
"""


@click.command(epilog="Example: translucent shader signed_depth --define OPAQUE=0 --define SPECTRAL=0 --target webgl2")
@click.argument("name", required=False)
@click.option(
    "--define",
    "defines",
    multiple=True,
    metavar="X=1",
    help="Value of a shader switch, such as OPAQUE=0. Repeat the option for each switch.",
)
@click.option(
    "--target",
    type=click.Choice(["glsl", "webgl2", "vulkan", "hlsl", "msl", "wgsl"]),
    default="glsl",
    show_default=True,
    help="Language of the printed shader.",
)
@common_options
def shader(name: str | None, defines: tuple[str, ...], target: Dialect | Language, as_json: bool) -> None:
    """Print the shader NAME as a single text.

    Constants and included files are inserted, and unused code is left out. NAME is the path of a file in shaders/,
    or its file name if no other file has the same name. Without NAME, the command lists all shaders with their
    switches. --json also lists the sets of switch values that each shader accepts.

    The target glsl is GLSL for OpenGL 3.3, webgl2 is GLSL for WebGL2 and OpenGL ES 3.0, and vulkan is GLSL for Vulkan.
    Translators convert the GLSL for Vulkan to hlsl, msl (Metal) and wgsl (WebGPU). These translators must be installed:
    glslang and SPIRV-Cross, or naga for wgsl.
    """

    from translucent.gpu.lifting import find_shader, lift

    given = dict(map(_define, defines))
    if name is None:
        if given or target != "glsl":
            option = f"--define {defines[0]}" if defines else f"--target {target}"
            raise InputError(option, "no shader name is given", "add the NAME of a shader")
        return _list(as_json)
    found = find_shader(name)
    if target == "hlsl" or target == "msl" or target == "wgsl":
        translated = translate(found, given, target)
        lifted, text, version = translated.lifted, translated.text, None
    else:
        lifted = lift(found, given, target)
        text, version = lifted.text, lifted.version
    if not as_json:
        return echo(text, nl=False)
    reported = {
        "name": lifted.name,
        "target": target,
        "version": version,
        "defines": lifted.defines,
        "files": lifted.files,
        "blocks": [_placed(block) for block in lifted.blocks],
        "text": text,
    }
    return echo(json.dumps(reported))


def _placed(block: UniformBlock) -> dict[str, object]:
    """Binding of a uniform block, and the places of its members in it."""
    fields = block.dtype.fields
    assert fields is not None
    offsets = {name: place for name, (_, place, *_) in fields.items()}
    return {"name": block.name, "binding": block.binding, "bytes": block.dtype.itemsize, "offsets": offsets}


def _list(as_json: bool) -> None:
    from translucent.assets import shader_names
    from translucent.gpu.lifting import switches, valid_sets

    found = {name: switches(name) for name in shader_names()}
    if as_json:
        rows = [
            {"name": name, "switches": requested, "valid_sets": valid_sets(name)} for name, requested in found.items()
        ]
        return echo(json.dumps({"shaders": rows}))
    wide = max(map(len, found))
    for name, requested in found.items():
        echo(f"{name:<{wide}}  {' '.join(requested)}".rstrip())
    return None


def _define(text: str) -> tuple[str, int]:
    """Parse a switch and its value; one without a value is on."""
    key, equals, value = text.partition("=")
    if not (key.isidentifier() and (value.isdecimal() if equals else True)):
        raise InputError(
            f"--define {text!r}",
            "the value must be a switch name and a whole number",
            "write for example --define OPAQUE=0",
        )
    return key, int(value) if equals else 1


def with_block_names(module: bytes) -> bytes:
    """SPIR-V module in which unnamed uniform blocks get the name of their type, in lower case.

    Translators put the names in front of those of the members, or numbers that change with every edit.
    """
    words = np.frombuffer(module, "<u4")
    names: dict[int, str] = {}
    pointees: dict[int, int] = {}
    blocks: dict[int, str] = {}
    for code, operands in _instructions(words):
        if code == _NAME:
            names[int(operands[0])] = operands[1:].tobytes().split(b"\0")[0].decode()
        elif code == _TYPE_POINTER:
            pointees[int(operands[0])] = int(operands[2])
        elif code == _VARIABLE and not names.get(int(operands[1])):
            blocks[int(operands[1])] = names.get(pointees[int(operands[0])], "").lower()
    named = [words[:_HEADER]]
    for code, operands in _instructions(words):
        block = blocks.get(int(operands[0])) if code == _NAME else None
        rest = _text(block) if block else operands[1:]
        first = operands[:1]
        length = 1 + len(first) + len(rest)
        named += [np.array([length << 16 | code], "<u4"), first, rest]
    return np.concatenate(named).astype("<u4").tobytes()


def _instructions(words: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """Opcode and operands of each instruction."""
    at = _HEADER
    while at < len(words):
        length, code = divmod(int(words[at]), 1 << 16)
        yield code, words[at + 1 : at + length]
        at += length


def _text(text: str) -> np.ndarray:
    """Words of a string, which ends with a zero."""
    data = text.encode()
    return np.frombuffer(data + b"\0" * (4 - len(data) % 4), "<u4")


@dataclass(frozen=True)
class Translated:
    """Shader text in a language that is not GLSL.

    Attributes
    ----------
    lifted : Lifted
        The GLSL for Vulkan that was translated.
    language : {"hlsl", "msl", "wgsl"}
    text : str
    """

    lifted: Lifted
    language: Language
    text: str


def translate(name: str, defines: Mapping[str, int], language: Language) -> Translated:
    """Translate a stage, or a library of pure functions.

    Parameters
    ----------
    name : str
        As `translucent.gpu.lifting.find_shader` gives it: a stage, or a file of lib/.
    defines : dict of str to int
        Values of its switches.
    language : {"hlsl", "msl", "wgsl"}

    Raises
    ------
    InputError
        If a translator is not installed or refuses the shader, or the file is a part of shaders that is not whole.
    """
    from translucent.gpu.lifting import lift

    is_library = name.startswith("lib/")
    if name.endswith(".glsl") and not is_library:
        raise InputError(
            f"shader {name!r} in {_LANGUAGES[language]}",
            "the file is only a part of other shaders, and uses names that these shaders define",
            "choose a complete shader (.vert, .frag), a file of lib/, or --target glsl, webgl2 or vulkan",
        )
    vulkan: Dialect = "vulkan"
    lifted = lift(name, defines, vulkan)
    source = lifted.text + _call_all(lifted.text) if is_library else lifted.text
    stage = "vert" if name.endswith(".vert") else "frag"
    what = f"shader {name!r} in {_LANGUAGES[language]}"
    text = _by_naga(what, source, stage) if language == "wgsl" else _by_spirv_cross(what, source, stage, language)
    if is_library:
        text = text[: text.index(_MAIN[language])].rstrip()
    decided = "".join(f" {key}={value}" for key, value in lifted.defines.items())
    head = f"// translucent: shaders/{name}{decided}; {_MADE_BY[language]}. Comments are in the GLSL.\n"
    return Translated(lifted, language, f"{head}{text.strip()}\n")


def _call_all(text: str) -> str:
    """A main that calls every function, since translators leave out what nothing reaches."""
    calls = []
    for function, parameters in _FUNCTION.findall(text):
        declared = [one.strip() for one in parameters.split(",")]
        names = ", ".join(re.sub(r"\[.*", "", one).split()[-1] for one in declared)
        calls.append(f"    {{ {'; '.join(declared)}; {function}({names}); }}\n")
    return f"\nvoid main() {{\n{''.join(calls)}}}\n"


def _by_spirv_cross(what: str, source: str, stage: str, language: Language) -> str:
    requested = f"--target {language}"
    do = "install them: apt-get install glslang-tools spirv-cross, brew install glslang spirv-cross, or the Vulkan SDK"
    glslang = shutil.which("glslangValidator") or shutil.which("glslang")
    cross = shutil.which("spirv-cross")
    if glslang is None or cross is None:
        absent = [name for name, path in (("glslang", glslang), ("SPIRV-Cross", cross)) if path is None]
        raise InputError(requested, f"{' and '.join(absent)} {'is' if len(absent) == 1 else 'are'} not installed", do)
    with tempfile.TemporaryDirectory(prefix="translucent-") as folder:
        written, spirv = Path(folder) / f"shader.{stage}", Path(folder) / "shader.spv"
        written.write_text(source, encoding="utf-8")
        _run(what, [glslang, "-V", "-S", stage, "-o", str(spirv), str(written)], folder)
        spirv.write_bytes(with_block_names(spirv.read_bytes()))
        return _run(what, [cross, str(spirv), *_SPIRV_CROSS[language]], folder)


def _by_naga(what: str, source: str, stage: str) -> str:
    node = shutil.which("node")
    absent = InputError(
        "--target wgsl",
        "naga is not installed",
        (
            f"install Node.js, then run 'npm install {NAGA}' in this folder, or elsewhere with NODE_PATH set "
            "to its node_modules"
        ),
    )
    if node is None:
        raise absent
    # WGSL has no word for it: a driver may fuse products and sums.
    source = re.sub(r"\bprecise ", "", source)
    given = json.dumps({"source": source, "stage": "vertex" if stage == "vert" else "fragment"})
    done = subprocess.run(
        [node, "--input-type=module", "-e", _NAGA], input=given, capture_output=True, encoding="utf-8"
    )
    if done.returncode == 3:
        raise absent
    if done.returncode:
        raise InputError(what, f"naga stopped: {_first_line(done.stderr)}", "choose another target")
    answer: dict[str, str] = json.loads(done.stdout)
    if "error" in answer:
        raise InputError(what, f"naga: {_first_line(answer['error'])}", "choose another target")
    return answer["text"]


def _run(what: str, command: Sequence[str], folder: str) -> str:
    done = subprocess.run(command, capture_output=True, encoding="utf-8", cwd=folder)
    if done.returncode:
        tool = Path(command[0]).name
        # It names the file that it was given, first alone and then with the line.
        output = (done.stdout + done.stderr).replace(f"{command[-1]}:", "line ")
        reported = _first_line("\n".join(line for line in output.splitlines() if folder not in line))
        raise InputError(what, f"{tool}: {reported or 'it stopped'}", "choose another target")
    return done.stdout


def _first_line(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return re.sub(r"^(error|ERROR): ", "", lines[0]) if lines else ""
