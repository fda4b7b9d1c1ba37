"""Cases and contenders are really drawn; what fails is a row, and the rest goes on. No time is judged here."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, NoReturn, get_args

import moderngl
import numpy as np
import pytest

import translucent as tl
from tests.bench.conftest import HASTE
from tests.bench.measuring import case_of, measured
from tests.bench.provenance import PROVENANCE
from translucent.bench import run as running
from translucent.bench.cases import CASES, Case
from translucent.bench.contenders import CONTENDERS, Contender, Effect, check_names, contenders
from translucent.bench.drawing import BenchContext, FloorDrawing
from translucent.bench.experiment import Experiment, Whole
from translucent.bench.methods import CostScaling, MethodComparison, ScalingStep
from translucent.bench.output import read_report, table, write_report
from translucent.bench.record import HardCase, Part, Report, ShadowCase
from translucent.bench.run import ReportRequest, measure_all
from translucent.bench.shapes import lying_torus, menger_sponge, nested_shells, plates
from translucent.bench.truth import CaseTruth
from translucent.geometry.solids import Box, Sphere
from translucent.gpu.passes.opaque import OpaquePass
from translucent.gpu.passes.shortcuts import DepthOnlyPass
from translucent.gpu.passes.thickness import SignedDepthPass
from translucent.gpu.targets import Storage, Targets
from translucent.planning.passes import PassName


def test_rows_have_times_errors_and_pictures(bench: BenchContext) -> None:
    made = measured(bench, case_of(lying_torus(48)), "signed-depth", "DepthPeeling", "constant thickness")
    rows = {row.method: row for row in made.rows}
    assert made.failure is None
    assert next(iter(rows)) == "depth only"
    assert not [row.failure or row.refusal for row in made.rows if row.failure or row.refusal]
    signed, constant = rows["SignedDepth"], rows["constant thickness"]
    assert signed.exact
    assert signed.wall is not None
    assert signed.gpu is not None
    assert signed.frame is not None
    assert signed.frame.median > 0
    assert signed.wall.median > 0
    assert signed.thickness is not None
    assert constant.thickness is not None
    assert signed.thickness.p999 <= 1e-5
    assert constant.thickness.rms > 1000 * signed.thickness.rms
    assert rows["SignedDepth in float16"].thickness.rms > 1000 * signed.thickness.rms  # type: ignore[union-attr]
    peeled = rows["DepthPeeling, all layers"]
    assert peeled.layers >= 4  # type: ignore[operator]
    assert peeled.passes == -(-peeled.layers // 2)  # type: ignore[operator]
    assert peeled.ms_per_layer == pytest.approx(peeled.wall.median / peeled.layers)  # type: ignore[union-attr,operator]
    assert rows["DepthPeeling, 2 layers"].invalid > 0.01  # type: ignore[operator]
    assert rows["DepthPeeling, 2 layers"].bytes_per_pixel > signed.bytes_per_pixel  # type: ignore[operator]
    assert made.pictures[0].method == "reference"
    shown = {picture.method: picture for picture in made.pictures}
    error = shown["constant thickness"].error
    assert error is not None
    # The picture's error is that of the row, silhouettes aside.
    assert np.nanstd(error.array()) == pytest.approx(constant.thickness.rms, rel=0.2)


def test_programs_are_compiled_once_for_all_scenes_and_for_the_renderer(
    bench: BenchContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = ("SignedDepth", "constant thickness", "sphere assumption", "BackFaceDepth")
    measured(bench, case_of(lying_torus(24)), *names)

    def compiled(*_: object, **__: object) -> NoReturn:
        raise AssertionError("a program that there is")

    monkeypatch.setattr(moderngl.Context, "program", compiled)
    again = measured(bench, case_of(lying_torus(20)), *names)
    assert len(again.rows) >= 8
    assert not [row.failure for row in again.rows if row.failure]
    assert bench.step(PassName.SIGNED_DEPTH) is bench.renderer.gpu.step(SignedDepthPass), "one for both"


@pytest.fixture
def staged() -> tl.Scene:
    """A ball behind a bar, on a stand that is much larger."""
    ball = tl.Object(Sphere().tessellate(32), tl.Medium(absorption=(1.0, 2.0, 3.0)))
    bar = tl.Object(Box((-0.1, -3.0, 2.0), (0.1, 3.0, 2.2)).tessellate())
    stand = tl.Object(Box((-9.0, -3.0, -9.0), (9.0, -2.0, 9.0)).tessellate())
    return tl.Scene([bar, ball, stand], tl.Camera.look_at((0.0, 0.0, 8.0), (0.0, 0.0, 0.0), fov_y=30.0))


def test_staging_is_in_the_floor_as_in_every_cost(
    bench: BenchContext, staged: tl.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[tuple[str, tuple[int, ...]]] = []
    run = OpaquePass.run
    monkeypatch.setattr(DepthOnlyPass, "run", lambda _, __, objects: drawn.append(("depth", objects)))
    monkeypatch.setattr(
        OpaquePass, "run", lambda self, job, spec: (drawn.append(("opaque", spec.objects)), run(self, job, spec))
    )
    targets = Targets(bench.gl, (16, 16))
    floor = FloorDrawing(bench, staged, targets)
    floor.draw()
    floor.release()
    assert drawn == [("opaque", (0, 2)), ("depth", (1,))]
    drawn.clear()
    bare = FloorDrawing(bench, dataclasses.replace(staged, objects=staged.bodies), targets)
    bare.draw()
    bare.release()
    targets.release()
    assert drawn == [("depth", (0,))]


def test_edges_of_opaque_objects_are_no_errors_of_a_method(bench: BenchContext, staged: tl.Scene) -> None:
    """A rasterizer decides there which of two opaque objects ends a ray, which is not about thickness."""
    inside = [Box((-0.2, -3.0, 0.2), (0.2, 3.0, 0.3)), Box((-3.0, -3.0, -0.4), (3.0, 3.0, -0.3))]
    ends = [tl.Object(box.tessellate(), color=(0.9, 0.1, 0.1)) for box in inside]
    scene = dataclasses.replace(staged, objects=[*staged.bodies, *ends])
    truth = CaseTruth.of(scene, (64, 64), 1e-3)
    assert truth.diagonal == pytest.approx(np.linalg.norm([2.0, 2.0, 2.0]), rel=1e-2), "of the ball alone"
    depth, kept = truth.frame.thickness[32], truth.inside[32]
    (edges,) = np.nonzero((np.abs(np.diff(depth)) > 0.4) & truth.frame.coverage[32, 1:] & truth.frame.coverage[32, :-1])
    assert len(edges) == 2, "left and right of the bar, where rays end half a radius earlier"
    assert not kept[[edges, edges + 1]].any()
    assert truth.compared.sum() > 300
    made = measured(bench, Case("mine", "Mine", "mine", lambda _: scene), "signed-depth")
    signed = next(row for row in made.rows if row.method == "SignedDepth")
    assert signed.thickness is not None
    assert signed.thickness.p999 < 1e-5


def test_shortcuts_get_the_best_thickness_that_there_is(bench: BenchContext) -> None:
    """A ball is what the sphere assumption assumes; and the mean is the best constant."""
    made = measured(bench, case_of(Sphere().tessellate(96)), "sphere assumption", "constant thickness", size=(96, 96))
    rows = {row.method: row for row in made.rows}
    assert float(rows["sphere assumption"].parameters.split()[0]) == pytest.approx(2.0, rel=2e-3)
    assert rows["sphere assumption"].thickness.rms < 0.01  # type: ignore[union-attr]
    constant = rows["constant thickness"]
    assert constant.thickness is not None
    scene = tl.showcase(Sphere().tessellate(96), size=(96, 96), stage="none")
    truth = tl.reference.render(scene, size=(96, 96))
    best = truth.thickness[truth.coverage].mean()
    assert float(constant.parameters.split()[0]) == pytest.approx(best, rel=0.01)
    assert "least squared error" in constant.parameters


def test_back_face_depth_without_its_mask_is_wrong_where_there_is_a_gap(bench: BenchContext) -> None:
    made = measured(bench, case_of(lying_torus(48)), "back-face-depth")
    rows = {row.method: row for row in made.rows}
    honest, silent = rows["BackFaceDepth"], rows["BackFaceDepth, unmarked"]
    assert honest.invalid > 0.01  # type: ignore[operator]
    assert silent.invalid == 0
    assert silent.thickness.rms > 1e3 * honest.thickness.rms  # type: ignore[union-attr]


def test_a_refusal_is_an_answer_and_not_a_failure(bench: BenchContext) -> None:
    case = next(case for case in CASES if case.name == "two emitters")
    made = measured(bench, case, "SignedDepth", "FragmentLists", size=(48, 48))
    rows = {row.method: row for row in made.rows}
    assert "emission among several media" in str(rows["SignedDepth"].refusal)
    assert rows["FragmentLists"].radiance is not None
    assert Report(running.provenance(bench.renderer, "test", quick=True), (made,)).failures == ()


def test_what_fails_in_the_middle_is_a_row(bench: BenchContext) -> None:
    def failing(*_: object) -> NoReturn:
        raise MemoryError("no room for\nthe frame")

    chosen = Contender(name="broken", family="", shortcut=failing), Contender(name="SignedDepth", family="")
    case = case_of(Sphere().tessellate(32))
    rows = {row.method: row for row in MethodComparison((case,), chosen=chosen).measure(bench, case).rows}
    assert rows["broken"].failure == "MemoryError: no room for the frame"
    assert rows["SignedDepth"].ratio is not None


def test_a_model_without_a_pixel_to_trust_fails(bench: BenchContext) -> None:
    wall = tl.Mesh(np.array([(-1, -1, 0), (1, -1, 0), (0, 1, 0)], float), np.array([(0, 1, 2)], np.int32), name="wall")
    made = measured(bench, case_of(wall), "SignedDepth")
    assert "no pixel of the reference can be trusted; 'wall'" in str(made.failure)
    assert made.rows == ()


def test_density_is_marched_without_a_gpu(bench: BenchContext) -> None:
    case = next(case for case in CASES if case.name == "density")
    with tl.Renderer("cpu") as cpu:
        bench.cpu = cpu
        names = ("RayMarched on the CPU, 8 steps", "RayMarched on the CPU, 64 steps", "cpu backend")
        made = measured(bench, case, *names, size=(48, 48))
    rows = {row.method: row for row in made.rows}
    coarse, fine = rows["RayMarched on the CPU, 8 steps"], rows["RayMarched on the CPU, 64 steps"]
    assert coarse.radiance.rms > 20 * fine.radiance.rms  # type: ignore[union-attr]  # second order: 64 times
    assert rows["cpu backend"].radiance.rms < 1e-6  # type: ignore[union-attr]


class Told(Experiment[Whole]):
    """An experiment whose record is known beforehand."""

    shown = (Whole("one"),)
    label = ""

    def __init__(self, part: Part, into: str, record: Any) -> None:
        self.part, self.into, self.known = part, into, record  # type: ignore[misc]

    def measure(self, bench: BenchContext, scene: Whole) -> Any:
        return self.known


def small(monkeypatch: pytest.MonkeyPatch, *cases: Case, more: tuple[Told, ...] = ()) -> None:
    """A report of these cases, and of what is known."""

    def few(quick: bool, extra: Sequence[Case] = (), methods: Sequence[str] = ()) -> tuple[Experiment[Any], ...]:
        return MethodComparison((*extra, *cases), methods, quick), *more

    monkeypatch.setattr(running, "experiments", few)


def test_a_case_that_fails_leaves_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    def scene(size: object) -> tl.Scene:
        raise OSError("the file is gone")

    bad = dataclasses.replace(case_of(Sphere().tessellate(24)), name="bad", scene=scene)
    small(monkeypatch, bad, case_of(Sphere().tessellate(24)))
    report = measure_all(ReportRequest(size=(48, 48), methods=["signed-depth"], effort=HASTE, quick=True))
    assert report.complete
    assert report.failures == ("bad: OSError: the file is gone",)
    assert report.cases[1].rows[1].method == "SignedDepth"
    text = table(report)
    assert "failed: OSError: the file is gone" in text
    assert "SignedDepth in float16" in text


def test_an_interruption_leaves_what_is_done(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def scene(size: object) -> tl.Scene:
        raise KeyboardInterrupt

    last = dataclasses.replace(case_of(Sphere().tessellate(24)), name="last", scene=scene)
    small(monkeypatch, case_of(Sphere().tessellate(24)), last)
    path = tmp_path / "report.json"
    request = ReportRequest(size=(48, 48), methods=["signed-depth"], effort=HASTE)
    report = measure_all(request, keep=lambda part: write_report(part, path))
    assert not report.complete
    assert [case.name for case in report.cases] == ["mine"]
    assert read_report(path) == report


def test_parts_are_measured_anew_and_the_rest_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    ball = ShadowCase("ball", "Ball", "round")
    small(monkeypatch, case_of(Sphere().tessellate(24)), more=(Told("shadows", "shadows.cases", ball),))
    hard = HardCase("H01", "grazing", "exact", "as promised", passed=True)
    old = Report(PROVENANCE, hard_cases=(hard,), seconds=9.0, complete=True)
    new = measure_all(ReportRequest(only=["shadows"], quick=True), base=old, command="the command")
    assert (new.provenance, new.seconds, new.complete, new.hard_cases) == (PROVENANCE, 9.0, True, (hard,))
    assert new.shadows.cases == (ball,)
    assert [(one.parts, one.provenance.command) for one in new.renewals] == [(("shadows",), "the command")]
    again = measure_all(ReportRequest(only=["shadows", "hard-cases"], quick=True), base=new)
    assert [one.parts for one in again.renewals] == [("shadows", "hard-cases")], "nothing is left of the first"
    assert again.hard_cases == ()
    assert Report.from_json(again.to_json()) == again


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"methods": ["signed-dept"]}, "did you mean signed-depth"),
        ({"methods": ["xyz"]}, "use some of .*fragment-lists"),
        ({"size": (0, 4)}, "size"),
        ({"backend": "vulkan"}, "backend 'vulkan'"),
    ],
)
def test_bad_arguments_are_refused_before_any_work(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        measure_all(ReportRequest(**arguments))  # type: ignore[arg-type]


def test_the_cpu_alone_cannot_be_measured() -> None:
    with pytest.raises(tl.RenderError, match="no OpenGL"):
        measure_all(ReportRequest(backend="cpu"))


def test_methods_are_chosen_by_name_or_family() -> None:
    check_names(["SignedDepth", "depth-peeling", "DepthPeeling, 8 layers", "RayMarched, 64 steps, equiangular"])
    found = contenders("absorption", quick=True, only=["depth-peeling-4-layers", "thin_layer"])
    assert [one.name for one in found] == ["ThinLayer", "ThinLayer, refracted", "DepthPeeling, 4 layers"]
    assert {one.name for one in contenders("scattering", quick=True)} < {
        one.name for one in contenders("scattering", quick=False)
    }


def test_all_that_is_promised_is_measured() -> None:
    names = {one.name for one in CONTENDERS}
    assert len(names) == len(CONTENDERS)
    assert {f"DepthPeeling, {n} layer{'s' * (n > 1)}" for n in (1, 2, 4, 8)} | {"DepthPeeling, all layers"} <= names
    assert {f"KBuffer, k = {k}" for k in (2, 4, 8)} | {"FragmentLists", "cpu backend", "sphere assumption"} <= names
    assert {f"RayMarched, {steps} steps" for steps in (8, 16, 32, 64, 128, 256, 512)} <= names
    quadratures = ("left", "exponential", "jittered", "equiangular", "gauss")
    assert {one.method.quadrature for one in CONTENDERS if isinstance(one.method, tl.RayMarched)} >= {*quadratures}
    assert len({case.name for case in CASES}) == len(CASES)
    assert {case.effect for case in CASES} == set(get_args(Effect))


def test_the_sponge_is_a_closed_body_of_known_volume() -> None:
    for level in (1, 2, 3):
        sponge = menger_sponge(level)
        assert sponge.diagnosis.solid
        assert sponge.volume == pytest.approx((20 / 27) ** level, rel=1e-12)


def test_shells_and_plates_have_as_many_surfaces_as_asked_for() -> None:
    shells = nested_shells(3, 24)
    camera = tl.Camera.orthographic((0.01, 0.02, 5), (0.01, 0.02, 0), height=0.1)
    assert tl.reference.hit_counts(tl.Scene([tl.Object(shells, tl.Medium())], camera), (2, 2)).max() == 12
    assert shells.diagnosis.solid
    stack = plates(10)
    assert tl.reference.hit_counts(tl.Scene([tl.Object(stack, tl.Medium())], camera), (2, 2)).min() == 10
    truth = tl.reference.render(tl.Scene([tl.Object(stack, tl.Medium(absorption=(1, 1, 1)))], camera), (2, 2))
    assert truth.thickness == pytest.approx(0.5)


def test_cost_is_measured_along_an_axis_and_limits_are_told(
    bench: BenchContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    def layers(count: int) -> tuple[tl.Scene, tuple[int, int]]:
        camera = tl.Camera.orthographic((0, 0, 2), (0, 0, 0), height=1.0)
        return tl.Scene([tl.Object(plates(count), tl.Medium(absorption=(1, 1, 1)))], camera), (16, 16)

    def gone() -> NoReturn:
        raise OSError("gone")

    monkeypatch.setattr(Storage, "largest", 1000)
    report = Report(PROVENANCE)
    experiment = CostScaling(methods={"SignedDepth": tl.SignedDepth(), "KBuffer": tl.KBuffer(k=256)})
    for x, make in {2: partial(layers, 2), 20: partial(layers, 20), 30: gone}.items():
        step = ScalingStep("layers", "16 x 16", x, make)
        report = experiment.added(report, experiment.measure(bench, step))
    found = {one.family: one.points for one in report.scaling}
    assert found.keys() == {"depth only", "SignedDepth", "KBuffer"}
    assert [point.x for point in found["SignedDepth"]] == [2, 20, 30]
    assert [point.ratio is not None for point in found["SignedDepth"]] == [True, True, False]
    assert found["depth only"][0].ratio.median == 1  # type: ignore[union-attr]
    assert "OpenGL does not have enough memory for" in str(found["KBuffer"][0].refusal)
    assert [point.failure for point in found["KBuffer"]] == [None, None, "OSError: gone"]


def test_the_axes_are_those_of_the_design(bench: BenchContext) -> None:
    def steps(quick: bool) -> dict[str, list[int]]:
        found: dict[str, list[int]] = {}
        for step in CostScaling(quick=quick).scenes(bench):
            found.setdefault(step.axis, []).append(step.x)
        return found

    full, quick = steps(False), steps(True)
    assert full.keys() == quick.keys() == {"triangles", "pixels", "layers", "media"}
    assert min(full["triangles"]) <= 1100
    assert max(full["triangles"]) >= 1_000_000
    assert {256**2, 512**2, 1024**2, 2048**2} <= set(full["pixels"])
    assert (full["layers"][-1], full["media"][0], full["media"][-1]) == (100, 1, 16)
    assert all(set(quick[axis]) < set(full[axis]) for axis in full)
