"""Hard cases of meshes: holes, flipped and repeated faces, slivers, overlaps, many layers, transforms."""

from __future__ import annotations

import numpy as np

from translucent import reference
from translucent.bench.hard.cases import SIZE, Checks, Hard
from translucent.bench.hard.views import EXACTLY, GLASS
from translucent.bench.shapes import (
    backward_window,
    bow_tie,
    inside_out_slab_beside_an_open_box,
    joined,
    nested_shells,
    plates,
)
from translucent.frames.metrics import interior
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Sphere, Torus
from translucent.media.medium import Medium
from translucent.planning.methods import DepthPeeling, FragmentLists, KBuffer, SignedDepth
from translucent.planning.methods.depth_peeling import MAX_LAYERS
from translucent.planning.notes import NoteKind
from translucent.scene.camera import Camera
from translucent.scene.scene import Object, Overlap, Scene
from translucent.scene.showcase import framing, showcase

RED = Medium(absorption=(2.0, 0.2, 0.2))


def _holes(checks: Checks) -> None:
    ball = Sphere().tessellate(48)
    scene = showcase(ball, GLASS, SIZE, stage="none")
    towards = ball.vertices[ball.faces].mean(axis=1) @ (scene.camera.pose[:3, 3] - ball.center)
    facing = np.argsort(-towards)
    for count, what in ((1, "a missing face"), (40, "a hole of 40 faces")):
        torn = Mesh(ball.vertices, np.delete(ball.faces, facing[:count], axis=0), name="torn")
        leaky = Scene([Object(torn, GLASS)], scene.camera)
        frame, truth = checks.render(leaky), reference.render(leaky, SIZE)
        missed = truth.coverage & ~truth.valid & frame.valid
        checks.holds(f"{what}: marks {int((~frame.valid).sum())} pixels", (~frame.valid).any())
        checks.error(f"{what}: defective pixels not marked, of {int((~truth.valid).sum())}", missed.sum())


def _inverted(checks: Checks) -> None:
    ball = Sphere().tessellate(48)
    turned = Mesh(ball.vertices, ball.faces[:, ::-1], name="inverted")
    checks.picture("all faces turned: thickness", showcase(turned, GLASS, SIZE, stage="none"))
    scene = showcase(ball, GLASS, (192, 192), stage="none")
    towards = ball.vertices[ball.faces].mean(axis=1) @ (scene.camera.pose[:3, 3] - ball.center)
    faces = ball.faces.copy()
    faces[towards.argmax()] = faces[towards.argmax()][::-1]
    flipped = Scene([Object(Mesh(ball.vertices, faces, name="flipped"), GLASS)], scene.camera)
    frame = checks.render(flipped, (192, 192))
    truth = reference.render(flipped, (192, 192))
    checks.holds(f"one face turned: {int((~frame.valid).sum())} pixels marked", (~frame.valid).any())
    checks.holds("all defective pixels among them", not (~truth.valid & frame.valid & truth.coverage).any())


def _doubled(checks: Checks) -> None:
    box = Box((-1, -1, -1), (1, 1, 1)).tessellate()
    twice = Mesh(box.vertices, np.concatenate([box.faces, box.faces]), name="twice")
    checks.holds(f"{twice.diagnosis.duplicate_faces.count} repeated faces found", bool(twice.diagnosis.duplicate_faces))
    doubled = showcase(twice, GLASS, SIZE, stage="none")
    checks.holds("and told by the plan", checks.renderer.plan(doubled).says(NoteKind.DUPLICATED_FACES))
    left, right = Box((-1, -1, -1), (0, 1, 1)).tessellate(), Box((0, -1, -1), (1, 1, 1)).tessellate()
    for method in (SignedDepth(), FragmentLists(), DepthPeeling()):
        scene = Scene([Object(left, GLASS), Object(right, RED)], showcase(box, size=SIZE, stage="none").camera)
        frame, truth = checks.render(scene, SIZE, method), reference.render(scene, SIZE)
        found = checks.compared(frame, truth, scene)
        checks.error(f"two bodies share a face, {type(method).__name__}", found.p999 / scene.diagonal)
    checks.holds("no pixel marked", frame.valid.all())


def _slivers(checks: Checks) -> None:
    ball = Sphere().tessellate(32)
    a, b, c = ball.faces[100]
    count = len(ball.vertices)
    middle = 0.5 * (ball.vertices[a] + ball.vertices[b])
    vertices = np.concatenate([ball.vertices, [middle, (50.0, 50.0, 50.0)]])
    # A vertex on an edge, with a needle of no area that closes the gap; and one that no face uses.
    faces = np.concatenate(
        [np.delete(ball.faces, 100, axis=0), [(a, count, c), (count, b, c), (a, b, count), (a, a, b)]]
    )
    sliver = Mesh(vertices, faces, name="slivers")
    checks.picture("zero-area faces and an unused vertex", showcase(sliver, GLASS, SIZE, stage="none"))
    needle = Mesh(ball.vertices * (1.0, 1.0, 1e-4), ball.faces, name="needles")
    camera = Camera.look_at((0.0, 3.0, 2.0), (0, 0, 0), fov_y=45)
    checks.picture("needles", Scene([Object(needle, GLASS)], camera))
    broken = ball.vertices.copy()
    broken[5, 1] = np.nan
    checks.refused("NaN", lambda: Object(Mesh(broken, ball.faces), GLASS), "finite")
    checks.refused("an empty mesh", lambda: Mesh(np.zeros((0, 3)), np.zeros((0, 3), int)), "no faces")


