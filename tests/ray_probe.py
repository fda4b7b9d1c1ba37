"""Nearest surfaces on rays anywhere in a scene, found on the GPU as the traced interfaces find them.

To check hierarchies, and to measure them.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
import numpy.typing as npt

import translucent as tl
from tests.rays import Found
from translucent.arrays import Array, Integers
from translucent.gpu.embree_hits import EmbreeHits
from translucent.gpu.hierarchies import SceneHierarchies, packed_mesh
from translucent.gpu.passes.variants import Variants
from translucent.gpu.shaders import set_uniform
from translucent.gpu.uniforms import object_rows, packed_objects
from translucent.scene.scene import Scene

_SAMPLERS = ("ray_origins", "ray_directions", "object_table", "hierarchy_nodes", "hierarchy_triangles")

#: Rays in a row of the texture that holds them.
_WIDTH = 1024

#: Where rays end that nothing ends.
_NOTHING = np.float32(1e30)


@dataclass(frozen=True, eq=False)
class NearestHits:
    """Nearest surfaces on rays.

    Attributes
    ----------
    path : (n,) float32
        Metres from the origin; 1e30 where nothing is hit.
    object : (n,) int64
        Number of the object in its scene; -1 where nothing is hit.
    face : (n,) int64
        Face of its mesh; -1 where nothing is hit.
    """

    path: npt.NDArray[np.float32]
    object: Integers
    face: Integers


class RayProbe:
    """Tracer of single rays through the hierarchies of a scene.

    Parameters
    ----------
    gl : moderngl.Context
    """

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._variants = Variants(gl, "geometry/fullscreen.vert", "transport/rays.frag", *_SAMPLERS)

    def nearest(
        self,
        scene: Scene,
        hierarchies: SceneHierarchies,
        origins: Array,
        directions: Array,
        start: npt.ArrayLike = 0.0,
        end: npt.ArrayLike = _NOTHING,
    ) -> NearestHits:
        """Trace rays to the nearest surface of any object.

        Parameters
        ----------
        scene : Scene
        hierarchies : SceneHierarchies
            Of its meshes.
        origins, directions : (n, 3) float64
            In the world; directions have unit length.
        start, end : array_like (n,) or float
            Metres from the origins between which surfaces count.
        """
        count = len(origins)
        center = scene_center(scene)
        size = _WIDTH, -(-count // _WIDTH)
        with np.errstate(under="ignore"):
            rays = np.zeros((2, size[0] * size[1], 4), np.float32)
            rays[0, :count, :3], rays[1, :count, :3] = origins - center, directions
            rays[0, :count, 3], rays[1, :count, 3] = start, end
            placements, frame = hierarchies.place(scene, center)
        rows = packed_objects(object_rows(scene, {}), placements)
        made = [self._gl.texture(size, 4, part, dtype="f4") for part in rays]
        made.append(self._gl.texture(rows.shape[1::-1], 4, rows, dtype="f4"))
        found = self._gl.texture(size, 4, dtype="i4")
        framebuffer = self._gl.framebuffer([found])
        program = self._variants.program(ONE_OBJECT=len(scene.objects) == 1)
        if "object_nodes" in program:
            set_uniform(program, "object_nodes", hierarchies.object_nodes)
            set_uniform(program, "objects_frame", frame)
        self._variants.bind(**dict(zip(_SAMPLERS, (*made, hierarchies.nodes, hierarchies.triangles), strict=True)))
        framebuffer.use()
        self._gl.enable_only(moderngl.NOTHING)
        self._variants.draw_fullscreen(program)
        hits = np.frombuffer(found.read(), np.int32).reshape(-1, 4)[:count]
        for resource in (framebuffer, found, *made):
            resource.release()
        item = hits[:, 1].astype(np.int64)
        return NearestHits(hits[:, 0].copy().view(np.float32), item, hierarchies.faces(scene, item, hits[:, 2]))


def embree_hits(scene: tl.Scene, hits: EmbreeHits, origins: Array, directions: Array) -> Found:
    """The nearest surface of any object, as traced interfaces get it from Embree."""
    rays = origins - scene_center(scene), directions
    found = hits.nearest(*(part.astype(np.float32) for part in rays))
    face = np.full(len(origins), -1, np.int64)
    for number, body in enumerate(scene.objects):
        own = found.object == number
        face[own] = packed_mesh(body.mesh).faces[found.triangle[own]]
    return Found(found.path.astype(np.float64), found.object.astype(np.int64), face)


def scene_center(scene: Scene) -> Array:
    """(3,): center of the bounds of all objects, from which positions count."""
    boxes = np.stack([body.bounds for body in scene.objects])
    return np.asarray(0.5 * boxes[:, 0].min(axis=0) + 0.5 * boxes[:, 1].max(axis=0))
