"""Paths through interfaces against an independent renderer, Mitsuba 3, where it is installed (pip install mitsuba).

Its rays start up to 1e-4 of a unit off the surface that they left, so that the body here is a thousand units large.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from translucent.arrays import Array
from translucent.geometry.normals import corner_normals
from translucent.geometry.solids import Sphere
from translucent.media.medium import Medium
from translucent.reference import path_trace
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import Surface

BALL = Sphere(radius=500.0).tessellate(16)
SIDE, PATHS = 16, 200
MEDIA = {
    "glass": (Medium((1e-4, 4e-4, 9e-4), ior=1.5), 0.0),
    "frosted": (Medium((1e-4, 4e-4, 9e-4), ior=1.5), 0.2),
    "wax": (Medium((1e-4, 4e-4, 9e-4), 4e-3, anisotropy=0.4, ior=1.4), 0.0),
}


def described(medium: Medium, roughness: float, file: Path) -> dict[str, Any]:
    largest = float(medium.extinction.max())
    bsdf = {"type": "roughdielectric", "distribution": "ggx", "alpha": roughness**2}
    interior = {
        "type": "homogeneous",
        "sigma_t": {"type": "rgb", "value": (medium.extinction / largest).tolist()},
        "scale": largest,
        "albedo": {"type": "rgb", "value": (np.asarray(medium.scattering) / medium.extinction).tolist()},
        "phase": {"type": "hg", "g": medium.anisotropy},
    }
    return {
        "type": "ply",
        "filename": str(file),
        "bsdf": {**(bsdf if roughness else {"type": "dielectric"}), "int_ior": medium.ior, "ext_ior": 1.0},
        "interior": interior,
    }


def written(mi: Any, file: Path) -> None:
    """Write the ball with the normals of its corners."""
    corners = BALL.vertices[BALL.faces].reshape(-1, 3)
    mesh = mi.Mesh("ball", len(corners), len(corners) // 3, has_vertex_normals=True)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = corners.ravel().astype(np.float32)
    parameters["vertex_normals"] = corner_normals(BALL).ravel().astype(np.float32)
    parameters["faces"] = np.arange(len(corners), dtype=np.uint32)
    parameters.update()
    mesh.write_ply(str(file))


def traced(mi: Any, camera: Camera, sky: Array, ball: dict[str, Any]) -> tuple[Array, Array]:
    """Mean (h, w, 3) over the paths of each pixel, and its standard error. Rays go through the centers of pixels."""
    light = {"type": "envmap", "bitmap": mi.Bitmap(sky.astype(np.float32))}
    loaded, sampler = (
        mi.load_dict({"type": "scene", "light": light, "ball": ball}),
        mi.load_dict({"type": "independent"}),
    )
    integrator = mi.load_dict({"type": "volpathmis", "max_depth": -1, "rr_depth": 100_000})
    sampler.seed(0, 1)
    origins, directions = (np.broadcast_to(v, (SIDE, SIDE, 3)).reshape(-1, 3) for v in camera.rays((SIDE, SIDE)))
    found = np.zeros((len(directions), PATHS, 3))
    for i, (origin, direction) in enumerate(zip(origins.tolist(), directions.tolist(), strict=True)):
        ray = mi.RayDifferential3f(mi.Point3f(*origin), mi.Vector3f(*direction))
        for k in range(PATHS):
            found[i, k] = integrator.sample(loaded, sampler, ray)[0]
    error = found.std(axis=1, ddof=1) / np.sqrt(PATHS)
    return found.mean(axis=1).reshape(SIDE, SIDE, 3), error.reshape(SIDE, SIDE, 3)


@pytest.mark.parametrize("name", MEDIA)
def test_a_ball(name: str, tmp_path: Path) -> None:
    """Means of the picture and its halves, to four standard errors; a share that single microfacets lose is theirs."""
    mi = pytest.importorskip("mitsuba", reason="the independent renderer is absent: pip install mitsuba")
    mi.set_variant("scalar_rgb")
    medium, roughness = MEDIA[name]
    camera = Camera.look_at((0, 600, 3000), (0, 0, 0), fov_y=18)
    # So smooth that it is the same in both, however they look between its pixels.
    rows = np.cos(np.pi * (np.arange(64) + 0.5) / 64)
    sky = np.broadcast_to((1 + 0.9 * rows[:, None, None] * (1.0, 0.0, -1.0)), (64, 128, 3))
    body = Object(BALL, medium, surface=Surface(roughness=roughness))
    scene = Scene([body], camera, environment=Environment.image(sky))
    frame, error = path_trace(scene, (SIDE, SIDE), paths=PATHS)
    with np.errstate(all="ignore"):
        written(mi, tmp_path / "ball.ply")
        truth, other_error = traced(mi, camera, sky, described(medium, roughness, tmp_path / "ball.ply"))
    both, lost = np.hypot(error, other_error), 0.02 if roughness else 0.0
    for part in (np.s_[:], np.s_[: SIDE // 2], np.s_[SIDE // 2 :], np.s_[:, : SIDE // 2]):
        distance, scale = (values[part].sum(axis=(0, 1)) for values in (frame.radiance - truth, truth))
        bound = 4 * np.sqrt((both[part] ** 2).sum(axis=(0, 1)))
        assert (distance > -bound).all()
        assert (distance < bound + lost * scale).all()
