"""ThicknessNode and TranslucentNodeMaterial in headless Chromium, WebGPU over a Vulkan in software."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.browser.pages import WebPage, decoded, encoded
from tests.browser.test_thickness_pass import EDGE_ON
from tests.browser.thickness import TOOLS, Errors, Measured, Truth, described, described_camera, framing, rounded
from tests.solids import Box, Sphere
from translucent.assets import mesh_path

SIZE = (512, 512)
SMALL = (128, 128)
BALL = rounded(Sphere().tessellate())
SAGITTA = 2 * Sphere().sagitta()
#: Meshes of other people, which the project does not hold.
HELD = Path(__file__).parents[3] / "shared" / "assets" / "meshes_clean"

#: A renderer for all tests of the page, and what a node finds of a scene.
BEGIN = """async () => {
  const { THREE, ThicknessNode } = translucentThree;
  if (!(await navigator.gpu?.requestAdapter())) return false;
  globalThis.gpu = new THREE.WebGPURenderer({ antialias: false });
  await gpu.init();
  gpu.setPixelRatio(1);
  globalThis.found = async (node, scene, camera, size) => {
    gpu.setSize(...size);
    node.measure(gpu, scene, tools.camera(camera));
    return { ...tools.encoded(await node.read(gpu)), precision: node.precision };
  };
  globalThis.message = async (use) => { try { await use(); } catch (error) { return error.message; } };
  return true;
}"""

MEASURE = """async ({ meshes, opaque, camera, size, options }) => {
  const { THREE, ThicknessNode } = translucentThree;
  const scene = new THREE.Scene();
  const bodies = meshes.map((one) => tools.mesh(one));
  scene.add(...bodies, ...opaque.map((one) => tools.mesh(one, new THREE.MeshBasicMaterial())));
  const node = new ThicknessNode({ bodies, ...options });
  const pixels = await found(node, scene, camera, size);
  node.dispose();
  return pixels;
}"""


@pytest.fixture(scope="module")
def page_of_module(chromium: Any, web_dist: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[WebPage]:
    page = WebPage(chromium, (300, 150))
    file = tmp_path_factory.mktemp("webgpu") / "page.html"
    file.write_text("<!doctype html>", encoding="utf-8")
    page.open(file)  # WebGPU is for pages of files and of https, not for blank ones
    page.add_script(web_dist / "webgpu.browser.js")
    page.add_script(TOOLS)
    ready = page.run(BEGIN)
    if not ready:
        page.close()
        pytest.skip("this Chromium has no WebGPU adapter")
    yield page
    page.close()


@pytest.fixture
def page(page_of_module: WebPage) -> Iterator[WebPage]:
    yield page_of_module
    errors, messages = list(page_of_module.errors), list(page_of_module.messages)
    page_of_module.errors.clear()
    page_of_module.messages.clear()
    assert errors == []
    assert messages == []  # three warns of nodes that it does not understand


def measure(
    page: WebPage,
    meshes: list[dict[str, Any]],
    camera: tl.Camera,
    size: tuple[int, int] = SMALL,
    opaque: tuple[dict[str, Any], ...] = (),
    **options: Any,
) -> Measured:
    given = {"meshes": meshes, "opaque": list(opaque), "camera": described_camera(camera, size), "size": size}
    return Measured.of(page.run(MEASURE, {**given, "options": options}))


def seen_from(distance: float, fov_y: float) -> tl.Camera:
    return tl.Camera.look_at((0.0, 0.0, distance), (0.0, 0.0, 0.0), fov_y=fov_y)


def spring() -> tl.Mesh:
    """Closed tube along a helix, of five turns: up to ten surfaces on a ray."""
    turn, around = np.linspace(0.0, 10.0 * np.pi, 400), np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    along = np.stack([np.cos(turn), np.sin(turn), 0.08 * turn], axis=1)
    tangent = np.gradient(along, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    inwards = -along * (1.0, 1.0, 0.0)
    inwards -= (inwards * tangent).sum(axis=1)[:, None] * tangent
    inwards /= np.linalg.norm(inwards, axis=1)[:, None]
    ring = np.cos(around)[:, None] * inwards[:, None] + np.sin(around)[:, None] * np.cross(tangent, inwards)[:, None]
    i, j = (part.ravel() for part in np.meshgrid(np.arange(399), np.arange(24), indexing="ij"))
    a, b = 24 * i + j, 24 * i + (j + 1) % 24
    sides = np.concatenate([np.stack([a, b, a + 24], axis=1), np.stack([b, b + 24, a + 24], axis=1)])
    j, first, last = np.arange(24), 400 * 24, 400 * 24 + 1
    caps = [np.stack([np.full(24, first), (j + 1) % 24, j], axis=1)]
    caps += [np.stack([np.full(24, last), 399 * 24 + j, 399 * 24 + (j + 1) % 24], axis=1)]
    vertices = np.concatenate([(along[:, None] + 0.15 * ring).reshape(-1, 3), along[[0, -1]]])
    return tl.Mesh(vertices, np.concatenate([sides, *caps]))


@pytest.mark.parametrize("name", ["knot", "bear", "spring", "bunny.obj", "rocker-arm.obj", "spot.obj"])
def test_thickness_is_that_of_the_reference(page: WebPage, name: str) -> None:
    """By edges of faces the grid of 1/16 pixel decides which of two is shown; refined threefold it is 1/48."""
    if name == "spring":
        mesh = rounded(spring())
    else:
        path = HELD / name if "." in name else mesh_path(name)
        if not path.is_file():
            pytest.skip(f"{path} is not here")
        mesh = rounded(tl.load_mesh(path))
    camera = framing(mesh)
    truth = Truth.of(mesh, camera, SIZE)
    for options, by_edges in (({}, 1e-5), ({"precision": "fixed28", "refine": 1}, 5e-5)):
        found = measure(page, [described(mesh)], camera, SIZE, **options)
        errors = Errors.of(found, truth, mesh.diagonal)
        assert errors.pixels > 50_000
        assert errors.median <= 1e-7
        assert errors.p999_off_edges <= 1e-5
        assert errors.p999 <= by_edges
        assert (errors.wrong, errors.wrong_by_edges, errors.marked) == (0, 0, 0)
        assert errors.coverage <= 3e-4


ADAPTERS = """async ({ ball, camera, infos }) => {
  const { ThicknessNode } = translucentThree;
  const body = tools.mesh(ball);
  const refined = async (options) => {
    const node = new ThicknessNode({ bodies: [body], ...options });
    await found(node, body, camera, [8, 8]);
    return node.refine;
  };
  const all = [await refined({}), await refined({ refine: 1 })];
  for (const info of infos) {
    Object.defineProperty(gpu.backend.device, "adapterInfo", { value: info, configurable: true });
    all.push(await refined({}));
  }
  delete gpu.backend.device.adapterInfo;
  return all;
}"""


def test_adapters_in_software_are_refined(page: WebPage) -> None:
    infos = [{"vendor": "nvidia"}, {"isFallbackAdapter": True}, {"vendor": "mesa", "description": "llvmpipe"}, None]
    camera = described_camera(seen_from(5.0, fov_y=30.0), (8, 8))
    found = page.run(ADAPTERS, {"ball": described(BALL), "camera": camera, "infos": infos})
    assert found == [3, 1, 1, 3, 3, 1]


def test_transforms_eyes_and_opaque_objects(page: WebPage) -> None:
    """Uneven, mirrored and far away; from inside; before a wall through the middle."""
    turn = np.array([[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn @ np.diag((-1.0, 0.5, 1.5)), (1e3, -2e3, 500.0)
    moved = tl.Mesh(BALL.vertices @ matrix[:3, :3].T + matrix[:3, 3], BALL.faces)
    camera = framing(moved)
    half = (256, 256)
    found = measure(page, [described(BALL, matrix)], camera, half)
    errors = Errors.of(found, Truth.of(BALL, camera, half, matrix), moved.diagonal)
    assert errors.median <= 5e-7  # twice the pixel, four times what the grid leaves
    assert (errors.wrong, errors.marked) == (0, 0)

    flat = tl.Camera(seen_from(5.0, fov_y=30.0).pose, None, 2.5)
    errors = Errors.of(measure(page, [described(BALL)], flat, half), Truth.of(BALL, flat, half), BALL.diagonal)
    assert errors.median <= 5e-7
    assert (errors.wrong, errors.marked) == (0, 0)

    for precision in ("float32", "fixed28"):
        inside = measure(page, [described(BALL)], seen_from(0.4, fov_y=60.0), precision=precision)
        assert inside.valid.all()
        assert np.all(inside.count == 1)
        assert inside.thickness[64, 64] == pytest.approx(1.4, abs=SAGITTA)
        wall = described(rounded(Box((0.0, -2.0, -0.01), (2.0, 2.0, 0.0)).tessellate()))
        far = seen_from(500.0, fov_y=0.3)
        walled = measure(page, [described(BALL)], far, opaque=(wall,), precision=precision)
        assert walled.valid.all()
        assert walled.thickness[64, 65] == pytest.approx(1.0, abs=SAGITTA)
        assert walled.thickness[64, 50] == pytest.approx(2 * walled.thickness[64, 77], abs=2 * SAGITTA)

        hole = BALL.vertices[BALL.faces].mean(axis=1)[:, 2] > 0.9
        opened = described(tl.Mesh(BALL.vertices, BALL.faces[~hole]))
        broken = measure(page, [opened], seen_from(5.0, fov_y=30.0), precision=precision)
        assert not broken.valid[64, 64]
        assert 100 < (~broken.valid).sum() < 5_000


MANY = """async ({ ball, camera, size }) => {
  const { THREE, ThicknessNode } = translucentThree;
  const row = new THREE.Group();
  for (let i = 0; i < 40; i++) {
    const one = tools.mesh(ball);
    one.position.z = -3 * i;
    row.add(one);
  }
  const found_of = async (count, precision) => {
    row.children.forEach((one, i) => { one.visible = i < count; });
    const node = new ThicknessNode({ bodies: [row], precision });
    const pixels = await found(node, row, camera, size);
    node.dispose();
    return pixels;
  };
  return [await found_of(16, "fixed28"), await found_of(17, "fixed28"), await found_of(40, "float32")];
}"""


def test_digits_say_where_their_sums_end(page: WebPage) -> None:
    """32 faces add up exactly in half floats; where more are, pixels are marked."""
    camera = described_camera(seen_from(500.0, fov_y=0.3), (33, 33))
    found = page.run(MANY, {"ball": described(BALL), "camera": camera, "size": (33, 33)})
    sound, marked, floats = (Measured.of(one) for one in found)
    assert sound.valid[16, 16]
    assert sound.thickness[16, 16] == pytest.approx(16 * 2.0, abs=17 * SAGITTA)
    assert not marked.valid[16, 16]
    assert floats.thickness[16, 16] == pytest.approx(40 * 2.0, abs=40 * SAGITTA)


VARIANTS = """async ({ ball, camera, size }) => {
  const { THREE, ThicknessNode } = translucentThree;
  const places = [[-1.2, 0, 1, 1], [1.2, 0.3, 0.5, -1]].map(([x, y, scale, mirror]) => new THREE.Matrix4()
    .makeTranslation(x, y, 0).multiply(new THREE.Matrix4().makeScale(mirror * scale, scale, scale)));
  const plain = new THREE.Group();
  for (const place of places) {
    const one = tools.mesh(ball);
    one.matrix.copy(place);
    one.matrixAutoUpdate = false;
    plain.add(one);
  }
  const instanced = new THREE.InstancedMesh(tools.geometry(ball), new THREE.MeshBasicMaterial(), 2);
  places.forEach((place, i) => instanced.setMatrixAt(i, place));
  const larger = tools.geometry(ball);
  const three_times = new THREE.Matrix4().makeScale(3, 3, 3);
  larger.morphAttributes.position = [larger.getAttribute("position").clone().applyMatrix4(three_times)];
  const morphed = new THREE.Mesh(larger, new THREE.MeshBasicMaterial());
  morphed.morphTargetInfluences[0] = 0.25;
  const scaled = tools.mesh(ball);
  scaled.scale.setScalar(1.5);
  const rigged = tools.geometry(ball);
  const n = rigged.getAttribute("position").count;
  rigged.setAttribute("skinIndex", new THREE.Uint16BufferAttribute(new Uint16Array(4 * n), 4));
  const weights = Float32Array.from({ length: 4 * n }, (_, i) => (i % 4 ? 0 : 1));
  rigged.setAttribute("skinWeight", new THREE.Float32BufferAttribute(weights, 4));
  const skinned = new THREE.SkinnedMesh(rigged, new THREE.MeshBasicMaterial());
  const bone = new THREE.Bone();
  skinned.add(bone);
  skinned.bind(new THREE.Skeleton([bone]));
  bone.scale.setScalar(1.5);
  const node = new ThicknessNode();
  const all = {};
  for (const [name, root] of Object.entries({ plain, instanced, morphed, skinned, scaled })) {
    node.options.bodies = [root];
    all[name] = await found(node, root, camera, size);
  }
  node.dispose();
  return all;
}"""


def test_instances_and_poses_are_what_they_show(page: WebPage) -> None:
    """One of the instances is mirrored; morphed and skinned the ball is half again as large."""
    camera = described_camera(seen_from(8.0, fov_y=35.0), SMALL)
    found = page.run(VARIANTS, {"ball": described(BALL), "camera": camera, "size": SMALL})
    pictures = {name: Measured.of(pixels) for name, pixels in found.items()}
    for one, other in (("instanced", "plain"), ("morphed", "scaled"), ("skinned", "scaled")):
        assert pictures[one].valid.all()
        assert pictures[other].covered.sum() > 800
        assert (pictures[one].covered != pictures[other].covered).sum() <= 10
        both = pictures[one].covered & pictures[other].covered
        assert np.quantile(np.abs(pictures[one].thickness - pictures[other].thickness)[both], 0.98) < 1e-5


SLIVERS = """async ({ size, angles }) => {
  const { THREE, ThicknessNode } = translucentThree;
  gpu.setSize(...size);
  const camera = new THREE.PerspectiveCamera(30, size[0] / size[1], 0.01, 1);
  camera.position.z = 0.15;
  const knot = new THREE.Mesh(new THREE.TorusKnotGeometry(0.02, 0.006, 128, 24));
  const node = new ThicknessNode({ bodies: [knot] });
  const longest = [];
  for (const angle of angles) {
    knot.rotation.y = angle;
    node.measure(gpu, knot, camera);
    longest.push((await node.read(gpu)).thickness.reduce((a, b) => Math.max(a, b), 0));
  }
  return longest;
}"""


def test_faces_that_are_seen_edge_on_have_no_depth_of_their_own(page: WebPage) -> None:
    assert max(page.run(SLIVERS, {"size": (200, 160), "angles": EDGE_ON})) < 0.058


#: A ball before a gray sky, below white; and two media, one behind the other.
DRAWN = """async ({ ball, normals, camera, size, color, distance }) => {
  const { THREE, TSL, ThicknessNode, TranslucentNodeMaterial, thickness } = translucentThree;
  const [wide, high] = [128, 64];
  const texels = new Float32Array(4 * wide * high).fill(0.5).fill(1, 2 * wide * high);
  const sky = new THREE.DataTexture(texels, wide, high, THREE.RGBAFormat, THREE.FloatType);
  sky.mapping = THREE.EquirectangularReflectionMapping;
  sky.minFilter = sky.magFilter = THREE.LinearFilter;
  sky.needsUpdate = true;
  const scene = new THREE.Scene();
  scene.environment = scene.background = sky;
  const body = tools.mesh(ball);
  body.geometry.setAttribute("normal", new THREE.BufferAttribute(new Float32Array(tools.bytes(normals)), 3));
  scene.add(body);
  const target = new THREE.RenderTarget(...size, { type: THREE.FloatType });
  const pictures = [];
  const draw = async () => {
    gpu.setRenderTarget(target);
    gpu.render(scene, tools.camera(camera));
    gpu.setRenderTarget(null);
    pictures.push(tools.base64(await gpu.readRenderTargetPixelsAsync(target, 0, 0, ...size)));
  };
  const thicknessNode = thickness();
  const medium = { attenuationColor: new THREE.Color().setRGB(...color), attenuationDistance: distance };
  for (const ior of [1, 1.5]) {
    body.material = new TranslucentNodeMaterial({ thicknessNode, ior, ...medium });
    await draw();
  }
  body.material = body.material.clone();
  const clone = body.material.thicknessNode === thicknessNode && body.material.attenuationDistance === distance;
  // Metres as a color, of any material.
  body.material = new THREE.MeshBasicNodeMaterial();
  const metres = new ThicknessNode({ bodies: [body], opticalDepth: true });
  const depth = TSL.textureLoad(metres.opticalDepth, TSL.ivec2(TSL.screenCoordinate));
  body.material.colorNode = TSL.vec4(metres.x, depth.rg, 1);
  Object.assign(body.material, medium);
  await draw();
  return { pictures, clone };
}"""


def test_the_material_absorbs_what_was_measured(page: WebPage) -> None:
    color, distance, size = (0.2, 0.5, 0.9), 0.8, (64, 64)
    given = {"ball": described(BALL), "normals": encoded(BALL.vertex_normals, "f4"), "color": color}
    camera = described_camera(framing(BALL), size)
    found = page.run(DRAWN, {**given, "camera": camera, "size": size, "distance": distance})
    plain, glass, metres = (decoded(one).reshape(64, 64, 4)[..., :3] for one in found["pictures"])
    assert found["clone"]
    truth = Truth.of(BALL, framing(BALL), size)
    seen = tl.interior(truth.crossed) & (truth.crossed > 0)
    medium = tl.Medium.from_color(color, distance=distance, ior=1.5)
    assert metres[seen][:, 0] == pytest.approx(truth.thickness[seen], abs=1e-3)  # by edges; on the whole far less
    assert np.median(np.abs(metres[seen][:, 0] - truth.thickness[seen])) < 2e-5  # of 64 pixels
    depth = np.outer(truth.thickness[seen], medium.extinction[:2])
    assert metres[seen][:, 1:] == pytest.approx(depth, abs=1e-2)
    down = seen & (framing(BALL).rays(size)[1][..., 1] < -0.1)
    # What is behind is in half floats.
    assert plain[down] == pytest.approx(0.5 * medium.transmittance(truth.thickness[down]), abs=5e-4)
    rows = np.where(np.arange(64) < 32, 1.0, 0.5)[:, None, None] * np.ones((1, 128, 3))
    scene = tl.Scene([tl.Object(BALL, medium=medium)], framing(BALL), environment=tl.Environment.image(rows))
    bent = tl.reference.render(scene, size, bounces=4).radiance
    # What it leaves out is light that is mirrored inside, and the horizon that maps of three.js blur.
    assert np.sqrt(np.mean((glass - bent)[seen] ** 2)) < 0.15 * bent[seen].mean()


REFUSED = """async () => {
  const { THREE, ThicknessNode, TranslucentNodeMaterial } = translucentThree;
  const camera = new THREE.PerspectiveCamera();
  const ball = new THREE.Mesh(new THREE.SphereGeometry(), new THREE.MeshBasicMaterial());
  ball.name = "ball";
  const measure = (options, seen = camera, renderer = gpu) =>
    message(() => new ThicknessNode(options).measure(renderer, ball, seen));
  const told = {
    one: await measure({ bodies: ball }),
    unknown: await measure({ body: [ball] }),
    array: await measure({ bodies: [ball] }, new THREE.ArrayCamera([camera])),
    renderer: await measure({ bodies: [ball] }, camera, {}),
    unread: await message(() => new ThicknessNode().read(gpu)),
    material: await message(() => new TranslucentNodeMaterial({})),
  };
  const group = new THREE.ClippingGroup();
  group.add(ball);
  told.clipped = await measure({ bodies: [ball] });
  group.remove(ball);
  const webgl = new THREE.WebGPURenderer({ forceWebGL: true });
  await webgl.init();
  told.webgl = await measure({ bodies: [ball] }, camera, webgl);
  webgl.dispose();
  return told;
}"""


def test_what_cannot_be_followed_is_refused(page: WebPage) -> None:
    told = page.run(REFUSED)
    assert told["one"].startswith("option bodies of ThicknessNode; it is one Mesh; give a list of objects")
    assert told["unknown"].startswith("option body of ThicknessNode; there is no such option; use one of bodies")
    assert "an ArrayCamera; it has several pictures" in told["array"]
    assert told["renderer"] == (
        "ThicknessNode; the renderer is no WebGPURenderer; use ExactThicknessPass with a WebGLRenderer"
    )
    assert told["unread"].startswith("read(); nothing is measured yet")
    assert told["material"] == (
        "TranslucentNodeMaterial; it has no ThicknessNode; give one: { thicknessNode: thickness() }"
    )
    assert 'the ClippingGroup of Mesh "ball"; the pass measures whole bodies' in told["clipped"]
    assert told["webgl"] == (
        "ThicknessNode in this browser; there is no WebGPU, and its renderer draws with WebGL2; "
        "use ExactThicknessPass with a WebGLRenderer there"
    )
