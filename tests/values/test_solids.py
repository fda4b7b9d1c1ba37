"""Analytic solids: chords against sampling, formulas and rational arithmetic; meshes against volume and sagitta."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.solids import (
    Box,
    Ellipsoid,
    Frustum,
    Solid,
    Sphere,
    SphericalShell,
    Torus,
    TwoSpheres,
    revolve,
)
from translucent.errors import InputError

Array = npt.NDArray[np.float64]
Inside = Callable[[Array], npt.NDArray[np.bool_]]

EPS = float(np.finfo(np.float64).eps)


def _in_ball(center: tuple[float, float, float], radius: float) -> Inside:
    return lambda p: np.linalg.norm(p - np.array(center), axis=-1) < radius


def _frustum(bottom: float, top: float, height: float) -> Inside:
    def inside(p: Array) -> npt.NDArray[np.bool_]:
        share = p[..., 2] / height + 0.5
        return (share > 0) & (share < 1) & (np.hypot(p[..., 0], p[..., 1]) < bottom + share * (top - bottom))

    return inside


SHELL, PAIR = (
    SphericalShell(1.2, 0.7, (0.1, 0.2, 0.3)),
    TwoSpheres(Sphere((-1.0, 0, 0), 0.8), Sphere((0.7, 0.2, 0), 0.6)),
)
SOLIDS: dict[str, tuple[Solid, Inside]] = {
    "sphere": (Sphere((0.3, -0.2, 0.1), 0.9), _in_ball((0.3, -0.2, 0.1), 0.9)),
    "ellipsoid": (
        Ellipsoid((0.1, 0.0, -0.2), (1.5, 0.6, 0.3)),
        lambda p: np.linalg.norm((p - np.array([0.1, 0.0, -0.2])) / np.array([1.5, 0.6, 0.3]), axis=-1) < 1,
    ),
    "box": (Box((-0.5, -0.7, -0.2), (0.9, 0.4, 0.6)), lambda p: _within(p, (-0.5, -0.7, -0.2), (0.9, 0.4, 0.6))),
    "slab": (Box.slab((2.0, 1.5), 0.1), lambda p: _within(p, (-1.0, -0.75, -0.05), (1.0, 0.75, 0.05))),
    "torus": (Torus(1.0, 0.3), lambda p: np.hypot(np.hypot(p[..., 0], p[..., 1]) - 1.0, p[..., 2]) < 0.3),
    "fat torus": (Torus(1.0, 0.95), lambda p: np.hypot(np.hypot(p[..., 0], p[..., 1]) - 1.0, p[..., 2]) < 0.95),
    "shell": (SHELL, lambda p: _in_ball(SHELL.center, 1.2)(p) & ~_in_ball(SHELL.center, 0.7)(p)),
    "pair": (PAIR, lambda p: _in_ball((-1.0, 0, 0), 0.8)(p) | _in_ball((0.7, 0.2, 0), 0.6)(p)),
    "cone": (Frustum(0.8, 0.0, 1.4), _frustum(0.8, 0.0, 1.4)),
    "inverted cone": (Frustum(0.0, 0.8, 1.4), _frustum(0.0, 0.8, 1.4)),
    "frustum": (Frustum(0.9, 0.3, 1.0), _frustum(0.9, 0.3, 1.0)),
    "cylinder": (Frustum(0.6, 0.6, 1.5), _frustum(0.6, 0.6, 1.5)),
}
each_solid = pytest.mark.parametrize("name", SOLIDS)


@pytest.fixture(autouse=True)
def _strict_floats():
    with np.errstate(all="raise"):
        yield


def _within(p: Array, low: tuple[float, ...], high: tuple[float, ...]) -> npt.NDArray[np.bool_]:
    return ((p > np.array(low)) & (p < np.array(high))).all(axis=-1)


def _unit(v: npt.ArrayLike) -> Array:
    a = np.asarray(v, dtype=np.float64)
    return a / np.linalg.norm(a, axis=-1, keepdims=True)


def _rays(count: int, seed: int, distance: float = 3.0) -> tuple[Array, Array]:
    """Rays towards points near the solid, a third of them along an axis or a plane of axes."""
    rng = np.random.default_rng(seed)
    target = rng.uniform(-1, 1, (count, 3))
    direction = rng.normal(size=(count, 3))
    direction[::6, :2] = 0.0
    direction[1::6, 2] = 0.0
    direction = _unit(direction)
    return target - distance * direction, direction


def _sampled_length(inside: Inside, origins: Array, directions: Array, steps: Array) -> Array:
    """Length within, of rays whose last step is outside: each change between two steps is halved down to rounding."""
    state = np.array([inside(o + steps[:, None] * d) for o, d in zip(origins, directions, strict=True)])
    assert not state[:, -1].any()
    ray, step = np.nonzero(state[:, 1:] != state[:, :-1])
    low, high, entered = steps[step], steps[step + 1], state[ray, step + 1]
    for _ in range(40):
        middle = 0.5 * (low + high)
        beyond = inside(origins[ray] + middle[:, None] * directions[ray]) == entered
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    return np.bincount(ray, np.where(entered, -low, low), len(origins)) - np.where(state[:, 0], steps[0], 0.0)


@each_solid
@pytest.mark.parametrize("distance", [3.0, 0.0])
def test_chord_is_what_sampling_finds(name: str, distance: float) -> None:
    solid, inside = SOLIDS[name]
    origins, directions = _rays(150, seed=1, distance=distance)
    steps = np.linspace(0.0, 8.0, 10_001)
    off = np.abs(solid.chord(origins, directions) - _sampled_length(inside, origins, directions, steps))
    # Where no step falls into an interval or a gap, it is missed: at most two, each shorter than a step.
    assert off.max() <= 2 * steps[1]
    # Ends are known to rounding, which near a tangent moves them by its square root.
    assert np.quantile(off, 0.95) <= 1e-8
    assert (solid.chord(origins, directions) > 0).sum() > 20


@each_solid
def test_chord_far_away_keeps_the_digits_of_its_rays(name: str) -> None:
    solid, _ = SOLIDS[name]
    near, direction = _rays(2000, seed=2, distance=4.0)
    far = near - 2e4 * direction
    # The far origin is rounded: give both the same line, from the far one.
    near = far + 2e4 * direction
    chord, exact = solid.chord(far, direction), solid.chord(near, direction)
    # Rounding moves a line by EPS * 2e4, and a chord of a round body by the square root of that at a tangent.
    moved = 4 * EPS * 2e4
    assert np.median(np.abs(chord - exact)) < 1e-11
    clear = exact > 0.3
    assert np.abs(chord - exact)[clear].max() < 100 * moved


@each_solid
def test_rays_away_and_missing_are_zero(name: str) -> None:
    solid, _ = SOLIDS[name]
    origins, directions = _rays(200, seed=3, distance=-5.0)
    assert (solid.chord(origins, directions) == 0).all()
    assert (solid.chord(np.array([5.0, 5.0, 5.0]), np.eye(3)) == 0).all()


@each_solid
def test_a_line_is_its_two_halves(name: str) -> None:
    solid, _ = SOLIDS[name]
    points, directions = _rays(500, seed=4, distance=0.0)
    whole = solid.chord(points - 5 * directions, directions)
    halves = solid.chord(points, directions) + solid.chord(points, -directions)
    clear = whole > 0.1
    assert np.abs(whole - halves)[clear].max() < 1e-12
    assert np.abs(whole - halves).max() < 1e-6


@each_solid
def test_shapes_broadcast_and_arguments_stay(name: str) -> None:
    solid, _ = SOLIDS[name]
    origins, directions = _rays(12, seed=5)
    before = origins.copy(), directions.copy()
    whole = solid.chord(origins.reshape(3, 4, 3), directions.reshape(3, 4, 3))
    assert whole.shape == (3, 4)
    assert whole.dtype == np.float64
    assert np.array_equal(origins, before[0])
    assert np.array_equal(directions, before[1])
    one = solid.chord(origins[5], directions[5])
    assert one.shape == ()
    assert one == whole[1, 1]
    assert solid.chord(origins[0], directions).shape == (12,)
    assert solid.chord(np.empty((0, 3)), np.empty((0, 3))).shape == (0,)


@each_solid
def test_mesh_is_a_clean_solid(name: str) -> None:
    solid, _ = SOLIDS[name]
    diagnosis = solid.tessellate().diagnosis
    assert diagnosis.solid
    assert diagnosis.problems == ()
    assert diagnosis.volume > 0
    assert diagnosis.components == (2 if name in ("shell", "pair") else 1)
    assert diagnosis.convex == (name not in ("shell", "pair", "torus", "fat torus"))


@each_solid
def test_mesh_volume_converges_at_second_order(name: str) -> None:
    solid, _ = SOLIDS[name]
    errors = np.array([abs(solid.tessellate(n).volume / solid.volume - 1) for n in (24, 48, 96)])
    if name in ("box", "slab"):
        assert errors.max() < 8 * EPS
    else:
        order = np.log2(errors[:-1] / errors[1:])
        assert order == pytest.approx([2.0, 2.0], abs=0.05)


def _distance(name: str, points: Array) -> Array:
    """Distance to the surface, where that is simple."""
    if name == "sphere":
        return np.abs(np.linalg.norm(points - np.array([0.3, -0.2, 0.1]), axis=1) - 0.9)
    if name == "torus":
        return np.abs(np.hypot(np.hypot(points[:, 0], points[:, 1]) - 1.0, points[:, 2]) - 0.3)
    assert name == "cylinder"
    across = 0.6 - np.hypot(points[:, 0], points[:, 1])
    return np.abs(np.minimum(across, 0.75 - np.abs(points[:, 2])))


@pytest.mark.parametrize("segments", [16, 64])
@pytest.mark.parametrize("name", ["sphere", "torus", "cylinder"])
def test_sagitta_bounds_the_distance_closely(name: str, segments: int) -> None:
    solid, _ = SOLIDS[name]
    mesh = solid.tessellate(segments)
    corners = mesh.vertices[mesh.faces]
    weights = np.random.default_rng(6).dirichlet(np.ones(3), size=40)
    weights = np.concatenate([weights, np.full((1, 3), 1 / 3), 0.5 * (1 - np.eye(3))])
    points = np.einsum("kj,fjx->fkx", weights, corners).reshape(-1, 3)
    largest = _distance(name, points).max()
    assert 0.3 * solid.sagitta(segments) < largest <= solid.sagitta(segments) * (1 + 1e-9) + 4 * EPS


@each_solid
def test_vertices_lie_on_the_surface(name: str) -> None:
    solid, inside = SOLIDS[name]
    mesh = solid.tessellate()
    low, high = mesh.bounds
    # A step along the normal in- and outwards crosses the surface.
    normals = mesh.vertex_normals * 1e-6 * np.linalg.norm(high - low)
    outside, within = inside(mesh.vertices + normals), inside(mesh.vertices - normals)
    assert not outside.any()
    assert within.all()


def test_sphere_tangent_and_center() -> None:
    sphere = Sphere((0, 0, 0), 1.0)
    assert sphere.chord([1.0, 0.0, -5.0], [0, 0, 1]) == 0.0
    assert sphere.chord([0.0, 0.0, -5.0], [0, 0, 1]) == 2.0
    assert sphere.chord([0.0, 0.0, 0.0], _unit([1, 2, 3])) == pytest.approx(1.0, abs=2 * EPS)
    assert sphere.chord([0.0, 0.0, 0.5], [0, 0, 1]) == 0.5
    # Just within a tangent: 2 sqrt(2 h - h^2) with h a power of two.
    h = 2.0**-40
    assert sphere.chord([1.0 - h, 0.0, -5.0], [0, 0, 1]) == pytest.approx(2 * np.sqrt(2 * h - h * h), rel=4 * EPS)


def test_sphere_at_1e4_diameters() -> None:
    sphere = Sphere((0, 0, 0), 0.5)
    b = np.linspace(0, 0.49, 50)
    origins = np.stack([b, np.zeros(50), np.full(50, -1e4)], axis=1)
    assert np.abs(sphere.chord(origins, [0.0, 0.0, 1.0]) - 2 * np.sqrt(0.25 - b * b)).max() < 1e-15


def test_thin_ellipsoid_of_relative_thickness_1e_4() -> None:
    solid = Ellipsoid((0, 0, 0), (1.0, 1.0, 1e-4))
    assert solid.chord([0.6, 0.0, -1e4], [0, 0, 1]) == pytest.approx(2e-4 * 0.8, rel=1e-14)
    assert solid.chord([-1e4, 0.0, 0.6e-4], [1, 0, 0]) == pytest.approx(1.6, rel=1e-14)


def test_box_parallel_rays_faces_and_slab() -> None:
    box = Box((0, 0, 0), (1, 2, 3))
    assert box.chord([0.5, 0.5, -1e6], [0, 0, 1]) == 3.0
    assert box.chord([1.5, 0.5, -1.0], [0, 0, 1]) == 0.0
    assert box.chord([1.0, 0.5, -1.0], [0, 0, 1]) == 3.0  # within a face: a closed set
    assert box.chord([0.5, 0.5, 1.0], [0, 0, -1]) == 1.0
    assert box.chord([-1.0, -1.0, 0.5], _unit([1, 1, 0])) == pytest.approx(np.sqrt(2), rel=4 * EPS)
    assert box.chord([-2.0, 0.5, 0.5], [1, 1e-300, 0]) == 1.0
    slab = Box.slab((1.0, 1.0), 1e-4)
    direction = _unit([0.3, 0.2, 1.0])
    assert slab.chord(-1e4 * direction, direction) == pytest.approx(1e-4 / direction[2], rel=1e-12)
    assert slab.volume == pytest.approx(1e-4)


def test_torus_along_its_axis() -> None:
    torus = Torus(1.0, 0.25)
    rho = np.linspace(0.0, 1.5, 301)
    origins = np.stack([rho, np.zeros_like(rho), np.full_like(rho, 7.0)], axis=1)
    expected = 2 * np.sqrt(np.maximum((0.25 - np.abs(rho - 1)) * (0.25 + np.abs(rho - 1)), 0))
    chord = torus.chord(origins, [0.0, 0.0, -1.0])
    tangent = np.isclose(np.abs(rho - 1), 0.25, atol=1e-9)
    assert np.abs(chord - expected)[~tangent].max() < 1e-14
    # At a tangent, rounding of the position by EPS shows as the root of that.
    assert np.abs(chord - expected)[tangent].max() < 4 * np.sqrt(EPS)


@pytest.mark.parametrize("z", [0.0, 0.1, -0.2, 0.2499])
def test_torus_in_its_plane(z: float) -> None:
    torus = Torus(1.0, 0.25)
    b = np.concatenate([np.linspace(0, 1.3, 131), [0.75, 1.25, 1.0]])
    half = np.sqrt(0.0625 - z * z)
    expected = 2 * np.sqrt(np.maximum((1 + half) ** 2 - b * b, 0)) - 2 * np.sqrt(np.maximum((1 - half) ** 2 - b * b, 0))
    origins = np.stack([np.full_like(b, -8.0), b, np.full_like(b, z)], axis=1)
    chord = torus.chord(origins, [1.0, 0.0, 0.0])
    tangent = (np.abs(b - 1 - half) < 1e-9) | (np.abs(b - 1 + half) < 1e-9)
    assert np.abs(chord - expected)[~tangent].max() < 1e-13
    assert np.abs(chord - expected)[tangent].max(initial=0.0) < 8 * np.sqrt(EPS)


def test_torus_tangent_from_above_touches_along_a_circle() -> None:
    torus = Torus(1.0, 0.25)
    b = np.linspace(-1.2, 1.2, 49)
    origins = np.stack([np.full_like(b, -8.0), b, np.full_like(b, 0.25)], axis=1)
    # The line meets the top circle in a double root each: fourth order where both fall together.
    assert torus.chord(origins, [1.0, 0.0, 0.0]).max() < 4 * EPS**0.25
    assert (torus.chord(origins + np.array([0, 0, 1e-9]), [1.0, 0.0, 0.0]) == 0).all()


def test_torus_villarceau_plane() -> None:
    """In the bitangent plane the torus is cut in two circles of radius `major`, their centers `minor` aside."""
    major, minor = 1.0, 0.4
    tilt = np.arcsin(minor / major)
    e1, e2 = np.array([np.cos(tilt), 0, np.sin(tilt)]), np.array([0.0, 1.0, 0.0])
    s = np.linspace(-1.3, 1.3, 105)
    origins = -6.0 * e2 + s[:, None] * e1
    # Along e2: inside exactly one of the two circles about (0, +-minor).
    half = np.sqrt(np.maximum(major**2 - s**2, 0))
    both = np.where(half > minor, 2 * (half - minor), 0.0)
    expected = 4 * half - 2 * both
    assert np.abs(Torus(major, minor).chord(origins, e2) - expected)[half > 0].max() < 1e-12


def test_cone_apex_axis_and_generator() -> None:
    cone = Frustum(1.0, 0.0, 2.0)  # apex at z = 1
    assert cone.chord([0, 0, 5.0], [0, 0, -1]) == 2.0
    assert cone.chord([0, 0, 0.0], [0, 0, 1]) == 1.0
    assert cone.chord([-5.0, 0, 1.0], [1, 0, 0]) == pytest.approx(0.0, abs=1e-15)
    assert cone.chord([-5.0, 0, 1.0 + 1e-12], [1, 0, 0]) == 0.0
    assert cone.chord([-5.0, 0, 0.0], [1, 0, 0]) == pytest.approx(1.0, abs=4 * EPS)
    # Through the apex at an angle: the mirrored cone does not count. Two roots meet there: half of the digits.
    steep, flat = _unit([0.2, 0.0, 1.0]), _unit([2.0, 0.0, 1.0])
    apex = np.array([0, 0, 1.0])
    assert cone.chord(apex - 10 * steep, steep) == pytest.approx(2 / steep[2], abs=1e-7)
    assert cone.chord(apex + 10 * steep, -steep) == pytest.approx(2 / steep[2], abs=1e-7)
    assert cone.chord(apex - 10 * flat, flat) == pytest.approx(0.0, abs=1e-7)
    # Along a generator the chord jumps; just within, it is the generator's length.
    generator = _unit([-1.0, 0.0, 2.0])
    start = np.array([1.0 - 1e-9, 0.0, -1.0]) - generator
    assert cone.chord(start, generator) == pytest.approx(np.sqrt(5), abs=1e-3)


def test_cylinder_parallel_and_across() -> None:
    cylinder = Frustum(0.5, 0.5, 3.0)
    assert cylinder.chord([0.2, 0.3, -9.0], [0, 0, 1]) == 3.0
    assert cylinder.chord([0.2, 0.6, -9.0], [0, 0, 1]) == 0.0
    assert cylinder.chord([-9.0, 0.3, 0.0], [1, 0, 0]) == pytest.approx(0.8, rel=4 * EPS)
    assert cylinder.chord([-9.0, 0.5, 0.0], [1, 0, 0]) == 0.0
    assert cylinder.chord([-9.0, 0.3, 1.6], [1, 0, 0]) == 0.0
    assert cylinder.chord([0.2, 0.3, -9.0], _unit([1e-17, 0, 1])) == 3.0


def test_shell_and_pair_are_sums() -> None:
    shell = SphericalShell(1.0, 0.999)
    assert shell.chord([0, 0, -1e4], [0, 0, 1]) == pytest.approx(0.002, rel=1e-12)
    assert shell.chord([0, 0, 0], [0, 0, 1]) == pytest.approx(0.001, rel=1e-12)
    pair = TwoSpheres(Sphere((0, 0, 0), 1.0), Sphere((0, 0, 5.0), 2.0))
    assert pair.chord([0, 0, -3.0], [0, 0, 1]) == 6.0
    assert pair.chord([0, 0, 2.0], [0, 0, 1]) == 4.0


def _decimals(low: float, high: float) -> st.SearchStrategy[float]:
    """Floats of six decimals: rays at distances of 1e-300 test the test's own arithmetic only."""
    return st.integers(round(low * 1e6), round(high * 1e6)).map(lambda n: n / 1e6)


