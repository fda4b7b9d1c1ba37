"""The first command of the README."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_demo_renders_two_pictures_and_says_how_wrong_they_are(tmp_path: Path, renderer: object) -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "tools" / "demo.py")], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    for name in ("bear", "wine"):
        assert (tmp_path / "out" / f"{name}.png").stat().st_size > 10_000
    for word in ("backend ", "plan: SignedDepth", "signed_depth", " ms", "p99.9", "of the scene's diagonal"):
        assert word in done.stdout, word
