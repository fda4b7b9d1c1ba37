"""Remarks on bodies that are black in a picture."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.values.plan_scenes import BOX, body, scene
from translucent.assets import mesh_path
from translucent.planning.passes import NoteKind
from translucent.planning.plan import plan
from translucent.planning.render_plan import Capabilities

#: Extinction at which 1/255 passes the mean chord of a cube of 1 m, 4 V / S = 2/3 m.
EDGE = 1.5 * np.log(255.0)
INK = tl.Medium(absorption=2 * EDGE)


@pytest.mark.parametrize("scale", [1.0, 1e-3])
def test_a_body_is_black_from_a_step_of_8_bits_on(scale: float) -> None:
    for share, expected in ((0.999, 0), (1.001, 1)):
        cube = tl.Object(BOX, tl.Medium(absorption=share * EDGE / scale), np.diag([scale, scale, scale, 1.0]))
        found = plan(scene(cube))
        assert len(found.remarks) == expected
        assert found.says(NoteKind.BLACK) == bool(expected)
        assert found.exact
        assert not any("black" in note for note in (*found.limits, *found.unmodelled))


def test_the_remark_tells_thickness_what_passes_and_what_would_show_it() -> None:
    found = plan(scene(body(INK)))
    # exp(-2 ln 255), and ln 5 / sigma, which is a factor of 2 ln 255 / ln 5.
    assert found.remarks == (
        "'box': black: only 1.5e-05 of white light passes 667 mm, the mean thickness; a fifth passes 96.8 mm; diluted "
        "6.9 times (--dilute 6.9), the color becomes visible",
    )
    assert str(found).splitlines()[-1] == f"  remark: {found.remarks[0]}"
    assert found.summary()["remarks"] == list(found.remarks)
    diluted = tl.Medium(absorption=np.asarray(INK.absorption) / 6.9)
    assert float(diluted.transmittance(2 / 3)[0]) == pytest.approx(0.2, rel=0.02)


def test_colors_count_by_luminance() -> None:
    # Of what passes blue alone, 0.0722 of the luminance is left where nothing is absorbed.
    assert not plan(scene(body(tl.Medium(absorption=(1e3, 1e3, 0))))).remarks
    # ln(0.0722 * 255) = 2.91 in place of ln 255 = 5.54.
    for depth, expected in ((2.9, 0), (2.93, 1)):
        assert len(plan(scene(body(tl.Medium(absorption=(1e3, 1e3, 1.5 * depth))))).remarks) == expected


@pytest.mark.parametrize(
    "shown",
    [
        body(tl.Medium(absorption=2 * EDGE, emission=1.0)),
        body(tl.Medium(absorption=2 * EDGE, scattering=2 * EDGE)),
        body(INK, sheet_thickness=0.01),
        body(INK, surface=tl.Surface(transmission=0.5)),
        body(None, x=3),
    ],
    ids=["emits", "scatters", "thin", "painted", "opaque"],
)
def test_what_shows_otherwise_is_not_black(shown: Any) -> None:
    assert not plan(scene(shown, body())).remarks


def test_one_line_tells_of_all_and_of_the_nearest_to_being_seen() -> None:
    names = [tl.Mesh(BOX.vertices, BOX.faces, name=name) for name in ("a", "b")]
    thick = body(INK, names[0])
    thin = tl.Object(names[1], INK, np.diag([0.6, 0.6, 0.6, 1.0]))
    for found in (plan(scene(thick, thin)), plan(scene(thin, thick), capabilities=Capabilities(opengl=False))):
        (remark,) = found.remarks
        assert "of white light passes 400 mm, the mean thickness of 'b'" in remark


def test_measured_merlot_is_black_in_a_glass_and_not_in_a_gummy_bear() -> None:
    merlot = tl.preset("merlot").medium
    glass = tl.Object(tl.load_mesh(mesh_path("goblet")), tl.preset("crystal").medium, priority=1)
    for mesh, expected in (("wine", ["wine.ply"]), ("bear", [])):
        filled = scene(glass, tl.Object(tl.load_mesh(mesh_path(mesh)), merlot), overlap="priority")
        assert [remark.split("'")[1] for remark in plan(filled).remarks] == expected