angles = st.tuples(_decimals(0, 6.283185), _decimals(-1, 1))
small = _decimals(-1.5, 1.5)
points = st.tuples(small, small, small)


def _direction(angle: tuple[float, float]) -> Array:
    phi, z = angle
    across = np.sqrt(max(1 - z * z, 0.0))
    return _unit([across * np.cos(phi), across * np.sin(phi), z])


@given(name=st.sampled_from(sorted(SOLIDS)), point=points, angle=angles)
def test_chord_is_never_negative_or_longer_than_the_bounds(name: str, point: tuple[float, ...], angle) -> None:
    solid, _ = SOLIDS[name]
    chord = float(solid.chord(np.array(point), _direction(angle)))
    assert 0 <= chord <= solid.tessellate().diagonal


@given(name=st.sampled_from(["sphere", "ellipsoid", "box", "shell"]), point=points, angle=angles, shift=points)
def test_translation_changes_nothing(name: str, point, angle, shift) -> None:
    solid, _ = SOLIDS[name]
    a = np.array(shift)
    moved = {
        "sphere": lambda s: Sphere(tuple(a + s.center), s.radius),
        "ellipsoid": lambda s: Ellipsoid(tuple(a + s.center), s.radii),
        "box": lambda s: Box(tuple(a + s.low), tuple(a + s.high)),
        "shell": lambda s: SphericalShell(s.outer, s.inner, tuple(a + s.center)),
    }[name](solid)
    direction = _direction(angle)
    before, after = solid.chord(np.array(point), direction), moved.chord(np.array(point) + a, direction)
    # A box edge can be grazed over its whole length by one rounding: leave out lines within a face.
    if name != "box" or np.abs(direction).min() > 1e-3:
        assert after == pytest.approx(before, abs=1e-6)


