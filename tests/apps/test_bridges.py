"""Meshes of trimesh and PyVista: taken, shown, and with the results on them."""

from __future__ import annotations

import subprocess
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import translucent as tl
from translucent.preview.scenes import load
from translucent.preview.session import load_session


class PolyData:
    """Stand-in for a `pyvista.PolyData`, with its attributes: faces stand in one row, each behind its number."""

    def __init__(self, mesh: trimesh.Trimesh, corners: int = 3) -> None:
        self.points = np.array(mesh.vertices, dtype=np.float32)
        faces = np.array(mesh.faces)[:, [*range(3), *range(corners - 3)]]
        self.faces = np.column_stack([np.full(len(faces), corners), faces]).ravel()
        self.n_strips = 0
        self.active_texture_coordinates = None
        self.point_data: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        return self.point_data[name]

    def triangulate(self) -> PolyData:
        raise NotImplementedError


@pytest.fixture
def ball() -> trimesh.Trimesh:
    """Ball of 10 mm radius."""
    made = trimesh.creation.icosphere(subdivisions=4, radius=10.0)
    made.units = "mm"
    return made


# Taken


def test_lines_of_trimeshs_own_documentation_go_on_here() -> None:
    mesh = trimesh.Trimesh(vertices=[[0, 0, 0], [0, 0, 1], [0, 1, 0]], faces=[[0, 1, 2]])
    assert tl.Object(mesh).mesh.faces.tolist() == [[0, 1, 2]]
    mesh = trimesh.creation.icosphere(subdivisions=2)
    assert mesh.is_watertight
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.5, [1, 0, 0]))
    mesh.metadata["name"] = "ball"
    (mesh + trimesh.creation.box(bounds=[[2, 0, 0], [3, 1, 1]])).split()
    scene = tl.showcase(mesh, tl.preset("jade").medium, stage="none")
    assert scene.objects[0].mesh.name == "ball"
    assert scene.objects[0].mesh.volume == pytest.approx(mesh.volume)


def test_lines_of_pyvistas_own_documentation_go_on_here() -> None:
    pyvista = pytest.importorskip("pyvista", reason="pyvista is not installed")
    sphere = pyvista.Sphere(radius=0.01)
    assert tl.load_mesh(sphere).volume == pytest.approx(sphere.volume, rel=1e-5)
    tl.attach(sphere, tl.bake_vertex_thickness(sphere, rays=4))
    assert sphere["thickness"].shape == (sphere.n_points,)
    tl.load_mesh(pyvista.Cube().triangulate())


def test_what_is_no_surface_of_pyvista_is_refused_with_its_own_call() -> None:
    pyvista = pytest.importorskip("pyvista", reason="pyvista is not installed")
    sphere, points = pyvista.Sphere(), np.eye(3)
    for thing, sentence in (
        (pyvista.PolyData(), r"has no points and no faces"),
        (pyvista.PolyData(points), r"has 3 points and no faces; make a surface from points, cloud\.reconstruct"),
        (pyvista.PointSet(points), r"has 3 points and no faces"),
        (pyvista.Line(), r"has 2 points and 1 lines and no faces; .*line\.tube"),
        (pyvista.Cube(), r"not all faces of the mesh are triangles; triangulate the mesh: mesh\.triangulate\(\)"),
        (sphere.strip(), r"triangle strips; triangulate the mesh: mesh\.triangulate\(\)"),
        (pyvista.MultiBlock([sphere]), r"MultiBlock is not a surface; .*extract_surface\(\)\.triangulate\(\)"),
        (sphere.cast_to_unstructured_grid(), r"UnstructuredGrid is not a surface; .*extract_surface"),
        (pyvista.ImageData(dimensions=(3, 3, 3)), r"ImageData is not a surface"),
        (pyvista.Table({"a": points[0]}), r"of type Table"),
    ):
        for take in (tl.load_mesh, tl.show, tl.Object):
            with pytest.raises(tl.InputError, match=sentence):
                take(thing)


def test_polydata_has_the_volume_of_the_mesh(ball: trimesh.Trimesh) -> None:
    mesh = tl.load_mesh(PolyData(ball), unit="mm")
    assert mesh.volume == pytest.approx(ball.volume * 1e-9, rel=1e-6)
    assert tl.load_mesh(PolyData(ball)).assumed_unit == "m"


