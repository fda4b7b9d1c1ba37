"""Bytes that frames read and write: as told from plans, and as passes ask for them."""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import Any

import moderngl
import numpy as np
import pytest

import translucent as tl
from tests.gpu.test_compact import BALL, CAMERA, MEDIA, OPEN, SCENES, SIZE, balls, with_opaque
from translucent.gpu import recording
from translucent.gpu.pass_costs import PassTraffic, frame_traffic
from translucent.gpu.targets import FORMATS, Targets
from translucent.planning.passes import PassName

SHEET = tl.Object(BALL, MEDIA[0], sheet_thickness=0.01)
GLASS = tl.Object(BALL, dataclasses.replace(MEDIA[0], ior=1.5))
PLANS: dict[str, tuple[tl.Scene, tl.Method | None, dict[str, Any]]] = {
    "one medium": (balls(1), None, {}),
    "two media": (balls(2), None, {}),
    "four media": (balls(4), None, {}),
    "before a stone": (with_opaque(), None, {}),
    "two open balls": (balls(2, mesh=OPEN), None, {}),
    "back faces": (balls(1), tl.BackFaceDepth(), {}),
    "a sheet beside": (tl.Scene([*balls(1).objects, SHEET], CAMERA), None, {}),
    "in order": (balls(2), tl.DepthPeeling(), {}),
    "screen space": (tl.Scene([GLASS], CAMERA), None, {"interfaces": tl.ScreenInterfaces()}),
    "traced": (tl.Scene([GLASS, with_opaque().objects[-1]], CAMERA), None, {}),
}


def recorded(scene: tl.Scene, plan: tl.RenderPlan, monkeypatch: pytest.MonkeyPatch) -> dict[str, PassTraffic]:
    """Bytes of each pass, counted from the draws, clears and textures that it asks for."""
    monkeypatch.setattr(recording, "RecordedJob", partial(recording.RecordedJob, compact=True))
    recorder = recording.FrameRecorder(1, 4, 32)
    steps = recorder.record(plan).single
    gl, units = recorder.gl, {"f4": 4, "f1": 1, "u4": 4}

    def size(number: int) -> int:
        texture = gl.textures[number]
        target = texture["size"] is None and texture["kind"] == "2d" and texture["content"] is None
        return texture["components"] * units[texture["dtype"]] if target else 0

    found = {}
    for name in dict.fromkeys(step["pass"] for step in steps):
        read, written, cleared, face = set(), set(), set(), [(0, 0)]
        for step in (step for step in steps if step["pass"] == name):
            if step["op"] == "mipmaps":
                continue
            colors = gl.framebuffers[step["target"]]["colors"]
            if step["op"] == "clear":
                cleared |= {colors[i] for i in step["attachments"]}
                continue
            textures = set(step["textures"].values())
            blended = set(colors) if step["flags"] & moderngl.BLEND else set()
            if step["mesh"] is None:
                read, written = read | textures | blended, written | set(colors)
            else:
                face.append((sum(map(size, textures | blended)), sum(map(size, colors))))
        both = sum(map(size, read)), sum(map(size, written)) + sum(map(size, cleared))
        most = np.array(face).max(axis=0).tolist()
        found[name] = PassTraffic(PassName(name), both, (most[0], most[1]))
    return found


@pytest.mark.parametrize("name", PLANS)
@pytest.mark.filterwarnings("ignore::translucent.TranslucentWarning")
def test_it_is_what_passes_ask_for(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    scene, method, more = PLANS[name]
    plan = tl.plan(scene, method, **more)
    told = {step.name.value: step for step in frame_traffic(plan).passes if step.pixel is not None}
    found = recorded(scene, plan, monkeypatch)
    special = {"screen space": PassName.SURFACES, "traced": PassName.TRACED, "back faces": PassName.BACK_FACE_DEPTH}
    assert {PassName.TRANSMITTANCE, special.get(name, PassName.TRANSMITTANCE)} <= told.keys()
    assert {key: found[key] for key in told} == told


@pytest.mark.filterwarnings("ignore::translucent.TranslucentWarning")
def test_what_is_read_back_is_what_a_renderer_reads(monkeypatch: pytest.MonkeyPatch) -> None:
    taken: list[int] = []
    read_into = moderngl.Framebuffer.read_into

    def counted(self: moderngl.Framebuffer, buffer: Any, *rest: Any, **named: Any) -> None:
        taken.append(memoryview(buffer).nbytes)
        read_into(self, buffer, *rest, **named)

    monkeypatch.setattr(moderngl.Framebuffer, "read_into", counted)
    scenes = {key: SCENES[key] for key in ("one medium", "two media", "in order")}
    screen = PLANS["screen space"]
    with tl.Renderer() as renderer:
        for scene, method in scenes.values():
            taken.clear()
            frame = renderer.render(scene, SIZE, method)
            assert sum(taken) == frame_traffic(frame.plan).read_back * SIZE[0] * SIZE[1]
        taken.clear()
        frame = renderer.render(screen[0], SIZE, **screen[2])
        assert sum(taken) == frame_traffic(frame.plan).read_back * SIZE[0] * SIZE[1]


def test_formats_are_those_of_the_textures() -> None:
    with tl.Renderer() as renderer, renderer.gpu.context.current():
        targets = Targets(renderer.gpu.context.gl, SIZE)
        for name in ("opaque", "entered", "result", "paths", "fronts"):
            before = targets.bytes_per_pixel()
            found = targets[name]
            assert targets.bytes_per_pixel() - before == FORMATS[name].bytes_of()
            assert (found.depth_attachment is not None) == FORMATS[name].with_depth
        peeled = targets.peel_state(0)
        assert len(peeled.color_attachments) == len(FORMATS["peel_state"].components) + FORMATS["peel_state"].windings
        targets.release()


def test_it_is_told_in_words_and_as_json() -> None:
    scene = balls(1)
    told = frame_traffic(tl.plan(scene))
    assert str(told).splitlines() == [
        "largest number of bytes read and written in render targets, for one sample:",
        "  signed_depth: 0 read, 8 written per pixel and 8 read, 8 written for each face over the pixel",
        "  transmittance: 8 read, 20 written per pixel",
        "  together: 8 read, 28 written per pixel, and 16 read back",
    ]
    shown = dataclasses.replace(told, passes=(*told.passes, PassTraffic(PassName.CAUSTICS)))
    assert str(shown).splitlines()[-1] == "  not counted, because it depends on the rays: caustics"
    assert shown.summary() == {
        "passes": [
            {"name": "signed_depth", "pixel": {"read": 0, "written": 8}, "face": {"read": 8, "written": 8}},
            {"name": "transmittance", "pixel": {"read": 8, "written": 20}, "face": {"read": 0, "written": 0}},
            {"name": "caustics", "pixel": None, "face": None},
        ],
        "read_back": 16,
    }
