"""Small pictures, drawn in a worker process: of media, on a ball in the studio, and of environments."""

from __future__ import annotations

import dataclasses
import hashlib
import os
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.assets import newest_shader
from translucent.formulas.color import linear_to_srgb
from translucent.formulas.tone import tone_curve
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Sphere
from translucent.media.preset import Preset
from translucent.planning.shadow_maps import ShadowMaps
from translucent.preview.tasks import Report
from translucent.renderer import Renderer
from translucent.scene.camera import Camera
from translucent.scene.environment_map import texel_directions
from translucent.scene.scene import Scene
from translucent.scene.showcase import named_environment, showcase, with_roughness
from translucent.scene.stages import DEFAULT_STAGE, STAGED_TONE, stage_named
from translucent.version import VERSION

Picture = npt.NDArray[np.uint8]

#: Sides in pixels of pictures of media, environments and models.
BALL, PANORAMA, MODEL = (96, 96), (128, 64), (120, 80)

#: Radius of the ball in metres: a body of some centimetres, for which most media are known.
RADIUS = 0.01

#: Samples of a pixel, and directions of the environment that throw shadows.
SAMPLES, SHADOWS = 4, ShadowMaps(directions=8)

#: Version of how the pictures are made, raised when they change: kept ones are then made again.
LOOK = 1


def ball_key(one: Preset) -> str:
    """Key of the picture of a preset: of its content, and of the version."""
    medium = one.medium
    values = (medium.absorption, medium.scattering, medium.emission, medium.anisotropy, medium.ior, one.roughness)
    return _key("ball", BALL, *(np.asarray(value, dtype=np.float64).tolist() for value in values))


def panorama_key(path: str) -> str:
    """Key of the picture of an environment: its name, or of a file as it is now."""
    try:
        found = os.stat(path)
    except OSError:
        return _key("panorama", PANORAMA, path)
    return _key("panorama", PANORAMA, os.path.realpath(path), found.st_mtime_ns, found.st_size)


def model_key(path: str) -> str:
    """Key of the picture of a model: one of a path, whatever the file says now."""
    return _key("model", os.path.realpath(path))


def _key(kind: str, *content: object) -> str:
    text = repr((kind, LOOK, VERSION, *content))
    return f"{kind}-{hashlib.sha256(text.encode('utf-8', 'surrogateescape')).hexdigest()[:32]}"


def draw_ball(report: Report, one: Preset) -> Picture:
    """Draw a ball of a medium on the default stage."""
    scene = with_roughness(showcase(_ball(), one.medium, BALL), one.roughness or None)
    frame = _renderer(newest_shader()).render(_closer(scene), BALL, samples=SAMPLES, shadows=SHADOWS)
    return np.ascontiguousarray(frame.to_srgb8(0.0, STAGED_TONE))


def draw_panorama(report: Report, name: str) -> Picture:
    """Draw all directions of an environment; pictures as bright as makes their middle gray."""
    width, height = PANORAMA
    lit = named_environment(name)
    if lit.map is not None:
        light = lit.map.reduced(height, width)
        middle = float(np.median(light.mean(axis=-1)))
        return _encoded(np.minimum(light * (0.35 / middle if middle > 0 else 1.0), 1e4))
    places = np.moveaxis(np.indices((width, height)) / height, 0, -1).swapaxes(0, 1)
    return _encoded(lit.radiance(texel_directions(height, width), places))


def _encoded(light: Array) -> Picture:
    with np.errstate(under="ignore"):
        return np.rint(255.0 * np.clip(linear_to_srgb(tone_curve(STAGED_TONE)(light)), 0.0, 1.0)).astype(np.uint8)


def model_picture(seen: Picture) -> Picture:
    """Small picture of a view, from its middle."""
    from PIL import Image, ImageOps

    return np.asarray(ImageOps.fit(Image.fromarray(seen), MODEL, Image.Resampling.BOX))


@lru_cache(maxsize=1)
def _ball() -> Mesh:
    return Sphere(radius=RADIUS).tessellate()


def _closer(scene: Scene) -> Scene:
    """Scene seen from where the ball fills the picture."""
    stage = stage_named(DEFAULT_STAGE)
    assert stage is not None
    camera = Camera.framing(scene.objects[0].mesh.vertices, BALL, stage.view)
    return dataclasses.replace(scene, camera=camera)


@lru_cache(maxsize=1)
def _renderer(written: float) -> Renderer:
    """Renderer of the worker process, for one version of the shaders."""
    return Renderer()