def test_any_object_with_vertices_and_faces_is_a_mesh(ball: trimesh.Trimesh) -> None:
    thing = types.SimpleNamespace(vertices=ball.vertices.tolist(), triangles=ball.faces.tolist())
    assert tl.load_mesh(thing, "mm").volume == pytest.approx(ball.volume * 1e-9)


@pytest.mark.parametrize(("units", "metres"), [("mm", 1e-3), ("inches", 0.0254), ("meters", 1.0), (None, 1.0)])
def test_units_of_trimesh_count(ball: trimesh.Trimesh, units: str | None, metres: float) -> None:
    ball.units = units
    assert tl.load_mesh(ball).bounds[1] == pytest.approx(10 * metres)
    assert tl.load_mesh(ball).assumed_unit == ("m" if units is None else "")
    assert tl.load_mesh(ball, longest=0.12).bounds[1] == pytest.approx(0.06)


def test_meshes_keep_texture_coordinates() -> None:
    box = trimesh.creation.box()
    uv = box.vertices[:, :2] + 0.5
    box.visual = trimesh.visual.TextureVisuals(uv=uv)
    mesh = tl.load_mesh(box)
    assert mesh.uv is not None
    np.testing.assert_array_equal(mesh.uv, mesh.vertices[:, :2] + 0.5)


def test_a_scene_has_its_transforms_materials_names_and_instances() -> None:
    box = trimesh.creation.box()
    box.visual = trimesh.visual.TextureVisuals(
        material=trimesh.visual.material.PBRMaterial(
            name="red", baseColorFactor=[255, 0, 0, 255], roughnessFactor=0.3, metallicFactor=0.0
        )
    )
    scene = trimesh.Scene()
    scene.add_geometry(box, node_name="mirrored", geom_name="box", transform=np.diag([-2.0, 1.0, 1.0, 1.0]))
    away = trimesh.transformations.translation_matrix((5, 0, 0))
    scene.graph.update(frame_to="again", matrix=away, geometry="box")
    scene.add_geometry(trimesh.creation.icosphere(subdivisions=1), node_name="ball")
    scene.units = "cm"
    found = tl.load_scene(scene)
    mirrored, again, ball = found.objects
    assert mirrored.mesh is again.mesh
    assert ball.mesh.name == "ball"
    assert mirrored.surface is not None
    assert (mirrored.surface.roughness, *mirrored.surface.color) == (0.3, 1.0, 0.0, 0.0)
    assert again.bounds[0] == pytest.approx([0.045, -0.005, -0.005])
    assert mirrored.mirrored


def test_a_mirrored_part_of_a_scene_has_a_positive_volume() -> None:
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box(), transform=np.diag([-2.0, 1.0, 1.0, 1.0]))
    scene.add_geometry(trimesh.creation.box(), transform=trimesh.transformations.translation_matrix((5, 0, 0)))
    assert tl.load_mesh(scene).volume == pytest.approx(3.0)


def test_trimesh_shows_meshes_and_scenes_by_it(ball: trimesh.Trimesh) -> None:
    for thing in (ball, trimesh.Scene([ball])):
        with pytest.raises(tl.InputError, match=r"preset 'jaded'"):
            thing.show(viewer=tl.show, material="jaded")


# Refused


@pytest.mark.parametrize(
    ("thing", "sentence"),
    [
        (
            PolyData(trimesh.creation.box(), corners=4),
            r"not all faces of the mesh are triangles; .*mesh\.triangulate\(\)",
        ),
        (types.SimpleNamespace(vertices=np.zeros((4, 3)), faces=[[0, 1, 2], [0, 1, 2, 3]]), r"different numbers"),
        (types.SimpleNamespace(vertices=np.zeros((4, 3)), faces=[[0, 1, 2, 3]]), "the faces of the mesh are quads"),
        (types.SimpleNamespace(vertices=[["a"]], faces=[[0, 0, 0]]), "the vertices of the mesh are not numbers"),
        (types.SimpleNamespace(points=[], faces=[], n_strips=2), "2 triangle strips"),
        (types.SimpleNamespace(extract_surface=None), r"is not a surface; .*extract_surface"),
        (trimesh.Trimesh(), "the mesh has no faces"),
        (trimesh.Scene(), r"has no (faces|geometry)"),
        (trimesh.Trimesh([[0, 0, np.nan], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], process=False), r"not finite"),
        (trimesh.PointCloud(np.zeros((3, 3))), r"PointCloud"),
    ],
)
def test_what_is_no_mesh_of_triangles_is_refused_by_a_sentence(thing: Any, sentence: str) -> None:
    for take in (tl.load_mesh, tl.showcase, tl.Object, tl.bake_thickness, tl.show):
        with pytest.raises(tl.InputError, match=sentence):
            take(thing)