@given(point=points, angle=angles, scale=st.floats(1e-6, 1e6))
def test_scale_invariance_of_torus_and_frustum(point, angle, scale) -> None:
    direction = _direction(angle)
    for one, big in (
        (Torus(1.0, 0.3), Torus(scale, 0.3 * scale)),
        (Frustum(0.9, 0.3, 1.0), Frustum(0.9 * scale, 0.3 * scale, scale)),
    ):
        expected = float(one.chord(np.array(point), direction))
        # Rounding may move a tangent line: by the root of that, at most the fourth root for the torus.
        assert float(big.chord(np.array(point) * scale, direction)) / scale == pytest.approx(expected, abs=1e-3)


@given(point=points, angle=angles, turn=_decimals(0, 6.283185))
def test_rotation_about_z_changes_no_solid_of_revolution(point, angle, turn) -> None:
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    direction = _direction(angle)
    for solid in (Torus(1.0, 0.3), Frustum(0.9, 0.3, 1.0)):
        expected = float(solid.chord(np.array(point), direction))
        turned = float(solid.chord(rotation @ np.array(point), _unit(rotation @ direction)))
        assert turned == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Sphere(radius=0.0),
        lambda: Sphere(radius=float("nan")),
        lambda: Sphere((0, float("inf"), 0), 1.0),
        lambda: Ellipsoid(radii=(1.0, -1.0, 1.0)),
        lambda: Box((0, 0, 0), (1, 0, 1)),
        lambda: Torus(1.0, 1.0),
        lambda: Torus(float("inf"), 1.0),
        lambda: Frustum(0.0, 0.0, 1.0),
        lambda: Frustum(1.0, 1.0, 0.0),
        lambda: SphericalShell(1.0, 1.0),
        lambda: TwoSpheres(Sphere((0, 0, 0), 1.0), Sphere((1.9, 0, 0), 1.0)),
    ],
)
def test_impossible_measures_are_refused(make: Callable[[], Solid]) -> None:
    with pytest.raises(InputError, match="these dimensions do not describe a solid"):
        make()


def test_directions_must_be_unit_and_resolution_enough() -> None:
    with pytest.raises(InputError, match="unit length"):
        Sphere().chord([0, 0, 0], [0, 0, 2])
    with pytest.raises(InputError, match="unit length"):
        Sphere().chord([0, 0, 0], [0, 0, np.nan])
    with pytest.raises(InputError, match="use 3 points and 3 segments, or more"):
        Frustum().tessellate(2)
    with pytest.raises(InputError, match="use 3 points and 3 segments, or more"):
        revolve([[1.0, 0.0]], 8)
