"""Correctness and speed of rays through hierarchies on the GPU, and the time that building them takes.

``python tools/check_rays.py [--rays N] [--quick] [MESH ...]`` prints a line of JSON for each mesh (default: four of the
toolkit): triangles, seconds to build and to pack, how many random rays meet another surface than Embree says, how many
meet another on the GPU than with the hits of traced interfaces by Embree, how many
from inside find no way out, millions of rays per second of processor time beside Embree's on the same rays; then
one for balls of 20 thousand and of a million triangles without the comparison.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).parents[1]))

import translucent as tl
from tests.ray_probe import RayProbe, embree_hits, scene_center
from tests.rays import agreeing, embree_nearest, inside_points, random_rays, sah_cost
from translucent.assets import mesh_path
from translucent.geometry.bvh import build_hierarchy
from translucent.geometry.normals import drawn_normals
from translucent.geometry.ray_caster import RayCaster
from translucent.gpu.embree_hits import EmbreeHits
from translucent.gpu.hierarchies import SceneHierarchies, packed_mesh

#: Meshes of the toolkit: a shape of blobs, thin walls, many turns, and holes.
OWN = ("bear", "goblet", "knot", "bangle")

#: Rays of a chunk.
CHUNK = 1 << 18


def built(mesh: tl.Mesh) -> dict[str, Any]:
    """Seconds of processor time for a mesh, which are those of one core."""
    corners = ((mesh.vertices - mesh.center) / np.ptp(mesh.bounds, axis=0).max()).astype(np.float32)[mesh.faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    drawn_normals(mesh)
    begin = time.process_time()
    tree = build_hierarchy(low, high)
    middle = time.process_time()
    packed_mesh(mesh)
    end = time.process_time()
    return {
        "triangles": len(mesh.faces),
        "build_seconds": round(middle - begin, 3),
        "packed_seconds": round(end - middle, 3),
        "nodes": len(tree.size),
        "cost": round(sah_cost(tree), 1),
    }


def checked(renderer: tl.Renderer, mesh: tl.Mesh, rays: int, rng: np.random.Generator) -> dict[str, Any]:
    """Comparison of random rays with Embree, and leaks of rays from inside."""
    scene = tl.Scene([tl.Object(mesh, tl.Medium())], tl.Camera.framing(mesh.vertices, (64, 64)))
    embree = RayCaster(mesh)
    found = {"different": 0, "hits_different": 0, "hit": 0}
    seconds = np.zeros(2)
    with renderer.gpu.context.current() as gl:
        probe, held, hits = RayProbe(gl), SceneHierarchies(gl, [mesh], 1), EmbreeHits(scene, scene_center(scene))
        probe.nearest(scene, held, np.zeros((1, 3)), np.eye(3)[:1])  # compiles
        for begin in range(0, rays, CHUNK):
            origins, directions = random_rays(scene, min(CHUNK, rays - begin), rng)
            started = time.process_time()
            ours = probe.nearest(scene, held, origins, directions)
            seconds[0] += time.process_time() - started
            local = (origins - embree.center) / embree.radius
            started = time.process_time()
            embree.first_hits(local, directions)
            seconds[1] += time.process_time() - started
            theirs = embree_nearest(scene, origins, directions)
            found["different"] += int((~agreeing(scene, ours, theirs)).sum())
            own = embree_hits(scene, hits, origins, directions)
            found["hits_different"] += int((~agreeing(scene, ours, own)).sum())
            found["hit"] += int((theirs.face >= 0).sum())
        leaks = None
        if mesh.diagnosis.solid:
            origins = np.repeat(inside_points(mesh, 64, rng), rays // 64, axis=0)
            directions = rng.normal(size=origins.shape)
            directions /= np.linalg.norm(directions, axis=1, keepdims=True)
            leaks = int((probe.nearest(scene, held, origins, directions).face < 0).sum())
        held.release()
    rates = {f"{name}_mrays": round(rays / s / 1e6, 2) for name, s in zip(("gl", "embree"), seconds, strict=True)}
    return {"rays": rays, **found, "leaks": leaks, **rates}


def crowd(subdivisions: int) -> tl.Mesh:
    """A ball with waves, of 20 * 4^n triangles."""
    made = trimesh.creation.icosphere(subdivisions)
    x, y, _ = made.vertices.T
    return tl.Mesh(made.vertices * (1 + 0.2 * np.sin(7 * y) * np.cos(5 * x))[:, None], made.faces, name="crowd")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", nargs="*", type=Path, help="default: four of the toolkit")
    parser.add_argument("--rays", type=int, default=1_000_000, help="random rays for each mesh")
    parser.add_argument("--quick", action="store_true", help="without the million triangles")
    given = parser.parse_args()
    rng = np.random.default_rng(20240611)
    with tl.Renderer() as renderer:
        for path in given.mesh or [mesh_path(name) for name in OWN]:
            mesh = tl.load_mesh(path)
            print(
                json.dumps({"mesh": mesh.name, **built(mesh), **checked(renderer, mesh, given.rays, rng)}), flush=True
            )
    if not given.quick:
        for subdivisions in (5, 8):
            print(json.dumps({"mesh": "crowd", **built(crowd(subdivisions))}), flush=True)


if __name__ == "__main__":
    main()