def test_unknown_and_mixed_units_are_refused(ball: trimesh.Trimesh) -> None:
    ball.units = "furlong"
    with pytest.raises(tl.InputError, match="the unit 'furlong' of the mesh is not known; state unit="):
        tl.load_mesh(ball)
    ball.units = "mm"
    mixed = trimesh.Scene([ball, trimesh.creation.box()])
    for take in (tl.load_mesh, tl.load_scene):
        with pytest.raises(tl.InputError, match=r"different units: None, mm; .*convert_units"):
            take(mixed)
    with pytest.raises(tl.InputError, match="the scene has no geometry"):
        tl.load_scene(trimesh.Scene())


# Given back


def test_baked_thickness_of_a_ball_is_on_its_mesh(ball: trimesh.Trimesh) -> None:
    baked = tl.bake_vertex_thickness(ball, spread=1.0, rays=2)
    for mesh, unit in ((ball, None), (PolyData(ball), "mm")):
        values = tl.attach(mesh, baked, unit=unit)
        # Rays along the normal cross the whole ball; the facets are at most 1 - cos(half an edge) nearer.
        assert values == pytest.approx(np.full(len(ball.vertices), 0.02), rel=5e-3)
        found = mesh.vertex_attributes if mesh is ball else mesh
        np.testing.assert_array_equal(found["thickness"], values)


def test_vertices_that_were_welded_have_their_values_back() -> None:
    soup = trimesh.creation.box(extents=(0.01, 0.02, 0.03))
    soup.unmerge_vertices()
    assert len(soup.vertices) == 36
    assert len(tl.load_mesh(soup).vertices) == 8
    values = tl.attach(soup, tl.bake_vertex_thickness(tl.load_mesh(soup), rays=16))
    assert np.isfinite(values).all()
    positions, which = np.unique(soup.vertices, axis=0, return_inverse=True)
    assert len(positions) == 8
    assert all(np.ptp(values[which == corner]) == 0 for corner in range(8))


def test_a_frame_gives_vertices_the_chord_of_the_ray_that_shows_them(ball: trimesh.Trimesh) -> None:
    size = (128, 128)
    camera = tl.Camera.look_at((0.0, 0.0, 0.1), (0.0, 0.0, 0.0), fov_y=14.0)
    scene = tl.showcase(ball, tl.Medium(absorption=(10, 10, 10)), size, camera, stage="none")
    frame = tl.reference.render(scene, size)
    values = tl.attach(ball, frame)
    points = np.asarray(ball.vertices) * 1e-3
    away = points - camera.eye
    length = np.linalg.norm(away, axis=1)
    cosine = -(away * points).sum(axis=1) / (length * np.linalg.norm(points, axis=1))
    np.testing.assert_array_equal(np.isnan(values[np.abs(cosine) > 0.1]), cosine[np.abs(cosine) > 0.1] < 0)
    # Half a pixel is 0.1 mm at the ball; a chord 2 R cos changes by 2 tan of that where it is seen at an angle.
    middle = cosine > 0.5
    bound = 2 * np.sqrt(2) * 1e-4 * np.tan(np.arccos(cosine[middle])) + 1e-4
    assert (np.abs(values[middle] - 0.02 * cosine[middle]) < bound).all()
    assert tl.attach(ball, frame, "radiance").shape == (len(points), 3)


def test_values_of_another_mesh_are_refused(ball: trimesh.Trimesh) -> None:
    baked = tl.bake_vertex_thickness(ball, rays=2)
    with pytest.raises(tl.InputError, match=r"8 of its 8 vertices are not vertices of mesh"):
        tl.attach(trimesh.creation.box(), baked)
    with pytest.raises(tl.InputError, match=r"vertices are not vertices of mesh"):
        tl.attach(ball, baked, unit="m")
    with pytest.raises(tl.InputError, match=r"quantity 'valid'.*use thickness, standard_error"):
        tl.attach(ball, baked, "valid")
    with pytest.raises(tl.InputError, match="this is not a single mesh with values at its vertices"):
        tl.attach(trimesh.Scene(ball), baked)


