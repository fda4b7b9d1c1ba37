"""Scenes of glTF files at a time of their animations, and in a variant of their materials."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

import translucent as tl
from tests.gltf.gltf_writer import BOX, WINE, Json, Writer, glass, load
from translucent.gltf.nodes import sampled_channel

HALF = math.sqrt(0.5)
#: About y, by 0 and by 90 degrees.
TURNS = [[0.0, 0.0, 0.0, 1.0], [0.0, HALF, 0.0, HALF]]


def animated(path: str, times: list[float], values: Any, mode: str | None = "LINEAR", **node: Any) -> Writer:
    """A box on a node that is moved, hung on another one."""
    writer = Writer()
    writer.add("nodes", mesh=writer.mesh(), name="Box", **node)
    writer.add("nodes", children=[0], translation=[0.0, 0.0, 7.0])
    animate(writer, path, times, values, mode)
    return writer


def animate(writer: Writer, path: str, times: list[float], values: Any, mode: str | None = "LINEAR") -> None:
    sampler: Json = {"input": writer.accessor(times), "output": writer.accessor(values)}
    if mode is not None:
        sampler["interpolation"] = mode
    writer.add("animations", channels=[{"sampler": 0, "target": {"node": 0, "path": path}}], samplers=[sampler])


def pose(writer: Writer, tmp_path: Path, time: float) -> np.ndarray:
    (item,) = load(writer, tmp_path, time=time).objects
    return np.asarray(item.transform)


@pytest.mark.parametrize(("time", "x"), [(0.0, 1.0), (1.0, 1.0), (1.25, 1.5), (2.0, 3.0)])
def test_a_node_stands_between_its_keys(tmp_path: Path, time: float, x: float) -> None:
    """And at the first before them."""
    found = pose(animated("translation", [1, 2], [[1, 0, 0], [3, 0, 0]], None), tmp_path, time)
    np.testing.assert_allclose(found[:3, 3], [x, 0, 7], atol=1e-6)


def test_after_all_keys_a_node_stays_and_that_is_told(tmp_path: Path) -> None:
    writer = animated("translation", [1, 2], [[1, 0, 0], [3, 0, 0]])
    with pytest.warns(tl.TranslucentWarning, match=r"animations end after 2 s; the pose at 9 s is the last pose"):
        found = pose(writer, tmp_path, 9.0)
    np.testing.assert_allclose(found[:3, 3], [3, 0, 7], atol=1e-6)


@pytest.mark.parametrize(("time", "scale"), [(0.0, 1.0), (1.9, 1.0), (2.0, 3.0)])
def test_steps_hold_until_the_next_key(tmp_path: Path, time: float, scale: float) -> None:
    found = pose(animated("scale", [1, 2], [[1, 1, 1], [3, 3, 3]], "STEP"), tmp_path, time)
    np.testing.assert_allclose(found[:3, :3], scale * np.eye(3), atol=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rotations_take_the_shorter_arc(tmp_path: Path, sign: float) -> None:
    found = pose(animated("rotation", [0, 1], [TURNS[0], [sign * v for v in TURNS[1]]]), tmp_path, 1 / 3)
    expected = Rotation.from_rotvec([0, math.radians(30), 0]).as_matrix()
    np.testing.assert_allclose(found[:3, :3], expected, atol=1e-6)


def test_arcs_are_those_of_another_library() -> None:
    rng = np.random.default_rng(3)
    for turns in rng.normal(size=(20, 2, 4)):
        turns /= np.linalg.norm(turns, axis=1)[:, None]
        expected = Slerp([0, 1], Rotation.from_quat(turns))([0.3]).as_quat()[0]
        found = sampled_channel(np.array([0.0, 1.0]), turns[:, None], 0.3, "LINEAR", arc=True)
        assert abs(float(found @ expected)) == pytest.approx(1, abs=1e-12)


def test_cubic_splines_follow_their_tangents() -> None:
    """The derivative of a cubic as tangents gives the cubic itself."""
    times = np.array([0.0, 0.5, 2.0])
    keys = np.stack([3 * times**2 - 1, times**3 - times, 3 * times**2 - 1], axis=1)[..., None]
    for t in (0.1, 0.5, 1.7):
        np.testing.assert_allclose(sampled_channel(times, keys, t, "CUBICSPLINE", arc=False), t**3 - t, atol=1e-14)


def test_animations_play_at_once_and_the_first_moves_what_two_do(tmp_path: Path) -> None:
    writer = animated("translation", [0], [[1, 0, 0]])
    animate(writer, "translation", [0], [[9, 9, 9]])
    animate(writer, "scale", [0], [[2, 2, 2]])
    with pytest.warns(tl.TranslucentWarning, match="animations of a property that another animation moves"):
        found = pose(writer, tmp_path, 0)
    np.testing.assert_allclose(found[:3, 3], [1, 0, 7])
    assert found[0, 0] == 2


def test_what_is_moved_may_be_anything(tmp_path: Path) -> None:
    writer = animated("scale", [0], [[1, 1, 1]])
    writer.tree["animations"][0]["channels"][0]["target"]["path"] = ["scale"]
    with pytest.warns(tl.TranslucentWarning, match="animated properties"):
        pose(writer, tmp_path, 0)


def test_without_a_time_nodes_stand_as_written_and_animations_are_told(tmp_path: Path) -> None:
    writer = animated("translation", [0], [[1, 0, 0]], translation=[5.0, 0.0, 0.0])
    with pytest.warns(tl.TranslucentWarning, match=r"animations \(1\)"):
        (item,) = load(writer, tmp_path).objects
    assert item.transform[0, 3] == 5


def test_morph_targets_move_vertices_by_their_animated_weights(tmp_path: Path) -> None:
    """The second of two targets makes the box twice as large, by half of its weight halfway."""
    writer = animated("weights", [0, 1], [0, 0, 0, 1])
    zero, own = (writer.accessor(factor * np.asarray(BOX.vertices)) for factor in (0.0, 1.0))
    writer.tree["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": zero}, {"POSITION": own}]
    writer.tree["meshes"][0]["weights"] = [0.0, 0.25]
    with pytest.warns(tl.TranslucentWarning, match="animations"):
        (item,) = load(writer, tmp_path).objects
    np.testing.assert_allclose(np.ptp(item.mesh.vertices, axis=0), 1.25 * np.ptp(BOX.vertices, axis=0), rtol=1e-6)
    for time, factor in ((0.0, 1.0), (0.5, 1.5), (1.0, 2.0)):
        (item,) = load(writer, tmp_path, time=time).objects
        np.testing.assert_allclose(np.ptp(item.mesh.vertices, axis=0), factor * np.ptp(BOX.vertices, axis=0), rtol=1e-6)
        assert item.mesh.diagnosis.solid
    assert load(writer, tmp_path, time=0.0).duration == 1.0


def test_a_skin_moves_vertices_by_its_joints_whatever_its_node(tmp_path: Path) -> None:
    """The upper half of a box turns by 90 degrees about the joint above its middle, the lower half stays."""
    writer = animated("rotation", [0, 1], TURNS)  # of node 0, which is a joint here
    count = len(BOX.vertices)
    upper = (np.asarray(BOX.vertices)[:, 1] > 0).astype(float)
    attributes = writer.tree["meshes"][0]["primitives"][0]["attributes"]
    attributes["JOINTS_0"] = writer.accessor(np.tile([0, 1, 0, 0], (count, 1)), "u1")
    attributes["WEIGHTS_0"] = writer.accessor(np.stack([upper, 1 - upper, 0 * upper, 0 * upper], axis=1))
    joint, fixed = 0, 1
    del writer.tree["nodes"][joint]["mesh"]
    writer.tree["nodes"][joint]["translation"] = [0.0, 1.0, -7.0]
    back = [np.eye(4), np.eye(4)]
    back[0][3, 1], back[1][3, 2] = -1.0, -7.0  # by columns: from the places of the joints
    inverse = writer.accessor(np.stack(back).reshape(2, 16))
    skin = writer.add("skins", joints=[joint, fixed], inverseBindMatrices=inverse)
    writer.add("nodes", mesh=0, skin=skin, translation=[99.0, 0.0, 0.0], name="Body")
    item = load(writer, tmp_path, time=1.0).objects[0]
    found = item.mesh.vertices @ item.matrix[:3, :3].T + item.matrix[:3, 3]
    assert np.abs(found).max() < 4.0, "its node has no effect"
    low, high = found[found[:, 1] < 0], found[found[:, 1] > 0]
    np.testing.assert_allclose(np.abs(low).max(axis=0), [1, 2, 3], atol=1e-6)
    np.testing.assert_allclose(np.abs(high).max(axis=0), [3, 2, 1], atol=1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"joints": []}, "not a list of nodes"),
        ({"joints": [9]}, "nodes 9"),
        ({"joints": [0]}, "JOINTS_0 or WEIGHTS_0 has another length than the vertices"),
    ],
)
def test_a_broken_skin_is_refused(tmp_path: Path, change: Json, message: str) -> None:
    writer = animated("translation", [0], [[1, 0, 0]])
    attributes = writer.tree["meshes"][0]["primitives"][0]["attributes"]
    attributes["JOINTS_0"] = attributes["WEIGHTS_0"] = writer.accessor(np.ones((2, 4)))
    writer.tree["nodes"][0]["skin"] = writer.add("skins", **change)
    with pytest.raises(tl.InputError, match=re.escape(message)):
        load(writer, tmp_path, time=0.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"samplers": []}, "the animation has no sampler 0"),
        ({"channels": 3}, "channels is not a list"),
        ({"channels": [{"sampler": 0}]}, "a channel has no target"),
        ({"samplers": [{"interpolation": "SWING"}]}, "sampler 0 has no interpolation that glTF 2.0 defines"),
        ({"samplers": [{"input": 9, "output": 9}]}, "accessors 9 does not exist"),
    ],
)
def test_a_broken_animation_is_refused(tmp_path: Path, change: Json, message: str) -> None:
    writer = animated("translation", [0], [[1, 0, 0]])
    writer.tree["animations"][0] |= change
    with pytest.raises(tl.InputError, match=re.escape(message)):
        pose(writer, tmp_path, 0)


@pytest.mark.parametrize(
    ("times", "values", "message"),
    [
        ([0, 1], [[1, 0, 0]], "1 values for 2 keys"),
        ([1, 0], [[1, 0, 0]] * 2, "not in ascending order of time"),
        ([math.nan], [[1, 0, 0]], "not finite"),
    ],
)
def test_broken_keys_are_refused(tmp_path: Path, times: list[float], values: Any, message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        pose(animated("translation", times, values), tmp_path, 0)


def test_other_broken_animations_are_refused(tmp_path: Path) -> None:
    with pytest.raises(tl.InputError, match="whose matrix forbids that"):
        pose(animated("scale", [0], [[1, 1, 1]], matrix=np.eye(4).ravel().tolist()), tmp_path, 0)
    with pytest.raises(tl.InputError, match="a rotation has the length 0"):
        pose(animated("rotation", [0], [[0, 0, 0, 0]]), tmp_path, 0)
    still = Writer()
    still.add("nodes", mesh=still.mesh())
    with pytest.raises(tl.InputError, match="the file has no animations; omit the time"):
        pose(still, tmp_path, 0)
    for time in (-1.0, math.inf, math.nan):
        with pytest.raises(tl.InputError, match="negative or not finite"):
            pose(animated("scale", [0], [[1, 1, 1]]), tmp_path, time)


# Variants


def varied() -> Writer:
    """Two boxes: one has another medium in the variants Red and Late, the other none of its own."""
    writer = Writer()
    own, other = writer.material(name="Own", extensions=glass()), writer.material(name="Other", extensions=WINE)
    mapping = {"KHR_materials_variants": {"mappings": [{"material": other, "variants": [1, 2]}]}}
    writer.add("nodes", mesh=writer.mesh(writer.primitive(material=own, extensions=mapping)), name="A")
    writer.add("nodes", mesh=writer.mesh(writer.primitive(material=own)), name="B", translation=[9.0, 0.0, 0.0])
    names = [{"name": name} for name in ("Clear", "Red", "Late")]
    writer.tree["extensions"] = {"KHR_materials_variants": {"variants": names}}
    writer.tree["extensionsUsed"] = ["KHR_materials_variants"]
    return writer


@pytest.mark.parametrize(("variant", "red"), [(None, False), ("Clear", False), ("Red", True), ("Late", True)])
def test_a_variant_has_its_materials(tmp_path: Path, variant: str | None, red: bool) -> None:
    scene = load(varied(), tmp_path, variant=variant)
    assert scene.variants == ("Clear", "Red", "Late")
    assert scene.left_out == ()
    first, second = scene.objects
    assert bool(first.medium.extinction.any()) == red
    assert not second.medium.extinction.any()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Latte", "the file has no variant of this name; did you mean Late? use one of Clear, Red, Late"),
        ("x", "use one of Clear, Red, Late"),
    ],
)
def test_an_unknown_variant_names_the_known_ones(tmp_path: Path, name: str, message: str) -> None:
    with pytest.raises(tl.InputError, match=re.escape(message)):
        load(varied(), tmp_path, variant=name)


def test_a_file_without_variants_says_so(tmp_path: Path) -> None:
    writer = Writer()
    writer.add("nodes", mesh=writer.mesh())
    with pytest.raises(tl.InputError, match=r"the file has no material variants \("):
        load(writer, tmp_path, variant="Red")


@pytest.mark.parametrize("mappings", [3, [3], [{}], [{"variants": [1]}], [{"variants": [1], "material": 99}]])
def test_broken_mappings_are_refused(tmp_path: Path, mappings: Any) -> None:
    writer = varied()
    primitive = writer.tree["meshes"][0]["primitives"][0]
    primitive["extensions"]["KHR_materials_variants"]["mappings"] = mappings
    with pytest.raises(tl.InputError):
        load(writer, tmp_path, variant="Red")


def test_a_liquid_in_its_glass_has_a_priority_and_the_file_that_has_one_body_none(tmp_path: Path) -> None:
    """The glass has the space that both claim; a part of another scene has none of its own."""
    writer = Writer()
    crystal = writer.material(extensions=glass(ior=1.5, attenuationColor=[0.9, 0.9, 0.9], attenuationDistance=1.0))
    wine = writer.material(extensions=WINE)
    for name, material, x in (("Glass", crystal, 0.0), ("Wine", wine, 1.5)):
        index = writer.mesh(writer.primitive(material=material))
        writer.add("nodes", mesh=index, name=name, translation=[x, 0.0, 0.0])
    scene = load(writer, tmp_path)
    assert scene.overlap == "priority"
    assert [item.mesh.name for item in sorted(scene.objects, key=lambda item: item.priority)] == ["Wine", "Glass"]
    assert scene.remarks[0].startswith("where bodies overlap, Glass displaces Wine")
    (tmp_path / "scene.toml").write_text(f'[[object]]\nmodel = "{tmp_path / "model.glb"}"\n')
    composed = tl.load_scene(tmp_path / "scene.toml")
    assert composed.overlap == "priority"
    del writer.tree["nodes"][1]
    alone = load(writer, tmp_path)
    assert (alone.overlap, alone.remarks, alone.objects[0].priority) == ("add", (), 0)
