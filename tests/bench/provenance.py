"""Lines of a report of the tests on the machine that it ran on."""

from __future__ import annotations

from translucent.bench.record import Provenance

PROVENANCE = Provenance(
    command="translucent report -o out",
    started="2025-01-02T03:04:05Z",
    platform="Linux",
    processor="a processor",
    processors=2,
    backend="egl",
    renderer="llvmpipe",
    driver="4.5 Mesa",
    software=True,
    versions={"numpy": "2.4"},
    commit="0123abc",
    dirty=True,
    seed=7,
    quick=False,
)