# Shown


@pytest.fixture
def headless(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr("translucent.page.write.web_path", _viewer(tmp_path))


def _viewer(folder: Path) -> Any:
    script = folder / "viewer.js"
    script.write_text("export default { render() {} };")
    return lambda name: script


@pytest.mark.usefixtures("headless", "few_shadows", "coarse_light", "quick_packing")
def test_show_writes_a_page_where_there_is_no_display(ball: trimesh.Trimesh) -> None:
    path = tl.show(ball, "merlot")
    assert path.suffix == ".html"
    assert "<title>trimesh</title>" in path.read_text()


@pytest.mark.usefixtures("headless")
def test_show_fills_the_objects_of_a_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[tl.Scene] = []
    monkeypatch.setattr("translucent.showing.write_page", lambda scene, path, size: shown.append(scene))
    tl.show(trimesh.Scene([trimesh.creation.box(), trimesh.creation.icosphere()]), "jade")
    tl.show("bear", "jade")
    tl.show(tl.showcase(trimesh.creation.box(), stage="none"), tl.Medium(absorption=(1, 2, 3)))
    jade = tl.preset("jade")
    assert [len(scene.bodies) for scene in shown] == [2, 1, 1]
    assert all(np.array_equal(body.medium.extinction, jade.medium.extinction) for body in shown[0].bodies)
    assert shown[1].bodies[0].surface.roughness == jade.roughness
    assert np.array_equal(shown[2].bodies[0].medium.absorption, (1, 2, 3))
    assert len(shown[2].objects) == 1  # a scene has its own surroundings, and no stage is added


@pytest.mark.usefixtures("few_shadows", "coarse_light", "quick_packing")
def test_show_returns_a_widget_in_a_notebook(
    ball: trimesh.Trimesh, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    pytest.importorskip("anywidget", reason="anywidget is not installed (extra notebook)")
    monkeypatch.setattr("translucent.notebook.view.web_path", _viewer(tmp_path))
    shell = types.SimpleNamespace(kernel=object())
    monkeypatch.setitem(sys.modules, "IPython", types.SimpleNamespace(get_ipython=lambda: shell))
    widget = tl.show(ball)
    assert widget.media == ("trimesh",)
    widget.close()


@pytest.mark.parametrize("kind", ["mesh", "scene", "own"])
def test_show_opens_the_window_at_a_desk(kind: str, ball: trimesh.Trimesh, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("imgui_bundle", reason="imgui_bundle is not installed (extra ui)")
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.delitem(sys.modules, "IPython", raising=False)
    opened = []

    def run(command: list[str], check: bool) -> Any:
        assert command[1:4] == ["-m", "translucent", "preview"]
        document = load_session(command[-1])
        opened.append((document, load(document.model).scene))
        return types.SimpleNamespace(returncode=0)

    monkeypatch.setattr(subprocess, "run", run)
    thing = {"mesh": ball, "scene": trimesh.Scene(ball), "own": "sphere"}[kind]
    assert tl.show(thing, "jade") is None
    ((document, scene),) = opened
    assert document.material.preset == "jade"
    assert document.material.scattering == tuple(tl.preset("jade").medium.scattering)
    if kind != "own":
        assert scene.bounds[1] == pytest.approx([0.01] * 3, rel=1e-6)


def test_show_refuses_what_it_cannot_show(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(tl.InputError, match=r'where \'cinema\'; .*use "notebook", "window" or "page"'):
        tl.show("bear", where="cinema")
    with pytest.raises(tl.InputError, match="the window would ignore the lights and the camera of the scene"):
        tl.show(tl.showcase(trimesh.creation.box()), where="window")
    with pytest.raises(tl.InputError, match=r"preset 'jad'"):
        tl.show("bear", "jad")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: types.SimpleNamespace(returncode=1))
    with pytest.raises(tl.RenderError, match=r"exit code 1"):
        tl.show("bear", where="window")
