"""Ray marching: orders of convergence, and schemes that must agree."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from tests import references
from translucent.errors import InputError
from translucent.formulas import optics
from translucent.geometry.solids import Box, Torus
from translucent.media.density import Density, DensityGrid, ExponentialDensity, LinearDensity
from translucent.media.medium import Medium
from translucent.planning.methods import METHODS, RayMarched, method_from_name
from translucent.reference import compositing, march, render
from translucent.reference.quadrature import equiangular, even_steps, gauss_steps, hashed
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, PointLight
from translucent.scene.scene import Light, Object, Scene

Array = npt.NDArray[np.float64]

#: A slab, seen at an angle; nothing but its two sides is near.
SLAB = Box((-4, -4, -1), (4, 4, 0)).tessellate()
CAMERA = Camera.look_at((0.3, 0.2, 3.0), (0.1, 0.0, -0.5), fov_y=20)
MEDIUM = Medium(absorption=(0.5, 1.0, 2.0), scattering=(1.0, 2.0, 3.0), emission=(1.0, 0.5, 0.2), anisotropy=0.3)
DIM = replace(MEDIUM, emission=0.0)
DARK = Environment.constant((0, 0, 0))
SUN = DirectionalLight((0.3, 0.2, -1.0), 2.0)
LAMP = PointLight((1.0, 0.6, -0.4), 2.0)
DENSITY = ExponentialDensity(2, 0.3, 2.0)

#: Eight doublings.
STEPS = 2 ** np.arange(2, 10)


def slab(light: Light | None = None, density: Density | None = None, medium: Medium = MEDIUM) -> Scene:
    return Scene([Object(SLAB, medium, density=density)], CAMERA, [light] if light else [], DARK)


def errors(scene: Scene, size: tuple[int, int], **method: Any) -> Array:
    """RMS relative error of radiance for each number of steps."""
    truth = references.render(scene, size, tolerance=1e-11).radiance
    frames = (march(scene, size, RayMarched(int(steps), **method)) for steps in STEPS)
    return np.array([np.sqrt(np.mean((frame.radiance / truth - 1.0) ** 2)) for frame in frames])


def order(found: Array) -> float:
    """Slope of the error over the last six of the numbers of steps: five doublings."""
    return -float(np.polyfit(np.log2(STEPS[-6:]), np.log2(found[-6:]), 1)[0])


SCENES: dict[str, Scene] = {
    "sun": slab(SUN),
    "lamp": slab(LAMP, None, DIM),
    "sun, density": slab(SUN, DENSITY),
    "lamp, density": slab(LAMP, DENSITY, DIM),
    "emission, density": slab(None, LinearDensity(2, 0.1, 2.0)),
}
ORDERS = {"left": (1.0, 0.15), "midpoint": (2.0, 0.2), "exponential": (2.0, 0.2), "equiangular": (2.0, 0.2)}


# Exponential steps are exact for the emission of one medium with a linear density.
PAIRS = [(quadrature, name) for quadrature in ORDERS for name in SCENES]
PAIRS.remove(("exponential", "emission, density"))


@pytest.mark.parametrize(("quadrature", "name"), PAIRS)
def test_order_of_convergence(quadrature: Any, name: str) -> None:
    found = errors(SCENES[name], (2, 2), quadrature=quadrature)
    expected, bar = ORDERS[quadrature]
    print(f"{quadrature}, {name}: order {order(found):.3f}, errors {found[0]:.1e} to {found[-1]:.1e}")
    assert order(found) == pytest.approx(expected, abs=bar)


@pytest.mark.parametrize("name", ["sun", "lamp", "emission, density"])
def test_order_of_jittered_steps(name: str) -> None:
    """Each stratum adds an independent error of variance N^-4, and there are N of them (Mitchell 1996)."""
    found = errors(SCENES[name], (12, 12), quadrature="jittered")
    print(f"jittered, {name}: order {order(found):.3f}")
    assert order(found) == pytest.approx(1.5, abs=0.3)


def test_jittered_steps_have_no_bias() -> None:
    truth = references.render(SCENES["sun"], (12, 12), tolerance=1e-11).radiance
    frames = [march(SCENES["sun"], (12, 12), RayMarched(4, "jittered", seed=seed)) for seed in range(40)]
    relative = np.stack([frame.radiance / truth - 1.0 for frame in frames])
    mean, error = relative.mean(axis=0), relative.std(axis=0, ddof=1) / np.sqrt(len(frames))
    z = mean / error
    # Of 432 values nearly independent.
    assert abs(z.mean()) < 4 / np.sqrt(432)
    assert 0.8 < z.std() < 1.25


@pytest.mark.parametrize("density", [None, LinearDensity(2, 0.0, 2.0)])
def test_exponential_steps_are_exact_for_emission(density: Density | None) -> None:
    """One step for a homogeneous medium; one for a linear density, whose mean is in the middle."""
    scene = slab(None, density)
    truth = render(scene, (4, 3))
    frame = march(scene, (4, 3), RayMarched(1, "exponential"))
    for name in ("radiance", "transmittance", "optical_depth"):
        np.testing.assert_allclose(getattr(frame, name), getattr(truth, name), rtol=1e-12)
    assert np.abs(march(scene, (4, 3), RayMarched(1)).radiance / truth.radiance - 1).max() > 0.1


def test_gauss_points_converge_faster_than_any_order() -> None:
    for light, points in ((SUN, 12), (LAMP, 24)):
        truth = render(slab(light), (4, 3), tolerance=1e-12).radiance
        found = march(slab(light), (4, 3), RayMarched(points, "gauss")).radiance
        np.testing.assert_allclose(found, truth, rtol=1e-9)


def test_steps_across_surfaces_lose_an_order() -> None:
    """A slab that steps do not fit: aligned ones beat them by far, and more so the more there are."""
    scene = Scene([Object(Torus().tessellate(24), MEDIUM)], Camera.look_at((1, 2, 3), (0, 0, 0)), [SUN], DARK)
    size = (12, 9)
    truth = render(scene, size, tolerance=1e-6)
    seen = truth.coverage
    found = {aligned: [] for aligned in (True, False)}
    for aligned, rms in found.items():
        for steps in STEPS:
            frame = march(scene, size, RayMarched(int(steps)), aligned=aligned)
            rms.append(np.sqrt(np.mean((frame.radiance[seen] - truth.radiance[seen]) ** 2)))
    print(f"order {order(np.array(found[True])):.2f} aligned, {order(np.array(found[False])):.2f} not")
    assert order(np.array(found[False])) == pytest.approx(1.0, abs=0.4)
    assert found[False][-1] > 50 * found[True][-1]


SCHEMES: dict[str, dict[str, Any]] = {
    "back to front": {"compositing": "back-to-front"},
    "unassociated": {"associated": False},
    "unassociated, back to front": {"associated": False, "compositing": "back-to-front"},
}


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("quadrature", ["left", "midpoint", "exponential", "jittered", "equiangular", "gauss"])
@pytest.mark.parametrize("aligned", [True, False])
def test_schemes_agree(scheme: str, quadrature: Any, aligned: bool) -> None:
    bodies = [Object(Torus().tessellate(16), MEDIUM, density=DENSITY), Object(SLAB, Medium(1.0, 0.5))]
    camera = Camera.look_at((1, 2, 3), (0, 0, 0))
    scene = Scene(bodies, camera, [SUN, LAMP], Environment.gradient("red", "blue"))
    method = RayMarched(16, quadrature)
    plain = march(scene, (8, 6), method, aligned=aligned)
    other = march(scene, (8, 6), method, aligned=aligned, **SCHEMES[scheme])
    assert plain.radiance.min() > 0
    for name in ("radiance", "transmittance", "optical_depth"):
        np.testing.assert_allclose(getattr(other, name), getattr(plain, name), rtol=1e-12)


def test_an_opaque_layer_hides_what_is_behind(rng: np.random.Generator) -> None:
    color, depth = rng.random((2, 5, 3))
    front, back = (
        compositing.ColorLayer(color, depth),
        compositing.ColorLayer(rng.random((5, 3)), np.full((5, 3), np.inf)),
    )
    both = compositing.over(front, back)
    np.testing.assert_allclose(both.color, color + np.exp(-depth) * back.color, rtol=1e-15)
    assert (both.opacity == 1).all()
    np.testing.assert_array_equal(compositing.over(both, front).color, both.color)
    np.testing.assert_allclose(compositing.associated(compositing.unassociated(front)).color, color, rtol=1e-15)


@pytest.mark.parametrize("ratio", [0.1, 0.5, 2.0, 37.0])
@pytest.mark.parametrize("extinction", [0.0, 1e-12, 0.7, 30.0])
def test_steps_of_another_length(ratio: float, extinction: float) -> None:
    """Opacity of a step, corrected for another length, is that of a step of this length."""
    length = 0.3
    alpha = optics.opacity(extinction * length)
    assert optics.opacity_for_step(alpha, ratio) == pytest.approx(
        optics.opacity(extinction * ratio * length), rel=1e-12
    )


@pytest.mark.parametrize("termination", [1e-3, 0.1, 0.6])
def test_early_termination_keeps_its_bound(termination: float) -> None:
    """In a medium as bright as what is around it everything is: so much radiance arrives everywhere."""
    hot = Medium(absorption=(4.0, 8.0, 16.0), emission=(4.0, 8.0, 16.0))
    scene = Scene([Object(Torus().tessellate(16), hot)], Camera.look_at((1, 2, 3), (0, 0, 0)))
    method = RayMarched(64, "exponential")
    whole = march(scene, (16, 12), method)
    ended = march(scene, (16, 12), method, termination=termination)
    np.testing.assert_allclose(whole.radiance, 1.0, rtol=1e-12)
    missing = whole.radiance - ended.radiance
    assert missing.max() <= termination
    # The channel of the thinnest medium decides; where it is not below, nothing is left out.
    stopped = whole.transmittance.max(axis=-1) < termination
    assert stopped.any() == (termination > 1e-3)
    assert (missing[~stopped] == 0).all()
    assert missing.max(initial=0.0, where=stopped[..., None]) > (0.5 * termination if stopped.any() else -1)


def test_sheets_and_arguments_that_cannot_be() -> None:
    sheet = Scene([Object(SLAB, MEDIUM, sheet_thickness=1e-3)], CAMERA)
    glowing = slab(None, None, Medium(emission=1.0))
    cases: list[tuple[Callable[[], Any], str]] = [
        (lambda: march(sheet, (2, 2)), "ray marching; the scene has thin-walled sheets, which have no inside"),
        (lambda: march(slab(), (2, 2), RayMarched(8), compositing="sideways"), "compositing 'sideways'"),  # type: ignore[arg-type]
        (lambda: march(slab(), (2, 2), termination=1.0), "termination 1.0; the value must lie in 0 to 1"),
        (lambda: march(slab(), (2, 2), termination=float("nan")), "termination nan"),
        (lambda: march(slab(), (2, 2), termination=0.1, compositing="back-to-front"), "from back to front"),
        (lambda: march(slab(), (2, 2), "midpoint"), "marching by 'midpoint'"),  # type: ignore[arg-type]
        (lambda: march(slab(), (0, 2)), "size"),
        (
            lambda: march(glowing, (2, 2), associated=False),
            "unassociated colors; a step of the ray emits light, although its opacity is 0",
        ),
        (lambda: RayMarched(0), "RayMarched steps 0"),
        (lambda: RayMarched(-4), "RayMarched steps -4"),
        (lambda: RayMarched(2.5), "RayMarched steps 2.5"),  # type: ignore[arg-type]
        (lambda: RayMarched(1 << 20), "RayMarched steps 1048576"),
        (lambda: RayMarched(257, "gauss"), "steps of gauss 257; the value must be a whole number in 1 to 256"),
        (
            lambda: RayMarched(8, "simpson"),
            "quadrature 'simpson'; no quadrature has this name; use one of left, midpoint",
        ),  # type: ignore[arg-type]
        (lambda: RayMarched(8, "gauss", jitter=True), "'gauss' with jitter"),
        (lambda: RayMarched(8, "jittered", jitter=True), "'jittered' with jitter"),
        (lambda: RayMarched(8, seed=-1), "seed -1"),
    ]
    for call, message in cases:
        with pytest.raises(InputError, match=message):
            call()


def test_the_name_on_the_command_line() -> None:
    assert method_from_name("ray-marched") == RayMarched() == METHODS["ray-marched"]()


def test_jitter_moves_all_samples_of_a_pixel_alike() -> None:
    scene = slab(SUN)
    plain, moved = (march(scene, (6, 5), RayMarched(16, jitter=jitter)).radiance for jitter in (False, True))
    assert not np.allclose(plain, moved, rtol=1e-4)
    np.testing.assert_array_equal(march(scene, (6, 5), RayMarched(16, jitter=True)).radiance, moved)
    assert not np.allclose(march(scene, (6, 5), RayMarched(16, jitter=True, seed=1)).radiance, moved, rtol=1e-4)
    # At the offset that the hash gives a pixel, a Riemann sum over one step by hand.
    frame = march(slab(None), (1, 1), RayMarched(1, jitter=True))
    offset, length = hashed(np.zeros(1, int), np.zeros(1, int), np.zeros(1, int), 0)[0], frame.thickness[0, 0]
    by_hand = np.asarray(MEDIUM.emission) * length * np.exp(-MEDIUM.extinction * offset * length)
    np.testing.assert_allclose(frame.radiance[0, 0], by_hand, rtol=1e-13)


def test_every_interval_has_random_numbers_of_its_own() -> None:
    """One step in each of two slabs, by hand."""
    objects = [Object(Box((-4, -4, z - 1), (4, 4, z)).tessellate(), MEDIUM) for z in (0, -2)]
    frame = march(Scene(objects, CAMERA, [], DARK), (1, 1), RayMarched(1, "jittered", seed=5))
    zero, length = np.zeros(1, int), frame.thickness[0, 0] / 2
    offsets = [hashed(zero, zero, zero + interval, 5)[0] for interval in (0, 1)]
    depths = MEDIUM.extinction * length
    first, second = (np.exp(-offset * depths) for offset in offsets)
    expected = np.asarray(MEDIUM.emission) * length * (first + np.exp(-depths) * second)
    np.testing.assert_allclose(frame.radiance[0, 0], expected, rtol=1e-12)


def test_hashed_numbers() -> None:
    """Values of pcg3d by hand, and a spread as of random numbers."""
    mask = 0xFFFFFFFF
    for column, row, number, seed in ((0, 0, 0, 0), (5, 7, 11, 3), (70000, 1, 2**31, 2**32 - 1)):
        x, y, z = ((v * 1664525 + 1013904223) & mask for v in (column, row, (number + 2654435769 * seed) & mask))
        x = (x + y * z) & mask
        y = (y + z * x) & mask
        z = (z + x * y) & mask
        x, y, z = x ^ x >> 16, y ^ y >> 16, z ^ z >> 16
        x = (x + y * z) & mask
        found = hashed(np.array([column]), np.array([row]), np.array([number]), seed)
        assert found[0] == (x >> 8) / 2**24
    row, column = np.divmod(np.arange(10000), 100)
    values = hashed(column, row, np.zeros_like(row), 0)
    assert (values * 2**24 == np.round(values * 2**24)).all()
    counts = np.bincount((values * 20).astype(int), minlength=20)
    assert ((counts - 500) ** 2 / 500).sum() < 43.8, "chi squared with 19 degrees of freedom, 99.9 %"
    for neighbor in (values.reshape(100, 100)[:, 1:], values.reshape(100, 100)[1:].T):
        assert abs(np.corrcoef(values.reshape(100, 100)[:, :99].ravel(), neighbor.ravel())[0, 1]) < 0.04


def test_equal_angles() -> None:
    """tan(theta) goes in proportion to the distance from where the ray is closest; the derivative is its own."""
    start, end = np.array([1.0, -2.0, 3.0]), np.array([4.0, 5.0, 3.5])
    middle, distance = np.array([2.0, 1.0, -1e6]), np.array([0.1, 3.0, 1e6])
    u = np.linspace(0, 1, 41)
    t, stretch = equiangular(start, end, middle, distance, np.broadcast_to(u, (3, 41)))
    theta = np.arctan2(t - middle[:, None], distance[:, None])
    np.testing.assert_allclose(t[:, [0, -1]], np.stack([start, end], axis=1), rtol=1e-12)
    for i, atol in ((0, 1e-13), (1, 1e-13), (2, 1e-13)):
        np.testing.assert_allclose(theta[i], theta[i, 0] + u * (theta[i, -1] - theta[i, 0]), atol=atol)
    h = 1e-5
    ahead, _ = equiangular(start, end, middle, distance, np.broadcast_to(u + h, (3, 41)))
    behind, _ = equiangular(start, end, middle, distance, np.broadcast_to(u - h, (3, 41)))
    np.testing.assert_allclose((ahead - behind)[:, 1:-1] / (2 * h), stretch[:, 1:-1], rtol=1e-4)


def test_equal_angles_of_a_light_on_the_line() -> None:
    """Beyond the ends nothing is singular there: the variable is -1 / (t - middle)."""
    u = np.linspace(0, 1, 9)[None]
    t, _ = equiangular(np.array([2.0]), np.array([3.0]), np.array([1.0]), np.array([0.0]), u)
    np.testing.assert_allclose(1 / (t - 1), 1 - 0.5 * u, rtol=1e-11)


def test_steps_fill_the_interval_without_gaps() -> None:
    start, end = np.array([0.5, 2.0]), np.array([0.7, 5.0])
    length = (end - start)[:, None]
    even = even_steps(lambda u: (start[:, None] + u * length, np.broadcast_to(length, u.shape)), np.full((2, 7), 0.5))
    for steps in (even, gauss_steps(start, end, 7)):
        np.testing.assert_allclose(steps.begin[:, 0], start, rtol=1e-15)
        np.testing.assert_allclose(steps.end[:, -1], end, rtol=1e-15)
        np.testing.assert_array_equal(steps.begin[:, 1:], steps.end[:, :-1])
        assert (steps.begin < steps.at).all()
        assert (steps.at < steps.end).all()
        np.testing.assert_allclose(steps.weight.sum(axis=1), end - start, rtol=1e-14)
    gauss = gauss_steps(np.zeros(1), np.ones(1), 7)
    np.testing.assert_allclose(
        [(gauss.at**k * gauss.weight).sum() for k in range(14)], 1 / np.arange(1, 15), rtol=1e-13
    )


def test_one_voxel_marches_as_a_homogeneous_medium() -> None:
    plain, voxel = slab(LAMP, None, Medium(0.35, 0.7)), slab(LAMP, DensityGrid([[[0.7]]]), Medium(0.5, 1.0))
    for method in (RayMarched(8), RayMarched(8, "exponential")):
        np.testing.assert_allclose(
            march(voxel, (4, 3), method).radiance, march(plain, (4, 3), method).radiance, rtol=1e-12
        )


def test_frames_say_what_they_are() -> None:
    frame = march(slab(SUN), (3, 2), RayMarched(4, "left"))
    assert frame.plan.method == RayMarched(4, "left")
    assert frame.plan.limits == ("optical depth is summed over 4 steps in each interval",)
    assert frame.provenance["backend"] == "reference"
    assert frame.radiance.shape == (2, 3, 3)
    assert frame.valid.all()
    np.testing.assert_array_equal(frame.thickness, render(slab(SUN), (3, 2)).thickness)
