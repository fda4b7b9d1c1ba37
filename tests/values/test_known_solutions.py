"""Solutions of earlier lights, from which that for the next one starts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import sparse
from threadpoolctl import threadpool_info, threadpool_limits

import translucent as tl
from translucent.diffusion import field
from translucent.diffusion.cell_system import MOST, TOLERANCE, KnownSolutions
from translucent.diffusion.entering_rays import EnteringRays, LateralShift
from translucent.diffusion.field import DiffusingBody
from translucent.diffusion.grid import body_grid
from translucent.diffusion.lit_body import lit_body
from translucent.diffusion.solution import BodySystem
from translucent.diffusion.volume import DiffusingVolume, VolumeGrid
from translucent.geometry.solids import Sphere
from translucent.planning.scattering import Diffusion
from translucent.scene.lights import by_spheres, with_points
from translucent.threads import one_blas_thread

MILK = tl.Medium(absorption=0.1, scattering=20.0, ior=1.33)


def test_mixed_lights_take_no_steps() -> None:
    """Dimmed, tinted, and both together, once each has been solved for; and solutions are those from nothing."""
    body = tl.Object(Sphere().tessellate(24), MILK)
    grid = body_grid(body, Diffusion(12).cell_size(body))
    count = len(grid.points)
    system = BodySystem(grid, MILK, 0.0, warm_starts=True)
    dark = np.zeros((grid.count, 3))
    above = np.maximum(grid.normals[:, :1], 0.0) * np.ones(3)
    even, steps = np.ones((count, 3)), []
    for entering in (even, above, 0.2 * above, 3.0 * even + 0.5 * above, even * (0.1, 1.0, 2.0)):
        found = system.solved(entering, None, dark)
        alone = BodySystem(grid, MILK, 0.0).solved(entering, None, dark)
        np.testing.assert_allclose(found.fluence, alone.fluence, atol=20 * TOLERANCE * alone.fluence.max())
        steps.append(found.steps)
    assert min(steps[:2]) > 10
    assert max(steps[2:]) <= 3


def test_solutions_use_one_thread_of_a_blas_which_gets_its_others_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Contexts that overlap, as of two threads: the first to begin is the first to end."""
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)

    def threads() -> set[int]:
        return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}

    with threadpool_limits(2):
        first, second = one_blas_thread(), one_blas_thread()
        assert threads() == {2}
        first.__enter__()
        second.__enter__()
        assert threads() == {1}
        first.__exit__(None, None, None)
        assert threads() == {1}
        second.__exit__(None, None, None)
        assert threads() == {2}


def test_solutions_depend_on_earlier_ones_only_with_warm_starts() -> None:
    body = tl.Object(Sphere().tessellate(24), MILK)
    lit, grid = lit_body(body, None, 0.25), VolumeGrid(body, 0.25)
    camera, sky = tl.Camera.look_at((0, 0, 5), (0, 0, 0)), tl.Environment.constant((0.3, 0.2, 0.1))
    one, other = (tl.Scene([body], camera, lights, sky) for lights in ((), [tl.PointLight((3, 0, 1), 1.0)]))
    for warm in (False, True):
        surface = DiffusingBody(lit, MILK, 0.0, warm_starts=warm)
        volume = DiffusingVolume(grid, MILK, warm_starts=warm)
        first, _, last = ((surface.field(scene, 0), volume.field(scene)) for scene in (one, other, one))
        for before, after in zip(first, last, strict=True):
            same = [np.array_equal(a, b) for a, b in zip(before.volumes, after.volumes, strict=True)]
            assert all(same) is not warm
            assert (after.steps < 0.5 * before.steps) is warm


def test_light_that_stays_arrives_as_it_did(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shadows and events of a light are found once, whatever other lights and the sky do, and again if it moves."""
    found, shifted = list[object](), list[object]()
    original, shift = field.from_light, LateralShift.of

    def counted(*given: Any) -> EnteringRays:
        found.append(given[2])
        return original(*given)

    def counted_shift(*given: Any) -> LateralShift:
        shifted.append(given[1])
        return shift(*given)

    monkeypatch.setattr(field, "from_light", counted)
    monkeypatch.setattr(LateralShift, "of", counted_shift)
    body = tl.Object(Sphere().tessellate(24), MILK)
    diffusing = DiffusingBody(lit_body(body, None, 0.25), MILK, 0.0)
    camera, white = tl.Camera.look_at((0, 0, 5), (0, 0, 0)), tl.Environment.constant((1, 1, 1))
    black = tl.Environment.constant((0, 0, 0))
    stays, first, moved = (tl.PointLight((x, 0, 1), 1.0) for x in (3, -3, -2))
    scenes = [([stays, first], white), ([stays, first], black), ([stays, moved], black), ([stays, moved], white)]
    for lights, around in scenes:
        alone = DiffusingBody(lit_body(body, None, 0.25), MILK, 0.0)
        scene = tl.Scene([body], camera, lights, around)
        kept = diffusing.field(scene, 0)
        asked, moves = len(found), len(shifted)
        assert np.array_equal(alone.field(scene, 0).fluence, kept.fluence)
        del found[asked:], shifted[moves:]
    assert found == [stays, first, moved]
    assert len(shifted) == 3


def test_points_of_a_sphere_light_enter_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two rays at each sample stand for all. Measured: 2e-4 of the largest exitance at most."""
    body = tl.Object(Sphere().tessellate(24), MILK)
    lights = with_points([tl.SphereLight((3, 0, 1), 1.0, 0.8), tl.PointLight((0, 3, 0), 1.0)], 32)
    scene = tl.Scene([body], tl.Camera.look_at((0, 0, 5), (0, 0, 0)), lights)
    assert [len(parts) for parts in by_spheres(lights)] == [16, 1]
    diffusing = DiffusingBody(lit_body(body, None, 0.25), MILK, 0.0)
    together = diffusing.field(scene, 0).leaving
    monkeypatch.setattr(field, "by_spheres", lambda lights: [[light] for light in lights])
    alone = diffusing.field(scene, 0).leaving
    np.testing.assert_allclose(together, alone, atol=1e-3 * alone.max())
    assert not np.array_equal(together, alone)


def test_many_lights_are_no_worse_than_none_before() -> None:
    """Solutions of long ago are dropped, one by one; what is dropped is found again."""
    rng = np.random.default_rng(3)
    n = 40
    matrix = sparse.csr_array(np.diag(np.linspace(1.0, 50.0, n)) + 0.1)
    known = KnownSolutions(matrix)
    right = rng.normal(size=(3 * MOST, n))
    for wanted in right:
        exact = np.linalg.solve(matrix.toarray(), wanted)
        near = known.nearest(wanted)
        assert (exact - near) @ (matrix @ (exact - near)) <= exact @ (matrix @ exact) * (1 + 1e-9)
        known.add(exact)
    again = 0.3 * right[-1] - 2.0 * right[-MOST + 1]
    np.testing.assert_allclose(known.nearest(again), np.linalg.solve(matrix.toarray(), again), atol=1e-6)
    known.add(np.zeros(n))  # says nothing
