"""Third-party meshes whose thickness or volume is known elsewhere."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from translucent.geometry.mesh import Mesh
from translucent.media.medium import Medium
from translucent.mesh_files import load_mesh
from translucent.reference import render
from translucent.scene.camera import Camera
from translucent.scene.scene import Object, Overlap, Scene

MESHES = Path(__file__).parents[3] / "shared" / "assets" / "meshes_clean"
MEDIUM = Medium(absorption=1e-3)


def load(name: str) -> Mesh:
    if not (MESHES / name).is_file():
        pytest.skip(f"third-party mesh {name} is not in ../shared/assets/meshes_clean")
    return load_mesh(MESHES / name)


def above(bounds: np.ndarray, axis: int, scale: float = 1.01) -> tuple[Camera, float]:
    """Orthographic camera that looks down an axis at a box, and the height of its picture."""
    center, diagonal = bounds.mean(axis=0), float(np.linalg.norm(np.ptp(bounds, axis=0)))
    eye = center + np.eye(3)[axis] * diagonal
    height = diagonal * scale
    return Camera.orthographic(eye, center, up=np.eye(3)[(axis + 1) % 3], height=height), height


def test_tray_is_as_thick_as_its_sheet() -> None:
    mesh = load("1002_tray_bottom.STL")
    camera, _ = above(mesh.bounds, axis=1)
    frame = render(Scene([Object(mesh, MEDIUM)], camera), (256, 256))
    assert frame.valid.all()
    assert np.median(frame.thickness[frame.coverage]) == pytest.approx(3.175, abs=1e-6)


def test_unit_cube() -> None:
    mesh = load("unit_cube.STL")
    camera, _ = above(mesh.bounds, axis=2)
    frame = render(Scene([Object(mesh, MEDIUM)], camera), (128, 128))
    assert frame.valid.all()
    np.testing.assert_array_equal(frame.thickness[frame.coverage], 1.0)


@pytest.mark.parametrize(
    ("overlap", "volume", "axis"), [("add", 2802.21, 0), ("union", 2477.66, 2), ("priority", 2477.66, 0)]
)
def test_volumes_of_overlapping_balls(overlap: Overlap, volume: float, axis: int) -> None:
    """The volumes of the two meshes, of their union, and with that of their intersection, are known (324.55)."""
    media = [MEDIUM, MEDIUM if overlap == "union" else Medium(absorption=2e-3, emission=1.0)]
    bodies = [
        Object(load(name), medium, priority=i)
        for i, (name, medium) in enumerate(zip(("ballA.off", "ballB.off"), media, strict=True))
    ]
    bounds = np.stack([np.min([b.bounds[0] for b in bodies], axis=0), np.max([b.bounds[1] for b in bodies], axis=0)])
    camera, height = above(bounds, axis)
    frame = render(Scene(bodies, camera, overlap=overlap), (512, 512))
    assert frame.valid.all()
    assert frame.thickness.sum() * (height / 512) ** 2 == pytest.approx(volume, rel=1e-4)
    depth = frame.optical_depth[..., 0].sum() * (height / 512) ** 2 / 1e-3
    both, inner = 2802.21, 324.55
    expected = {"add": 1.5 * both, "union": both - inner, "priority": 1.5 * both - inner}[overlap]
    assert depth == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(
    ("name", "volume"), [("bunny.obj", 0.7493341), ("armadillo.obj", 0.06832287), ("mengerSponge3.glb", 0.4064421)]
)
def test_volumes_and_balance(name: str, volume: float) -> None:
    mesh = load(name)
    camera, height = above(mesh.bounds, axis=2)
    body = Object(mesh, MEDIUM)
    frame = render(Scene([body], camera), (512, 512))
    assert frame.valid.all()
    # A sponge's walls are parallel to all rays: the picture's lattice decides to about a pixel per wall.
    assert frame.thickness.sum() * (height / 512) ** 2 == pytest.approx(volume, rel=2e-2 if "Sponge" in name else 2e-4)
    for shift in (np.zeros(3), np.array([0.1, 0.2, 2.0])):
        target = mesh.center + mesh.diagonal * np.array([0.01, 0.02, -1.0])
        view = Camera.look_at(mesh.center + mesh.diagonal * shift, target)
        assert render(Scene([body], view), (128, 128)).valid.all()
