"""``translucent shader``: GLSL to be used elsewhere, and what it asks for."""

from __future__ import annotations

import re
import shutil
from functools import partial

import pytest

from tests.command_line import Run, one_error_line, strict_json
from translucent.assets import shader_names

SIGNED = ("signed_depth", "--define", "OPAQUE=0", "--define", "SPECTRAL=1")


@pytest.fixture
def run(run: Run) -> Run:
    return partial(run, "shader")


def test_without_a_name_all_are_listed_with_their_switches(run: Run) -> None:
    code, out, err = run()
    assert (code, err) == (0, "")
    rows = {line.split()[0]: line.split()[1:] for line in out.splitlines()}
    assert list(rows) == shader_names()
    assert rows["thickness/signed_depth.frag"] == ["OPAQUE", "SPECTRAL"]
    assert rows["lib/optics.glsl"] == []
    listed = strict_json(run("--json").out)["shaders"]
    assert {row["name"]: row["switches"] for row in listed} == rows
    sets = {row["name"]: row["valid_sets"] for row in listed}
    assert sets["lib/optics.glsl"] == [{}]
    assert sets["thickness/signed_depth.frag"][:2] == [{"OPAQUE": 0, "SPECTRAL": 0}, {"OPAQUE": 1, "SPECTRAL": 0}]
    assert {"MODE": 3, "RIGHT": 0, "TONE": 0} in sets["present/compare.frag"]
    # Nodes of lists of lights keep a gradient, and what SCATTER reads is made here.
    assert {(one["GRADIENT"], one["SCATTER"]) for one in sets["volume/light_lists.frag"]} == {(1, 0)}
    # The mirror of the ground needs the ground, and microfacets.
    mirrors = [one for one in sets["transport/traced_interfaces.frag"] if one["MIRROR"]]
    assert [(one["OPAQUE"], one["MICROFACETS"]) for one in mirrors] == [(1, 1)]


def test_a_name_prints_one_text(run: Run) -> None:
    code, out, err = run(*SIGNED)
    assert (code, err) == (0, "")
    assert out.startswith("#version 330 core\n")
    assert "out vec4 optical_depth_and_count;" in out
    told = strict_json(run(*SIGNED, "--json").out)
    assert told["text"] == out
    assert told["defines"] == {"OPAQUE": 0, "SPECTRAL": 1}
    assert told["version"] == 330
    assert told["files"][-1] == "thickness/signed_depth.frag" or "thickness/signed_depth.frag" in told["files"]


def test_a_target_is_the_language_of_the_text(run: Run) -> None:
    assert run(*SIGNED, "--target", "glsl") == run(*SIGNED)
    code, out, err = run(*SIGNED, "--target", "webgl2")
    assert (code, err) == (0, "")
    assert out.startswith("#version 300 es\n")
    told = strict_json(run(*SIGNED, "--target", "webgl2", "--json").out)
    assert (told["text"], told["target"], told["version"]) == (out, "webgl2", 300)
    assert run(*SIGNED, "--target", "vulkan").out.startswith("#version 450 core\n")


def test_json_says_where_the_members_of_uniform_blocks_are(run: Run) -> None:
    (block,) = strict_json(run("body", "--define", "WITH_NORMAL=0", "--define", "WITH_POSITION=0", "--json").out)[
        "blocks"
    ]
    assert (block["name"], block["binding"], block["bytes"] % 16) == ("Body", 1, 0)
    assert block["offsets"]["clip_from_offset"] == 0
    assert block["offsets"]["axis"] == 128
    assert strict_json(run("optics", "--json").out)["blocks"] == []


def test_a_language_by_translators_has_no_version_of_glsl(run: Run) -> None:
    if shutil.which("glslangValidator") is None or shutil.which("spirv-cross") is None:
        pytest.skip("glslang or SPIRV-Cross is absent: apt-get install glslang-tools spirv-cross")
    told = strict_json(run(*SIGNED, "--target", "hlsl", "--json").out)
    assert (told["target"], told["version"], told["defines"]) == ("hlsl", None, {"OPAQUE": 0, "SPECTRAL": 1})
    assert told["text"] == run(*SIGNED, "--target", "hlsl").out
    assert "float4 optical_depth_and_count : SV_Target0;" in told["text"]


def test_a_switch_without_a_value_is_on(run: Run) -> None:
    assert run("signed_depth", "--define", "SPECTRAL", "--define", "OPAQUE=0") == run(*SIGNED)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["signed_depth"],
            "the shader needs 2 switches more switches; add --define OPAQUE=0 --define SPECTRAL=0, or choose other",
        ),
        (["signed_depth", "--define", "OPAQUE=0"], "the shader needs 1 switch more switches; add --define SPECTRAL=0"),
        (
            [*SIGNED, "--define", "SPECTRUM=1"],
            "the shader has no switch SPECTRUM; use one of its switches: OPAQUE, SPECTRAL",
        ),
        (
            ["optics", "--define", "FAST=1"],
            "the shader has no switch FAST; omit --define, because this shader has no switches",
        ),
        (
            ["signed_depth", "--define", "OPAQUE=yes"],
            "--define 'OPAQUE=yes'; the value must be a switch name and a whole number",
        ),
        (["signed_depth", "--define", "=1"], "--define '=1'; the value must be a switch name and a whole number"),
        (["--define", "OPAQUE=1"], "--define OPAQUE=1; no shader name is given; add the NAME of a shader"),
        (["../README.md"], "no shader has this name"),
        (["opticz"], "did you mean optics?"),
        (["--target", "wgsl"], "--target wgsl; no shader name is given; add the NAME of a shader"),
        ([*SIGNED, "--target", "cg"], "'cg' is not one of 'glsl', 'webgl2', 'vulkan', 'hlsl', 'msl', 'wgsl'"),
        (
            ["k_buffer", "--define", "OPAQUE=0", "--target", "webgl2"],
            "the shader writes to buffers, which WebGL2 has none of",
        ),
        (
            ["hierarchy", "--define", "ONE_OBJECT=1", "--target", "msl"],
            "the file is only a part of other shaders, and uses names that these shaders define",
        ),
    ],
    ids=lambda v: " ".join(v) if isinstance(v, list) else None,
)
def test_bad_usage_is_one_line(run: Run, arguments: list[str], message: str) -> None:
    assert message in one_error_line(run(*arguments))


def test_values_that_a_shader_refuses_are_told_in_its_words(run: Run) -> None:
    given = [
        "INTERFACES",
        "EMISSION",
        "MARCH",
        "PRIORITY",
        "SCATTER",
        "SLOTS",
        "UNION",
        "VARIES",
        "GRADIENT",
        "OPAQUE",
        "SCATTERS_AGAIN",
    ]
    options = [word for key in given for word in ("--define", f"{key}=0")]
    assert "a walk needs a slot; choose other values for --define" in one_error_line(
        run("fragment_lists_resolve", *options)
    )
    options[options.index("SLOTS=0")] = "SLOTS=2"
    assert "winding[SLOTS]" in run("fragment_lists_resolve", *options).out


def test_help_has_an_example(run: Run) -> None:
    assert "Example: translucent shader" in run("--help").out


def test_the_set_that_a_message_advises_is_accepted(run: Run) -> None:
    advice = one_error_line(run("light_lists.frag"))
    options = re.findall(r"--define \w+=\d+", advice)
    done = run("light_lists.frag", *" ".join(options).split())
    assert done.code == 0
    assert "#version 430" in done.out
    refused = one_error_line(run("light_lists.frag", *" ".join(options).replace("GRADIENT=1", "GRADIENT=0").split()))
    assert "GRADIENT is 1" in refused
