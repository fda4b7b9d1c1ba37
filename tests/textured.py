"""Scenes in which textures lie behind the first surface that a ray hits."""

from __future__ import annotations

import numpy as np

import translucent as tl
from translucent.geometry.solids import Box, Sphere

CAMERA = tl.Camera.look_at((0.4, 0.5, 6.0), (0, 0, 0), fov_y=21)
SKY = tl.Environment.gradient((1.0, 0.5, 0.2), (0.1, 0.5, 1.0))
GLASS = tl.Medium((0.1, 0.3, 0.6), ior=1.5)


def checkers(dark: tuple[float, ...], light: tuple[float, ...], scale: float = 1.3) -> tl.Texture:
    """Two by two squares that repeat, of `dark` and `light` RGB, blurred by half their side."""
    pixels = np.array([[dark, light], [light, dark]])
    return tl.Texture(pixels, scale=(scale, scale), offset=(0.1, 0.3), rotation=15.0)


def unwrapped(mesh: tl.Mesh) -> tl.Mesh:
    """The mesh with texture coordinates that are those along x and z, sheared by y."""
    x, y, z = mesh.vertices.T
    return tl.Mesh(mesh.vertices, mesh.faces, uv=np.stack([x + 0.4 * y, z - 0.7 * y], axis=1))


def colored(mesh: tl.Mesh) -> tl.Mesh:
    """The mesh with another color at each vertex, and texture coordinates."""
    colors = np.ones((len(mesh.vertices), 4))
    colors[:, :3] = 0.5 + 0.45 * np.sin(3.0 * mesh.vertices + [0.0, 1.0, 2.0])
    return tl.Mesh(mesh.vertices, mesh.faces, uv=unwrapped(mesh).uv, colors=colors)


BALL = unwrapped(Sphere().tessellate(10))
CUBE = unwrapped(Box((-0.5, -0.4, -0.45), (0.45, 0.5, 0.4)).tessellate())
SLAB = unwrapped(Box((-0.55, -0.7, -3.0), (0.6, -0.3, -1.3)).tessellate())
PAINT = tl.Surface(color=(0.9, 0.8, 0.7), ior=1.0, color_texture=checkers((0.05, 0.1, 0.6), (1.0, 0.9, 0.2)))


def _scene(*objects: tl.Object) -> tl.Scene:
    return tl.Scene(list(objects), CAMERA, [], SKY, "priority")


def _glass(surface: tl.Surface | None = None, mesh: tl.Mesh = BALL) -> tl.Object:
    return tl.Object(mesh, GLASS, surface=surface)


#: Scenes by what they show.
TEXTURED = {
    "painted cube in glass": _scene(_glass(), tl.Object(CUBE, None, surface=PAINT)),
    "painted slab behind glass": _scene(_glass(), tl.Object(SLAB, None, surface=PAINT)),
    "glass that is rough in places": _scene(
        _glass(tl.Surface(roughness=0.7, roughness_texture=checkers((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))))
    ),
    "painted pane before a painted cube": _scene(
        tl.Object(
            unwrapped(tl.Mesh([(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)], [(0, 1, 2), (0, 2, 3)])),
            tl.Medium(absorption=100.0, ior=1.5),
            surface=tl.Surface(color_texture=checkers((0.1, 0.9, 0.3), (1.0, 0.3, 0.9))),
            sheet_thickness=1e-3,
        ),
        tl.Object(colored(CUBE), None, surface=PAINT),
    ),
    "glass over a base in places": _scene(
        _glass(
            tl.Surface(
                transmission=0.9,
                transmission_texture=checkers((0.2, 0.2, 0.2), (1.0, 1.0, 1.0)),
                color_texture=checkers((0.9, 0.2, 0.1), (0.2, 0.9, 0.8), 2.0),
            ),
            colored(BALL),
        )
    ),
}
