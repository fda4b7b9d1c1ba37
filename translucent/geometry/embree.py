"""Candidate faces of rays from Embree, in float32."""

from __future__ import annotations

from functools import cache
from importlib.metadata import version
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask
from translucent.errors import RenderError
from translucent.geometry.mesh import Mesh

if TYPE_CHECKING:
    from embreex.rtcore_scene import EmbreeScene


#: Step behind a face at which the search for the next one begins, in radii of the mesh: nearer, float32 finds it again.
STEP = 2e-6

#: Distance before the middle of the mesh at which a search begins, in radii.
BEFORE = 1.01


class EmbreeMesh:
    """Mesh in an Embree scene of its own, moved and scaled into the unit ball.

    Parameters
    ----------
    mesh : Mesh

    Attributes
    ----------
    center : (3,) float64
        Where the middle of the ball is, in the coordinates of the mesh.
    radius : float
        Of the ball, in metres.
    scene : EmbreeScene
        Ready for rays.

    Raises
    ------
    RenderError
        If embreex cannot be imported.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.center = mesh.center
        self.radius = 0.5 * mesh.diagonal
        with np.errstate(under="ignore"):
            vertices = ((mesh.vertices - self.center) / self.radius).astype(np.float32)
        self.scene = embree_scene(vertices, mesh.faces)

    def candidates(
        self, origins: Array, directions: Array, expected: Integers, counted: Mask
    ) -> tuple[Integers, Integers]:
        """Faces on whole lines, ahead of the origins and behind.

        Embree tells only the nearest face ahead, so the search for the next one starts a little behind it. What is
        within this step is missed, and near edges a neighbor may be told instead of the face.

        Parameters
        ----------
        origins, directions : (k, 3) float64
            In the ball; directions have unit length.
        expected : (k,) int64
            After how many faces each search ends.
        counted : (m,) bool
            Faces that count.

        Returns
        -------
        ray, face : (n,) int64
        """
        rays, faces = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
        start = starts(origins, directions)
        step, last = np.full(len(start), STEP), np.full(len(start), -1)
        missing = expected.copy()
        live = np.flatnonzero(missing > 0)
        # Twice as often as there are faces, for those that are found again; no ray may circle for ever.
        for _ in range(2 * int(expected.max(initial=0)) + 8):
            face, distance = self.first_hits(origins[live] + start[live, None] * directions[live], directions[live])
            hit = face >= 0
            live, face, distance = live[hit], face[hit], distance[hit]
            again = face == last[live]
            rays.append(live[~again])
            faces.append(face[~again])
            last[live] = face
            missing[live] -= counted[face] & ~again
            step[live] = np.where(again, 2.0 * step[live], STEP)
            start[live] += distance + step[live]
            live = live[missing[live] > 0]
            if not live.size:
                break
        return np.concatenate(rays), np.concatenate(faces)

    def first_hits(self, origins: Array, directions: Array) -> tuple[Integers, Array]:
        """Nearest face ahead, (k,), -1 where there is none, and its distance (k,); rays as for `candidates`."""
        with np.errstate(under="ignore", over="ignore"):
            rays = origins.astype(np.float32), directions.astype(np.float32)
        hits = self.scene.run(*rays, output=True)
        return hits["primID"].astype(np.int64), hits["tfar"].astype(np.float64)


def starts(origins: Array, directions: Array) -> Array:
    """(k,): distance from the origins at which rays are about to enter the ball; rays as for `candidates`."""
    return np.asarray(-np.einsum("ki,ki->k", origins, directions) - BEFORE)


def embree_versions() -> dict[str, str]:
    """Versions of embreex, and of the Embree in it; raises `RenderError` if it cannot be imported."""
    _import_embreex()
    return {"embreex": version("embreex"), "embree": _embree_version()}


@cache  # making a device takes milliseconds, and each record of a batch asks
def _embree_version() -> str:
    from embreex.rtcore import EmbreeDevice

    return str(EmbreeDevice()).rpartition(" ")[2]


def _import_embreex() -> None:
    try:
        import embreex.mesh_construction
        import embreex.rtcore_scene  # noqa: F401
    except ImportError as error:
        raise RenderError(
            "rendering on the CPU",
            f"embreex cannot be imported ({error})",
            "pip install embreex, or render with OpenGL (`translucent doctor` says how)",
        ) from None


def embree_scene(vertices: npt.NDArray[np.float32], faces: npt.NDArray[np.int32]) -> EmbreeScene:
    """Embree scene of triangles, ready for rays; raises `RenderError` if embreex cannot be imported."""
    _import_embreex()
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene = EmbreeScene(robust=True)
    TriangleMesh(scene, vertices, faces)
    # The first ray builds the acceleration structure, which several threads must not do at once.
    scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))
    return scene
