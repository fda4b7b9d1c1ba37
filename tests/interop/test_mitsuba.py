"""Scenes for Mitsuba 3: their numbers by formulas of its documentation, and pictures where it is installed."""

from __future__ import annotations

import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

import translucent as tl
from tests.command_line import Run, one_error_line
from translucent.arrays import Array
from translucent.interop.mitsuba import describe, units_per_metre

SIZE = (48, 32)
BALL = tl.load_mesh(trimesh.creation.icosphere(subdivisions=3, radius=0.01))
GLASS = tl.Medium(absorption=(10, 40, 90), ior=1.5)
WAX = tl.Medium(absorption=(80, 160, 350), scattering=(870, 800, 550), anisotropy=0.2, ior=1.44)
SKY = np.random.default_rng(1).uniform(0, 3, (6, 12, 3))


def scene_of(*objects: tl.Object, **others: Any) -> tl.Scene:
    camera = tl.Camera.look_at((0.02, 0.03, 0.06), (0.001, 0.0, 0.0), up=(0.1, 1, 0), fov_y=24.0)
    return tl.Scene(objects or [tl.Object(BALL, GLASS)], **{"camera": camera, **others})


# As Mitsuba reads it


def seen_by_mitsuba(described: dict[str, Any], size: tuple[int, int]) -> tuple[Array, Array]:
    """Origins and directions (h, w, 3) of its cameras: they look along +Z, +X is left and +Y up."""
    sensor, (width, height) = described["sensor"], size
    matrix = np.array(sensor["to_world"])
    right, down = (np.arange(width) + 0.5) / width * 2 - 1, (np.arange(height)[:, None] + 0.5) / height * 2 - 1
    across, upwards = np.broadcast_arrays(-right, -down)
    if sensor["type"] == "orthographic":
        places = np.stack([across, upwards * height / width, np.zeros_like(across)], axis=-1)
        return places @ matrix[:3, :3].T + matrix[:3, 3], np.broadcast_to(matrix[:3, 2], places.shape)
    assert sensor["fov_axis"] == "y"
    slope = np.tan(np.radians(sensor["fov"]) / 2)
    local = np.stack([across * slope * width / height, upwards * slope, np.ones_like(across)], axis=-1)
    world = local @ matrix[:3, :3].T
    return np.broadcast_to(matrix[:3, 3], world.shape), world / np.linalg.norm(world, axis=-1, keepdims=True)


def lit_by_mitsuba(emitter: dict[str, Any], pixels: Array, directions: Array) -> Array:
    """Radiance of its environment map: columns have centers, and the first and last row are the poles."""
    local = directions @ np.array(emitter["to_world"])[:3, :3]  # the transpose is the inverse
    height, width = pixels.shape[:2]
    column = np.mod(np.arctan2(local[:, 0], -local[:, 2]) / (2 * np.pi) - 0.5 / width, 1.0) * width
    row = np.arccos(np.clip(local[:, 1], -1, 1)) / np.pi * (height - 1)
    left, top = np.floor(column).astype(int) % width, np.minimum(row.astype(int), height - 2)
    across, down = (column - np.floor(column))[:, None], (row - top)[:, None]
    upper = pixels[top, left] * (1 - across) + pixels[top, (left + 1) % width] * across
    lower = pixels[top + 1, left] * (1 - across) + pixels[top + 1, (left + 1) % width] * across
    return emitter["scale"] * (upper * (1 - down) + lower * down)


def read_pfm(path: Path) -> Array:
    kind, size, order, rest = path.read_bytes().split(b"\n", 3)
    width, height = map(int, size.split())
    assert (kind, float(order)) == (b"PF", -1.0)
    return np.frombuffer(rest, "<f4").reshape(height, width, 3)[::-1].astype(np.float64)


# Numbers


