"""Tasks of an artist, by mouse and keyboard in the window: the quick ones; ``tools/preview_tasks.py`` does them all."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.preview.waiting import environment
from tests.processes import PATIENCE

TOOL = Path(__file__).resolve().parents[2] / "tools" / "preview_tasks.py"
NAMES = ("distance in mm", "find a key")


@pytest.mark.skipif(
    shutil.which("xdotool") is None, reason="no xdotool: nothing moves the mouse (apt-get install xdotool)"
)
def test_a_distance_is_typed_and_a_key_found(display: str, tmp_path: Path) -> None:
    command = [sys.executable, str(TOOL), *NAMES, "--folder", str(tmp_path), "--size", "1000x700"]
    own = environment(display, tmp_path)
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, env=own, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert [line[:22].strip() for line in done.stdout.splitlines()] == list(NAMES)
