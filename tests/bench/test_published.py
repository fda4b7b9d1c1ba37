"""Figures of the README and of the docs, held against the published report."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
REPORT = json.loads((ROOT / "docs" / "reports" / "software.json").read_text(encoding="utf-8"))
CASES = {case["name"]: case for case in REPORT["cases"]}
METHODS = (ROOT / "docs" / "methods.md").read_text(encoding="utf-8")
PROSE = " ".join(METHODS.split())
README = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())

SCATTERING = {
    "jade ring": "ring of jade",
    "soap": "bar of soap, roughness 0.35",
    "milk ball": "ball of milk, g = 0.5",
    "milk bear": "bear of skimmed milk",
    "marble knot": "knot of marble",
    "wax block": "block of wax without an interface, a point light behind it",
    "lantern": "hollow ball without an interface, a point light inside",
}
INTERFACES = {
    "glass": "ball of glass",
    "hollow": "hollow ball of glass",
    "glass knot": "knot of glass",
    "filled goblet": "wine in a crystal glass",
    "nested balls": "ball in a ball",
    "amber": "amber",
    "lenses": "row of lenses",
    "frosted": "frosted ball",
    "dispersion": "ball of heavy flint",
    "thin wall": "sheet of glass",
}
MESHES = {"sphere": "sphere, 99k triangles", "torus": "torus, 100k triangles", "knot": "knot, 81k triangles"}
THIN = ("sphere", "torus", "knot", "bear", "far knot")

TREES = ("ScreenInterfaces()", "depth=4, forks=1", "depth=12, forks=2", "depth=16, forks=3", 'backend="cpu"')


def row(case: str, what: str) -> dict[str, Any] | None:
    """The one measured row of a case whose method or parameters contain this."""
    for one in CASES[case]["rows"]:
        if (what == one["method"] or what in one["parameters"]) and one["ratio"]:
            # Parameters of the CPU's row hold those of the tree, too.
            if 'backend="cpu"' in one["parameters"] and what != 'backend="cpu"':
                continue
            return dict(one)
    return None


def ratio(case: str, what: str) -> float:
    found = row(case, what)
    assert found is not None
    return float(found["ratio"]["median"])


#: A number as the docs write it, or an upper bound.
NUMBER = re.compile(r"(< )?(\d[\d,]*(?:\.\d+)?)(e-\d+)?( %)?")


def cells(header: str, title: str) -> str:
    """Cells of the row that begins with this title, of the table in docs/methods.md whose header begins so."""
    lines = METHODS[METHODS.index(f"| {header} |") :].splitlines()
    return next(line for line in lines if line.startswith(f"| {title} |")).removeprefix(f"| {title} |")


def differences(where: str, text: str, values: Sequence[float | None]) -> list[str]:
    """Figures that are written otherwise than measured, by more than half of the last digit that is written."""
    found = list(NUMBER.finditer(text))
    values = [value for value in values if value is not None]
    if len(found) != len(values):
        return [f"{where}: {text!r} is not {len(values)} numbers"]
    wrong = []
    for number, value in zip(found, values, strict=True):
        below, digits, power, percent = number.groups()
        scale = float(f"1{power or 'e0'}") * (0.01 if percent else 1.0)
        written = float(digits.replace(",", "")) * scale
        step = scale * 10.0 ** -len(digits.partition(".")[2])
        if "." not in digits:  # zeros after the first two digits stand for whatever was there
            whole = digits.replace(",", "")
            step *= 10.0 ** (len(whole[2:]) - len(whole[2:].rstrip("0")))
        if not (value <= written + 1e-12 if below else abs(value - written) <= 0.501 * step):
            wrong.append(f"{where}: {number[0]} is {value:.4g}")
    return wrong


def ratios(cases: Sequence[str], what: str) -> list[float]:
    """Least and largest multiple of a depth-only pass over these cases, of those that have the row."""
    found = [ratio(case, what) for case in cases if row(case, what)]
    return [min(found), max(found)]


def signed_depth() -> Iterator[tuple[str, str, Sequence[float | None]]]:
    for title, cases in {
        "one body of 2 to 6 layers: sphere, torus, knot, bear, the knot far away": THIN,
        "a Menger sponge, 28 layers": ["sponge"],
        "nested shells, 24 layers": ["shells"],
        "a slab of twelve triangles, far away and near by": ["far slab", "slab"],
        "two media in one picture": ["two media"],
    }.items():
        found = ratios(cases, "SignedDepth")
        yield title, cells("on", title), found[:1] if len(cases) == 1 else found


def methods() -> Iterator[tuple[str, str, Sequence[float | None]]]:
    lines = METHODS.splitlines()
    for case, title in MESHES.items():
        start = next(i for i, line in enumerate(lines) if line.startswith(f"| {title} |"))
        for line, method in zip(lines[start:], ("SignedDepth", "BackFaceDepth", "FragmentLists"), strict=False):
            one = row(case, method)
            assert one is not None
            assert f"| {method} |" in line
            times, error = [one[key]["median"] for key in ("ratio", "frame_ratio")], one["thickness"]
            yield f"{title}, {method}", line.split(method)[1], [*times, error["median"], error["p999"], one["invalid"]]


def scattering() -> Iterator[tuple[str, str, Sequence[float | None]]]:
    columns = (
        "layer without inner mirrors",
        "Burley's normalized diffusion",
        "Frostbite's translucency",
        "SingleScattering",
        "ScatteringLayer",
        *(f"Diffusion, resolution {n}" for n in (16, 24, 32, 48)),
        *(f"PathTraced, {n} paths" for n in (2, 4, 16)),
    )
    for case, title in SCATTERING.items():
        rows = [row(case, column) for column in columns]
        yield (
            title,
            cells("scene | layer without inner mirrors", title),
            [one and one["light"]["nrmse"] for one in rows],
        )


def interfaces() -> Iterator[tuple[str, str, Sequence[float | None]]]:
    header = "scene | noise of the truth in a pixel"
    for case, title in INTERFACES.items():
        rows = [one for what in TREES if (one := row(case, what))]
        errors = [error for one in rows for error in (one["radiance"]["rms"], one["sampled"]["rms"])]
        yield title, cells(header, title), [CASES[case]["truth_spread"], *errors]
    yield (
        "time",
        cells(header, "time / depth-only"),
        [value for what in TREES for value in ratios(list(INTERFACES), what)],
    )


def slabs() -> Iterator[tuple[str, str, Sequence[float | None]]]:
    def worst(some: list[dict[str, Any]], model: str) -> float:
        sides = ("reflectance", "transmittance")
        return max(abs(found - slab[side]) for slab in some for found, side in zip(slab[model], sides, strict=True))

    for anisotropy, text in ((0.0, "0"), (0.5, "0.5"), (0.9, "0.9")):
        for ior, name in ((1.0, "none"), (1.5, "1.5")):
            some = [slab for slab in REPORT["slabs"] if (slab["anisotropy"], slab["ior"]) == (anisotropy, ior)]
            bright = [slab for slab in some if slab["albedo"] >= 0.9]
            deep = [slab for slab in bright if slab["depth"] >= 4]
            reduced = [slab for slab in bright if slab["depth"] * (1 - slab["albedo"] * anisotropy) >= 4]
            values = [worst(of, "diffusion") for of in (some, deep, reduced)]
            values += [worst(of, "layer") for of in (some, deep)]
            # Without an interface the planner takes fog for thin ones, which pictures alone tell.
            planned = [] if name == "none" else [worst(some, "diffusion")]
            title = f"{text}, {name}"
            yield title, cells("anisotropy, index of refraction", title), [*values, *planned]


def prose() -> Iterator[tuple[str, str, Sequence[float | None]]]:
    def between(text: str, start: str, end: str) -> str:
        return text.split(start)[1].split(end)[0]

    def errors(cases: Sequence[str], what: str, group: str, key: str) -> list[float]:
        found = [one[group][key] for case in cases if (one := row(case, what))]
        return [min(found), max(found)]

    scenes, paths = list(SCATTERING), [f"PathTraced, {n} paths" for n in (2, 4, 16)]
    alone = [case for case in scenes if case not in ("wax block", "lantern")]
    everywhere = "Diffusion, resolution 32"
    yield "README, bodies", between(README, "It costs ", " times a depth-only"), ratios(THIN, "SignedDepth")
    yield (
        "README, layers",
        between(README, "bodies of few layers, up to ", " times where 24"),
        [ratio("shells", "SignedDepth")],
    )
    layer = errors(scenes, "ScatteringLayer", "light", "nrmse")
    yield "README, layer", between(README, "a layer without sideways light is ", ". In clouds"), layer
    yield (
        "README, diffusion",
        between(README, "camera moves: ", " from the truth"),
        errors(scenes, everywhere, "light", "nrmse"),
    )
    lists = between(PROSE, "`KBuffer(8)` takes ", " times the floor on these")
    yield "KBuffer", lists, ratios(list(MESHES), "KBuffer, k = 8")
    peeled = [ratio(case, "DepthPeeling, all layers") for case in MESHES]
    yield "peeling", between(PROSE, "`DepthPeeling` ", " for the two layers of"), peeled[:1]
    yield "peeling", between(PROSE, "layers of the sphere, ", " for the four"), peeled[1:2]
    yield "peeling", between(PROSE, "for the four of the torus and ", " for the twelve"), peeled[2:]
    frames = ratios(alone, everywhere)
    yield "diffusion", between(PROSE, "A frame takes ", " times a depth-only pass, the same"), frames
    gathered = [ratio("wax block", everywhere), ratio("lantern", everywhere)]
    yield "gathering", between(PROSE, "on the block and the hollow ball, ", " times. `PathTraced`"), gathered
    text = re.sub(r"with \d+( paths)?", "", between(PROSE, "times. `PathTraced` takes ", ", which is"))
    yield "paths", text, [value for what in paths for value in ratios(scenes, what)]
    beside = [ratio(case, paths[2]) / ratio(case, everywhere) for case in scenes]
    yield "paths, diffusion", between(PROSE, "which is ", " times the frame of"), [min(beside[:5]), max(beside[:5])]
    yield "paths, gathering", between(PROSE, "frame of `Diffusion()`, or ", " times where that"), sorted(beside[5:])
    for n, words in (
        (16, ("a mesh takes ", " seconds at 16")),
        (32, ("at 16, ", " at 32")),
        (48, ("at 32, and ", " at 48")),
    ):
        yield (
            f"solve, {n}",
            between(PROSE, *words),
            errors(scenes, f"Diffusion, resolution {n}", "light", "solve_seconds"),
        )
    glass = [case for case in INTERFACES if row(case, paths[2])]
    told = between(PROSE, "one sample of a pixel are ", " times. So it is noise")
    tree = "depth=12, forks=2"
    values = [errors(glass, what, "radiance", "rms") + ratios(glass, what) for what in (paths[2], tree)]
    yield "paths, interfaces", told, [value for some in values for value in some]


@pytest.mark.parametrize("claims", [signed_depth, methods, scattering, interfaces, slabs, prose])
def test_figures_are_those_of_the_report(
    claims: Callable[[], Iterator[tuple[str, str, Sequence[float | None]]]],
) -> None:
    wrong = [line for where, text, values in claims() for line in differences(where, text, values)]
    assert not wrong, "\n".join(wrong)