@pytest.mark.parametrize(
    "camera",
    [
        tl.Camera.look_at((0.02, 0.03, 0.06), (0.001, 0, 0), up=(0.1, 1, 0), fov_y=24.0),
        tl.Camera.orthographic((0.001, 0.002, 0.0), (0, 0, -1), height=0.03),
    ],
)
def test_cameras_send_the_same_rays(camera: tl.Camera) -> None:
    scene = scene_of(camera=camera)
    scale = units_per_metre(scene)
    origins, directions = seen_by_mitsuba(describe(scene, SIZE)[0], SIZE)
    own_origins, own_directions = camera.rays(SIZE)
    assert np.abs(directions - own_directions).max() < 1e-12
    # The same line: an orthographic one begins before the ball, which the camera is in here.
    away = origins / scale - own_origins
    assert np.abs(np.cross(away, directions)).max() < 1e-12
    assert camera.fov_y is not None or (origins / scale @ camera.forward < -0.01).all()


@pytest.mark.parametrize(
    "environment",
    [
        tl.Environment.image(SKY, rotation=37.0, exposure=-1.5),
        tl.Environment.image(SKY[:1, :2]),
        tl.Environment.gradient((0.1, 0.2, 0.3), (2.0, 1.0, 0.5)),
    ],
)
@pytest.mark.filterwarnings("ignore:environment image")
def test_environments_have_the_same_radiance(environment: tl.Environment, tmp_path: Path) -> None:
    tl.write_mitsuba(scene_of(environment=environment), SIZE, tmp_path / "scene.xml")
    emitter = describe(scene_of(environment=environment), SIZE)[0]["environment"]
    directions = np.random.default_rng(0).normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    found = lit_by_mitsuba(emitter, read_pfm(tmp_path / "scene.environment.pfm"), directions)
    # float32 pixels; a gradient is a picture of 256 rows, straight within 2e-5 between them.
    bound = 1e-6 if environment.kind == "image" else 5e-5
    np.testing.assert_allclose(found, environment.lighting(directions), atol=bound * 3, rtol=0)


def test_media_have_the_same_extinction_and_albedo() -> None:
    scene = scene_of(tl.Object(BALL, WAX, surface=tl.Surface(roughness=0.2)))
    scale = units_per_metre(scene)
    described = describe(scene, SIZE)[0]["object_0"]
    assert described["bsdf"] == {
        "type": "roughdielectric",
        "distribution": "ggx",
        "alpha": pytest.approx(0.04),
        "int_ior": 1.44,
        "ext_ior": 1.0,
    }
    interior = described["interior"]
    extinction = np.array(interior["sigma_t"]["value"]) * interior["scale"]
    assert (np.array(interior["sigma_t"]["value"]) <= 1).all()
    np.testing.assert_allclose(extinction * scale, WAX.extinction)
    np.testing.assert_allclose(np.array(interior["albedo"]["value"]) * extinction * scale, WAX.scattering)
    assert interior["phase"] == {"type": "hg", "g": 0.2}


@pytest.mark.parametrize(
    ("medium", "bsdf", "keys"),
    [
        (tl.Medium(absorption=(1, 2, 3)), "null", {"bsdf", "interior"}),
        (GLASS, "dielectric", {"bsdf", "interior"}),
        (tl.Medium(ior=1.5), "dielectric", {"bsdf"}),
        (None, "twosided", {"bsdf"}),
    ],
)
def test_interfaces_are_those_of_the_medium(medium: tl.Medium | None, bsdf: str, keys: set[str]) -> None:
    described = describe(scene_of(tl.Object(BALL, medium)), SIZE)[0]["object_0"]
    assert described["bsdf"]["type"] == bsdf
    assert set(described) == {"type", "filename", *keys}


