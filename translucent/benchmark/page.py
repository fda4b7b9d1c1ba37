"""Page of results: one self-contained .html file, and the same numbers as text."""

from __future__ import annotations

import base64
import io
import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from translucent.arrays import Array
from translucent.bench.figures import page_templates
from translucent.benchmark.results import FLOOR, Results, SceneResult, picture_path, read_picture
from translucent.benchmark.scenes import FEATURES, SCENES, BenchmarkScene, promise_kept
from translucent.benchmark.truth import AGREEING, TruthPicture, read_records, stored_truth_of, truth_path
from translucent.errors import InputError
from translucent.extras import install_command, require_package
from translucent.files.paths import require_output, write_text_atomically
from translucent.formulas.color import linear_to_srgb

if TYPE_CHECKING:
    from jinja2 import Environment

#: Size of drawings in CSS pixels, and their margins.
WIDTH, HEIGHT, LEFT, BELOW = 460, 250, 56, 34

#: Error that a heat map shows at its end, as a fraction of the truth's mean.
HOTTEST = 0.5

#: Name of the results whose promises the page judges, and with whose time others are compared.
OURS = "translucent"

#: Why a renderer misses the truth of a scene by its design.
EXPLAINED = {
    ("thin-plate", "Blender EEVEE"): "the plate is thinner than the cells of its volumes, and each sample sees a whole "
    "cell or none",
}

#: Colors of renderers in drawings (Okabe and Ito 2008).
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#8c6bb1", "#6b6b6b", "#a6761d")


# --- text ------------------------------------------------------------------------------------------------------------


def table_of(results: Results) -> str:
    """Results as text: a line for each scene, and what is wrong with the pictures."""
    lines = [f"{results.name} {results.version}".strip()]
    if results.settings:
        lines.append(results.settings)
    lines.append(
        f"{'scene':<16}{'nRMSE':>8}{'4x4':>8}{'bias r':>8}{'g':>7}{'b':>7}{'FLIP':>7}{'visible':>9}"
        f"{'thickness p99':>15}{'seconds':>9}{'/ floor':>9}"
    )
    for name, one in results.scenes.items():
        lines.append(f"{name:<16}{_line(one)}")
    if any(one.score is not None and math.isnan(one.score.flip) for one in results.scenes.values()):
        lines.append(f"FLIP is not measured: {install_command('benchmark')}")
    for said in results.suspicions:
        lines.append(f"warning: most pictures look wrong: {said}")
    return "\n".join(lines)


def _line(one: SceneResult) -> str:
    if one.score is None:
        return "  " + (
            f"not supported: {one.lacking}" if one.lacking else one.failure or "no picture, or no true picture"
        )
    score = one.score
    thick = "" if score.thickness is None else f"{score.thickness.p99:.1e}"
    numbers = f"{score.nrmse:8.4f}{score.block:8.4f}{score.bias[0]:+8.3f}{score.bias[1]:+7.3f}{score.bias[2]:+7.3f}"
    times = "" if one.seconds is None else f"{one.seconds:9.3f}{_ratio(one):>9}"
    said = f"  <- {score.suspicions[0]}" if score.suspicions else ""
    text = f"{numbers}{score.flip:7.3f}{score.visible:9.1%}{thick:>15}{times}{said}"
    return text.replace("+nan", "   -").replace("nan%", "   -").replace("nan", "  -")


def _ratio(one: SceneResult) -> str:
    return f"{one.seconds / one.floor:.3g}" if one.seconds and one.floor else "-"


# --- page ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class PageRow:
    """A renderer's line in the table of a scene."""

    number: int
    name: str
    color: str
    result: SceneResult
    frontier: bool
    picture: str = ""
    error: str = ""

    @property
    def nrmse(self) -> float:
        """Error of the picture; infinite if the renderer computes only thickness."""
        found = math.nan if self.result.score is None else self.result.score.nrmse
        return found if math.isfinite(found) else math.inf

    @property
    def ratio(self) -> float | None:
        """Render time divided by the floor's."""
        one = self.result
        return one.seconds / one.floor if one.seconds and one.floor else None


