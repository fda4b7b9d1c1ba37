"""ExactThicknessPass in headless Chromium against the float64 reference."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.browser.pages import WebPage, decoded
from tests.browser.thickness import Errors, Measured, Truth, described, described_camera, framing, measure, rounded
from tests.solids import Box, Sphere
from translucent.assets import mesh_path

SIZE = (256, 256)
KNOT = rounded(tl.load_mesh(mesh_path("knot")))
BALL = rounded(Sphere().tessellate())
#: What a chord through the middle of the tessellated ball differs by from that of the ball, in metres.
SAGITTA = 2 * Sphere().sagitta()


def turned(angle: float, scale: tuple[float, float, float], shift: tuple[float, float, float]) -> np.ndarray:
    """Scales along the axes, then a turn about an oblique axis, then a shift."""
    axis = np.array([1.0, 2.0, -1.0]) / np.sqrt(6.0)
    cross = np.cross(np.eye(3), axis)
    turn = np.eye(3) - np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn @ np.diag(scale), shift
    return matrix


def seen_from(distance: float, fov_y: float) -> tl.Camera:
    return tl.Camera.look_at((0.0, 0.0, distance), (0.0, 0.0, 0.0), fov_y=fov_y)


def test_thickness_is_that_of_the_reference(three_page: WebPage) -> None:
    """By edges of faces the grid of 1/16 pixel decides which of two is shown; in software it is refined to 1/48."""
    camera, size = framing(KNOT, (-1.0, 0.2, 0.4)), (512, 512)
    found = measure(three_page, [described(KNOT)], camera, size)
    errors = Errors.of(found, Truth.of(KNOT, camera, size), KNOT.diagonal)
    assert errors.pixels > 50_000
    assert errors.median <= 1e-7
    assert errors.p999_off_edges <= 1e-5
    assert errors.p999 <= 1e-5
    assert (errors.wrong, errors.wrong_by_edges) == (0, 0)
    assert errors.marked <= MARKED
    assert errors.coverage <= 3e-4


#: Pixels of a picture beside edges, outlines above all, in which the grid of a rasterizer in software decides.
MARKED = 120


def mostly_valid(found: Measured) -> bool:
    """True if all pixels are, but for some by edges of the outline."""
    return bool((~found.valid).sum() <= 2e-3 * found.covered.sum())


@pytest.mark.parametrize(
    ("name", "ahead", "before"), [("armadillo", (-1.0, 0.2, 0.4), 3), ("cow", (0.3, -0.5, -0.9), 1)]
)
def test_pixels_by_edges_are_marked_if_wrong(
    three_page: WebPage, assets: Path, name: str, ahead: tuple[float, float, float], before: int
) -> None:
    """At outlines as well. Without the check as many pixels inside outlines would be wrong."""
    mesh, size = rounded(tl.load_mesh(assets / "meshes_clean" / f"{name}.obj")), (512, 512)
    camera = framing(mesh, ahead)
    truth = Truth.of(mesh, camera, size)
    found = measure(three_page, [described(mesh)], camera, size)
    wrong = np.abs(found.thickness - truth.thickness) > 1e-3 * mesh.diagonal
    assert not (wrong & found.valid & (truth.crossed > 0) & found.covered).any()
    inside = tl.interior(truth.crossed) & (truth.crossed > 0)
    assert before <= (inside & ~found.valid).sum() <= 10
    assert (~found.valid).sum() <= MARKED


AT_REST = """({ mesh, camera, size }) => tools.withRenderer(size, (renderer) => {
    const { THREE, ExactThicknessPass } = translucentThree;
    const body = tools.mesh(mesh);
    const seen = tools.camera(camera);
    const pass = new ExactThicknessPass(renderer, { bodies: [body] });
    const check = pass.checkEdges.bind(pass);
    let checks = 0;
    pass.checkEdges = (...all) => { checks++; check(...all); };
    const after = (act) => { checks = 0; act(); return checks; };
    const draw = () => pass.render(body, seen);
    const move = () => { body.position.x += 0.01; body.updateMatrix(); draw(); };
    return { first: after(draw), again: after(draw), moved: after(move), rests: after(draw), rested: after(draw),
        unread: after(move), read: after(() => pass.read()), twice: after(() => pass.at(1, 1)) };
})"""


def test_edges_are_checked_once_at_rest(three_page: WebPage) -> None:
    """Not while something moves, but before numbers are read."""
    camera = described_camera(seen_from(5.0, fov_y=30.0), (64, 64))
    found = three_page.run(AT_REST, {"mesh": described(BALL), "camera": camera, "size": (64, 64)})
    once = {"first", "rests", "read"}
    assert found == {name: int(name in once) for name in found}


REFINEMENTS = """(renderers) => tools.withRenderer([8, 8], (renderer) => {
    const { ExactThicknessPass } = translucentThree;
    const gl = renderer.getContext();
    const own = gl.getParameter.bind(gl);
    const found = renderers.map((name) => {
        gl.getParameter = (what) => (what === 0x9246 ? name : own(what));
        return new ExactThicknessPass(renderer).refine;
    });
    gl.getParameter = own;
    const most = renderer.capabilities.maxTextureSize;
    const wide = new ExactThicknessPass(renderer, { refine: 3, size: [most, 1] });
    let message = null;
    try { wide.refine; } catch (error) { message = error.message; }
    const refine = (options) => new ExactThicknessPass(renderer, options).refine;
    return [...found, refine(), refine({ refine: 1 }), refine({ size: [most, 1] }), message];
})"""


def test_rasterizers_in_software_are_refined(three_page: WebPage) -> None:
    """A number that is requested wins; by default a size that would not fit is not refined."""
    names = ["ANGLE (NVIDIA, NVIDIA GeForce RTX 4070, D3D11)", "ANGLE (Mesa, llvmpipe (LLVM 19.1), OpenGL 4.5)"]
    *found, message = three_page.run(REFINEMENTS, names)
    assert found == [1, 3, 3, 1, 1]
    assert message.startswith("ExactThicknessPass with refine: 3; ")
    assert message.endswith("refine less, or set a smaller size")


@pytest.mark.parametrize(
    ("scale", "shift"),
    [((1.0, 1.0, 1.0), (1e4, -3e3, 2e3)), ((0.3, 1.0, 2.5), (0.1, 0.0, 0.0)), ((-1.0, 0.5, 1.0), (0.0, 0.0, 0.0))],
    ids=["far from the origin", "scaled unevenly", "mirrored"],
)
def test_transforms_are_followed(three_page: WebPage, scale: Any, shift: Any) -> None:
    matrix = turned(0.7, scale, shift)
    moved = tl.Mesh(KNOT.vertices @ matrix[:3, :3].T + matrix[:3, 3], KNOT.faces)
    camera = framing(moved)
    found = measure(three_page, [described(KNOT, matrix)], camera, SIZE)
    errors = Errors.of(found, Truth.of(KNOT, camera, SIZE, matrix), moved.diagonal)
    assert errors.pixels > 3_000
    assert errors.median <= 5e-7  # twice the pixel, four times what the grid leaves
    assert errors.p999_off_edges <= 5e-5
    assert errors.wrong == 0
    assert errors.marked <= MARKED


def test_orthographic_cameras(three_page: WebPage) -> None:
    camera = tl.Camera(framing(BALL).pose, None, 2.5)
    found = measure(three_page, [described(BALL)], camera, SIZE)
    errors = Errors.of(found, Truth.of(BALL, camera, SIZE), BALL.diagonal)
    assert errors.median <= 1e-7
    assert errors.wrong == 0
    assert errors.marked <= MARKED


def test_rays_from_inside_begin_at_the_eye(three_page: WebPage) -> None:
    found = measure(three_page, [described(BALL)], seen_from(0.4, fov_y=60.0), SIZE)
    assert mostly_valid(found)
    assert found.covered.all()
    assert found.thickness[128, 128] == pytest.approx(1.4, abs=SAGITTA)
    assert np.all(found.count == 1)


def test_orthographic_rays_begin_at_the_near_plane(three_page: WebPage) -> None:
    found = measure(three_page, [described(BALL)], tl.Camera(seen_from(0.4, fov_y=60.0).pose, None, 1.0), (32, 32))
    assert mostly_valid(found)
    assert found.thickness[16, 16] == pytest.approx(1.4 - 0.01, abs=SAGITTA)


def test_opaque_objects_end_rays(three_page: WebPage) -> None:
    """The right half of a wall through the middle of the ball."""
    wall = Box((0.0, -2.0, -0.01), (2.0, 2.0, 0.0)).tessellate()
    found = measure(three_page, [described(BALL)], seen_from(500.0, fov_y=0.3), SIZE, opaque=[described(rounded(wall))])
    assert mostly_valid(found)
    assert found.thickness[128, 100] == pytest.approx(2 * found.thickness[128, 155], abs=2 * SAGITTA)
    assert found.thickness[128, 129] == pytest.approx(1.0, abs=SAGITTA)


def test_an_open_mesh_is_marked(three_page: WebPage) -> None:
    """Marks are where rays meet its hole, and nowhere else."""
    hole = BALL.vertices[BALL.faces].mean(axis=1)[:, 2] > 0.9
    opened = tl.Mesh(BALL.vertices, BALL.faces[~hole])
    found = measure(three_page, [described(opened)], seen_from(5.0, fov_y=30.0), SIZE)
    truth = measure(three_page, [described(BALL)], seen_from(5.0, fov_y=30.0), SIZE)
    assert 500 < (~found.valid).sum() < 20_000
    assert not found.valid[128, 128]
    assert found.covered[128, 128]
    assert np.array_equal(found.thickness[found.valid], truth.thickness[found.valid])


def test_holes_of_two_bodies_do_not_balance_each_other(three_page: WebPage) -> None:
    hole = BALL.vertices[BALL.faces].mean(axis=1)[:, 2] > 0.9
    behind = BALL.vertices[BALL.faces].mean(axis=1)[:, 2] < -0.9
    bodies = [described(tl.Mesh(BALL.vertices, BALL.faces[~faces])) for faces in (hole, behind)]
    found = measure(three_page, bodies, seen_from(5.0, fov_y=30.0), SIZE)
    assert not found.valid[128, 128]


VARIANTS = """({ ball, camera, size }) => tools.withRenderer(size, (renderer) => {
    const { THREE, ExactThicknessPass } = translucentThree;
    const place = (x, y, scale, mirror) => new THREE.Matrix4()
        .makeTranslation(x, y, 0)
        .multiply(new THREE.Matrix4().makeScale(mirror * scale, scale, scale));
    const places = [place(-1.2, 0, 1, 1), place(1.2, 0.3, 0.5, -1)];
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
    const weights = Float32Array.from({ length: 4 * n }, (_, i) => (i % 4 ? 0 : 1));
    rigged.setAttribute("skinIndex", new THREE.Uint16BufferAttribute(new Uint16Array(4 * n), 4));
    rigged.setAttribute("skinWeight", new THREE.Float32BufferAttribute(weights, 4));
    const skinned = new THREE.SkinnedMesh(rigged, new THREE.MeshBasicMaterial());
    const bone = new THREE.Bone();
    skinned.add(bone);
    skinned.bind(new THREE.Skeleton([bone]));
    bone.scale.setScalar(1.5);

    const pass = new ExactThicknessPass(renderer);
    const found = {};
    for (const [name, root] of Object.entries({ plain, instanced, morphed, skinned, scaled })) {
        pass.options.bodies = [root];
        found[name] = tools.measured(pass, root, camera);
    }
    return found;
})"""


def test_instances_and_poses_are_what_they_show(three_page: WebPage) -> None:
    """One of the instances is mirrored; morphed and skinned the ball is half again as large."""
    camera = described_camera(seen_from(8.0, fov_y=35.0), SIZE)
    found = three_page.run(VARIANTS, {"ball": described(BALL), "camera": camera, "size": SIZE})
    pictures = {name: Measured.of(pixels) for name, pixels in found.items()}
    for one, other in (("instanced", "plain"), ("morphed", "scaled"), ("skinned", "scaled")):
        assert mostly_valid(pictures[one])
        assert pictures[other].covered.sum() > 3_000
        assert (pictures[one].covered != pictures[other].covered).sum() <= 20
        both = pictures[one].covered & pictures[other].covered
        assert np.quantile(np.abs(pictures[one].thickness - pictures[other].thickness)[both], 0.98) < 1e-5


MEDIA = """({ ball, camera, size }) => tools.withRenderer(size, (renderer) => {
    const { THREE, ExactThicknessPass, TranslucentMaterial } = translucentThree;
    const pass = new ExactThicknessPass(renderer);
    const scene = new THREE.Scene();
    for (const [color, z] of [["#ff8080", 0], ["#80ff80", -3]]) {
        const material = new TranslucentMaterial({ pass, attenuationColor: color, attenuationDistance: 0.5 });
        const one = tools.mesh(ball, material);
        one.position.z = z;
        scene.add(one);
    }
    pass.render(scene, tools.camera(camera));
    const [width, height] = size;
    const depth = new Float32Array(4 * width * height);
    renderer.readRenderTargetPixels(pass.result, 0, 0, width, height, depth, undefined, 1);
    return { depth: tools.base64(depth), thickness: tools.pixels(pass).thickness };
})"""


def test_several_media_add_up_their_optical_depths(three_page: WebPage) -> None:
    camera = described_camera(seen_from(20.0, fov_y=10.0), SIZE)
    found = three_page.run(MEDIA, {"ball": described(BALL), "camera": camera, "size": SIZE})
    depth = decoded(found["depth"]).reshape(256, 256, 4)[128, 128, :3]
    half = -np.log(((0x80 / 255 + 0.055) / 1.055) ** 2.4) / 0.5
    assert decoded(found["thickness"]).reshape(SIZE)[128, 128] == pytest.approx(4.0, abs=2 * SAGITTA)
    assert depth == pytest.approx([2.0 * half, 2.0 * half, 4.0 * half], rel=2 * SAGITTA)


FALLBACKS = """({ ball, camera, size, missing }) => tools.withRenderer(size, (renderer) => {
    const { THREE, ExactThicknessPass } = translucentThree;
    const has = renderer.extensions.has;
    renderer.extensions.has = (name) => !missing.includes(name) && has(name);
    const body = tools.mesh(ball);
    try {
        return tools.measured(new ExactThicknessPass(renderer, { bodies: [body] }), body, camera);
    } catch (error) {
        return { error: error.message };
    }
})"""


def test_sixteen_bits_where_floats_cannot_be_added_up(three_page: WebPage) -> None:
    camera = seen_from(5.0, fov_y=30.0)
    asked = {"ball": described(BALL), "camera": described_camera(camera, SIZE), "size": SIZE}
    found = three_page.run(FALLBACKS, {**asked, "missing": ["EXT_float_blend"]})
    assert found["precision"] == "float16"
    pixels, truth = Measured.of(found), Truth.of(BALL, camera, SIZE)
    assert mostly_valid(pixels)
    assert np.abs(pixels.thickness - truth.thickness)[tl.interior(truth.crossed)].max() < 4e-3 * BALL.diagonal
    none = ["EXT_color_buffer_float", "EXT_color_buffer_half_float"]
    message = three_page.run(FALLBACKS, {**asked, "missing": none})["error"]
    assert message.startswith("exact thickness in this browser; it draws into no texture of floats")


LOST = """async ({ ball, camera, size }) => {
    const { ExactThicknessPass } = translucentThree;
    const renderer = tools.renderer(...size);
    const body = tools.mesh(ball);
    const pass = new ExactThicknessPass(renderer, { bodies: [body] });
    const before = tools.measured(pass, body, camera);
    const loss = renderer.getContext().getExtension("WEBGL_lose_context");
    const canvas = renderer.domElement;
    // After the event, not within it: a context cannot come back before.
    const told = (name) => new Promise((done, fail) => {
        canvas.addEventListener(name, () => setTimeout(done), { once: true });
        setTimeout(() => fail(new Error(`no ${name}`)), 10000);
    });
    const lost = told("webglcontextlost");
    loss.loseContext();
    await lost;
    const drawn = pass.render(body, tools.camera(camera));
    const restored = told("webglcontextrestored");
    loss.restoreContext();
    await restored;
    const after = tools.measured(pass, body, camera);
    renderer.dispose();
    canvas.remove();
    return { before, after, drawn };
}"""


def test_a_lost_context_is_survived(three_page: WebPage) -> None:
    camera = described_camera(seen_from(5.0, fov_y=30.0), (64, 64))
    found = three_page.run(LOST, {"ball": described(BALL), "camera": camera, "size": (64, 64)})
    assert found["drawn"] is False
    assert found["after"] == found["before"]
    three_page.messages.clear()


LIFE = """({ ball, camera, size }) => tools.withRenderer(size, (renderer) => {
    const { THREE, ExactThicknessPass } = translucentThree;
    const scene = new THREE.Scene();
    const body = tools.mesh(ball);
    const wall = new THREE.Mesh(new THREE.PlaneGeometry(), new THREE.MeshBasicMaterial());
    scene.add(body, wall);
    renderer.render(scene, tools.camera(camera));
    const { memory, programs } = renderer.info;
    const settings = () => ({ target: renderer.getRenderTarget(), clear: renderer.autoClear });
    const state = () => ({ ...memory, programs: programs.length, ...settings() });
    const before = state();
    const pass = new ExactThicknessPass(renderer, { bodies: [body], exits: true });
    pass.render(scene, tools.camera(camera));
    const first = [pass.read().width, pass.read().height];
    renderer.setPixelRatio(2);
    renderer.setSize(50, 40);
    pass.render(scene, tools.camera(camera));
    const second = [pass.read().width, pass.read().height];
    pass.dispose();
    return { before, after: state(), first, second, children: scene.children.length, material: body.material.type };
})"""


def test_it_follows_the_canvas_and_frees_all_that_it_made(three_page: WebPage) -> None:
    camera = described_camera(seen_from(5.0, fov_y=30.0), (64, 64))
    found = three_page.run(LIFE, {"ball": described(BALL), "camera": camera, "size": (64, 64)})
    assert found["first"] == [64, 64]
    assert found["second"] == [100, 80]
    assert found["after"] == found["before"]
    assert (found["children"], found["material"]) == (2, "MeshBasicMaterial")


REFUSED = """() => tools.withRenderer([16, 16], (renderer) => {
    const { THREE, ExactThicknessPass } = translucentThree;
    const told = (use) => { try { use(); } catch (error) { return error.message; } };
    const camera = new THREE.PerspectiveCamera();
    const measure = (body) => told(() => new ExactThicknessPass(renderer, { bodies: [body] }).render(body, camera));
    const points = new THREE.Points(new THREE.BufferGeometry());
    points.name = "stars";
    return {
        points: measure(points),
        batch: measure(new THREE.BatchedMesh(1, 3)),
        empty: measure(new THREE.Mesh(new THREE.BufferGeometry())),
        renderer: told(() => new ExactThicknessPass({})),
        unread: told(() => new ExactThicknessPass(renderer).read()),
    };
})"""


def test_what_has_no_inside_is_refused(three_page: WebPage) -> None:
    told = three_page.run(REFUSED)
    assert told["points"] == 'Points "stars"; it has no triangles, so no inside; give meshes as bodies'
    assert "batches have a transform per part" in told["batch"]
    assert "its geometry has no positions" in told["empty"]
    assert "use three's WebGLRenderer" in told["renderer"]
    assert "call render(scene, camera) first" in told["unread"]


MISTAKES = """() => tools.withRenderer([16, 16], (renderer) => {
    const { THREE, ExactThicknessPass } = translucentThree;
    const told = (use) => { try { use(); } catch (error) { return `${error.name}: ${error.message}`; } };
    const made = (options) => told(() => new ExactThicknessPass(renderer, options));
    const mesh = new THREE.Mesh(new THREE.SphereGeometry(), new THREE.MeshBasicMaterial());
    mesh.name = "ball";
    const camera = new THREE.PerspectiveCamera();
    const pass = new ExactThicknessPass(renderer, { bodies: [mesh], exits: undefined });
    const cut = new THREE.Plane(new THREE.Vector3(0, 1, 0), 0);
    const found = {
        one: made({ bodies: mesh }), unknown: made({ body: [mesh] }), list: made({ opaque: [mesh, {}] }),
        size: made({ size: 64 }), exits: made({ exits: "yes" }), precision: made({ precision: "double" }),
        none: made(null), array: told(() => pass.render(mesh, new THREE.ArrayCamera([camera]))),
        right: made({ bodies: [mesh], opaque: [], size: [8, 8], precision: "float16", exits: false }),
    };
    pass.options.size = [0, 0];
    found.later = told(() => pass.render(mesh, camera));
    pass.options.size = undefined;
    renderer.clippingPlanes = [cut];
    found.planes = told(() => pass.render(mesh, camera));
    renderer.clippingPlanes = [];
    mesh.material.clippingPlanes = [cut];
    found.disabled = told(() => pass.render(mesh, camera));
    renderer.localClippingEnabled = true;
    found.local = told(() => pass.render(mesh, camera));
    return found;
})"""


def test_options_and_views_that_cannot_be_followed_are_refused(three_page: WebPage) -> None:
    told = three_page.run(MISTAKES)
    start = "TranslucentError: option"
    of = "of ExactThicknessPass"
    assert told["one"].startswith(f"{start} bodies {of}; it is one Mesh; give a list of objects, as [mesh]")
    known = "bodies, opaque, size, precision, opticalDepth, exits, refine"
    assert told["unknown"] == f"{start} body {of}; there is no such option; use one of {known}"
    assert told["list"].startswith(f"{start} opaque {of}; it is a list with an object in it; give a list of objects")
    assert told["size"] == f"{start} size {of}; it is 64; give [width, height] in pixels"
    assert told["exits"] == f'{start} exits {of}; it is "yes"; give "auto", true, false, or leave it out'
    assert told["precision"] == f'{start} precision {of}; it is "double"; give "float32", "float16", or leave it out'
    assert "they are null; give an object" in told["none"]
    assert "an ArrayCamera; it has several pictures" in told["array"]
    assert "option size" in told["later"]
    assert "renderer.clippingPlanes; the pass measures whole bodies" in told["planes"]
    assert 'clippingPlanes of Mesh "ball"; the pass measures whole bodies' in told["local"]
    assert told["right"] is None
    assert told["disabled"] is None


DEPTHS = """({ ball, wall, camera, size }) => {
    const { THREE, ExactThicknessPass } = translucentThree;
    const measured = (options, change) => tools.withRenderer(size, (renderer) => {
        const scene = new THREE.Scene();
        const body = tools.mesh(ball);
        body.geometry.computeVertexNormals();
        scene.add(body, tools.mesh(wall));
        const pass = new ExactThicknessPass(renderer, { bodies: [body], exits: true });
        const seen = tools.camera(camera);
        change(seen);
        pass.render(scene, seen);
        const exits = new Float32Array(4 * size[0] * size[1]);
        renderer.readRenderTargetPixels(pass.last, 0, 0, ...size, exits);
        return { ...tools.pixels(pass), exits: tools.base64(exits) };
    }, options);
    const as_is = () => {};
    return {
        plain: measured({}, as_is),
        reversed: measured({ reversedDepthBuffer: true }, as_is),
        logarithmic: measured({ logarithmicDepthBuffer: true }, as_is),
        part: measured({}, (seen) => seen.setViewOffset(2 * size[0], 2 * size[1], size[0], 0, ...size)),
    };
}"""


def test_whatever_the_depth_buffer_is(three_page: WebPage) -> None:
    """And of an off-axis view, the same as in the part of the picture that it shows."""
    wall = Box((0.0, -2.0, -0.01), (2.0, 2.0, 0.0)).tessellate()
    camera = described_camera(seen_from(5.0, fov_y=30.0), (64, 64))
    asked = {"ball": described(BALL), "wall": described(wall), "camera": camera, "size": (64, 64)}
    found = three_page.run(DEPTHS, asked)
    assert found["reversed"] == found["plain"]
    assert found["logarithmic"] == found["plain"]
    exits = decoded(found["plain"]["exits"]).reshape(64, 64, 4)[32, 32]
    assert exits == pytest.approx([0.0, 0.0, -1.0, 6.0], abs=0.05)
    whole, part = Measured.of(found["plain"]), Measured.of(found["part"])
    # Pixels of the whole lie between four of the part.
    between = part.thickness.reshape(32, 2, 32, 2).mean(axis=(1, 3))
    deep = whole.thickness[:32, 32:] > 0.8
    assert deep.sum() > 200
    assert between[deep] == pytest.approx(whole.thickness[:32, 32:][deep], abs=SAGITTA + 0.01)


PRIMITIVES = """({ camera, size }) => tools.withRenderer(size, (renderer) => {
    const { THREE, ExactThicknessPass } = translucentThree;
    const made = {
        sphere: new THREE.SphereGeometry(1, 64, 32),
        torus: new THREE.TorusKnotGeometry(0.6, 0.2, 128, 16),
        box: new THREE.BoxGeometry(1, 1.2, 0.8),
    };
    const pass = new ExactThicknessPass(renderer);
    return Object.fromEntries(Object.entries(made).map(([name, geometry]) => {
        const body = new THREE.Mesh(geometry);
        body.rotation.set(0.4, 0.7, 0.1);
        pass.options.bodies = [body];
        const found = tools.measured(pass, body, camera);
        return [name, { ...found, weight: pass.standIns.kept.get(body).uniforms.count_weight.value }];
    }));
})"""


def test_geometries_of_three_are_closed(three_page: WebPage) -> None:
    """Though their seams have two vertices at places that differ by a rounding."""
    camera = described_camera(seen_from(5.0, fov_y=30.0), SIZE)
    for pixels in three_page.run(PRIMITIVES, {"camera": camera, "size": SIZE}).values():
        found = Measured.of(pixels)
        assert pixels["weight"] == 1  # more: open
        assert found.covered.sum() > 5_000
        assert mostly_valid(found)


SLIVERS = """({ size, angles }) => tools.withRenderer(size, (renderer) => {
    const { THREE, ExactThicknessPass } = translucentThree;
    const camera = new THREE.PerspectiveCamera(30, size[0] / size[1], 0.01, 1);
    camera.position.z = 0.15;
    const knot = new THREE.Mesh(new THREE.TorusKnotGeometry(0.02, 0.006, 128, 24));
    const pass = new ExactThicknessPass(renderer, { bodies: [knot] });
    return angles.map((angle) => {
        knot.rotation.y = angle;
        pass.render(knot, camera);
        return pass.read().thickness.reduce((a, b) => Math.max(a, b), 0);
    });
})"""

#: Turns of the knot that show a face so nearly edge-on that its plane is up to 2 m off half a step of the grid.
EDGE_ON = [2 * np.pi * pose / 300 + 0.001 for pose in (15, 59, 73, 91, 93, 224, 297)]


def test_faces_that_are_seen_edge_on_have_no_depth_of_their_own(three_page: WebPage) -> None:
    """No ray is longer in the knot than its size."""
    longest = three_page.run(SLIVERS, {"size": (200, 160), "angles": EDGE_ON})
    assert max(longest) < 0.058
