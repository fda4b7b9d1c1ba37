"""Costs of plans: the planner picks the cheapest of the exact ones."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import translucent as tl
from tests.values.plan_scenes import (
    BOX,
    COLUMNS,
    FIRE,
    GLASS,
    NO_STORAGE,
    OPEN,
    SCENES,
    TORUS,
    WINE,
    body,
    names,
    scene,
    sheet,
)
from translucent.planning.assembly import COSTS
from translucent.planning.methods import METHODS
from translucent.planning.passes import Note, NoteKind, PassName, PassSpec
from translucent.planning.plan import plan
from translucent.planning.render_plan import RenderPlan

#: Of passes that methods have, and of those that any plan has.
TIMES = {
    **{name.replace("-", "_"): method.cost for name, method in METHODS.items()},
    "signed_depth_spectral": tl.SignedDepth.spectral_cost,
    **COSTS,
}


@pytest.mark.parametrize(
    ("kind", "method", "steps"),
    [
        ("convex", None, ["signed_depth"]),
        ("media", None, ["signed_depth_spectral"]),
        ("sheets", None, ["thin_layer"]),
        ("opaque", None, ["opaque", "signed_depth"]),
        ("convex", tl.BackFaceDepth(), ["back_face_depth"]),
        ("open and closed", None, ["signed_depth", "thin_layer", "signed_depth"]),
        ("open and closed", tl.FragmentLists(), ["thin_layer", "signed_depth_spectral", "fragment_lists"]),
        ("convex", tl.KBuffer(), ["k_buffer"]),
        ("union", None, ["fragment_lists"]),
        ("everything", None, ["opaque", "thin_layer", "thin_layer", "signed_depth_spectral", "fragment_lists"]),
    ],
)
def test_a_plan_costs_what_its_passes_cost(kind: str, method: Any, steps: list[str]) -> None:
    found = plan(SCENES[kind], method)
    assert [step.cost for step in found.passes] == [TIMES[name] for name in (*steps, "resolve")]
    assert found.cost == pytest.approx(sum(TIMES[name] for name in (*steps, "resolve")), rel=1e-12)


def test_spectral_fallbacks_cost_more() -> None:
    one, two = (plan(scene(body(mesh=OPEN), body(), body(medium))) for medium in (GLASS, WINE))
    assert one.passes[2].name == two.passes[2].name == "signed_depth_fallback"
    assert (one.passes[2].cost, two.passes[2].cost) == (tl.SignedDepth.cost, tl.SignedDepth.spectral_cost)


@pytest.mark.parametrize(
    ("objects", "method", "draws"),
    [
        ([body()], tl.DepthPeeling(), 1),
        ([body()], tl.DepthPeeling(order="front-to-back"), 2),
        ([body()], tl.DepthPeeling(order="back-to-front"), 2),
        ([body(), body(), body()], tl.DepthPeeling(), 3),
        ([body(), body(), body()], tl.DepthPeeling(order="front-to-back"), 6),
        # Never more than the layers that were asked for, and then one draw that counts.
        ([body(), body(), body()], tl.DepthPeeling(4, "front-to-back"), 4 + 1),
        ([body(), body(), body()], tl.DepthPeeling(4), 2 + 1),
        ([body(), body(), body()], tl.DepthPeeling(3), 2 + 1),
        ([body(), body(), body()], tl.DepthPeeling(1), 1 + 1),
        # Neither sheets nor opaque objects are peeled.
        ([body(), sheet(), body(None)], tl.DepthPeeling(order="front-to-back"), 2),
    ],
)
def test_peeling_draws_once_for_every_layer_or_two(
    objects: list[tl.Object], method: tl.DepthPeeling, draws: int
) -> None:
    step = next(step for step in plan(scene(*objects), method).passes if step.name == "depth_peeling")
    assert (step.geometry_passes, step.cost) == (draws, draws * tl.DepthPeeling.cost)


def test_a_concave_body_is_expected_to_have_more_layers() -> None:
    def draws(mesh: tl.Mesh) -> int:
        return plan(scene(body(mesh=mesh)), tl.DepthPeeling()).geometry_passes

    assert draws(TORUS) > draws(BOX)
    assert draws(OPEN) > draws(BOX)


@pytest.mark.parametrize(("objects", "draws"), [([body(FIRE), body(WINE)], 2), ([body(FIRE), body(WINE), body()], 3)])
def test_the_cheaper_of_the_ordered_methods_is_chosen(
    objects: list[tl.Object], draws: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    for cost, name in ((draws - 0.01, "fragment_lists"), (draws + 0.01, "depth_peeling")):
        monkeypatch.setattr(tl.FragmentLists, "cost", cost * tl.DepthPeeling.cost)
        assert names(plan(scene(*objects))) == [name, "transmittance"]


def test_a_method_that_leaves_surfaces_out_is_never_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tl.KBuffer, "cost", 0.01)
    for given_scene in SCENES.values():
        assert not isinstance(plan(given_scene).method, tl.KBuffer)


def test_methods_by_their_costs_where_all_are_exact() -> None:
    costs = [plan(SCENES["convex"], method).cost for method in (tl.SignedDepth(), tl.BackFaceDepth())]
    costs += [plan(SCENES["convex"], method).cost for method in (tl.FragmentLists(), tl.DepthPeeling())]
    assert costs == sorted(costs)
    assert plan(SCENES["convex"]).cost == costs[0]


ITEMS = {
    "body": body(),
    "apart": body(x=3),
    "wine": body(WINE, x=0.5),
    "fire": body(FIRE),
    "torus": body(mesh=TORUS),
    "open": body(mesh=OPEN),
    "sheet": sheet(),
    "emitting sheet": sheet(FIRE),
    "rock": body(None, x=1),
}


def planned(kinds: list[str], overlap: Any, method: Any = None, capabilities: Any = None) -> RenderPlan | None:
    """The plan; None where the planner refuses the scene."""
    try:
        return plan(scene(*(ITEMS[kind] for kind in kinds), overlap=overlap), method, capabilities)
    except tl.InputError:
        return None


any_scene = st.lists(st.sampled_from(sorted(ITEMS)), min_size=1, max_size=5)
any_overlap = st.sampled_from(["add", "union"])
any_method = st.sampled_from([*COLUMNS, tl.DepthPeeling(), tl.FragmentLists(), tl.KBuffer()])
any_machine = st.sampled_from([None, NO_STORAGE])


@given(any_scene, st.sampled_from(sorted(ITEMS)), any_overlap, any_method, any_machine)
def test_nothing_that_is_added_makes_a_plan_cheaper(
    kinds: list[str], more: str, overlap: Any, method: Any, machine: Any
) -> None:
    before, after = planned(kinds, overlap, method, machine), planned([*kinds, more], overlap, method, machine)
    if before is not None and after is not None:
        assert after.cost >= before.cost - 1e-9
        assert after.geometry_passes >= before.geometry_passes
        assert len(after.limits) >= len(before.limits)


@pytest.mark.parametrize(
    ("kinds", "more"),
    [
        (["body"], "wine"),
        (["body"], "sheet"),
        (["body"], "rock"),
        (["body"], "open"),
        (["body"], "fire"),
        (["body", "open"], "wine"),
        (["fire"], "wine"),
        (["sheet"], "body"),
    ],
)
def test_what_needs_more_work_costs_more(kinds: list[str], more: str) -> None:
    before, after = planned(kinds, "add"), planned([*kinds, more], "add")
    assert before is not None
    assert after is not None
    assert after.cost > before.cost


@given(any_scene, any_overlap, any_method, any_machine)
def test_every_plan_draws_everything_and_says_why(kinds: list[str], overlap: Any, method: Any, machine: Any) -> None:
    found = planned(kinds, overlap, method, machine)
    if found is None:
        return
    drawn = [i for step in found.passes if step.target == "accumulated" for i in step.objects]
    assert sorted(drawn) == list(range(len(kinds)))
    assert found.cost == pytest.approx(sum(step.cost for step in found.passes), rel=1e-12)
    assert found.geometry_passes == sum(step.geometry_passes for step in found.passes)
    assert len(set(names(found))) == len(found.passes)
    for step in found.passes:
        assert step.reason
        assert step.cost > 0
        assert bool(step.objects) == (step.geometry_passes > 0) == (step.name != "transmittance")
    json.dumps(found.summary())
    # What the planner picks is no dearer than any other method that is exact here.
    picked = planned(kinds, overlap, None, machine)
    if found.exact and picked is not None and picked.exact:
        assert picked.cost <= found.cost + 1e-9


def test_the_cost_of_a_plan_is_the_sum_of_its_passes() -> None:
    passes = (
        PassSpec(PassName.OPAQUE, "first", (0,), 2, cost=1.25),
        PassSpec(PassName.K_BUFFER, "second", (0, 1), 3, cost=2.5),
    )
    found = RenderPlan(scene(body()), tl.SignedDepth(), passes)
    assert (found.cost, found.geometry_passes) == (3.75, 5)
    assert found.exact
    assert not RenderPlan(scene(body()), tl.SignedDepth(), passes, limits=(Note(NoteKind.OPEN_MESH, "a hole"),)).exact
    assert RenderPlan(scene(body()), tl.SignedDepth(), passes, unmodelled=(Note(NoteKind.SHADOWS, "shadows"),)).exact