def test_lights_shine_as_bright() -> None:
    lights = (
        tl.PointLight((0.01, 0.02, 0.03), (1, 2, 3)),
        tl.DirectionalLight((0, -1, 0), (4, 5, 6)),
        tl.SphereLight((0.0, 0.05, 0.0), (0.5, 0.4, 0.3), radius=0.004),
    )
    scene = scene_of(lights=lights)
    scale = units_per_metre(scene)
    point, sun, sphere = (describe(scene, SIZE)[0][f"light_{i}"] for i in range(3))
    # Irradiance at a distance is what counts: I / r^2, and pi R^2 L / r^2.
    distance = np.linalg.norm(np.array(point["position"]) - scale * np.array([0.0, 0.02, 0.03]))
    np.testing.assert_allclose(np.array(point["intensity"]["value"]) / distance**2, np.array([1, 2, 3]) / 0.01**2)
    assert sun == {"type": "directional", "direction": [0, -1, 0], "irradiance": {"type": "rgb", "value": [4, 5, 6]}}
    area = np.pi * sphere["radius"] ** 2 / scale**2
    np.testing.assert_allclose(np.array(sphere["emitter"]["radiance"]["value"]) * area, (0.5, 0.4, 0.3))
    np.testing.assert_allclose(sphere["center"], (0, 0.05 * scale, 0))


@pytest.mark.parametrize("inverted", [False, True])
@pytest.mark.parametrize("mirrored", [False, True])
def test_meshes_are_in_the_world_and_face_outwards(inverted: bool, mirrored: bool, tmp_path: Path) -> None:
    mesh = tl.Mesh(BALL.vertices, BALL.faces[:, ::-1] if inverted else BALL.faces, name="ball")
    matrix = np.diag([-2.0 if mirrored else 2.0, 1.0, 1.0, 1.0])
    matrix[:3, 3] = 0.1, 0.2, 0.3
    scene = scene_of(tl.Object(mesh, GLASS, transform=matrix))
    scale = units_per_metre(scene)
    files = tl.write_mitsuba(scene, SIZE, tmp_path / "scene.xml")
    assert [file.name for file in files] == ["scene.xml", "scene.0.ply"]
    found = trimesh.load(files[1], process=False)
    assert found.volume == pytest.approx(2 * BALL.volume * scale**3, rel=1e-5)
    assert found.bounds.mean(axis=0) / scale == pytest.approx([0.1, 0.2, 0.3], rel=1e-6)
    # Normals of an ellipsoid: x / a^2, within the angle of a facet.
    local = (found.vertices / scale - matrix[:3, 3]) / np.array([4.0, 1.0, 1.0])
    cosine = (found.vertex_normals * local).sum(axis=1) / np.linalg.norm(local, axis=1)
    assert cosine.min() > np.cos(np.radians(9.0))
    assert not np.allclose(found.vertex_normals[0], found.face_normals[0], atol=1e-3)


# Files


def test_the_xml_says_what_the_dictionary_says(tmp_path: Path) -> None:
    scene = scene_of(
        tl.Object(BALL, WAX, surface=tl.Surface(roughness=0.2)),
        lights=[tl.PointLight((0.01, 0.02, 0.03), 1), tl.DirectionalLight((0, -1, 0), 2)],
        environment=tl.Environment.image(SKY),
    )
    described = describe(scene, SIZE, samples=7)[0]
    tl.write_mitsuba(scene, SIZE, tmp_path / "scene.xml", samples=7)
    root = ElementTree.parse(tmp_path / "scene.xml").getroot()
    assert (root.tag, root.get("version")) == ("scene", "3.0.0")
    values = [described[name] for name in described if name != "type"]
    for element, value in zip(root, values, strict=True):
        assert read_element(element) == {
            **value,
            **({"filename": f"scene.{value['filename']}"} if "filename" in value else {}),
        }
    tags = [element.tag for element in root]
    assert tags == ["integrator", "sensor", "shape", "emitter", "emitter", "emitter"]
    medium = root.find("shape/medium")
    assert medium is not None
    assert medium.get("name") == "interior"


def test_a_texture_is_a_picture_beside_the_scene(tmp_path: Path) -> None:
    files = tl.write_mitsuba(scene_of(textured(), tl.Object(BALL, GLASS)), SIZE, tmp_path / "scene.xml")
    assert [file.name for file in files] == ["scene.xml", "scene.0.ply", "scene.0.pfm", "scene.1.ply"]
    texture = ElementTree.parse(files[0]).getroot().find("shape/bsdf/bsdf/texture")
    assert texture is not None
    assert (texture.get("type"), texture.get("name")) == ("bitmap", "reflectance")
    assert {child.get("name"): child.get("value") for child in texture} == {
        "filename": "scene.0.pfm",
        "raw": "true",
        "filter_type": "bilinear",
        "wrap_mode": "repeat",
    }
    np.testing.assert_allclose(read_pfm(files[2]), SKY / 3, rtol=1e-6)


