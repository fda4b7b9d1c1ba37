"""Sheets: paths through their thickness, by the angle of the interpolated normal."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from translucent import optics
from translucent.camera import Camera
from translucent.medium import Medium
from translucent.mesh import Mesh
from translucent.reference import hit_counts, render
from translucent.scene import Object, Scene
from translucent.solids import Box, Sphere
from translucent.thickness import ThinLayer

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
    np.testing.assert_allclose(frame.thickness, 2 * 0.02 / cosine, rtol=1e-3)


def test_declared_sheets_stand_beside_solids() -> None:
    sheet = Object(quad(np.array([0.0, 0.0, 1.0])), MEDIUM, sheet_thickness=0.01)
    bodies = [Object(Box().tessellate(), MEDIUM), sheet]
    camera = Camera.orthographic((0, 0, 3), (0, 0, 0), height=0.5)
    assert render(Scene(bodies, camera), (2, 2)).thickness == pytest.approx(np.full((2, 2), 1.01))
    assert render(Scene([sheet], camera), (2, 2), ThinLayer(0.5)).thickness == pytest.approx(np.full((2, 2), 0.01))


def test_a_normal_turned_away_counts_as_edge_on() -> None:
    """A coarse sphere shows faces at its rim whose interpolated normals look away."""
    camera = Camera.look_at((0, 0.2, 3), (0, 0, 0))
    sphere = Scene([Object(Sphere().tessellate(8), MEDIUM)], camera)
    frame = render(sphere, (256, 256), ThinLayer(1.0))
    assert frame.thickness.max() > 1000
    assert (frame.thickness <= 1000.0 * hit_counts(sphere, (256, 256))).all()
