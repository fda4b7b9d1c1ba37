"""What is measured: scenes and methods, as data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from translucent.assets import mesh_path
from translucent.mesh import Mesh, load_mesh
from translucent.solids import Sphere, Torus
from translucent.thickness import BackFaceDepth, DepthPeeling, FragmentLists, KBuffer, Method, SignedDepth, ThinLayer


@dataclass(frozen=True)
class Case:
    """A mesh to measure on.

    Attributes
    ----------
    name : str
    why : str
        What it is hard on.
    mesh : callable
        Makes it.
    """

    name: str
    why: str
    mesh: Callable[[], Mesh]


def _subdivided(name: str, triangles: int) -> Mesh:
    """A mesh of the toolkit with each face cut in four until it has at least this many."""
    from trimesh.remesh import subdivide

    mesh = load_mesh(mesh_path(name))
    vertices, faces = mesh.vertices, mesh.faces
    while len(faces) < triangles:
        vertices, faces = subdivide(vertices, faces)
    return Mesh(vertices, faces, name=f"{name} subdivided")


CASES = (
    Case("sphere-100k", "convex, two layers", lambda: Sphere().tessellate(316)),
    Case("torus-100k", "concave, up to four layers", lambda: Torus().tessellate(316)),
    Case("knot", "concave, up to eight layers", lambda: _subdivided("knot", 80_000)),
)

METHODS: dict[str, Method] = {
    "signed-depth": SignedDepth(),
    "signed-depth from the camera": SignedDepth(anchored=False),
    "back-face-depth": BackFaceDepth(),
    "thin-layer": ThinLayer(),
    "fragment-lists": FragmentLists(),
    "depth-peeling": DepthPeeling(),
    "depth-peeling, 8 layers": DepthPeeling(max_layers=8),
    "k-buffer, 8": KBuffer(k=8),
}
