"""Light that is scattered many times, against truth that is stored; what engines do of it; slabs. No time is judged."""

from __future__ import annotations

import dataclasses
from importlib.resources import files
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.bench.measuring import measured, named
from tests.bench.provenance import PROVENANCE
from translucent.bench.cases import CASES, Case
from translucent.bench.claims import SLAB_CLAIMS
from translucent.bench.drawing import BenchContext
from translucent.bench.engines import (
    RAYS,
    Frostbite,
    NormalizedDiffusion,
    PaintLayer,
    cosine_directions,
    visible_points,
)
from translucent.bench.experiment import Whole
from translucent.bench.record import Report, Slab
from translucent.bench.slabs import SlabComparison
from translucent.bench.truth import CaseTruth, StoredTruth, stored_truth, truth_file
from translucent.diffusion.cache import FieldCache
from translucent.errors import InputError
from translucent.geometry.solids import Sphere

#: Those whose truth is stored.
SCENES = [case for case in CASES if case.paths]

WHITE = tl.Environment.constant((1, 1, 1))


@pytest.mark.parametrize("one", SCENES, ids=lambda one: one.name)
def test_each_scene_has_a_truth_of_its_own(one: Case) -> None:
    truth = stored_truth(one.name, one.scene((0, 0)))
    assert truth.mask.shape == (one.compared, one.compared)
    assert truth.noise < 0.04
    assert len(files("translucent.bench").joinpath(truth_file(one.name)).read_bytes()) < 30_000
    # The two halves differ by no more than their standard error says: their mean has half of the difference.
    apart = 0.5 * np.sqrt(((truth.halves[0] - truth.halves[1]) ** 2).mean())
    assert apart == pytest.approx(np.sqrt((truth.error**2).mean()), rel=0.1)


def test_a_scene_that_has_changed_is_told() -> None:
    jade = SCENES[0].scene((0, 0))
    body = jade.objects[0]
    assert body.medium is not None
    media = [
        dataclasses.replace(body.medium, anisotropy=1e-3),
        dataclasses.replace(body.medium, scattering=1.0001 * np.asarray(body.medium.scattering)),
        dataclasses.replace(body.medium, absorption=1.0001 * np.asarray(body.medium.absorption)),
        dataclasses.replace(body.medium, ior=1.601),
    ]
    turned = np.eye(4)
    turned[0, 3] = 1e-3
    for other in (
        *(dataclasses.replace(jade, objects=[dataclasses.replace(body, medium=medium)]) for medium in media),
        dataclasses.replace(jade, objects=[dataclasses.replace(body, surface=tl.Surface(roughness=0.1))]),
        dataclasses.replace(jade, objects=[dataclasses.replace(body, transform=turned)]),
        dataclasses.replace(jade, environment=WHITE),
        dataclasses.replace(jade, lights=[tl.DirectionalLight((0, -1, 0), 1.0)]),
    ):
        with pytest.raises(InputError, match="the scene has changed since its true picture was path traced"):
            stored_truth("jade ring", other)
    with pytest.raises(InputError, match="no true picture of this scene is stored"):
        stored_truth("nothing", jade)


def test_a_truth_is_the_same_after_writing_and_reading(rng: np.random.Generator) -> None:
    mask = rng.random((5, 7)) < 0.5
    halves = rng.random((2, mask.sum(), 3)).astype(np.float16).astype(np.float64)
    truth = StoredTruth(halves, 0.5 * halves[0].astype(np.float16), mask, np.arange(4.0), 32, 1.5)
    found = StoredTruth.from_bytes(truth.to_bytes())
    assert (found.paths, found.seconds, found.noise) == (32, 1.5, pytest.approx(truth.noise, rel=1e-3))
    np.testing.assert_array_equal(found.mask, mask)
    np.testing.assert_array_equal(found.halves, halves)


def jade_truth() -> CaseTruth:
    scene = SCENES[0].scene((0, 0))
    return CaseTruth.of_paths(scene, stored_truth("jade ring", scene))


