"""Hard cases: inputs that break renderers, each measured against its promise; of numbers, views and meshes.

Those of light that bends, scatters or is thrown into shadows are in `hard_light`.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from translucent import reference
from translucent.bench.drawing import Size
from translucent.bench.experiment import one_line
from translucent.bench.judgement import ROUNDING
from translucent.bench.record import HardCase
from translucent.bench.shapes import (
    backward_window,
    bow_tie,
    inside_out_slab_beside_an_open_box,
    joined,
    nested_shells,
    placed,
    plates,
    surface_of_cells,
)
from translucent.errors import InputError, TranslucentWarning
from translucent.formulas import optics
from translucent.frames.frame import Frame
from translucent.frames.metrics import Errors, Quantity, compare, interior
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Sphere, Torus
from translucent.media.density import DensityGrid
from translucent.media.medium import Medium
from translucent.planning.methods import DepthPeeling, FragmentLists, KBuffer, Method, SignedDepth
from translucent.planning.methods.depth_peeling import MAX_LAYERS
from translucent.planning.passes import NoteKind
from translucent.renderer import Renderer
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import PointLight
from translucent.scene.scene import Object, Overlap, Scene
from translucent.scene.showcase import framing, showcase

#: Size of frames, small so that each case takes a fraction of a second.
SIZE: Size = (96, 96)

EXACTLY = "exact: 99.9 % of the pixels within a hundred roundings of float32"

#: Relative rounding error of a formula of a few steps in float64.
FORMULA = 1e-14

GLASS = Medium(absorption=(0.5, 1.0, 2.0))
RED = Medium(absorption=(2.0, 0.2, 0.2))


@dataclass
class Checks:
    """Findings of one hard case, gathered while it runs.

    Attributes
    ----------
    renderer : Renderer
    limit : float
        Of all errors.
    worst : float or None
        Largest of all errors so far.
    held, failed : list of str
        Findings in words.
    """

    renderer: Renderer
    limit: float
    worst: float | None = None
    held: list[str] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)

    def error(self, what: str, value: float) -> None:
        """Record an error, which must stay within the limit; NaN does not."""
        value = abs(float(value))
        self.worst = value if self.worst is None else float(np.maximum(self.worst, value))
        self.holds(f"{what} {value:.1e}", value <= self.limit)

    def holds(self, what: str, held: bool | np.bool_) -> None:
        """Record a condition that must be true."""
        (self.held if held else self.failed).append(what)

    def refused(self, what: str, make: Callable[[], object], word: str) -> None:
        """Record that a call must raise an `InputError` whose message has this word."""
        try:
            made = make()
        except InputError as error:
            self.holds(f"{what} refused", word in str(error))
        else:
            self.holds(f"{what} gave {type(made).__name__}, no error", held=False)

    def picture(self, what: str, scene: Scene) -> tuple[Frame, Frame]:
        """Record the error in thickness, its 99.9th percentile over the diagonal; return the frame and the truth."""
        frame, truth = self.both(scene)
        self.error(what, self.compared(frame, truth, scene).p999 / scene.diagonal)
        inside = interior(reference.hit_counts(scene, SIZE))
        self.holds(f"{what}: no pixel marked", frame.valid[inside].all())
        return frame, truth

    def compared(self, frame: Frame, truth: Frame, scene: Scene, quantity: Quantity = "thickness") -> Errors:
        """Errors of a frame away from silhouettes."""
        return compare(frame, truth, quantity, mask=interior(reference.hit_counts(scene, frame.size)))

    def render(self, scene: Scene, size: Size = SIZE, method: Method | None = None) -> Frame:
        """Render a frame."""
        return self.renderer.render(scene, size, method)

    def both(self, scene: Scene, size: Size = SIZE, method: Method | None = None, **more: float) -> tuple[Frame, Frame]:
        """Render a frame, and the truth with more arguments of the reference."""
        return self.render(scene, size, method), reference.render(scene, size, **more)  # type: ignore[arg-type]


@dataclass(frozen=True)
class HardCheck:
    """One hard case: identifier, title and promise as in its record, the check that fills in `Checks`, and the limit of
    all errors that it records, with its unit.
    """

    name: str
    title: str
    promise: str
    check: Callable[[Checks], None]
    limit: float
    unit: str

    def measure(self, renderer: Renderer) -> HardCase:
        """Measure the case; one that raises has failed."""
        checks = Checks(renderer, self.limit)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", TranslucentWarning)
                self.check(checks)
        except Exception as error:  # noqa: BLE001 - a hard case that breaks something is a finding, and the others go on
            checks.failed.append(one_line(error))
        passed = not checks.failed
        result = "; ".join(checks.held) if passed else f"wrong: {'; '.join(checks.failed)}"
        # JSON has no word for infinity: an error that is not finite is in the words alone.
        worst = checks.worst if checks.worst is not None and np.isfinite(checks.worst) else None
        limit, unit = (self.limit, self.unit) if checks.worst is not None else (None, "")
        return HardCase(self.name, self.title, self.promise, result, passed, worst, limit, unit)


#: All hard cases that modules have defined so far.
DEFINED: list[HardCheck] = []


def hard(
    name: str, title: str, promise: str, limit: float = ROUNDING, unit: str = "of the diagonal"
) -> Callable[[Callable[[Checks], None]], Callable[[Checks], None]]:
    """Decorate a function that checks a hard case."""

    def define(check: Callable[[Checks], None]) -> Callable[[Checks], None]:
        DEFINED.append(HardCheck(name, title, promise, check, limit, unit))
        return check

    return define


def _scene(mesh: Mesh, medium: Medium = GLASS, size: Size = SIZE) -> Scene:
    return showcase(mesh, medium, size, stage="none")


@hard(
    "H01",
    "grazing n.v, 0 and below",
    "bounded: a sheet's path is t / max(0.001, n.v), from any side, to float64's rounding",
    FORMULA,
    unit="relative",
)
def _grazing(checks: Checks) -> None:
    cosines = np.array([1.0, 1e-3, 1e-6, 0.0, -1e-6, -0.5])
    path = optics.thin_layer_thickness(1e-3, cosines)
    checks.error("t / max(0.001, n.v)", np.max(np.abs(path / (1e-3 / np.maximum(cosines, 1e-3)) - 1)))
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], dtype=np.float64)
    square = Mesh(corners, np.array([(0, 1, 2), (0, 2, 3)], dtype=np.int32), name="square")
    sheet = Object(square, Medium(absorption=(1, 1, 1)), sheet_thickness=1e-3)
    for height in (1e-2, 0.0, -1e-2):
        camera = Camera.look_at((0, -4, height), (0, 0, 0), up=(0, 0, 1), fov_y=40)
        frame = checks.render(Scene([sheet], camera))
        finite = np.isfinite(frame.radiance).all() and np.isfinite(frame.thickness).all()
        checks.holds(f"sheet seen from {height:g} m above its plane: finite, at most 1000 t", finite)
        checks.holds("and within its bound", frame.thickness.max() <= 1.0 + 1e-4)


@hard(
    "H02",
    "transmitted color 0, 1, above 1, NaN",
    "1 absorbs nothing; all others that no medium can have are a clear error",
    1e-13,
    unit="relative",
)
def _channels(checks: Checks) -> None:
    kept = Medium.from_color((1.0, 1e-30, 0.5), 0.1)
    checks.error("1, 1e-30 and 0.5 come back", np.max(np.abs(kept.transmittance(0.1) / (1.0, 1e-30, 0.5) - 1)))
    checks.holds("t_c = 1 absorbs exactly nothing", kept.extinction[0] == 0)
    for value in (0.0, 1.0 + 1e-9, -0.1, np.nan):
        checks.refused(f"t_c = {value:.3g}", partial(Medium.from_color, (0.5, value, 0.5), 1.0), "color")


@hard(
    "H03",
    "distance 0, negative, 1e-30, 1e30, infinite",
    "infinity is clear, 1e-30 and 1e30 exact; all that give no finite extinction are a clear error",
    FORMULA,
    unit="absolute",
)
def _distances(checks: Checks) -> None:
    for distance in (0.0, -1.0, np.nan):
        what = f"distance {distance:g}"
        checks.refused(what, partial(Medium.from_color, (0.5, 0.5, 0.5), distance), "distance")
    checks.refused("1e-320 m", lambda: Medium.from_color((0.5, 0.5, 0.5), 1e-320), "overflows")
    for distance in (1e-30, 1e30):
        medium = Medium.from_color((0.5, 0.5, 0.5), distance)
        checks.error(f"{distance:g} m comes back", np.max(np.abs(medium.transmittance(distance) - 0.5)))
    checks.holds("infinity leaves light as it is", (Medium.from_color((0.5,) * 3, np.inf).extinction == 0).all())


@hard(
    "H04",
    "optical depth 1e-12 and 1e4",
    "no cancellation (expm1), and underflow to exactly 0; no NaN",
    FORMULA,
    unit="relative",
)
def _depths(checks: Checks) -> None:
    tau = 1e-12
    checks.error("opacity at tau = 1e-12", float(optics.opacity(tau)) / (tau - tau**2 / 2) - 1)
    checks.holds("T at 1e4 is 0", optics.transmittance(1e4) == 0)
    ball = Sphere().tessellate(32)
    for extinction, what in ((5e3, "1e4"), (1e30, "1e30")):
        frame = checks.render(_scene(ball, Medium(absorption=(extinction,) * 3)))
        middle = frame.transmittance[SIZE[1] // 2, SIZE[0] // 2]
        checks.holds(f"a body of depth {what} is black, nothing is NaN", (middle == 0).all())
        checks.holds("and finite", np.isfinite(frame.radiance).all() and np.isfinite(frame.optical_depth).all())
    clear = Medium(absorption=(1e-30,) * 3)
    thin = checks.render(_scene(ball, dataclasses.replace(clear, emission=(1e-3,) * 3)))
    expected = thin.thickness.astype(np.float64) * 1e-3
    emitted = thin.radiance[..., 0] - checks.render(_scene(ball, clear)).radiance[..., 0]
    # The two pictures differ by the emission, each rounded to float32 near 1.
    checks.holds("emission without extinction is q d", np.abs(emitted - expected).max() <= 4 * np.finfo(np.float32).eps)


@hard(
    "H23",
    "anisotropy near 1 and -1, light inside and on the surface",
    "|g| = 1 is a clear error; all else finite, with a median error of 1 % (16 points against a near light)",
    1e-2,
    unit="of the RMS radiance",
)
def _phases(checks: Checks) -> None:
    for g in (1.0, -1.0, np.nan):
        checks.refused(f"g = {g:g}", partial(Medium, scattering=(1,) * 3, anisotropy=g), "anisotropy")
    ball = Sphere().tessellate(24)
    eye = Camera.look_at((0, 0.3, 3.2), (0, 0, 0), fov_y=45)
    for g, where, position in (
        (0.99, "behind", (0.0, 0.4, -3.0)),
        (-0.99, "beside", (2.5, 0.5, 1.0)),
        (0.2, "inside", (0.2, 0.3, 0.1)),
        (0.2, "on the surface", tuple(ball.vertices[200])),
    ):
        milky = Medium(absorption=(0.1,) * 3, scattering=(1.0,) * 3, anisotropy=g)
        scene = Scene([Object(ball, milky)], eye, [PointLight(position, (5.0,) * 3)], Environment.constant((0, 0, 0)))
        frame, truth = checks.both(scene, (20, 20), FragmentLists(light_points=16), tolerance=1e-3)
        checks.holds(f"light {where}, g = {g:g}: all finite", np.isfinite(frame.radiance).all())
        both = frame.coverage & truth.coverage & frame.valid & truth.valid
        right = truth.radiance[both]
        error = np.abs(frame.radiance[both] - right)
        checks.error(f"light {where}, g = {g:g}: median", np.median(error) / np.sqrt(np.mean(right**2)))


@hard(
    "H24",
    "density grid with zeros, NaN, one voxel",
    "zeros are clear, one voxel of 1 is a homogeneous body, NaN is a clear error",
    1e-12,
    unit="transmittance",
)
def _densities(checks: Checks) -> None:
    checks.refused("NaN", lambda: DensityGrid([[[np.nan]]]), "densit")
    checks.refused("a negative density", lambda: DensityGrid([[[-1.0]]]), "densit")
    ball = Sphere().tessellate(32)
    medium = Medium(absorption=(1.0, 0.5, 0.2))
    plain = _scene(ball, medium)
    truth = reference.render(plain, SIZE)

    def filled(values: object) -> Scene:
        return dataclasses.replace(plain, objects=[Object(ball, medium, density=DensityGrid(values))])  # type: ignore[arg-type]

    one = reference.render(filled([[[1.0]]]), SIZE)
    checks.error("one voxel of 1 is no grid", np.abs(one.transmittance - truth.transmittance).max())
    empty = reference.render(filled(np.zeros((3, 3, 3))), SIZE)
    checks.error("a grid of zeros is clear", np.abs(empty.transmittance - 1.0).max())
    mixed = np.zeros((4, 4, 4))
    mixed[:2] = 1.0
    half = reference.render(filled(mixed), SIZE)
    checks.holds("zeros beside ones are finite", np.isfinite(half.radiance).all() and half.valid.all())


@hard("H05", "eye inside one body, inside nested ones, on a surface", EXACTLY)
def _eyes(checks: Checks) -> None:
    ball, core = Sphere().tessellate(48), Sphere(radius=0.5).tessellate(48)
    one, nested = [Object(ball, GLASS)], [Object(ball, GLASS), Object(core, Medium(absorption=(2, 1, 1)))]
    checks.picture("inside one", Scene(one, Camera.look_at((0.2, 0.1, 0.6), (1, 0.3, 0), fov_y=70)))
    checks.picture("inside two", Scene(nested, Camera.look_at((0.1, 0.1, 0.2), (1, 0.3, 0), fov_y=70)))
    eye = ball.vertices[ball.faces[900]].mean(axis=0)
    inwards = Scene(one, Camera.look_at(eye, (0, 0, 0), fov_y=60))
    frame, truth = checks.both(inwards)
    checks.holds("on a surface, inwards: no pixel marked", frame.valid.all())
    checks.error("on a surface", np.median(np.abs(frame.thickness - truth.thickness)) / inwards.diagonal)


@hard("H06", "near plane cuts the body", f"{EXACTLY}; there is none")
def _near_plane(checks: Checks) -> None:
    """An eye just before a wall: any near plane would cut it."""
    box = Object(Box((-1, -1, -1), (1, 1, 1)).tessellate(), GLASS)
    for gap in (1e-2, 1e-4, 1e-6):
        scene = Scene([box], Camera.look_at((0.1, 0.2, 1 + gap), (0, 0, 0), fov_y=80))
        checks.picture(f"{gap:g} m before the wall", scene)


@hard("H07", "body 10,000 diameters away", EXACTLY)
def _far(checks: Checks) -> None:
    mesh = Torus().tessellate(64)
    for diameters in (1e2, 1e4):
        away = np.array((0.6, 0.5, 0.8)) / np.linalg.norm((0.6, 0.5, 0.8))
        fov = float(2 * np.degrees(np.arctan(0.5 / diameters)))
        camera = Camera.look_at(away * diameters * mesh.diagonal, (0, 0, 0), fov_y=fov)
        checks.picture(f"{diameters:g} diameters", Scene([Object(mesh, GLASS)], camera))


@hard(
    "H08",
    "slab of 1e-4 relative thickness",
    "exact: distances up to half of its width are rounded, 10,000 times its thickness",
    1e4 * 16 * float(np.finfo(np.float32).eps),
    unit="of its thickness",
)
def _slab(checks: Checks) -> None:
    thin = 1e-4
    scene = _scene(Box.slab(thickness=thin).tessellate())
    frame, truth = checks.both(scene)
    checks.error("of its own thickness", checks.compared(frame, truth, scene).p999 / thin)
    checks.holds("no pixel marked", frame.valid.all())


@hard("H09", "scene 1e6 m from the origin", EXACTLY)
def _elsewhere(checks: Checks) -> None:
    mesh = Torus().tessellate(64)
    for offset in ((1e6, 0, 0), (-1e6, 1e6, 1e6)):
        body = placed(mesh, GLASS, offset)
        checks.picture(f"at {offset} m", Scene([body], framing([body], SIZE)))


@hard("H10", "units of 1e-6 m and 1e6 m", EXACTLY)
def _units(checks: Checks) -> None:
    mesh = Torus().tessellate(64)
    for unit in (1e-6, 1e6):
        medium = Medium(absorption=np.array((0.5, 1.0, 2.0)) / unit)
        scaled = Mesh(mesh.vertices * unit, mesh.faces, name="torus")
        checks.picture(f"{unit:g} m", _scene(scaled, medium))


@hard("H11", "90 and 150 degrees of view, corner pixels", f"{EXACTLY}, relative to each path", unit="relative")
def _angles(checks: Checks) -> None:
    """Wall so wide that it fills the picture, corner pixels included."""
    wall = Box((-60, -60, -1.5), (60, 60, -1)).tessellate()
    for fov in (90.0, 150.0):
        scene = Scene([Object(wall, GLASS)], Camera.look_at((0, 0, 0), (0, 0, -1), fov_y=fov))
        frame, truth = checks.both(scene)
        relative = np.abs(frame.thickness / truth.thickness - 1)
        checks.error(f"{fov:g} degrees", relative.max())
        checks.holds("corners are longer than the middle", frame.thickness[0, 0] > frame.thickness[48, 48])


@hard("H19", "opaque object in front, inside, behind, coincident", EXACTLY)
def _opaque(checks: Checks) -> None:
    ball, wall = Sphere().tessellate(48), Box((-0.5, -0.5, -0.05), (0.5, 0.5, 0.05)).tessellate()
    camera = Camera.look_at((0.3, 0.4, 4), (0, 0, 0), fov_y=40)
    for name, z in (("in front", 1.5), ("inside", 0.1), ("behind", -1.6)):
        checks.picture(name, Scene([Object(ball, GLASS), placed(wall, None, (0, 0, z))], camera))
    both = Scene([Object(ball, GLASS), Object(ball, None)], camera)
    frame = checks.render(both)
    checks.error("coincident: nothing before it", frame.thickness.max() / both.diagonal)


@hard("H20", "frames of 1 x 1, 1 x N, 8192 wide", EXACTLY)
def _sizes(checks: Checks) -> None:
    """Sizes of pictures that a body fills: few pixels suffer from the grid of 1/256 pixel that rasterizers draw on."""
    wedge = Box((-6000, -1, -1), (6000, 1, 1)).tessellate()
    camera = Camera.orthographic((0, 1, 5), (0, 0.05, 0), height=1.0)
    scene = Scene([Object(wedge, GLASS)], camera)
    for size in ((1, 1), (1, 33), (33, 1), (8192, 1)):
        frame, truth = checks.both(scene, size)
        checks.holds(f"{size[0]} x {size[1]}: its shape, no pixel marked", frame.thickness.shape == size[::-1])
        checks.holds("no pixel marked", frame.valid.all())
        checks.error("error", np.abs(frame.thickness - truth.thickness).max() / scene.diagonal)


@hard("H21", "vertices on pixel centers, edges along pixel rows", f"{EXACTLY}; every face counts once")
def _on_pixels(checks: Checks) -> None:
    """A box with a grid of vertices on pixel centers, and edges along their rows and columns, in front and behind."""
    count = 16
    camera = Camera.orthographic((0, 0, 5), (0, 0, 0), height=float(count))
    cells = surface_of_cells(np.ones((12, 12, 1), bool))
    mesh = Mesh(cells.vertices * (1, 1, 2) - (5.5, 5.5, 1), cells.faces, name="grid")
    checks.holds("the mesh is closed", mesh.diagnosis.solid)
    scene = Scene([Object(mesh, GLASS)], camera)
    frame = checks.render(scene, (count, count))
    inner = frame.thickness[3:-3, 3:-3]
    checks.error("thickness 2 in every pixel", np.abs(inner - 2).max() / scene.diagonal)
    checks.holds("no pixel counted twice or left out", frame.valid.all())


@hard(
    "H22",
    "two bodies of very different size in one frame",
    "exact: optical depth within a hundred roundings of the large body's",
    2 * 2.0 * 100 * float(np.finfo(np.float32).eps) / 2,
    unit="optical depth",
)
def _two_sizes(checks: Checks) -> None:
    large, small = Sphere().tessellate(64), Sphere(radius=1e-4).tessellate(48)
    objects = [Object(large, GLASS), placed(small, Medium(absorption=(5e3,) * 3), (0, 0, 1.0 + 5e-4))]
    scene = Scene(objects, Camera.look_at((0, 0, 1.0015), (0, 0, 0), fov_y=20))
    frame, truth = checks.both(scene)
    found = checks.compared(frame, truth, scene, "optical_depth")
    checks.error("optical depth behind a ball 10,000 times as small", found.p999)
    checks.holds("no pixel marked", frame.valid.all())


@hard(
    "H12",
    "open mesh: a hole, a missing face",
    "marked: no pixel whose ray goes through the hole is called valid",
    0.0,
    unit="pixels",
)
def _holes(checks: Checks) -> None:
    ball = Sphere().tessellate(48)
    scene = _scene(ball)
    towards = ball.vertices[ball.faces].mean(axis=1) @ (scene.camera.pose[:3, 3] - ball.center)
    facing = np.argsort(-towards)
    for count, what in ((1, "a missing face"), (40, "a hole of 40 faces")):
        torn = Mesh(ball.vertices, np.delete(ball.faces, facing[:count], axis=0), name="torn")
        leaky = Scene([Object(torn, GLASS)], scene.camera)
        frame, truth = checks.both(leaky)
        missed = truth.coverage & ~truth.valid & frame.valid
        checks.holds(f"{what}: marks {int((~frame.valid).sum())} pixels", (~frame.valid).any())
        checks.error(f"{what}: defective pixels not marked, of {int((~truth.valid).sum())}", missed.sum())


@hard("H13", "inverted winding: whole, one face", f"whole: {EXACTLY}; one face: its pixels are marked")
def _inverted(checks: Checks) -> None:
    ball = Sphere().tessellate(48)
    turned = Mesh(ball.vertices, ball.faces[:, ::-1], name="inverted")
    checks.picture("all faces turned: thickness", _scene(turned))
    scene = _scene(ball, size=(192, 192))
    towards = ball.vertices[ball.faces].mean(axis=1) @ (scene.camera.pose[:3, 3] - ball.center)
    faces = ball.faces.copy()
    faces[towards.argmax()] = faces[towards.argmax()][::-1]
    flipped = Scene([Object(Mesh(ball.vertices, faces, name="flipped"), GLASS)], scene.camera)
    frame, truth = checks.both(flipped, (192, 192))
    checks.holds(f"one face turned: {int((~frame.valid).sum())} pixels marked", (~frame.valid).any())
    checks.holds("all defective pixels among them", not (~truth.valid & frame.valid & truth.coverage).any())


@hard(
    "H14",
    "repeated faces, coplanar walls, bodies that share a face",
    f"repeated faces are reported; bodies that share a face: {EXACTLY}",
)
def _doubled(checks: Checks) -> None:
    box = Box((-1, -1, -1), (1, 1, 1)).tessellate()
    twice = Mesh(box.vertices, np.concatenate([box.faces, box.faces]), name="twice")
    checks.holds(f"{twice.diagnosis.duplicate_faces.count} repeated faces found", bool(twice.diagnosis.duplicate_faces))
    doubled = _scene(twice)
    checks.holds("and told by the plan", checks.renderer.plan(doubled).says(NoteKind.DUPLICATED_FACES))
    left, right = Box((-1, -1, -1), (0, 1, 1)).tessellate(), Box((0, -1, -1), (1, 1, 1)).tessellate()
    for method in (SignedDepth(), FragmentLists(), DepthPeeling()):
        scene = Scene([Object(left, GLASS), Object(right, RED)], _scene(box).camera)
        frame, truth = checks.both(scene, method=method)
        found = checks.compared(frame, truth, scene)
        checks.error(f"two bodies share a face, {type(method).__name__}", found.p999 / scene.diagonal)
    checks.holds("no pixel marked", frame.valid.all())


@hard(
    "H15",
    "zero-area, needle and NaN triangles; empty mesh; unused vertices",
    f"{EXACTLY}; NaN and no faces are a clear error",
)
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
    checks.picture("zero-area faces and an unused vertex", _scene(sliver))
    needle = Mesh(ball.vertices * (1.0, 1.0, 1e-4), ball.faces, name="needles")
    camera = Camera.look_at((0.0, 3.0, 2.0), (0, 0, 0), fov_y=45)
    checks.picture("needles", Scene([Object(needle, GLASS)], camera))
    broken = ball.vertices.copy()
    broken[5, 1] = np.nan
    checks.refused("NaN", lambda: Object(Mesh(broken, ball.faces), GLASS), "finite")
    checks.refused("an empty mesh", lambda: Mesh(np.zeros((0, 3)), np.zeros((0, 3), int)), "no faces")


@hard("H16", "self-intersection, nested shells, overlaps in all three policies", EXACTLY)
def _overlaps(checks: Checks) -> None:
    one, other = Sphere().tessellate(48), Sphere((0.8, 0.2, 0.3)).tessellate(48)
    policies: tuple[Overlap, ...] = ("add", "union", "priority")
    for policy in policies:
        objects = [Object(one, GLASS, priority=1), Object(other, RED)]
        scene = Scene(objects, framing(objects, SIZE), overlap=policy)
        frame, truth = checks.picture(policy, scene)
        depth = checks.compared(frame, truth, scene, "transmittance")
        checks.error(f"{policy}, transmittance", depth.p999)
    checks.picture("nested shells", _scene(nested_shells(3, 48)))
    crossing = joined([(ball.vertices, ball.faces) for ball in (one, other)], "crossing")
    checks.picture("a mesh that passes through itself", _scene(crossing))


@hard("H17", "100 layers", f"{EXACTLY}; methods with fewer mark the pixels and count what they leave out")
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


@hard("H18", "rotated, non-uniform and mirrored transforms", EXACTLY)
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


@hard(
    "H25",
    "a closed body with one lobe inside out",
    "marked by every method: no pixel of the lobe is valid",
    0.0,
    unit="pixels",
)
def _lobe(checks: Checks) -> None:
    checks.holds("the lobe is reported", bow_tie().diagnosis.inside_out)
    camera = Camera.look_at((1.5, 1.0, 3.5), (0, 0, 0), fov_y=45)
    _marks(checks, bow_tie(), camera, ("add", "union"))


@hard(
    "H26",
    "a thin plate with a window wound backwards, a thin box inside out beside an open one",
    "marked by every method: no pixel of the window or of the box is valid",
    0.0,
    unit="pixels",
)
def _window(checks: Checks) -> None:
    for mesh in (backward_window(), inside_out_slab_beside_an_open_box()):
        camera = Camera.look_at((0.2, 0.3, 2.0), (0.2, 0, 0), fov_y=60)
        _marks(checks, mesh, camera, ("add",))
