"""Sheets: paths through their thickness, by the angle of the interpolated normal."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from translucent.formulas import optics
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Sphere
from translucent.media.medium import Medium
from translucent.planning.methods import ThinLayer
from translucent.reference import render
from translucent.scene.camera import Camera
from translucent.scene.scene import Object, Scene

Array = npt.NDArray[np.float64]
MEDIUM = Medium(absorption=1.0)


def quad(normal: Array) -> Mesh:
    u = np.cross(normal, (0.0, 1.0, 0.0))
    v = np.cross(normal, u)
    return Mesh(5 * np.array([u + v, v - u, -u - v, u - v]), [(0, 1, 2), (0, 2, 3)], name="sheet")


@pytest.mark.parametrize("ior", [1.0, 1.5])
@pytest.mark.parametrize("degrees", [0.0, 60.0, 89.0, 120.0, 180.0])
def test_sheet(degrees: float, ior: float) -> None:
    angle = np.radians(degrees)
    sheet = Object(
        quad(np.array([np.sin(angle), 0.0, np.cos(angle)])), Medium(absorption=1.0, ior=ior), sheet_thickness=0.01
    )
    frame = render(Scene([sheet], Camera.orthographic((0, 0, 20), (0, 0, 0), height=0.01)), (3, 3))
    expected = optics.thin_layer_thickness(0.01, abs(np.cos(angle)), ior)
    np.testing.assert_allclose(frame.thickness, np.full((3, 3), expected), rtol=1e-10)
    assert frame.valid.all()
    assert frame.coverage.all()


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("inverted", [False, True])
def test_every_face_a_sheet(mirrored: bool, inverted: bool) -> None:
    """A sphere stretched along z, seen along x: its normals go through the inverse transpose."""
    mesh = Sphere().tessellate(256)
    if inverted:
        mesh = Mesh(mesh.vertices, mesh.faces[:, ::-1])
    matrix = np.diag((-1.0 if mirrored else 1.0, 1.0, 2.0, 1.0))
    camera = Camera.orthographic((5, 0, 0), (0, 0, 0), height=1.5)
    frame = render(Scene([Object(mesh, MEDIUM, matrix)], camera), (16, 16), ThinLayer(0.02))
    _, y, z = np.moveaxis(camera.rays((16, 16))[0], -1, 0)
    x = np.sqrt(1 - y**2 - (z / 2) ** 2)
    cosine = x / np.sqrt(x**2 + y**2 + (z / 4) ** 2)
    # A face of 256 around is tilted by up to pi / 256 against the sphere, and its cosine by the tangent times that.
    tilt = np.pi / 256 * np.tan(np.arccos(cosine)) * 2  # the stretch along z at most doubles it
    assert (np.abs(frame.thickness * cosine / 0.04 - 1) <= tilt + 1e-3).all()


def test_declared_sheets_stand_beside_solids() -> None:
    sheet = Object(quad(np.array([0.0, 0.0, 1.0])), MEDIUM, sheet_thickness=0.01)
    bodies = [Object(Box().tessellate(), MEDIUM), sheet]
    camera = Camera.orthographic((0, 0, 3), (0, 0, 0), height=0.5)
    assert render(Scene(bodies, camera), (2, 2)).thickness == pytest.approx(np.full((2, 2), 1.01))
    assert render(Scene([sheet], camera), (2, 2), ThinLayer(0.5)).thickness == pytest.approx(np.full((2, 2), 0.01))