@dataclass(frozen=True)
class ScenePart:
    """Section of one scene: truth, renderers by increasing error, renderers that cannot draw it, and a plot."""

    scene: BenchmarkScene
    truth: str
    noise: float
    agreements: Sequence[str]
    rows: Sequence[PageRow]
    others: Sequence[tuple[str, str]]
    plot: str

    @property
    def ours(self) -> PageRow | None:
        """Row of this toolkit with default settings."""
        return next((row for row in self.rows if row.name == OURS and row.result.score is not None), None)

    @property
    def promise(self) -> str:
        """Table cell with the error that this toolkit promises, and whether it holds; empty in other rows."""
        row = self.ours
        return "" if row is None or row.result.score is None else promise_kept(self.scene, row.result.score.block)

    @property
    def nearer(self) -> list[str]:
        """Names of other renderers that are nearer to the truth than this toolkit in no more time."""
        row = self.ours
        if row is None or row.ratio is None:
            return []
        others = (one for one in self.rows if not one.name.startswith(OURS))
        return [one.name for one in others if one.ratio and one.ratio <= row.ratio and one.nrmse < row.nrmse]


def write_benchmark_page(results: Sequence[Results], path: Path) -> None:
    """Write the page of results, which must have scores.

    Raises
    ------
    InputError
        If there are no results, or the path cannot be written to.
    RenderError
        If jinja2 is not installed.
    """
    require_output(path, f"page {str(path)!r}")
    if not any(one.score for each in results for one in each.scenes.values()):
        raise InputError(f"page {str(path)!r}", "no scene has a score", "score pictures first")
    parts = [_scene_part(scene, results) for scene in SCENES if truth_path(scene.name).is_file()]
    shown = [part for part in parts if part.rows]
    # The median of few scenes says little: renderers of more scenes stand first.
    done = [sum(each.score is not None for each in one.scenes.values()) for one in results]
    order = sorted(range(len(results)), key=lambda i: (-done[i], _place(i, shown), results[i].name))
    text = _templates().get_template("page.html.j2").render(
        results=[(i, results[i], COLORS[i % len(COLORS)], _place(i, shown), _times(i, shown)) for i in order],
        parts=parts,
        floor=FLOOR,
        features=FEATURES,
        overview=_overview(results, shown),
        hottest=HOTTEST,
    )  # fmt: skip
    write_text_atomically(path, text)


@cache
def _templates() -> Environment:
    found = page_templates("translucent.benchmark")
    found.filters["percent"] = lambda value: "-" if _no(value) else f"{100 * value:.1f} %"
    found.filters["signed"] = lambda value: "-" if _no(value) else f"{100 * value:+.1f}"
    found.filters["plain"] = lambda value: "-" if _no(value) else f"{value:.3g}"
    found.filters["small"] = lambda value: "-" if _no(value) else f"{value:.1e}"
    return found


def _no(value: float | None) -> bool:
    return value is None or not math.isfinite(value)


def _place(number: int, parts: Sequence[ScenePart]) -> float:
    """Median nRMSE of a renderer over the scenes that it did; a very large one if it did none."""
    found = [row.nrmse for part in parts for row in part.rows if row.number == number]
    known = [value for value in found if math.isfinite(value)]
    return statistics.median(known) if known else 1e9


def _times(number: int, parts: Sequence[ScenePart]) -> float | None:
    """Median time of a renderer, divided by the floor's."""
    found = [row.ratio for part in parts for row in part.rows if row.number == number and row.ratio]
    return statistics.median(found) if found else None


def _scene_part(scene: BenchmarkScene, results: Sequence[Results]) -> ScenePart:
    truth = stored_truth_of(scene)
    white = max(1.0, float(np.quantile(truth.radiance, 0.99)))
    record = read_records().get(scene.name)
    rows, others = [], []
    for number, one in enumerate(results):
        result = one.scenes.get(scene.name)
        if result is None:
            continue
        if result.score is None:
            others.append((one.name, f"not supported: {result.lacking}" if result.lacking else result.failure))
            continue
        picture = error = ""
        if one.folder is not None and picture_path(one.folder, scene.name) is not None:
            try:
                radiance = read_picture(one.folder, scene)
            except InputError:
                radiance = None
            if radiance is not None:
                picture, error = _shown(radiance / white), _heat(radiance, truth)
        rows.append(PageRow(number, one.name, COLORS[number % len(COLORS)], result, False, picture, error))
    rows.sort(key=lambda row: row.nrmse)
    best = math.inf
    marked = []
    for row in sorted(rows, key=lambda row: (row.ratio or math.inf, row.nrmse)):
        error_of = row.nrmse
        if row.ratio and error_of < best:
            best = error_of
            marked.append(row.number)
    rows = [PageRow(**{**row.__dict__, "frontier": row.number in marked}) for row in rows]
    said = []
    for judge in record.agreements if record else ():
        if not judge.paths:
            said.append(f"{judge.renderer}: not compared ({judge.explained})")
            continue
        text = f"{judge.renderer}: {judge.within:.1%} of the pixels within 4 standard errors, mean {judge.bias:+.2%}"
        text = f"{text}, noise of {judge.noise:.1%}"
        why = judge.explained or ("" if judge.within >= AGREEING else "not explained")
        said.append(f"{text}; {why}" if why else text)
    said += [f"{row.name}: {EXPLAINED[scene.name, row.name]}" for row in rows if (scene.name, row.name) in EXPLAINED]
    plot = _plot([(row.ratio, row.nrmse, row.color, row.name) for row in rows])
    return ScenePart(scene, _shown(truth.radiance / white), truth.noise, said, rows, others, plot)


