"""The numbers that a page's viewer works out for a camera, against those of the renderer."""

from __future__ import annotations

import base64
import dataclasses
import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import translucent as tl
from translucent.gpu.layout import BLOCKS, BODY
from translucent.gpu.recording import SIZE, FrameRecorder
from translucent.page.payload import payload
from translucent.page.plans import plan_page
from translucent.planning.request import RenderRequest

_SCRIPT = Path(__file__).with_name("blocks.mjs")


def _scene() -> tl.Scene:
    """A turned and mirrored body far from the origin, one inside out, a sheet, a floor, and lamps."""
    box = trimesh.creation.box((0.02, 0.03, 0.04))
    made = trimesh.creation.icosphere(1, 0.02)
    solid = tl.Mesh(made.vertices, made.faces, name="ball")
    inverted = tl.Mesh(box.vertices, box.faces[:, ::-1], name="box")
    place = trimesh.transformations.rotation_matrix(0.7, (1, 2, 3), (0, 0, 0)) @ np.diag([1.5, -1.0, 0.8, 1.0])
    place[:3, 3] = 0.05, -0.01, 0.02
    floor = tl.Mesh([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], [[0, 2, 1], [0, 3, 2]], name="floor")
    down = np.eye(4)
    down[1, 3] = -0.05
    medium, other = tl.Medium([20, 30, 40], ior=1.4), tl.Medium([5, 50, 10])
    return tl.Scene(
        [
            tl.Object(solid, medium, transform=place),
            tl.Object(inverted, other),
            tl.Object(floor, other, transform=down @ np.diag([0.1, 1, 0.1, 1]), sheet_thickness=1e-3),
            tl.Object(floor, None, transform=down),
        ],
        tl.Camera.look_at((0.1, 0.1, 0.3), (0, 0, 0)),
        lights=[tl.PointLight((0.1, 0.4, 0.2), 0.1), tl.DirectionalLight((0, -1, 0.2), 1.0)],
    )


_CAMERAS = (
    tl.Camera.look_at((-0.2, 0.05, 0.1), (0.02, 0, 0), fov_y=55),
    tl.Camera.look_at((0.001, 0.002, 0.003), (1, 0, 0.2), fov_y=80),  # inside the box
    tl.Camera.look_at((3.0, 2.0, -1.0), (0, 0, 0), (0.2, 1, 0), fov_y=3),
    tl.Camera.orthographic((0.1, 0.2, 0.3), (0, 0, 0), height=0.2),
    tl.Camera.orthographic((0.0, 0.0, 0.0), (0, 0, -1), height=0.2),  # its plane cuts the bodies
)


def _told(camera: tl.Camera) -> dict[str, Any]:
    axes = {name: getattr(camera, name).tolist() for name in ("eye", "right", "up", "forward")}
    return {**axes, "fov_y": camera.fov_y, "height": camera.height}


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    if (node := shutil.which("node")) is None:
        pytest.skip("node is not here")
    file = tmp_path_factory.mktemp("blocks") / "page.bin"
    planned = plan_page(_scene(), RenderRequest(interfaces=tl.ScreenInterfaces(), shadows=tl.ShadowMaps(64)))
    file.write_bytes(payload(planned, "blocks", SIZE, 2, 0.0, "none"))
    asked = {"file": str(file), "size": SIZE, "cameras": [_told(camera) for camera in _CAMERAS]}
    done = subprocess.run([node, str(_SCRIPT)], input=json.dumps(asked), capture_output=True, text=True, check=True)
    found: list[dict[str, Any]] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("number", range(len(_CAMERAS)))
def test_blocks_are_the_renderers(answers: list[dict[str, Any]], number: int) -> None:
    scene = dataclasses.replace(_scene(), camera=_CAMERAS[number])
    planned = plan_page(scene, RenderRequest(interfaces=tl.ScreenInterfaces(), shadows=tl.ShadowMaps(64)))
    frame = FrameRecorder(2, planned.most_layers, planned.texture_units).record(planned.plan)
    for block in BLOCKS.values():
        if (expected := frame.blocks.get(block.binding)) is not None:
            _assert_same(answers[number]["blocks"][block.name], expected, block.dtype)
    for found, expected in zip(answers[number]["bodies"], frame.bodies, strict=True):
        _assert_same(found, expected[: BODY.dtype.itemsize], BODY.dtype)


def _assert_same(found: str, expected: bytes, dtype: np.dtype[Any]) -> None:
    one, other = (np.frombuffer(content[: dtype.itemsize], dtype)[0] for content in (base64.b64decode(found), expected))
    for name in dtype.names or ():
        scale = max(float(np.abs(other[name]).max()), 1e-30)
        np.testing.assert_allclose(one[name], other[name], rtol=1e-6, atol=1e-6 * min(scale, 1.0), err_msg=name)
