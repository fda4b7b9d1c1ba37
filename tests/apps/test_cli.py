"""The command line, in-process: bad models and bad usage in one line, help, the version, and numbers."""

from __future__ import annotations

import errno
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import translucent as tl
from tests.command_line import Run, one_error_line, strict_json
from translucent.cli import cli
from translucent.commands.console import echo

# Bad input


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("missing.obj", None, "no file has this path"),
        ("garbage.glb", b"\x00\xff" * 100, "the JSON of the file is broken ("),
        ("garbage.gltf", b"[1]", "the JSON of the file has no 'asset', so the file is not glTF 2.0"),
        ("MISSING.GLB", None, "no file has this path"),
        ("garbage.ply", b"\x00\xff" * 100, "the file cannot be read ("),
        ("garbage.obj", b"\x00\xff" * 100, "error: mesh"),
        ("garbage.stl", b"\x00\xff" * 100, "error: mesh"),
        ("cut.ply", b"ply\nformat ascii 1.0\nelement vertex 3\n", "error: mesh"),
        ("empty.obj", b"", "the mesh has no faces"),
        ("points.obj", b"v 0 0 0\n", "the mesh has no faces"),
        (f"{'long' * 100}.obj", None, "no file has this path"),
        ("point.obj", b"v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n", "all vertices of the mesh are at one point"),
        ("model.fbx", b"Kaydara", "the mesh format '.fbx' is not supported; export it as .glb"),
        ("model.blend", b"BLENDER", "the mesh format '.blend' is not supported; export it as .glb"),
        ("model.txt", b"v 0 0 0", "the mesh format '.txt' is not supported; use glb, gltf, obj, stl, ply or off"),
        ("nan.obj", b"v 0 nan 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "1 vertices are not finite (first: 0)"),
        ("beyond.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "error: mesh"),
    ],
)
@pytest.mark.parametrize("verb", ["render", "explain"])
def test_a_bad_model_is_refused(
    run: Run, in_tmp_path: Path, verb: str, name: str, content: bytes | None, message: str
) -> None:
    model, output = Path(name), Path("out.png")
    if content is not None:
        model.write_bytes(content)
    result = run(verb, model, *(["-o", output] if verb == "render" else []))
    line = one_error_line(result)
    assert message in line
    assert name[:9] in line
    assert name[-9:] in line
    assert len(line) <= 320
    assert not output.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "Missing command"),
        (["frobnicate"], "No such command 'frobnicate'"),
        (["--frobnicate"], "No such option"),
        (["render"], "Missing argument 'MODEL...'"),
        (["render", "cube.ply"], "Missing option '-o'"),
        (["explain"], "Missing argument 'MODEL...'"),
        (["explain", "a", "b"], "no file 'a' and no built-in mesh has this name"),
        (
            ["explain", "beer"],
            "mesh 'beer'; no file and no built-in mesh has this name; give the path of a file, or one of amber, ",
        ),
        (["explain", "x.obj", "--method", "magic"], "x.obj'; no file has this path"),
        (["extinction"], "Missing argument 'COLOR'"),
        (["extinction", "teal"], "Missing argument 'DISTANCE'"),
        (["extinction", "red", "1cm", "--no-clamp"], "color 'red'; green = 0 is not in 0 < t <= 1"),
        (["render", "x.obj", "--color"], "Option '--color' requires an argument; in a shell, quote the color"),
        (["extinction", "linear(.5,.5,2)", "1cm"], "blue = 2 is not in 0 < t <= 1"),
        (["extinction", "linear(.5,.5,nan)", "1cm"], "a channel of the color is not a finite number"),
        (["extinction", "reddish", "1cm"], "color 'reddish'"),
        (["extinction", "#808080", "0"], "length '0'; the length must be positive and finite"),
        (["extinction", "#808080", "1e-320"], "so short that the extinction overflows"),
        (["extinction", "#808080", "abc"], "length 'abc'; the text is not a number"),
        (["extinction", "#808080", "nan"], "the length must be positive and finite"),
        (["extinction", "#808080", "--", "-1cm"], "length '-1cm'; the length must be positive"),
        (["extinction", "#808080", "1cm", "--json", "--nope"], "No such option"),
        (["doctor", "me"], "unexpected extra argument"),
    ],
    ids=lambda v: " ".join(v) if isinstance(v, list) else None,
)
def test_bad_usage_is_one_line_and_exit_code_2(run: Run, arguments: list[str], message: str) -> None:
    result = run(*arguments)
    assert message in one_error_line(result)


def test_debug_shows_the_traceback(run: Run, in_tmp_path: Path) -> None:
    with pytest.raises(tl.InputError, match="no file has this path"):
        run("explain", "missing.obj", "--debug")


@pytest.mark.parametrize("arguments", [["--help"], ["render", "--help"], ["explain", "-h"], ["extinction", "--help"]])
def test_help_is_no_error_and_every_verb_shows_an_example(run: Run, arguments: list[str]) -> None:
    result = run(*arguments)
    assert (result.code, result.err) == (0, "")
    assert "Usage: translucent" in result.out
    if len(arguments) > 1:
        assert f"Example: translucent {arguments[0]}" in result.out