def _overview(results: Sequence[Results], parts: Sequence[ScenePart]) -> str:
    points = [
        (_times(i, parts), _place(i, parts), COLORS[i % len(COLORS)], one.name)
        for i, one in enumerate(results)
        if _place(i, parts) < 1e9
    ]
    return _plot(points)


def _shown(linear: Array) -> str:
    """Data URI of a picture of linear values, white at 1."""
    return _uri(np.round(255 * linear_to_srgb(np.clip(linear, 0.0, 1.0))).astype(np.uint8))


def _heat(radiance: Array, truth: TruthPicture) -> str:
    """Data URI of the signed error: red too bright, blue too dark, white right."""
    right = truth.radiance
    off = (radiance - right).mean(axis=-1) / max(float(right[truth.mask].mean()), 1e-12) / HOTTEST
    off = np.sign(off) * np.sqrt(np.clip(np.abs(off), 0.0, 1.0))
    pale = 1.0 - np.abs(off)
    heat = np.stack([np.where(off > 0, 1.0, pale), pale, np.where(off < 0, 1.0, pale)], axis=-1)
    return _uri(np.round(255 * np.where(truth.mask[..., None], heat, 0.93)).astype(np.uint8))


def _uri(pixels: Any) -> str:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, format="WEBP", quality=88, method=4)
    return "data:image/webp;base64," + base64.b64encode(stream.getvalue()).decode("ascii")


def _plot(points: Sequence[tuple[float | None, float, str, str]]) -> str:
    """SVG of error against time, both logarithmic, with the frontier; empty without a time. Texts are escaped."""
    escape = require_package("markupsafe", "the page").escape
    known = [(x, max(y, 1e-4), color, name) for x, y, color, name in points if x and math.isfinite(y)]
    if not known:
        return ""
    xs, ys = [math.log10(x) for x, *_ in known], [math.log10(y) for _, y, *_ in known]
    x0, x1, y0, y1 = math.floor(min(xs)), math.ceil(max(xs) + 0.01), math.floor(min(ys)), math.ceil(max(ys) + 0.01)

    def at(x: float, y: float) -> tuple[float, float]:
        across = LEFT + (WIDTH - LEFT - 24) * (x - x0) / (x1 - x0)
        return across, 10 + (HEIGHT - BELOW - 10) * (y1 - y) / (y1 - y0)

    out = [f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="error against time">']
    for power in range(x0, x1 + 1):
        a, _ = at(power, y0)
        out.append(f'<line x1="{a:.1f}" y1="10" x2="{a:.1f}" y2="{HEIGHT - BELOW}" class="grid"/>')
        out.append(f'<text x="{a:.1f}" y="{HEIGHT - BELOW + 14}" text-anchor="middle">{10.0**power:g}</text>')
    for power in range(y0, y1 + 1):
        _, b = at(x0, power)
        out.append(f'<line x1="{LEFT}" y1="{b:.1f}" x2="{WIDTH - 24}" y2="{b:.1f}" class="grid"/>')
        out.append(f'<text x="{LEFT - 5}" y="{b + 4:.1f}" text-anchor="end">{10.0**power:g}</text>')
    best, steps = math.inf, []
    for x, y in sorted(zip(xs, ys, strict=True)):
        if y < best:
            steps += [at(x, best)] if math.isfinite(best) else []
            steps.append(at(x, y))
            best = y
    line = " ".join(f"{a:.1f},{b:.1f}" for a, b in steps)
    out.append(f'<polyline points="{line}" class="frontier"/>')
    for x, y, (_, _, color, name) in zip(xs, ys, known, strict=True):
        a, b = at(x, y)
        out.append(f'<circle cx="{a:.1f}" cy="{b:.1f}" r="5" fill="{color}"><title>{escape(name)}</title></circle>')
    middle = LEFT + (WIDTH - LEFT) / 2
    out.append(f'<text x="{middle:.0f}" y="{HEIGHT - 4}" text-anchor="middle">time / floor</text>')
    up = f'x="12" y="{HEIGHT / 2:.0f}" transform="rotate(-90 12 {HEIGHT / 2:.0f})"'
    out.append(f'<text {up} text-anchor="middle">nRMSE</text>')
    return "".join([*out, "</svg>"])
