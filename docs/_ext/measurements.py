"""Tables of the published report, for the pages on methods and measurements: no figure of theirs is typed by hand."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from datetime import datetime
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from translucent.planning.methods import METHODS

if TYPE_CHECKING:
    from sphinx.application import Sphinx

Case = dict[str, Any]
Row = dict[str, Any]

#: Contenders on scenes of interfaces and of scattered light, as the tables call them.
INTERFACES = {
    "constant thickness, one interface": "constant thickness",
    "ScreenInterfaces": "screen space",
    "TracedInterfaces, depth 4, 1 fork": "traced, depth 4",
    "TracedInterfaces, depth 12, 2 forks": "traced, depth 12",
    "TracedInterfaces, depth 16, 3 forks": "traced, depth 16",
}
SCATTERING = {
    "SingleScattering": "single scattering",
    "ScatteringLayer": "flat layer",
    "Diffusion, resolution 32": "diffusion (planner)",
    "PathTraced, 16 paths": "16 random paths",
}
ENGINES = {
    "layer without inner mirrors": "layer of paint",
    "Burley's normalized diffusion": "Burley's diffusion",
    "Frostbite's translucency": "Frostbite's translucency, fitted",
    "Diffusion, resolution 32": "diffusion (planner)",
}
RESOLUTIONS = (16, 24, 32, 48)


def number(value: float | None) -> str:
    """Two digits of a number, or nothing where there is none."""
    if value is None:
        return ""
    if value == 0:
        return "0"
    if abs(value) >= 10:
        return f"{value:,.0f}"
    if abs(value) >= 0.01:
        return f"{value:.2g}"
    digits, power = f"{value:.1e}".split("e")
    return f"{digits}e{int(power)}"


def span(values: Iterable[float | None]) -> str:
    """Least and largest of some numbers."""
    some = [value for value in values if value is not None]
    if not some:
        return ""
    low, high = number(min(some)), number(max(some))
    return low if low == high else f"{low} to {high}"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """A table in Markdown."""
    return [f"| {' | '.join(row)} |" for row in (header, ["---"] * len(header), *rows)]


def find(case: Case, method: str) -> Row | None:
    """The measured row of a contender in a case."""
    return next((row for row in case["rows"] if row["method"] == method and row["ratio"]), None)


def cost(row: Row | None) -> float | None:
    """Time as a multiple of a depth-only pass."""
    return None if row is None else float(row["ratio"]["median"])


def error(row: Row | None) -> float | None:
    """RMS error of the light: of 16 samples on interfaces, freed of the truth's noise in scattered light."""
    if row is None:
        return None
    if row["light"]:
        return float(row["light"]["nrmse"])
    return float((row["sampled"] or row["radiance"])["rms"])


def thickness_cases(report: dict[str, Any]) -> list[Case]:
    """Closed scenes that only absorb."""
    return [case for case in report["cases"] if case["closed"] and case["absorption_only"]]


def interface_cases(report: dict[str, Any]) -> list[Case]:
    """Scenes on which ways of finding interfaces are compared."""
    return [case for case in report["cases"] if find(case, "ScreenInterfaces") and not case["absorption_only"]]


def scattering_cases(report: dict[str, Any]) -> list[Case]:
    """Scenes of light that is scattered many times."""
    return [case for case in report["cases"] if find(case, "ScatteringLayer")]


def signed_depth(report: dict[str, Any]) -> list[str]:
    """Cost and error of signed depth on each scene."""
    rows = []
    for case in thickness_cases(report):
        row = find(case, "SignedDepth")
        if row:
            found = row["thickness"]
            rows.append(
                [case["title"], str(case["layers"]), f"{cost(row):.2f}", number(found["median"]), number(found["p999"])]
            )
    return table(["scene", "surfaces on a ray, at most", "time", "median error", "p99.9 error"], rows)


def thickness(report: dict[str, Any]) -> list[str]:
    """Cost and error of each way to find thickness, over closed scenes."""
    cases = thickness_cases(report)
    names = dict.fromkeys(row["method"] for case in cases for row in case["rows"] if row["kind"] != "floor")
    rows = []
    for name in names:
        found = [row for case in cases if (row := find(case, name)) and row["thickness"]]
        if len(found) > 1:
            rows.append(
                [
                    name,
                    span(map(cost, found)),
                    span(row["thickness"]["rms"] for row in found),
                    f"{max(row['invalid'] for row in found):.1%}",
                ]
            )
    return table(["method", "time", "RMS error", "marked invalid, at most"], rows)


