"""Against an independent renderer, Mitsuba 3, where it is installed (pip install mitsuba): Monte Carlo with error bars.

The same rays, through the same triangles with null boundaries; its own intersections, free paths and estimators.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import trimesh

from translucent.geometry.mesh import Mesh
from translucent.media.medium import Medium
from translucent.mesh_files import load_mesh
from translucent.reference import path_trace, render
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, PointLight
from translucent.scene.scene import Light, Object, Scene

Array = npt.NDArray[np.float64]
SIZE = (32, 24)


@pytest.fixture(scope="module")
def mitsuba() -> Any:
    mi = pytest.importorskip("mitsuba", reason="the independent renderer is absent: pip install mitsuba")
    # The plain variant: the others compile for the machine, with an LLVM that may not know it.
    mi.set_variant("scalar_rgb")
    return mi


@pytest.fixture(params=["bunny", "torus"])
def mesh(request: pytest.FixtureRequest, assets: Path) -> Mesh:
    """Scaled to a diagonal of 1 m, around the origin."""
    loaded = load_mesh(assets / "meshes_clean" / f"{request.param}.obj")
    return Mesh((loaded.vertices - loaded.center) / loaded.diagonal, loaded.faces, name=request.param)


def rgb(values: npt.ArrayLike) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(value) for value in np.asarray(values)]}


def described(scene: Scene, mesh_file: Path, max_depth: int) -> dict[str, Any]:
    """The scene of one object in terms of Mitsuba; the mesh goes into a file."""
    (body,) = scene.objects
    assert body.medium is not None
    trimesh.Trimesh(body.mesh.vertices, body.mesh.faces, process=False).export(mesh_file)
    largest = float(body.medium.extinction.max())
    interior = {
        "type": "homogeneous",
        "sigma_t": rgb(body.medium.extinction / largest),
        "scale": largest,
        "albedo": rgb(np.asarray(body.medium.scattering) / body.medium.extinction),
        "phase": {"type": "hg", "g": body.medium.anisotropy},
    }
    shape = {"type": "ply", "filename": str(mesh_file), "face_normals": True, "interior": interior}
    found: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "volpathmis", "max_depth": max_depth},
        "body": {**shape, "bsdf": {"type": "null"}},
    }
    for i, light in enumerate(scene.lights):
        if isinstance(light, PointLight):
            position = [float(x) for x in np.asarray(light.position)]
            found[f"light{i}"] = {"type": "point", "position": position, "intensity": rgb(light.intensity)}
        else:
            travel = [float(x) for x in np.asarray(light.direction)]
            found[f"light{i}"] = {"type": "directional", "direction": travel, "irradiance": rgb(light.irradiance)}
    if scene.environment.first.any():
        found["environment"] = {"type": "constant", "radiance": rgb(scene.environment.first)}
    return found


def traced(mi: Any, scene: Scene, folder: Path, paths: int, max_depth: int = -1) -> tuple[Array, Array]:
    """Mean (h, w, 3) over the paths of each pixel, and its standard error. Rays go through the centers of pixels."""
    loaded = mi.load_dict(described(scene, folder / "mesh.ply", max_depth))
    integrator, sampler = loaded.integrator(), mi.load_dict({"type": "independent"})
    sampler.seed(0, 1)
    origins, directions = (np.broadcast_to(v, (*SIZE[::-1], 3)).reshape(-1, 3) for v in scene.camera.rays(SIZE))
    found = np.zeros((len(directions), paths, 3))
    with np.errstate(all="ignore"):
        for i, (origin, direction) in enumerate(zip(origins.tolist(), directions.tolist(), strict=True)):
            ray = mi.RayDifferential3f(mi.Point3f(*origin), mi.Vector3f(*direction))
            for k in range(paths):
                found[i, k] = integrator.sample(loaded, sampler, ray)[0]
    error = found.std(axis=1, ddof=1) / np.sqrt(paths)
    return found.mean(axis=1).reshape(*SIZE[::-1], 3), error.reshape(*SIZE[::-1], 3)


def assert_agree(found: Array, error: Array, truth: Array) -> None:
    """Within three standard errors for 99.5 % of pixels; where nothing varies, within the float32 of the other."""
    distance = np.abs(found - truth)
    bound = np.where(error > 1e-7, 3 * error, 1e-5 * np.abs(truth) + 1e-7)
    within = (distance <= bound).mean()
    z = ((found - truth) / np.where(error > 0, error, 1.0))[error > 1e-7]
    print(f"{within:.2%} within three standard errors; of these mean {z.mean():.3f}, spread {z.std():.3f}")
    assert within >= 0.995
    # The channels share their paths.
    assert abs(z.mean()) < 4 / np.sqrt(z.size / 3)


def framed(mesh: Mesh, medium: Medium, lights: list[Light], environment: tuple[float, float, float]) -> Scene:
    camera = Camera.framing(mesh.vertices, SIZE)
    return Scene([Object(mesh, medium)], camera, lights, Environment.constant(environment))


LIGHTS = {
    "lamp": PointLight((0.5, 0.6, 0.4), 2.0),
    "lamp inside": PointLight((0.1, -0.05, 0.02), 0.5),
    "sun": DirectionalLight((1, -1, -0.5), 3.0),
}


def test_absorption(mitsuba: Any, mesh: Mesh, tmp_path: Path) -> None:
    scene = framed(mesh, Medium(absorption=(1.0, 2.0, 4.0)), [], (1.0, 0.8, 0.5))
    assert_agree(*traced(mitsuba, scene, tmp_path, 2048), render(scene, SIZE).radiance)


@pytest.mark.parametrize("name", LIGHTS)
def test_one_event(mitsuba: Any, mesh: Mesh, tmp_path: Path, name: str) -> None:
    medium = Medium(absorption=(1.0, 2.0, 4.0), scattering=(2.0, 4.0, 6.0), anisotropy=0.4)
    scene = framed(mesh, medium, [LIGHTS[name]], (0.0, 0.0, 0.0))
    truth = render(scene, SIZE, tolerance=1e-4).radiance
    assert_agree(*traced(mitsuba, scene, tmp_path, 1024, max_depth=2), truth)


@pytest.mark.parametrize("name", ["lamp", "sun"])
def test_many_events(mitsuba: Any, mesh: Mesh, tmp_path: Path, name: str) -> None:
    """Two independent estimates: their errors add up."""
    medium = Medium(absorption=(1.0, 2.0, 4.0), scattering=(8.0, 4.0, 6.0), anisotropy=0.4)
    scene = framed(mesh, medium, [LIGHTS[name]], (0.2, 0.2, 0.2))
    frame, error = path_trace(scene, SIZE, paths=128)
    found, other = traced(mitsuba, scene, tmp_path, 256)
    assert_agree(found, np.hypot(error, other), frame.radiance)
