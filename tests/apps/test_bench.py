"""The benchmark measures what it says: times and errors of the same run, in one table."""

from __future__ import annotations

import json

import translucent as tl
from translucent.assets import mesh_path
from translucent.bench.cases import METHODS, Case
from translucent.bench.measure import measure, table


def test_rows_hold_times_ratios_and_errors(renderer: tl.Renderer) -> None:
    case = Case("knot", "concave", lambda: tl.load_mesh(mesh_path("knot")))
    result = measure([case], METHODS, size=(64, 48), seconds=0.2)
    assert json.loads(json.dumps(result)) == result
    rows = {row["method"]: row for row in result["rows"]}
    assert rows.keys() == {"depth-only", *METHODS}
    for name in METHODS:
        row = rows[name]
        assert row["ms"] > 0
        assert row["ratio"] > 0
        assert row["frame_ms"] > 0
        assert row["triangles"] == 20160
    assert rows["signed-depth"]["p999"] <= 1e-5
    assert rows["thin-layer"]["median"] > 1e-3
    assert rows["back-face-depth"]["invalid"] > 0
    assert rows["back-face-depth"]["geometry_passes"] == 2
    assert "llvmpipe" not in result["machine"]["renderer"] or "software" in result["machine"]["renderer"]
    assert "signed-depth" in table(result)