def contenders(cases: Sequence[Case], names: dict[str, str]) -> list[str]:
    """Error of some contenders, a row for each scene, and the time of each below."""
    rows = [[case["title"], *(number(error(find(case, name))) for name in names)] for case in cases]
    times = [span(cost(find(case, name)) for case in cases) for name in names]
    return table(["scene", *names.values()], [*rows, ["*time*", *times]])


def noise(report: dict[str, Any]) -> list[str]:
    """Error of one sample and of 16, and the noise of the truth."""
    planner = "TracedInterfaces, depth 12, 2 forks"
    rows = []
    for case in interface_cases(report):
        row = find(case, planner)
        if row:
            one, many = row["radiance"]["rms"], row["sampled"]["rms"]
            rows.append([case["title"], number(one), number(many), number(case["truth_spread"])])
    return table(["scene", "1 sample", "16 samples", "noise of the truth in a pixel"], rows)


def resolutions(report: dict[str, Any]) -> list[str]:
    """Error of diffusion and seconds of its solution, by resolution."""
    cases = scattering_cases(report)
    found = {n: [find(case, f"Diffusion, resolution {n}") for case in cases] for n in RESOLUTIONS}
    rows = [[case["title"], *(number(error(found[n][i])) for n in RESOLUTIONS)] for i, case in enumerate(cases)]
    seconds = [span(row["light"]["solve_seconds"] for row in found[n] if row) for n in RESOLUTIONS]
    return table(["scene", *map(str, RESOLUTIONS)], [*rows, ["*seconds to solve*", *seconds]])


def slabs(report: dict[str, Any]) -> list[str]:
    """Largest error of reflectance and transmittance of flat slabs."""

    def worst(some: Sequence[dict[str, Any]], model: str) -> float:
        sides = ("reflectance", "transmittance")
        return max(abs(found - slab[side]) for slab in some for found, side in zip(slab[model], sides, strict=True))

    rows = []
    groups: dict[tuple[float, float], list[dict[str, Any]]] = {}
    for slab in report["slabs"]:
        groups.setdefault((slab["anisotropy"], slab["ior"]), []).append(slab)
    for (anisotropy, ior), some in groups.items():
        thick = [one for one in some if one["albedo"] >= 0.9 and one["depth"] * (1 - one["albedo"] * anisotropy) >= 4]
        cells = [worst(some, "diffusion"), worst(thick, "diffusion"), worst(some, "layer")]
        rows.append([f"{anisotropy:g}", "none" if ior == 1 else f"{ior:g}", *map(number, cells)])
    header = ["anisotropy", "interface", "diffusion, all", "diffusion, bright and thick", "flat layer, all"]
    return table(header, rows)


def which(report: dict[str, Any]) -> list[str]:
    """Cost and error of what a programmer chooses between, over the scenes of the report."""
    rows = []
    for name in ("SignedDepth", "FragmentLists", "KBuffer, k = 8", "BackFaceDepth, unmarked", "constant thickness"):
        found = [row for case in thickness_cases(report) if (row := find(case, name))]
        rows.append(["thickness", name, span(map(cost, found)), span(row["thickness"]["rms"] for row in found)])
    for what, cases, names in (
        ("refraction", interface_cases(report), INTERFACES),
        ("scattering", scattering_cases(report), SCATTERING),
    ):
        for name, title in names.items():
            found = [row for case in cases if (row := find(case, name))]
            rows.append([what, title, span(map(cost, found)), span(map(error, found))])
    return table(["to find", "method", "time", "error"], rows)


def claims(report: dict[str, Any]) -> list[str]:
    """Table of the promises of a report, and whether each held."""
    words = {True: "yes", False: "no", None: "undecided"}
    rows = [[one["text"], words[one["held"]], one["measured"].split("; ")[0]] for one in report["claims"]]
    return table(["promise", "held", "measured, on one scene"], rows)


def shadow_maps(cases: Sequence[Case]) -> list[str]:
    """Errors of shadow maps by size."""
    sizes = (1024, 4096)
    rows = []
    for case in cases:
        found = {row["size"]: row for row in case["rows"] if row["kind"] == "method" and row["errors"]}
        cells = [number(found[n]["errors"][which]) if n in found else "" for n in sizes for which in ("median", "p99")]
        time = found[1024]["ratio"]["median"] if 1024 in found and found[1024]["ratio"] else None
        rows.append([case["title"], *cells, "" if time is None else f"{time:.2f}"])
    return table(["scene", "1024: median", "p99", "4096: median", "p99", "time of 1024"], rows)


def shadow_shortcuts(cases: Sequence[Case]) -> list[str]:
    """Errors of what engines do instead."""
    found: dict[str, list[float]] = {}
    for row in (row for case in cases for row in case["rows"] if row["kind"] != "method" and row["errors"]):
        found.setdefault(row["method"], []).append(row["errors"]["median"])
    rows = [[name, number(median(some)), span(some)] for name, some in found.items()]
    return table(["shortcut", "error, median of the scenes", "range"], rows)


