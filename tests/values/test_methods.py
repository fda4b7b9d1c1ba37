"""Methods by name, and their parameters."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.values.plan_scenes import SCENES
from translucent.bench.contenders import CONTENDERS
from translucent.planning.methods import METHODS, Method, method_from_name
from translucent.planning.methods.depth_peeling import MAX_LAYERS
from translucent.planning.methods.k_buffer import MAX_K
from translucent.planning.plan import plan


@pytest.mark.parametrize("name", sorted(METHODS))
def test_a_method_has_a_name(name: str) -> None:
    for written in (name, name.upper(), name.replace("-", "_")):
        assert method_from_name(written) == METHODS[name]()


@pytest.mark.parametrize("method", METHODS.values())
def test_a_method_is_whole(method: type[Method]) -> None:
    """It has a cost, passes of its own with reasons, and a row in the report and a part of the documentation."""
    default, scene = method(), SCENES["convex"]
    found = default.passes(scene, "requested")
    assert method.cost > 0
    assert found
    assert all(step.reason and step.objects and step.cost > 0 for step in found)
    planned = plan(scene, default)
    # A plan adds what finds the hits of rays to reason and cost.
    assert {(step.name, step.objects) for step in found} <= {(step.name, step.objects) for step in planned.passes}
    assert planned.hits or set(found) <= set(planned.passes)
    assert {row.name for row in CONTENDERS if type(row.method) is method and row.kind == "method"}
    reference = (Path(__file__).parents[2] / "docs" / "methods.md").read_text(encoding="utf-8")
    assert re.search(rf"\b{method.__name__}\(", reference)


@pytest.mark.parametrize("method", METHODS.values())
def test_traits_agree_with_each_other(method: type[Method]) -> None:
    default = method()
    assert (default.usual_thickness is not None) == method.makes_sheets
    assert (default.with_thickness(0.25).usual_thickness == 0.25) == method.makes_sheets
    assert default.light_points == 1 or method.samples_lights
    # Without an order there are no single surfaces to peel, to count, to light or to step between.
    assert method.ordered or not (
        method.peels or method.samples_lights or method.finds_exits or method.marches or default.layer_limit
    )
    assert not (method.ordered and (method.makes_sheets or method.convex_only))


def test_a_misspelt_method_is_guessed() -> None:
    for name in ("signed depth", "Fragment-List", "kbuffer"):
        with pytest.raises(
            tl.InputError, match=r"no method has this name; did you mean (signed-depth|fragment|k-buffer)"
        ):
            method_from_name(name)


@pytest.mark.parametrize("name", ["magic", ""])
def test_an_unknown_method_names_the_known_ones(name: str) -> None:
    known = ", ".join(METHODS)
    with pytest.raises(tl.InputError, match=f"^method '{name}'; no method has this name; use one of {known}$"):
        method_from_name(name)


def test_methods_of_equal_parameters_are_equal_and_hash_alike() -> None:
    assert len({tl.DepthPeeling(), tl.DepthPeeling(64, "both-ends"), tl.KBuffer(8), tl.KBuffer()}) == 2
    assert tl.DepthPeeling(8) != tl.DepthPeeling()
    assert tl.DepthPeeling(order="front-to-back") != tl.DepthPeeling()


@pytest.mark.parametrize("thickness", [0, -1.0, np.nan, np.inf])
def test_a_sheet_has_a_positive_thickness(thickness: float) -> None:
    with pytest.raises(
        tl.InputError, match=re.escape(f"ThinLayer thickness {thickness}; the thickness must be above 0")
    ):
        tl.ThinLayer(thickness)


@pytest.mark.parametrize(
    ("method", "what", "most"),
    [(tl.DepthPeeling, "DepthPeeling max_layers", MAX_LAYERS), (tl.KBuffer, "KBuffer k", MAX_K)],
)
def test_layers_are_counted_in_whole_numbers(method: Any, what: str, most: int) -> None:
    assert method(1) != method(most)
    for wrong in (0, -1, most + 1, 2.0, np.nan, np.inf, "8", None, True, [8]):
        message = f"{what} {wrong!r}; the value must be a whole number in 1 to {most}; use a value such as 8"
        with pytest.raises(tl.InputError, match=f"^{re.escape(message)}$"):
            method(wrong)


@pytest.mark.parametrize("order", ["sideways", "", "Both-Ends", None, 2, ["both-ends"]])
def test_an_unknown_order_of_peeling_names_the_known_ones(order: Any) -> None:
    message = (
        f"DepthPeeling order {order!r}; no order has this name; use one of both-ends, front-to-back, back-to-front"
    )
    with pytest.raises(tl.InputError, match=f"^{re.escape(message)}$"):
        tl.DepthPeeling(order=order)