def test_errors_are_shares_of_the_mean_without_the_noise() -> None:
    truth = jade_truth()
    used = truth.compared
    mean = truth.frame.radiance[used].mean(axis=0)
    shown = dataclasses.replace(truth.frame, radiance=truth.frame.radiance + 0.1 * mean)
    found = truth.light_errors(shown, 0.25)
    assert found is not None
    assert found.bias == pytest.approx((0.1, 0.1, 0.1), rel=1e-6)
    assert found.solve_seconds == 0.25
    # What the shown frame shares with the halves, their mean, would be taken for noise: half of its square is negative.
    wanted = np.sqrt((mean**2).mean()) / mean.mean() * 0.1
    noise = truth.noise or 0.0
    assert found.nrmse == pytest.approx(np.sqrt(wanted**2 - noise**2), rel=0.1)
    assert found.block == pytest.approx(wanted, rel=0.1)


def test_diffusion_is_nearer_than_layers_and_what_engines_do(
    bench: BenchContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = ("diffusion-resolution-16", "diffusion-resolution-32", "ScatteringLayer", "layer-without-inner-mirrors")
    solved: list[tl.Diffusion] = []
    solve = FieldCache._body
    monkeypatch.setattr(FieldCache, "_body", lambda *given: (solved.append(given[4]), solve(*given))[1])
    made = measured(bench, named("jade ring"), *names)
    assert solved == [tl.Diffusion(16), tl.Diffusion(32)], "once each, though drawn in two sizes"
    assert made.truth_noise is not None
    assert made.compared_size == (40, 40)
    rows = {row.method: row for row in made.rows if row.kind != "floor"}
    assert not [row.failure or row.refusal for row in rows.values() if row.failure or row.refusal]
    off = {name: row.light.nrmse for name, row in rows.items()}  # type: ignore[union-attr]
    # Layers below the surface are as curved as it is, so a coarse grid is as near as a fine one.
    assert max(off["Diffusion, resolution 32"], off["Diffusion, resolution 16"]) < 0.025
    assert off["Diffusion, resolution 16"] < 0.5 * off["ScatteringLayer"] < 0.5 * off["layer without inner mirrors"]
    fine = rows["Diffusion, resolution 32"]
    assert fine.light is not None
    assert fine.light.solve_seconds is not None
    assert fine.light.solve_seconds > 0
    assert fine.color_difference is None, "of the noise of the truth"
    assert (fine.wall, fine.ratio, fine.exact) == (fine.frame, fine.frame_ratio, False)
    assert fine.parameters == "Diffusion(resolution=32)"


def ball(medium: tl.Medium, environment: tl.Environment, *lights: tl.PointLight) -> tl.Scene:
    camera = tl.Camera.look_at((0, 0.5, 4), (0, 0, 0), fov_y=32)
    return tl.Scene([tl.Object(Sphere().tessellate(48), medium)], camera, lights, environment)


def test_paint_without_interfaces_is_the_layer(renderer: tl.Renderer) -> None:
    """NumPy and the shader agree where next to nothing mirrors inside."""
    sky = tl.Environment.gradient((0.2, 0.1, 0.3), (1.0, 1.4, 0.8))
    scene = ball(tl.Medium(absorption=(0.1, 0.3, 1.0), scattering=(2.0, 1.0, 4.0), anisotropy=0.3, ior=1.0005), sky)
    shot = visible_points(renderer, scene, (24, 24))
    paint = shot.frame(PaintLayer().light(shot)).radiance.reshape(-1, 3)[shot.pixels]
    layer = renderer.render(scene, (24, 24), scattering=tl.ScatteringLayer()).radiance.reshape(-1, 3)[shot.pixels]
    # An interface that faint still mirrors 0.2 % of diffuse light.
    assert np.quantile(np.abs(paint - layer), 0.99) < 6e-3
    assert len(shot.pixels) > 200


def test_normalized_diffusion_gives_back_its_color_in_uniform_light(renderer: tl.Renderer) -> None:
    shot = visible_points(renderer, ball(tl.Medium((0.1, 1, 5), (20, 20, 20), ior=1.4), WHITE), (16, 16))
    found = NormalizedDiffusion(400).light(shot)
    np.testing.assert_allclose(found, np.broadcast_to(shot.entering * shot.diffuse_color, found.shape), rtol=1e-3)
    assert (np.diff(shot.diffuse_color) < 0).all()


def test_normalized_diffusion_spreads_light_by_the_mean_free_path(renderer: tl.Renderer) -> None:
    """A lamp beside a ball: what a larger mean free path carries around it is more."""
    dark = tl.Environment.constant((0, 0, 0))
    found = []
    for extinction in (2.0, 8.0):
        medium = tl.Medium(0.001 * extinction, 0.999 * extinction)
        shot = visible_points(renderer, ball(medium, dark, tl.PointLight((5, 0, 0), (25, 25, 25))), (16, 16))
        found.append(NormalizedDiffusion(400).light(shot)[shot.points[:, 0] < -0.2].mean())
    assert found[0] > 1.5 * found[1] > 0


def test_frostbite_gets_the_best_of_its_settings(renderer: tl.Renderer) -> None:
    lamp = tl.PointLight((2, 1, -2), (9, 9, 9))
    shot = visible_points(renderer, ball(tl.Medium(0.1, (4, 6, 8)), WHITE, lamp), (16, 16))
    wanted = Frostbite(wrap=0.5, distortion=0.3, power=8.0, reach=1.0, front=0.4, scale=2.0, ambient=0.7)
    found = Frostbite().fitted(shot, shot.frame(wanted.light(shot)).radiance.astype(np.float64))
    np.testing.assert_allclose(found.light(shot), wanted.light(shot), rtol=0.02, atol=1e-4)


def test_directions_are_even_by_the_cosine(rng: np.random.Generator) -> None:
    normals = rng.normal(size=(50, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    cosine = np.einsum("kri,ki->kr", cosine_directions(normals), normals)
    assert cosine.min() > 0
    assert cosine.mean(axis=1) == pytest.approx(2 / 3, abs=1 / RAYS)


def measured_slabs(*given: Any) -> tuple[Slab, ...]:
    """By albedos, triples of depths, anisotropies and indices of refraction."""
    found: tuple[Slab, ...] = SlabComparison((Whole(),), *given).measure(None, Whole())
    return found


def test_slabs_are_measured_by_all_models() -> None:
    found = {(slab.ior, slab.depth): slab for slab in measured_slabs((0.99,), ((0.005, 4.0, 16.0),), (0.0,))}
    assert len(found) == 6
    for slab in found.values():
        assert abs(slab.error("diffusion")) < 0.04
        assert abs(slab.error("layer")) < 0.04
        fog = slab.ior == 1.0 and slab.depth < 16.0
        assert slab.planned == ("none" if slab.depth < 0.01 else "volume" if fog else "diffusion")
    thin = found[1.5, 0.005]
    assert thin.error("planned") == pytest.approx(
        max(thin.unscattered[0] - thin.reflectance, thin.unscattered[1] - thin.transmittance, key=abs)
    )


def test_slabs_that_scatter_ahead_are_near() -> None:
    """Slabs with g = 0.9 are within 0.045: the exact mean over directions of the mirrored fraction is within 0.041."""
    found = measured_slabs((0.9,), ((2.0, 4.0, 8.0),), (0.9,), (1.5,))
    assert max(abs(slab.error("diffusion")) for slab in found) < 0.045


def slab(depth: float, transmittance: float, **more: float) -> Slab:
    values = {"albedo": 0.99, "anisotropy": 0.0, "ior": 1.5, **more}
    exact = (0.5, 0.3)
    return Slab(
        **values, depth=depth, reflectance=0.5, transmittance=0.3, unscattered=exact, diffusion=(0.5, transmittance),
        layer=exact, planned="diffusion",
    )  # fmt: skip


def test_claims_on_slabs_fall_where_one_is_off() -> None:
    def held(*slabs: Slab) -> list[bool | None]:
        return [judge(Report(PROVENANCE, slabs=slabs)).held for judge in SLAB_CLAIMS]

    assert held(slab(8.0, 0.32)) == [True, True]
    assert held(slab(8.0, 0.32), slab(8.0, 0.34)) == [False, True]
    assert held(slab(8.0, 0.32), slab(8.0, 0.34, anisotropy=0.9)) == [True, True], "its reduced depth is below 4"
    assert held(slab(8.0, 0.36, ior=1.0)) == [False, None], "what the planner takes for fog is no slab"
    assert held(slab(8.0, 0.36)) == [False, False]
    assert held() == [None, None]
