"""Sizes of models: what load_mesh assumes, says and scales, and remarks on media that do not suit the size."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from translucent.assets import mesh_path
from translucent.geometry.solids import Box
from translucent.planning.passes import Note, NoteKind
from translucent.units import likely_unit, size_note

BOX = Box((0, 0, 0), (1, 2, 1)).tessellate()


def _file(folder: Path, name: str, scale: float = 1.0) -> Path:
    import trimesh

    path = folder / name
    trimesh.Trimesh(scale * BOX.vertices, BOX.faces, process=False).export(path)
    return path


def test_files_without_a_unit_say_what_was_assumed(tmp_path: Path) -> None:
    mesh = tl.load_mesh(_file(tmp_path, "box.obj"))
    assert size_note(mesh) == "2 m tall; taken as metres; for a figurine --height 12cm"
    assert repr(mesh).endswith("; 2 m tall; taken as metres; for a figurine height=0.12)")
    small = tl.load_mesh(_file(tmp_path, "small.ply", 0.05))
    assert size_note(small) == "10 cm tall; taken as metres"
    for known in (tl.load_mesh(tmp_path / "box.obj", "cm"), tl.load_mesh(tmp_path / "box.obj", height=0.12)):
        assert size_note(known) == ""
    assert size_note(tl.load_mesh(_file(tmp_path, "box.glb"))) == ""


def test_the_unit_is_guessed_from_format_and_extents(tmp_path: Path) -> None:
    assert likely_unit(80.0, ".STL") == ("mm", ".stl files usually use millimetres")
    assert likely_unit(199.2, ".off") == ("mm", "a size of 199 metres is unusual, and millimetres are common")
    # Of models that were scaled to 1 or 10, and of an .stl that would be a millimetre, nothing is known.
    assert likely_unit(1.7, ".obj") is likely_unit(10.0, ".obj") is likely_unit(1.0, ".stl") is None
    note = size_note(tl.load_mesh(_file(tmp_path, "part.stl", 40.0)))
    assert note == "80 m tall; taken as metres; .stl files usually use millimetres: --unit mm makes it 8 cm tall"


def test_meshes_are_scaled_to_a_height_or_their_longest_side(tmp_path: Path) -> None:
    path = _file(tmp_path, "box.obj")
    tall = tl.load_mesh(path, height=0.12)
    np.testing.assert_allclose(tall.bounds, np.array([[0, 0, 0], [0.06, 0.12, 0.06]]), atol=1e-15)
    np.testing.assert_allclose(tl.load_mesh(path, longest=0.5).bounds[1], [0.25, 0.5, 0.25], atol=1e-15)
    np.testing.assert_allclose(tl.load_mesh(path, "25mm").bounds[1], [0.025, 0.05, 0.025], atol=1e-15)
    with pytest.raises(tl.InputError, match="height is given, too, and both set the size; use only one of them"):
        tl.load_mesh(path, "mm", height=0.12)
    with pytest.raises(tl.InputError, match=r"height 0.0; the length must be positive and finite"):
        tl.load_mesh(path, height=0.0)


def _remarks(side: float, medium: tl.Medium) -> tuple[Note, ...]:
    mesh = tl.Mesh(side * BOX.vertices, BOX.faces, name="box")
    return tl.plan(tl.showcase(mesh, medium)).remarks


@pytest.mark.parametrize(("times", "said"), [(190.0, False), (210.0, True)])
def test_bodies_of_many_mean_free_paths_look_opaque(times: float, said: bool) -> None:
    # 1 / (sigma_a + (1 - g) sigma_s) is 1 mm; the box is 2 high, and four mean chords 16 V / S = 3.2.
    medium = tl.Medium(absorption=50.0, scattering=1900.0, anisotropy=0.5, ior=1.5)
    found = _remarks(0.5e-3 * times, medium)
    assert [note.kind for note in found] == [NoteKind.OPAQUE_BODIES] * said
    if said:
        assert "opaque at this size, like plastic: the mean free path is 1 mm" in found[0]
        assert "5 cm tall (--height 5cm) light would shine through thin parts, or with --dilute" in found[0]


@pytest.mark.parametrize(("times", "said"), [(0.3, True), (0.4, False)])
def test_fog_that_light_crosses_is_not_to_be_seen(times: float, said: bool) -> None:
    found = _remarks(0.5 * times, tl.Medium(scattering=1.0))
    assert [note.kind for note in found] == [NoteKind.UNSEEN_BODIES] * said
    if said:
        assert "light travels 1 m through this medium before it is scattered or absorbed" in found[0]
        assert "5 m tall (--height 5m) the medium would be visible" in found[0]


def test_walls_are_what_a_cup_is_thick() -> None:
    goblet = tl.load_mesh(mesh_path("goblet"))  # walls of 2 mm, 20 cm high
    assert tl.plan(tl.showcase(goblet, tl.preset("wax").medium)).remarks == ()
