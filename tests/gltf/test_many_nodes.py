"""Scenes of thousands of nodes: what is done with them grows as their number does, and not with its square."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.gltf.gltf_writer import Writer, glass
from tests.values.plan_scenes import BOX, CAMERA, DIAMOND, GLASS, OPEN, WINE, body
from tests.work import calls
from translucent.geometry import mesh as meshes
from translucent.planning.bodies import medium_slots
from translucent.planning.plan import plan
from translucent.scene import scene as overlaps
from translucent.scene.scene import first_overlap
from translucent.scene.showcase import filled

#: Twice as many nodes; what is linear takes twice as many calls, but for what is done once.
FEW, MANY = 60, 120
MOST = 2.2


def by_force(boxes: Any, matters: Any = None) -> tuple[int, int] | None:
    for later in range(len(boxes)):
        for earlier in range(later):
            one, other = boxes[earlier], boxes[later]
            if (one[0] < other[1]).all() and (one[1] > other[0]).all() and (not matters or matters(earlier, later)):
                return earlier, later
    return None


def some_boxes(random: np.random.Generator, count: int) -> Any:
    """Boxes of whole coordinates, so that many touch, some are flat, and some are equal."""
    low = random.integers(0, 6, (count, 3))
    return np.stack([low, low + random.integers(0, 3, (count, 3))], axis=1).astype(np.float64)


@pytest.mark.parametrize("count", [0, 1, 2, 3, 8, 20])
def test_overlapping_boxes_are_those_that_all_pairs_show(count: int) -> None:
    random = np.random.default_rng(count)
    for _ in range(60):
        boxes, kind = some_boxes(random, count), random.integers(0, 2, count)
        assert first_overlap(boxes) == by_force(boxes)
        matters: Callable[[Any, Any], Any] = lambda one, other: kind[one] != kind[other]  # noqa: E731, B023
        assert first_overlap(boxes, matters) == by_force(boxes, matters)


def test_boxes_are_compared_a_part_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(overlaps, "MOST_PAIRS", 5)
    random = np.random.default_rng(0)
    for _ in range(60):
        boxes = some_boxes(random, 12)
        found = first_overlap(boxes)
        assert (found is None) == (by_force(boxes) is None)
        if found is not None:
            assert by_force(boxes[list(found)]) == (0, 1)
            assert found[0] < found[1]


@pytest.mark.parametrize("shape", [(900, 1, 1), (1, 30, 30), (9, 10, 10)])
def test_few_pairs_of_boxes_are_compared(shape: tuple[int, int, int]) -> None:
    low = np.stack(np.meshgrid(*map(np.arange, shape)), axis=-1).reshape(-1, 3) * 2.0
    boxes = np.stack([low, low + 1.0], axis=1)
    compared: list[int] = []

    def note(one: Any, other: Any) -> Any:
        compared.append(len(one))
        return np.zeros(len(one), dtype=bool)

    assert first_overlap(boxes, note) is None
    assert sum(compared) == 0
    candidates = sum(len(one) for one, _ in overlaps._candidates(boxes))
    assert candidates < 900 * 100 / 2  # of 900 * 899 / 2


SCENES: dict[str, Callable[[int], tl.Scene]] = {
    "one medium": lambda n: tl.Scene([body(x=2.0 * i) for i in range(n)], CAMERA),
    "media": lambda n: tl.Scene([body((GLASS, WINE)[i % 2], x=2.0 * i) for i in range(n)], CAMERA),
    "bodies with interfaces": lambda n: tl.Scene([body(DIAMOND, x=2.0 * i) for i in range(n)], CAMERA),
    "open bodies": lambda n: tl.Scene([body(mesh=OPEN, x=2.0 * i) for i in range(n)], CAMERA),
    "union": lambda n: tl.Scene([body(x=2.0 * i) for i in range(n)], CAMERA, overlap="union"),
    "priority": lambda n: tl.Scene(
        [body(tl.Medium(absorption=1.0 + i % 9), x=2.0 * i) for i in range(n)], CAMERA, overlap="priority"
    ),
    "sheets and opaque objects": lambda n: tl.Scene(
        [body((GLASS, None)[i % 2], x=2.0 * i, sheet_thickness=(1e-3, None)[i % 2]) for i in range(n)], CAMERA
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_plans_are_made_in_linear_time(name: str) -> None:
    BOX.diagnosis, OPEN.diagnosis  # noqa: B018 - once, whoever asks first

    def work(count: int) -> int:
        return calls(lambda: plan(SCENES[name](count)))

    work(2)
    assert work(MANY) < MOST * work(FEW)


def test_slots_of_bodies_that_keep_apart_are_found_in_linear_time() -> None:
    def work(count: int) -> int:
        scene = SCENES["open bodies"](count)
        return calls(lambda: medium_slots(scene))

    work(2)
    assert work(MANY) < MOST * work(FEW)


def many_nodes(path: Path, count: int, *, shared: bool, deep: bool = False) -> Path:
    writer = Writer()
    material, primitive = writer.material(name="glass", extensions=glass()), writer.primitive()
    meshes = [writer.mesh(primitive | {"material": material}) for _ in range(1 if shared else count)]
    for i in range(count):
        writer.add("nodes", mesh=meshes[i % len(meshes)], translation=[9.0 * i, 0, 0], name=f"part {i}")
    root = writer.add("nodes", children=list(range(count)))
    writer.add("scenes", nodes=[root])
    return writer.save(path)


@pytest.mark.parametrize("shared", [True, False])
def test_files_of_many_nodes_are_read_in_linear_time(shared: bool, tmp_path: Path) -> None:
    def work(count: int) -> int:
        path = many_nodes(tmp_path / f"{count}.glb", count, shared=shared)
        return calls(lambda: tl.load_scene(path))

    work(2)
    # What is read of the environment is the same for any number.
    assert work(MANY) - work(FEW) < 1.1 * 2 * (work(FEW) - work(FEW // 2))


def test_a_mesh_that_nodes_share_is_looked_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    diagnose = meshes.diagnose
    monkeypatch.setattr(meshes, "diagnose", lambda *arguments: found.append(1) or diagnose(*arguments))
    scene = tl.load_scene(many_nodes(tmp_path / "shared.glb", 20, shared=True))
    plan(scene)
    plan(filled(scene, WINE))
    assert len(scene.objects) == 20
    assert len({item.mesh for item in scene.objects}) == len(found) == 1
    looked = []
    monkeypatch.setattr(meshes.np, "isfinite", lambda array: looked.append(1))
    scene.objects[0].mesh.require_finite()
    assert looked == []


def test_messages_name_the_first_of_many_objects() -> None:
    meshes = [tl.Mesh(OPEN.vertices, OPEN.faces, name=f"part {i}") for i in range(12)]
    text = str(plan(tl.Scene([body(DIAMOND, mesh, x=3.0 * i) for i, mesh in enumerate(meshes)], CAMERA)))
    assert "'part 6', 'part 7' and 4 more: normal and position" in text
    assert "'part 8' and" not in text
    alike = str(plan(tl.Scene([body(DIAMOND, OPEN, x=3.0 * i) for i in range(12)], CAMERA)))
    assert alike.count("open edges") == 1