def test_rough_interfaces_are_darker_there_and_a_warning_says_so() -> None:
    rough = scene_of(tl.Object(BALL, GLASS, surface=tl.Surface(roughness=0.3)))
    with pytest.warns(tl.TranslucentWarning, match=r"without multiple scattering between microfacets"):
        describe(rough, SIZE)


def test_paths_across_a_hundred_mean_free_paths_are_not_left_to_chance() -> None:
    # A walk that crosses a slab of n mean free paths has about n^2 / 2 events: n^2 / (6 D) with D = 1 / 3.
    events = 0.5 * 100.0**2
    described, _ = describe(scene_of(tl.Object(BALL, WAX)), SIZE)
    assert 0.95 ** max(events - described["integrator"]["rr_depth"], 0.0) > 0.5


def read_element(element: ElementTree.Element) -> dict[str, Any]:
    """Dictionary of a plugin's element, as Mitsuba's manual pairs the two forms."""
    found: dict[str, Any] = {"type": element.get("type")}
    unnamed = {"film": "film", "sampler": "sampler", "rfilter": "filter", "bsdf": "bsdf", "phase": "phase"}
    for child in element:
        name, value = child.get("name"), child.get("value", "")
        read: dict[str, Callable[[], Any]] = {
            "string": lambda value=value: value,
            "integer": lambda value=value: int(value),
            "float": lambda value=value: float(value),
            "rgb": lambda value=value: {"type": "rgb", "value": [float(v) for v in value.split(",")]},
            "point": lambda value=value: [float(v) for v in value.split(",")],
            "vector": lambda value=value: [float(v) for v in value.split(",")],
            "transform": lambda child=child: np.array(child[0].get("value").split(), float).reshape(4, 4).tolist(),
        }
        found[name or unnamed[child.tag]] = read[child.tag]() if child.tag in read else read_element(child)
    return found


def test_the_command_writes_a_scene_in_place_of_a_picture(run: Run, tmp_path: Path) -> None:
    done = run("render", "sphere", "--as", "mitsuba", "-o", tmp_path / "s.xml", "--preset", "merlot", "--samples", "3")
    assert done.code == 0, done.err
    assert done.out.split() == [str(tmp_path / name) for name in ("s.xml", "s.0.ply", "s.environment.pfm")]
    root = ElementTree.parse(tmp_path / "s.xml").getroot()
    assert root.find("sensor/sampler/integer").get("value") == "3"  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["-o", "scene.json"], "the name must end in .xml"),
        (["-o", "scene.xml", "--scattering", "diffusion"], "--scattering; --as mitsuba"),
        (["-o", "scene.xml", "--turntable", "4"], "--turntable; --as mitsuba"),
        (["-o", "scene.xml", "--stage", "studio"], "or no stage"),
    ],
)
def test_what_the_command_cannot_write_is_refused(more: list[str], message: str, run: Run, tmp_path: Path) -> None:
    done = run("render", "sphere", "--as", "mitsuba", *(tmp_path / m if m.startswith("scene") else m for m in more))
    assert message in one_error_line(done)
    assert not list(tmp_path.iterdir())


# What has no words there