@pytest.mark.parametrize("verb", ["render", "explain", "bake", "page", "extinction"])
def test_help_fits_a_screen_and_the_rest_is_one_option_away(run: Run, verb: str) -> None:
    usual, whole = run(verb, "--help").out, run(verb, "--help-all").out
    assert len(usual.splitlines()) <= 42
    listed = {name for line in usual.splitlines() for name in re.findall(r"^  (?:-\w, )?(--[\w-]+)", line)}
    known = {name for option in cli.commands[verb].params for name in option.opts}
    assert "--help-all" in listed <= known
    assert all(name in whole for name in known if name.startswith("--"))


def test_the_version_is_told(run: Run) -> None:
    result = run("--version")
    assert result.code == 0
    assert re.fullmatch(r"translucent, version \d+\.\d+\.\d+\s*", result.out)


# Numbers


def test_extinction_as_json_has_the_numbers(run: Run) -> None:
    result = run("extinction", "linear(0.25,0.5,1)", "2cm", "--json")
    assert (result.code, result.err) == (0, "")
    told = strict_json(result.out)
    assert told["color"] == [0.25, 0.5, 1.0]
    assert told["distance"] == 0.02
    assert told["extinction"] == pytest.approx([math.log(4) / 0.02, math.log(2) / 0.02, 0.0], rel=1e-15)
    assert told["mean_free_path"][:2] == pytest.approx([0.02 / math.log(4), 0.02 / math.log(2)], rel=1e-15)
    assert told["mean_free_path"][2] is None
    assert told["transmittance"]["1"] == pytest.approx([0.25, 0.5, 1.0], rel=1e-15)
    assert told["transmittance"]["2"] == pytest.approx([0.0625, 0.25, 1.0], rel=2e-15)
    assert list(told["transmittance"]) == ["0.1", "0.5", "1", "2", "10"]


def test_extinction_in_words_has_the_same_numbers(run: Run) -> None:
    result = run("extinction", "linear(0.25,0.5,1)", "2cm")
    assert (result.code, result.err) == (0, "")
    lines = {line.split("  ")[0].strip(): line for line in result.out.splitlines()}
    assert [float(word) for word in lines["extinction"].split()[1:4]] == [69.315, 34.657, 0.0]
    assert "after 0.02 m" in lines["color"]
    assert lines["mean free path"].split()[3:] == ["0.014427", "0.028854", "inf", "m"]


def test_a_hex_color_is_srgb(run: Run) -> None:
    told = strict_json(run("extinction", "#808080", "1", "--json").out)
    linear = ((128 / 255 + 0.055) / 1.055) ** 2.4
    assert told["extinction"] == pytest.approx([-math.log(linear)] * 3, rel=1e-14)


def test_a_file_whose_name_begins_with_a_dash(run: Run, tmp_path: Path, in_tmp_path: Path) -> None:
    Path("-lid.obj").touch()
    assert "'-lid.obj'; a file has this name" in (line := one_error_line(run("explain", "-lid.obj")))
    assert "write ./-lid.obj" in line
    assert "No such option" in one_error_line(run("explain", "-lad.obj"))


@pytest.mark.parametrize("verb", ["presets", "doctor"])
def test_a_standard_output_that_is_closed(run: Run, monkeypatch: pytest.MonkeyPatch, verb: str) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    assert run(verb)[::2] == (0, "")


def test_a_standard_output_that_is_full(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(text: str, *, err: bool = False, **_: object) -> None:
        if not err:
            raise OSError(errno.ENOSPC, "No space left on device")
        sys.stderr.write(f"{text}\n")

    monkeypatch.setattr("translucent.commands.console.click.echo", full)
    line = one_error_line(run("presets"), 1)
    assert "standard output; the output cannot be written (No space left on device)" in line


@pytest.mark.parametrize("err", [False, True])
def test_nobody_who_reads_on_is_no_failure(monkeypatch: pytest.MonkeyPatch, err: bool) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as stream:
        monkeypatch.setattr(sys, "stderr" if err else "stdout", stream)
        for _ in range(2):
            echo("a line", err=err)


@pytest.mark.parametrize(
    "error",
    [
        MemoryError("Unable to allocate 9 GiB"),
        RuntimeError("can't start new thread"),
        ImportError("a.so: failed to map segment from shared object"),
        OSError(errno.ENOMEM, "Cannot allocate memory"),
    ],
    ids=repr,
)
def test_a_full_memory_is_called_so(run: Run, monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def fail() -> None:
        raise error

    monkeypatch.setattr("translucent.media.presets.presets", fail)
    line = one_error_line(run("presets"), code=1)
    assert line.startswith("error: memory; the limit of the process is reached (")
    assert line.endswith("; use smaller settings, or raise the limit (ulimit -v)")


#: The command line, with Ctrl-C while it is imported.
STRUCK = """
import signal, sys

class Struck:
    def find_spec(self, name, *rest):
        if name == "translucent.commands.bake":
            signal.raise_signal(signal.SIGINT)

signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Struck())
from translucent.__main__ import main
sys.exit(main())
"""


def test_ctrl_c_while_modules_are_imported_is_one_line() -> None:
    done = subprocess.run([sys.executable, "-c", STRUCK], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "error: interrupted\n")
