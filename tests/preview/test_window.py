"""The window itself, on a display of its own; skipped where there is none."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.processes import PATIENCE
from translucent.cli import main
from translucent.preview.session import load_session

SCRIPT = """
[[action]]
do = "change"
field = "material.color"
value = [0.6, 0.1, 0.2]
[[action]]
do = "change"
field = "display.compare"
value = "method"
[[action]]
do = "point"
x = 0.45
y = 0.5
[[action]]
do = "press"
[[action]]
do = "point"
x = 0.5
y = 0.45
[[action]]
do = "release"
[[action]]
do = "wheel"
steps = 1.0
[[action]]
do = "select"
panel = "Scene"
[[action]]
do = "hide"
number = 0
[[action]]
do = "select"
panel = "Look"
[[action]]
do = "wait"
seconds = 0.1
[[action]]
do = "select"
panel = "Files"
[[action]]
do = "open"
model = "{bad}"
[[action]]
do = "save"
kind = "save session"
file = "{session}"
[[action]]
do = "view"
name = "front"
[[action]]
do = "key"
name = "w"
[[action]]
do = "point"
x = 0.535
y = 0.433
[[action]]
do = "press"
[[action]]
do = "point"
x = 0.6
y = 0.433
[[action]]
do = "release"
[[action]]
do = "add_light"
[[action]]
do = "light"
field = "radius"
value = 0.0
[[action]]
do = "keep"
name = "1"
[[action]]
do = "save"
kind = "save session"
file = "{changed}"
[[action]]
do = "recall"
name = "1"
[[action]]
do = "remove_light"
number = 0
[[action]]
do = "place"
field = "location"
value = [0.0, 0.0, 0.0]
[[action]]
do = "select"
panel = "Material"
[[action]]
do = "key"
name = "f1"
[[action]]
do = "key"
name = "escape"
[[action]]
do = "ask"
kind = "open"
[[action]]
do = "key"
name = "escape"
[[action]]
do = "ask"
kind = "save session"
[[action]]
do = "answer"
file = "{asked}"
[[action]]
do = "save_preset"
name = "Deep red"
[[action]]
do = "preset"
name = "deep_red"
[[action]]
do = "save"
kind = "png"
file = "{picture}"
"""


def test_no_display_names_the_way_without_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if not sys.platform.startswith("linux"):
        pytest.skip("only Linux has machines without a display")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert main(["preview", "goblet"]) == 1
    error = capsys.readouterr().err
    assert "there is no display" in error
    assert "translucent render MODEL" in error


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--script", "none.toml"), "no file has this path"),
        (("--session", "none.toml"), "no file has this path"),
        (("--session", "none.toml", "goblet"), "goblet is given, too"),
        (("--screenshot", "a.jpg"), "this is not a .png file in an existing folder"),
        (("--scale", "9"), "the scale must lie in 0.5 to 4"),
    ],
)
def test_bad_arguments_are_told_before_a_window_opens(
    capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], message: str
) -> None:
    assert main(["preview", *arguments]) == 2
    assert message in capsys.readouterr().err


def test_a_display_that_does_not_answer_is_told() -> None:
    pytest.importorskip("imgui_bundle")
    command = [sys.executable, "-m", "translucent", "preview", "leaf"]
    environment = {**os.environ, "DISPLAY": ":987", "WAYLAND_DISPLAY": ""}
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, env=environment, check=False)
    assert done.returncode == 1
    assert "no window can be opened on display ':987'" in done.stderr


def test_the_window_does_what_a_script_says(preview, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    names = ("bad.glb", "session.toml", "changed.toml", "asked.toml", "picture.png")
    files = {Path(name).stem: tmp_path / name for name in names}
    bad, session, changed, asked, picture = files.values()
    bad.write_bytes(b"")
    done = preview("leaf", script=SCRIPT.format(**files))
    assert done.returncode == 2, "a file that is none was opened; the actions after it are done all the same"
    told = json.loads(done.stdout)
    assert told["model"] == "leaf"
    texts = {kind: [m["text"] for m in told["messages"] if m["kind"] == kind] for kind in ("info", "warning", "error")}
    assert len(texts["error"]) == 2
    assert "no other object is visible" in texts["error"][0]
    assert "bad.glb" in texts["error"][1]
    assert f"wrote {picture}" in texts["info"]
    assert "color = [" in session.read_text()
    document = load_session(changed)
    ((x, y, z),) = (place.location for place in document.placed)
    assert x > 0.001, "the arrow of the gizmo was dragged to the right"
    assert (round(y, 6), round(z, 6)) == (0.0, 0.0)
    assert [light.radius for light in document.lights] == [0.0]
    assert [one.name for one in document.snapshots] == ["1"]
    assert load_session(asked).placed == (), "the built-in browser asks where it is to be written"
    assert "[deep_red]" in (tmp_path / "translucent" / "presets" / "deep_red.toml").read_text()
    window = np.asarray(Image.open(tmp_path / "window.png").convert("RGB"))
    assert window.shape == (480, 640, 3)
    # Panels are dark, the model's backdrop is bright: both are there. The viewport is a third of this small window, and
    # how much of it is bright depends on how far the picture has got on a busy machine (0.14 when it is finished).
    assert (window.max(axis=2) > 200).mean() > 0.03
    assert (window.max(axis=2) < 60).mean() > 0.2
    with Image.open(picture) as saved:
        assert saved.size[0] > 100


def test_a_window_that_is_closed_while_work_is_under_way_ends_well(display: str, tmp_path: Path) -> None:
    """Libraries of C++ abort where a thread of theirs is unwound, as CPython does at exit."""
    code = (
        "import sys, numpy, scipy.fft\n"
        "from translucent.cli import main\n"
        "from translucent.preview import script\n"
        "class Quick(script.Script):\n"
        "    def step(self, state):\n"
        "        work = lambda task: [scipy.fft.dct(numpy.ones((64, 64, 4096)), axis=2) for _ in range(60)]\n"
        "        state.work.lanes['ray'].start('transforms', work, print)\n"
        "        return True\n"
        "script.Script.of = classmethod(lambda cls, steps: Quick([]))\n"
        "sys.exit(main(['preview', 'leaf', '--size', '640x480', '--screenshot', sys.argv[1]]))\n"
    )
    environment = {**os.environ, "DISPLAY": display}
    command = [sys.executable, "-c", code, str(tmp_path / "window.png")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, env=environment, check=False)
    assert done.returncode == 0, done.stderr


def test_ctrl_c_within_a_table_is_raised(display: str) -> None:
    """Dear ImGui objects to the table that is left open."""
    code = (
        "import signal\n"
        "from imgui_bundle import imgui\n"
        "from translucent.preview import app\n"
        "from translucent.preview.document import Document\n"
        "from translucent.preview.script import Script\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "imgui.end_table = lambda: signal.raise_signal(signal.SIGINT)\n"
        "class Waiting(Script):\n"
        "    def step(self, state):\n"
        "        return False\n"
        "try:\n"
        "    app.run(Document(), (640, 480), script=Waiting([]))\n"
        "except KeyboardInterrupt:\n"
        "    print('interrupted', flush=True)\n"
    )
    environment = {**os.environ, "DISPLAY": display}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE, env=environment, check=False
    )
    assert done.stdout.splitlines()[-1:] == ["interrupted"], done.stderr


def test_the_first_picture_waits_for_nobody(display: str) -> None:
    """A window draws by itself, before anything has been done in it."""
    code = (
        "import os\n"
        "from translucent.preview import app\n"
        "from translucent.preview.document import Document\n"
        "from translucent.preview.script import Script\n"
        "class First(Script):\n"
        "    def step(self, state):\n"
        "        return state.view.viewport.steps(0) > 0 or state.view.timings[0].wall > 0\n"
        "app.run(Document(), (1280, 800), script=First([]))\n"
        "print('drawn', flush=True)\n"
        "os._exit(0)\n"  # as the command does while work is under way
    )
    environment = {**os.environ, "DISPLAY": display}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE, env=environment, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "drawn", done.stdout
