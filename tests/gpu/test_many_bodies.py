"""Scenes of many bodies: what is done for a frame grows as their number does, and not with its square."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh

import translucent as tl
from tests.work import calls
from translucent.gpu import light_cameras
from translucent.gpu.constants import INTERIOR_SIZE
from translucent.gpu.light_cameras import ShadowOccluders, support_of
from translucent.gpu.placement import PlacedScene, SampleView, face_counts
from translucent.gpu.uniforms import BodyRoles, body_records, clip_rows

_BOX = trimesh.creation.box((1, 1, 1))
BOX = tl.Mesh(_BOX.vertices, _BOX.faces)
GLASS, WINE = tl.Medium(absorption=1.0, ior=1.5), tl.Medium(absorption=(1, 2, 3))
FEW = 20


def scene(count: int, overlap: str) -> tl.Scene:
    """Bodies with interfaces and without, sheets, and opaque objects, one after the other."""
    kinds = [(GLASS, None), (WINE, None), (GLASS, 1e-3), (None, None)]
    objects = []
    for i in range(count):
        medium, sheet = kinds[i % len(kinds)]
        at = trimesh.transformations.translation_matrix((2.0 * i, 0, 0))
        objects.append(tl.Object(BOX, medium, at, sheet_thickness=sheet))
    return tl.Scene(objects, tl.Camera.look_at((0, 0, 20), (0, 0, 0)), overlap=overlap)


@pytest.mark.parametrize("method", [None, tl.FragmentLists()])
def test_frames_of_many_bodies_are_drawn_in_linear_time(method: tl.Method | None, renderer: tl.Renderer) -> None:
    def work(count: int) -> int:
        given = scene(count, "add")
        return calls(lambda: renderer.render(given, (8, 8), method, samples=2))

    work(FEW)
    most, more, few = (work(number * FEW) for number in (3, 2, 1))
    # What a frame takes besides its bodies is the same for any number of them.
    assert most - more < 1.1 * (more - few)


@pytest.mark.parametrize("method", [None, tl.FragmentLists()])
def test_samples_cost_each_body_little_more_than_its_draws(method: tl.Method | None, renderer: tl.Renderer) -> None:
    def work(count: int, samples: int) -> int:
        given = scene(count, "add")
        return calls(lambda: renderer.render(given, (8, 8), method, samples=samples, adaptive=False))

    def added(count: int) -> int:
        work(count, 2)  # makes what is kept for all scenes of these bodies
        return work(count, 4) - work(count, 2)

    more = added(2 * FEW) - added(FEW)
    # Half of the bodies are drawn more than once, in some seven calls each; nothing else is done again for each.
    assert more / (2 * FEW) < 30


def test_bodies_are_placed_as_each_alone() -> None:
    """All at a time or one at a time: the same bits, of mirrored and inverted ones, and with the eye on a surface."""
    inverted = tl.Mesh(_BOX.vertices, _BOX.faces[:, ::-1])
    turned = trimesh.transformations.rotation_matrix(0.7, (1, 2, 3), (4, 5, 6))
    matrices = [turned @ np.diag([1.5, 2.0, 2.5, 1.0]), turned @ np.diag([-1.0, 1.0, 1.0, 1.0]), np.eye(4)]
    objects = [tl.Object(mesh, WINE, matrix) for mesh in (BOX, inverted) for matrix in matrices]
    for eye in ((0.5, 0.1, 0.2), (1, 2, 9)):
        camera = tl.Camera.look_at(eye, (0, 0, 0))

        def records(*items: tl.Object, camera: tl.Camera = camera) -> Any:
            placed = PlacedScene.of(tl.Scene(items, camera))
            roles = BodyRoles(True, np.ones(len(items)), face_counts(placed.scene, 8), np.zeros(len(items), np.intp))
            found = body_records(placed, roles, np.zeros(3))
            found["clip_from_offset"] = clip_rows(placed, SampleView(camera, (8, 6), (0.25, 0.125)))
            return found

        together = records(*objects)
        for i, item in enumerate(objects):
            alone = records(item)[0]
            for name in ("clip_from_offset", "world_from_normal", "eye_from_offset", "axis", "starts_unknown"):
                assert (together[i][name] == alone[name]).all()
        assert together["starts_unknown"].any() == (eye[0] == 0.5)
        normals = together["world_from_normal"][:, :3, :3]
        assert (normals[3:] == -normals[:3]).all()  # those of inverted meshes point inwards
        assert (normals[2] == np.eye(3)).all()


def _floor(count: int) -> tuple[tl.Scene, ShadowOccluders]:
    """A floor of flat tiles that a lamp lights, with a ball on it, and what throws shadows there."""
    tile = tl.Mesh([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)])
    tiles = [tl.Object(tile, None, trimesh.transformations.translation_matrix((i, 0, 0))) for i in range(count)]
    ball = tl.Object(BOX, WINE, trimesh.transformations.translation_matrix((2, 0.5, 1)))
    given = tl.Scene([*tiles, ball], tl.Camera.look_at((0, 0, 20), (0, 0, 0)))
    lamp = tl.PointLight((1, 1, 9), 1.0)
    return given, ShadowOccluders(lamp, given, [support_of(item) for item in given.objects])


def test_tiles_that_shadow_none_are_found_in_linear_time() -> None:
    assert set(_floor(FEW)[1].grounds) == set(range(FEW))
    work = [calls(lambda count=count: _floor(count)) for count in (FEW, 2 * FEW, 3 * FEW)]  # type: ignore[misc]
    assert work[2] - work[1] < 1.1 * (work[1] - work[0])


def test_tiles_beyond_those_that_are_compared_throw_shadows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(light_cameras, "MOST_GROUNDS", 4)
    found = _floor(FEW)[1]
    assert len(found.grounds) == 4
    assert set(found.blocking) == set(range(FEW)) - set(found.grounds)


def test_more_bodies_over_one_another_than_traced_rays_know_of_are_named(renderer: tl.Renderer) -> None:
    at = trimesh.transformations.translation_matrix
    boxes = [tl.Object(BOX, tl.Medium(absorption=1.0, ior=1.5), at((0, 0, 0.01 * i))) for i in range(INTERIOR_SIZE + 1)]
    with pytest.warns(tl.TranslucentWarning, match=f"more than {INTERIOR_SIZE} bodies at once"):
        renderer.render(tl.Scene(boxes, tl.Camera.look_at((0.3, 0.2, 5), (0, 0, 0))), (8, 8))
    renderer.render(tl.Scene(boxes[1:], tl.Camera.look_at((0.3, 0.2, 5), (0, 0, 0))), (8, 8))


def test_sixty_media_side_by_side_are_told_apart(renderer: tl.Renderer) -> None:
    """A sum needs no winding numbers, which a ray has for 16 bodies: each box has the optical depth of its medium."""
    at = trimesh.transformations.translation_matrix
    boxes = [tl.Object(BOX, tl.Medium(absorption=1.0 + i), at((1.5 * i, 0, 0)), priority=i % 7) for i in range(60)]
    pose = np.eye(4)
    pose[:3, 3] = 1.5 * 29.5, 0.0, 5.0
    camera = tl.Camera(pose, fov_y=None, height=1.5)
    for overlap in ("add", "union", "priority"):
        frame = renderer.render(tl.Scene(boxes, camera, overlap=overlap), (180, 3))  # type: ignore[arg-type]
        np.testing.assert_allclose(frame.optical_depth[1, 1::3, 0], np.arange(1.0, 61.0), rtol=1e-5)
        assert frame.valid.all()
