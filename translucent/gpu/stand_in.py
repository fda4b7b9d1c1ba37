"""Quick preview picture: bodies in one color each, by a small program that compiles at once.

A material that is chosen for the first time may need programs that a driver compiles for many seconds. This picture
needs none of them, no normals and no solution for scattered light: see ``shaders/present/stand_in.frag``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import moderngl
import numpy as np

from translucent.arrays import Array
from translucent.formulas.tone import TONES
from translucent.gpu.resources import MeshCache
from translucent.gpu.shaders import build_program, set_uniform, set_used
from translucent.media.albedo import hulst_color
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import PositionalLight
from translucent.scene.scene import Object, Scene

#: Directions in which the light of an environment is looked up.
DIRECTIONS = 256

#: Optical depth up to which what is left of light is more than nothing.
DEEPEST = 60.0

#: Reflectance of the air's interface with an opaque coat, seen straight: that of an ior of 1.5.
COAT = 0.04


class StandIn:
    """Programs of quick preview pictures.

    Parameters
    ----------
    gl : moderngl.Context
    meshes : MeshCache
    """

    def __init__(self, gl: moderngl.Context, meshes: MeshCache) -> None:
        self._gl, self._meshes = gl, meshes
        self._programs: dict[int, moderngl.Program] = {}

    def draw(
        self, into: moderngl.Framebuffer, scene: Scene, look: tuple[float, str], under: Callable[[], None] | None
    ) -> None:
        """Draw the bodies of a scene, hidden by opaque objects where these are nearer.

        Parameters
        ----------
        into : moderngl.Framebuffer
            With a depth buffer.
        scene : Scene
        look : (float, str)
            Exposure in stops, and the name of the tone curve.
        under : callable, optional
            Draws what is around the bodies. Without it, that is the mean background, and opaque objects.
        """
        gl, tone = self._gl, TONES.index(look[1])
        budget, gl.extra = gl.extra, None  # what this needs waits for nothing
        try:
            if tone not in self._programs:
                files = "present/stand_in.vert", "present/stand_in.frag"
                self._programs[tone] = build_program(gl, *files, {"TONE": tone})
            program, camera = self._programs[tone], scene.camera
            set_uniform(program, "seen", _floats(seen_matrix(camera, into.size, _reach(scene)).T))
            facing = np.append(camera.forward, float(camera.fov_y is None))
            set_used(program, {"forward": tuple(facing.tolist()), "stops": look[0]})
            into.use()
            into.clear(*_background(scene), depth=1.0)
            bands = light_bands(scene.environment)
            for translucent in (False, True):
                if translucent and under is not None:
                    under()
                into.use()
                gl.enable_only(moderngl.DEPTH_TEST)
                for item in scene.objects:
                    if (item.medium is not None) is translucent:
                        values = _values(item, scene, bands)
                        set_used(program, {name: _floats(value) for name, value in values.items()})
                        self._meshes[item.mesh].vertex_array(program, item.mesh).render()
        finally:
            gl.extra = budget

    def release(self) -> None:
        """Free the programs."""
        for program in self._programs.values():
            program.release()
        self._programs.clear()


def _reach(scene: Scene) -> tuple[float, float]:
    """Nearest and farthest depth of a scene in metres."""
    eye = scene.camera.eye
    boxes = np.stack([item.bounds for item in scene.objects])
    middles, radii = boxes.mean(axis=1), 0.5 * np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1)
    distances = np.linalg.norm(middles - eye, axis=1)
    farthest = float((distances + radii).max()) or 1.0
    return max(0.5 * float((distances - radii).min()), 1e-3 * float(distances.min()), 1e-6 * farthest), 2.0 * farthest


def _background(scene: Scene) -> tuple[float, float, float, float]:
    red, green, blue = np.clip(scene.environment.seen.mean, 0.0, 1.0).tolist()
    return red, green, blue, 1.0


def _values(item: Object, scene: Scene, bands: tuple[Array, Array]) -> dict[str, Any]:
    """Uniforms of an object."""
    placed = item.matrix.copy()
    placed[:3, 3] = item.matrix[:3, :3] @ item.mesh.center + item.matrix[:3, 3] - scene.camera.eye
    mean, slopes = bands
    middle = item.bounds.mean(axis=0)
    for light in scene.lights:  # a clamped cosine is 1/4 + 1/2 cos in these bands
        if isinstance(light, PositionalLight):
            towards = np.asarray(light.position) - middle
            towards = towards / max(float(np.linalg.norm(towards)), 1e-30)
            irradiance = light.irradiance_on(middle, towards) / np.pi
        else:
            towards, irradiance = -np.asarray(light.direction), np.asarray(light.irradiance) / np.pi
        mean = mean + 0.25 * irradiance
        slopes = slopes + 0.5 * towards[:, None] * irradiance
    found: dict[str, Any] = {"placed": placed.T, "mean_light": mean, "opaque": float(item.medium is None)}
    found |= dict(zip(("slope_right", "slope_up", "slope_back"), slopes, strict=True))
    if (medium := item.medium) is None:
        metal = 0.0 if item.surface is None or item.surface.ior == 1.0 else COAT
        dark = np.zeros(3)
        return found | {"absorbed": dark, "scattered": dark, "diffuse_color": item.base_color, "mirrored": metal}
    scattering = np.asarray(medium.scattering) * (1.0 - float(medium.anisotropy))
    events = np.asarray(medium.absorption) + scattering
    with np.errstate(invalid="ignore", divide="ignore"):
        albedo = np.where(events > 0, scattering / events, 0.0)
    # Of a ball, the longest chord is three halves of the mean one, which is twice the mean thickness.
    chord = 3.0 * item.mean_thickness
    return found | {
        "absorbed": np.minimum(np.asarray(medium.absorption) * chord, DEEPEST),
        "scattered": np.minimum(scattering * chord, DEEPEST),
        "diffuse_color": np.clip(hulst_color(albedo), 0.0, 1.0),
        "mirrored": ((medium.ior - 1.0) / (medium.ior + 1.0)) ** 2,
    }


def light_bands(environment: Environment) -> tuple[Array, Array]:
    """Mean radiance (3,) of an environment, and slopes (3, 3) along X, Y and Z of what surfaces get, over pi."""
    number = np.arange(DIRECTIONS) + 0.5
    height, angle = 1.0 - 2.0 * number / DIRECTIONS, np.pi * (1.0 + 5.0**0.5) * number
    level = np.sqrt(1.0 - height**2)
    directions = np.stack([level * np.cos(angle), height, level * np.sin(angle)], axis=1)
    radiance = environment.lighting(directions)
    return radiance.mean(axis=0), 2.0 * directions.T @ radiance / DIRECTIONS


def seen_matrix(camera: Camera, size: tuple[int, int], reach: tuple[float, float]) -> Array:
    """(4, 4): from the world, from the eye, to the picture, for depths between two in metres."""
    axes = np.eye(4)
    axes[:3, :3] = camera.pose[:3, :3].T
    half_width, half_height = camera.half_extent(size)
    near, far = reach
    if camera.fov_y is None:
        matrix = np.diag([1.0 / half_width, 1.0 / half_height, -1.0 / far, 1.0])
        return np.asarray(matrix @ axes)
    matrix = np.diag([1.0 / half_width, 1.0 / half_height, -(far + near) / (far - near), 0.0])
    matrix[2, 3], matrix[3, 2] = -2.0 * far * near / (far - near), -1.0
    return np.asarray(matrix @ axes)


def _floats(value: Any) -> Any:
    array = np.asarray(value, dtype=np.float64)
    return float(array) if array.ndim == 0 else tuple(array.reshape(-1).tolist())
