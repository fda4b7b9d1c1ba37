"""The first command of the README."""

from __future__ import annotations

import re
import runpy
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def test_demo_renders_two_pictures_and_says_how_wrong_they_are(
    tmp_path: Path,
    in_tmp_path: Path,
    few_shadows: None,
    capsys: pytest.CaptureFixture[str],
    renderer: object,
) -> None:
    demo = runpy.run_path(str(ROOT / "tools" / "demo.py"))
    main = demo["main"]
    main.__globals__["SIZE"] = (80, 60)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        assert main() == 0
    # Of a million rays through a mesh, one or two meet an edge just so, which frames tell.
    lost = [re.match(r"(\d) pixels are not valid \(\d+ are covered\)", str(one.message)) for one in told]
    assert all(found and int(found[1]) <= 3 for found in lost), [str(one.message) for one in told]
    printed = capsys.readouterr()
    assert printed.err == ""
    for name in ("bear", "wine"):
        assert (tmp_path / "out" / f"{name}.png").stat().st_size > 2_000
    for word in ("backend ", "plan: SignedDepth", "signed_depth", " ms", "p99.9", "of the scene's diagonal"):
        assert word in printed.out, word


def test_no_environment_is_made_where_a_link_leads(tmp_path: Path) -> None:
    """It would remove the environment of another checkout."""
    (tmp_path / "tools").mkdir()
    shutil.copy(ROOT / "tools" / "bootstrap.py", tmp_path / "tools")
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "kept").touch()
    (tmp_path / ".venv").symlink_to(tmp_path / "other")
    command = [sys.executable, str(tmp_path / "tools" / "bootstrap.py")]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 1
    assert f"it is a link to {tmp_path / 'other'}" in done.stderr
    assert (tmp_path / "other" / "kept").is_file()