def shadow_directions(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Errors by the number of directions of an environment."""
    counts = sorted({row["directions"] for row in rows})
    lines = []
    for name in dict.fromkeys(row["environment"] for row in rows):
        of = {row["directions"]: row["error"] for row in rows if row["environment"] == name}
        lines.append([name, *(number(of.get(count)) for count in counts)])
    return table(["environment", *map(str, counts)], lines)


def caustics(cases: Sequence[Case]) -> list[str]:
    """Errors of caustics by the number of photons."""
    rows = [
        [case["title"], f"{row['photons']:,}", f"{row['power']:+.2%}", number(row["nrmse"]), f"{row['seconds']:.1f}"]
        for case in cases
        for row in case["rows"]
    ]
    return table(["scene", "photons", "power", "RMS error", "seconds"], rows)


def caustics_in_media(cases: Sequence[Case]) -> list[str]:
    """Errors in media, with photons and without."""
    rows = []
    for case in cases:
        of = {bool(row["photons"]): row for row in case["rows"]}
        rows.append(
            [
                case["title"],
                f"{of[True]['power']:+.1%}",
                f"{case['noise']:.1%}",
                number(of[True]["nrmse"]),
                number(of[False]["nrmse"]),
            ]
        )
    return table(["scene", "mean, with photons", "error of the truth", "RMS error", "without photons"], rows)


def of_method(report: dict[str, Any], name: str) -> list[str]:
    """Cost and error of a method on each scene; of its variants, the most exact one there."""
    rows = []
    for case in report["cases"]:
        quantity = case["quantity"]
        ran = [row for row in case["rows"] if row["family"] == name and row["kind"] == "method"]
        ran = [row for row in ran if row["ratio"] and row[quantity]]
        if ran:
            row = min(ran, key=lambda row: (row[quantity]["rms"], cost(row)))
            found = row[quantity]
            cells = [number(cost(row)), number(found["rms"]), number(found["p999"]), f"{row['invalid']:.1%}"]
            rows.append([case["title"], row["method"], *cells])
    return table(["scene", "variant", "time", "RMS error", "p99.9 error", "invalid"], rows) if rows else []


def methods(report: dict[str, Any]) -> list[str]:
    """Each method with its own docstring and what has been measured of it."""
    lines: list[str] = []
    for name, method in METHODS.items():
        lines += [f"## {method.__name__}", "", f"`--method {name}`", ""]
        lines += ["```{eval-rst}", f".. autoclass:: translucent.{method.__name__}", "```", ""]
        lines += [*of_method(report, method.__name__), ""]
    return lines


def provenance(report: dict[str, Any]) -> list[str]:
    """Sentence with the source of the figures: command, version, date and machine."""
    found = report["provenance"]
    day = datetime.fromisoformat(found["started"])
    machine = f"{found['processor']}, {found['processors']} processors, {found['renderer']}"
    return [
        f"*Measured on {day.day} {day:%B %Y} by `translucent report`, version {found['versions']['translucent']}, on: "
        f"{machine}.*"
    ]


def tables(report: dict[str, Any]) -> dict[str, list[str]]:
    """Each generated file, by name."""
    shadows = report["shadows"]
    cases = [case for case in shadows["cases"] if not case["failure"]]
    return {
        "provenance": provenance(report),
        "which": which(report),
        "claims": claims(report),
        "signed_depth": signed_depth(report),
        "thickness": thickness(report),
        "interfaces": contenders(interface_cases(report), INTERFACES),
        "noise": noise(report),
        "scattering": contenders(scattering_cases(report), SCATTERING),
        "scattering_engines": contenders(scattering_cases(report), ENGINES),
        "resolutions": resolutions(report),
        "slabs": slabs(report),
        "shadow_maps": shadow_maps(cases),
        "shadow_shortcuts": shadow_shortcuts(cases),
        "shadow_directions": shadow_directions(shadows["sky"]),
        "caustics": caustics([case for case in shadows["caustics"] if case["rows"]]),
        "caustics_in_media": caustics_in_media([case for case in shadows.get("media", ()) if case["rows"]]),
        "methods": methods(report),
    }


def write_tables(app: Sphinx) -> None:
    """Write the files that pages include."""
    source = Path(app.srcdir)
    report = json.loads((source / "reports" / "software.json").read_text(encoding="utf-8"))
    folder = source / "generated"
    folder.mkdir(exist_ok=True)
    for name, lines in tables(report).items():
        (folder / f"{name}.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", write_tables)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
