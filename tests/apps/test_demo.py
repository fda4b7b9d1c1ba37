"""The first command of the README."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def test_demo_renders_two_pictures_and_says_how_wrong_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], renderer: object
) -> None:
    monkeypatch.chdir(tmp_path)
    demo = runpy.run_path(str(ROOT / "tools" / "demo.py"))
    main = demo["main"]
    main.__globals__["SIZE"] = (320, 240)
    assert main() == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    for name in ("bear", "wine"):
        assert (tmp_path / "out" / f"{name}.png").stat().st_size > 10_000
    for word in ("backend ", "plan: SignedDepth", "signed_depth", " ms", "p99.9", "of the scene's diagonal"):
        assert word in printed.out, word