def textured(of: str = "color_texture", **how: Any) -> tl.Object:
    quad = tl.Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 1, 2]], uv=[[0, 0], [1, 0], [1, 1]], name="quad")
    return tl.Object(quad, surface=tl.Surface(ior=1.0, **{of: tl.Texture(SKY / 3, **how)}))


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (
            lambda: scene_of(tl.Object(BALL, WAX, density=tl.DensityGrid(np.ones((2, 2, 2))))),
            r"a varying density cannot be written for Mitsuba",
        ),
        (
            lambda: scene_of(tl.Object(BALL, GLASS), tl.Object(BALL, WAX), overlap="priority"),
            r"Mitsuba has no rule for overlaps",
        ),
        (lambda: scene_of(tl.Object(BALL, GLASS, sheet_thickness=1e-3)), r"sheets"),
        (lambda: scene_of(tl.Object(BALL, tl.Medium(emission=(1, 1, 1)))), r"Mitsuba cannot render this emission"),
        (lambda: scene_of(tl.Object(BALL, tl.preset("fog").medium)), r"only the Henyey-Greenstein phase"),
        (lambda: scene_of(tl.Object(BALL, GLASS, surface=tl.Surface(clearcoat=0.5))), r"its surface has clearcoat"),
        (lambda: scene_of(tl.Object(BALL, GLASS, surface=tl.Surface(color=(1, 0, 0)))), r"its surface has color"),
        (lambda: scene_of(textured(wrap=("repeat", "clamp"))), r"a texture that repeats along only one axis"),
        (lambda: scene_of(textured(of="emissive_texture")), r"its surface has textures"),
        (lambda: scene_of(tl.Object(BALL, surface=tl.Surface())), r"a coat with an ior"),
        (lambda: scene_of(lights=[tl.SpotLight((0, 1, 0), (0, -1, 0), 1)]), r"spot lights"),
        (lambda: scene_of(ambient=(1, 1, 1)), r"ambient"),
        (lambda: scene_of(environment=tl.Environment.checkerboard()), r"checkerboard"),
        (lambda: scene_of(camera=tl.Camera.look_at((0, 0, 0.001), (0, 0, -1))), r"camera is inside a body"),
    ],
)
def test_what_mitsuba_cannot_say_is_refused_with_advice(scene: Callable[[], tl.Scene], message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        describe(scene(), SIZE)


def test_without_mitsuba_the_dictionary_names_the_file_that_needs_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    with pytest.raises(tl.RenderError, match=r"mitsuba is not installed; .*write_mitsuba"):
        tl.to_mitsuba(scene_of(), SIZE)


def test_the_dictionary_has_transforms_and_whole_paths(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    stand_in = types.SimpleNamespace(variant=lambda: "llvm_ad_rgb", ScalarTransform4f=lambda matrix: ("turned", matrix))
    monkeypatch.setitem(sys.modules, "mitsuba", stand_in)
    found = tl.to_mitsuba(scene_of(environment=tl.Environment.image(SKY)), SIZE, tmp_path)
    for part in (found["sensor"], found["environment"]):
        assert part["to_world"][0] == "turned"
        assert part["to_world"][1].shape == (4, 4)
    assert found["object_0"]["filename"] == str(tmp_path / "0.ply")
    assert (tmp_path / "0.ply").is_file()
    assert (tmp_path / "environment.pfm").is_file()
    stand_in.variant = lambda: None
    with pytest.raises(tl.RenderError, match=r"no variant.*set_variant"):
        tl.to_mitsuba(scene_of(), SIZE, tmp_path)


# Pictures

FOG = tl.Medium(absorption=(3, 5, 8), scattering=(60, 50, 40), anisotropy=0.5)
LAMBERT = {"ior": 1.0, "roughness": 1.0}


def sky() -> tl.Environment:
    rows = np.cos(np.pi * (np.arange(64) + 0.5) / 64)
    return tl.Environment.image(np.broadcast_to(1 + 0.9 * rows[:, None, None] * (1.0, 0.0, -1.0), (64, 128, 3)))


def ball(medium: tl.Medium, at: tuple[float, float, float], radius: float) -> tl.Object:
    matrix = np.diag([*np.full(3, radius / 0.01), 1.0])
    matrix[:3, 3] = at
    return tl.Object(BALL, medium, transform=matrix)


def box(*sides: float, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tl.Mesh:
    return tl.load_mesh(trimesh.creation.box(sides, trimesh.transformations.translation_matrix(at)))


def frosted() -> tl.Scene:
    return scene_of(tl.Object(BALL, GLASS, surface=tl.Surface(roughness=0.15)), environment=sky())


def wax_before_a_lamp() -> tl.Scene:
    light = tl.SphereLight((0.0, 0.03, 0.02), (1e-3, 8e-4, 6e-4), radius=0.006)
    return scene_of(tl.Object(BALL, WAX), lights=[light], environment=tl.Environment.constant((0.3, 0.3, 0.3)))


def fog_in_a_box() -> tl.Scene:
    lights = [tl.PointLight((0.02, 0.02, 0.02), 1e-3), tl.DirectionalLight((0, -1, 0), (0.5, 0.4, 0.3))]
    return scene_of(tl.Object(box(0.016, 0.012, 0.014), FOG), lights=lights, environment=sky())


def thin_plate() -> tl.Scene:
    return scene_of(tl.Object(box(0.016, 0.012, 0.0004), GLASS), environment=sky())


def picture_behind_glass() -> tl.Scene:
    corners = [[-0.012, -0.012, -0.01], [0.012, -0.012, -0.01], [0.012, 0.012, -0.01], [-0.012, 0.012, -0.01]]
    texture = tl.Texture(SKY[:5, :4] / 3, scale=(1.7, 1.3), rotation=30.0, offset=(0.1, 0.2), wrap=("clamp", "clamp"))
    uv = [[0, 0], [1, 0], [1, 1], [0, 1]]
    picture = tl.Mesh(corners, [[0, 1, 2], [0, 2, 3]], uv=uv, name="picture")
    surface = tl.Surface(color=(0.9, 0.8, 0.7), color_texture=texture, **LAMBERT)
    return scene_of(ball(GLASS, (0, 0, 0.01), 0.007), tl.Object(picture, surface=surface), environment=sky())


def on_a_ground() -> tl.Scene:
    ground = tl.Object(box(0.06, 0.001, 0.06, at=(0, -0.0085, 0)), surface=tl.Surface(color=(0.7, 0.6, 0.5), **LAMBERT))
    block = tl.Object(box(0.006, 0.01, 0.006, at=(0, -0.003, -0.01)), surface=tl.Surface(color="#b04020", **LAMBERT))
    balls = ball(GLASS, (-0.006, -0.003, 0), 0.0045), ball(WAX, (0.006, -0.003, 0), 0.0045)
    return scene_of(*balls, block, ground, lights=[tl.DirectionalLight((0.3, -1, -0.2), (1, 1, 1))], environment=sky())


@pytest.mark.parametrize(
    "make", [frosted, wax_before_a_lamp, fog_in_a_box, thin_plate, picture_behind_glass, on_a_ground]
)
@pytest.mark.filterwarnings("ignore:caustics and refracted light of point:translucent.errors.TranslucentWarning")
def test_pictures_agree(make: Callable[[], tl.Scene], renderer: tl.Renderer, tmp_path: Path) -> None:
    """Eight parts of the paths give the noise; 4 standard errors of the difference hold on 97 % of the pixels."""
    mi = pytest.importorskip("mitsuba", reason="the independent renderer is absent: pip install mitsuba")
    mi.set_variant("scalar_rgb")
    scene, size = make(), (48, 48)
    loaded = mi.load_dict(tl.to_mitsuba(scene, size, tmp_path, samples=32))
    parts = np.array([np.array(mi.render(loaded, seed=seed))[..., :3] for seed in range(8)], dtype=np.float64)
    frame = renderer.render(scene, size, method=tl.PathTraced(paths=256), samples=32)
    assert frame.standard_error is not None
    error = np.hypot(parts.std(axis=0, ddof=1) / np.sqrt(len(parts)), frame.standard_error)
    within = np.abs(frame.radiance - parts.mean(axis=0)) < 4 * error + 1e-4
    print(f"{make.__name__}: {within.mean():.4f} of all pixels, {within[frame.coverage].mean():.4f} of bodies")
    assert within.mean() > 0.97
    assert within[frame.coverage].mean() > 0.97