def _overlaps(checks: Checks) -> None:
    one, other = Sphere().tessellate(48), Sphere((0.8, 0.2, 0.3)).tessellate(48)
    policies: tuple[Overlap, ...] = ("add", "union", "priority")
    for policy in policies:
        objects = [Object(one, GLASS, priority=1), Object(other, RED)]
        scene = Scene(objects, framing(objects, SIZE), overlap=policy)
        frame, truth = checks.picture(policy, scene), reference.render(scene, SIZE)
        depth = checks.compared(frame, truth, scene, "transmittance")
        checks.error(f"{policy}, transmittance", depth.p999)
    checks.picture("nested shells", showcase(nested_shells(3, 48), GLASS, SIZE, stage="none"))
    crossing = joined([(ball.vertices, ball.faces) for ball in (one, other)], "crossing")
    checks.picture("a mesh that passes through itself", showcase(crossing, GLASS, SIZE, stage="none"))


def _layers(checks: Checks) -> None:
    camera = Camera.orthographic((0, 0, 2), (0, 0, 0), height=1.0)
    scene = Scene([Object(plates(100), GLASS)], camera)
    size = (16, 16)
    for method in (SignedDepth(), FragmentLists(), DepthPeeling(max_layers=MAX_LAYERS)):
        frame = checks.render(scene, size, method)
        checks.error(type(method).__name__, np.abs(frame.thickness - 0.5).max() / scene.diagonal)
        checks.holds("no pixel marked", frame.valid.all())
    short = checks.render(scene, size, KBuffer(k=8))
    checks.holds("k = 8 marks all pixels", not short.valid.any())
    left_out = 0 if short.truncated is None else int(short.truncated.max())
    checks.holds(f"and counts {left_out} surfaces left out", left_out == 92)


def _transforms(checks: Checks) -> None:
    mesh = Torus().tessellate(64)
    turn = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    for name, scale in (("rotated, 1 : 3 : 0.2", (1, 3, 0.2)), ("mirrored", (1, 1, -1)), ("both", (-2, 0.5, 1))):
        matrix = np.eye(4)
        matrix[:3, :3] = turn @ np.diag(scale)
        body = Object(mesh, GLASS, matrix)
        checks.picture(name, Scene([body], framing([body], SIZE)))


def _marks(checks: Checks, mesh: Mesh, camera: Camera, policies: tuple[Overlap, ...]) -> None:
    """No pixel is valid that the reference marks; where surfaces are in order, no other is marked."""
    for policy in policies:
        scene = Scene([Object(mesh, GLASS)], camera, overlap=policy)
        truth = reference.render(scene, SIZE)
        inside = interior(reference.hit_counts(scene, SIZE))
        defective = ~truth.valid & truth.coverage & inside
        # A sum is refused where order decides.
        methods = (None, FragmentLists(), DepthPeeling(), KBuffer(), *((SignedDepth(),) if policy == "add" else ()))
        for method in methods:
            frame = checks.render(scene, SIZE, method)
            name = "planned" if method is None else type(method).__name__
            what = f"{policy}, {name}: defective pixels not marked, of {int(defective.sum())}"
            checks.error(what, (defective & frame.valid).sum())
            if method is None or method.ordered:
                checks.holds("none too many", not (truth.valid & inside & ~frame.valid).any())


def _lobe(checks: Checks) -> None:
    checks.holds("the lobe is told", bow_tie().diagnosis.inside_out)
    camera = Camera.look_at((1.5, 1.0, 3.5), (0, 0, 0), fov_y=45)
    _marks(checks, bow_tie(), camera, ("add", "union"))


def _window(checks: Checks) -> None:
    for mesh in (backward_window(), inside_out_slab_beside_an_open_box()):
        camera = Camera.look_at((0.2, 0.3, 2.0), (0.2, 0, 0), fov_y=60)
        _marks(checks, mesh, camera, ("add",))


CASES = (
    Hard(
        "H12",
        "open mesh: a hole, a missing face",
        "marked: no pixel whose ray goes through the hole is called valid",
        _holes,
        0.0,
        "pixels",
    ),
    Hard("H13", "inverted winding: whole, one face", f"whole: {EXACTLY}; one face: its pixels are marked", _inverted),
    Hard(
        "H14",
        "repeated faces, coplanar walls, bodies that share a face",
        f"repeated faces are told; bodies that share a face: {EXACTLY}",
        _doubled,
    ),
    Hard(
        "H15",
        "zero-area, needle and NaN triangles; empty mesh; unused vertices",
        f"{EXACTLY}; NaN and no faces are a clear error",
        _slivers,
    ),
    Hard("H16", "self-intersection, nested shells, overlaps in all three policies", EXACTLY, _overlaps),
    Hard("H17", "100 layers", f"{EXACTLY}; methods with fewer mark the pixels and count what they leave out", _layers),
    Hard("H18", "rotated, non-uniform and mirrored transforms", EXACTLY, _transforms),
    Hard(
        "H25",
        "a closed body one lobe of which is inside out",
        "marked by every method: no pixel of the lobe is valid",
        _lobe,
        0.0,
        "pixels",
    ),
    Hard(
        "H26",
        "a thin plate with a window wound backwards, a thin box inside out beside an open one",
        "marked by every method: no pixel of the window or of the box is valid",
        _window,
        0.0,
        "pixels",
    ),
)
