"""Models on a stage: what the ground receives, what stays as it was, and what a transparent frame keeps of it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import translucent as tl
from translucent.geometry.solids import Box, Sphere

SIZE = (96, 54)
BALL = Sphere().tessellate(48)
GREEN = tl.Medium(absorption=(0.9, 0.2, 0.6))


def slab(unit: float = 1.0) -> tl.Object:
    return tl.Object(
        Box((-unit, 0.5 * unit, -unit), (unit, unit, unit)).tessellate(),
        tl.Medium(absorption=(2.0 / unit, 0.5 / unit, 0.0)),
    )


def catcher(unit: float = 1.0) -> tl.Object:
    corners = 20 * unit * np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)])
    paint = tl.Surface(color=(0.3, 0.5, 0.4), roughness=0.2, double_sided=False)
    mesh = tl.Mesh(corners, [[0, 2, 1], [0, 3, 2]])
    return tl.Object(mesh, surface=paint, shadow_catcher=True)


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_a_caught_shadow_is_what_the_medium_takes_from_the_light(renderer: tl.Renderer, unit: float) -> None:
    """Light at 45 degrees through both faces of a slab, beside light from the sky that nothing shadows."""
    sky = tl.Environment.constant((0.3, 0.2, 0.1))
    light = tl.DirectionalLight((1, -1, 0), (2.0, 3.0, 1.0))
    camera = tl.Camera.look_at((4.0 * unit, 4 * unit, 0), (0.75 * unit, 0, 0), fov_y=30)
    scene = tl.Scene([slab(unit), catcher(unit)], camera, [light], sky)
    frame = renderer.render(scene, (33, 33), transparent=True)
    assert frame.passed is not None
    assert frame.alpha is not None
    # The middle of the picture sees the ground at x = 0.75, in the shadow, and past the slab.
    assert not frame.coverage[16, 16]
    through = np.exp(-np.array([2.0, 0.5, 0.0]) * 0.5 * np.sqrt(2.0))
    falls = np.array([2.0, 3.0, 1.0]) * np.sqrt(0.5)
    expected = (np.pi * sky.first + falls * through) / (np.pi * sky.first + falls)
    np.testing.assert_allclose(frame.passed[16, 16], expected, atol=1e-4)  # maps of irradiance have 32 bits, light 24
    np.testing.assert_allclose(frame.alpha[16, 16], 1 - expected.mean(), atol=1e-4)
    assert frame.radiance[16, 16].max() == 0
    # Nearer to the camera it is lit, and nothing is to be seen of the ground.
    assert frame.alpha[-1, 16] == pytest.approx(0, abs=1e-5)


@pytest.mark.parametrize("stage", ["studio", "light-table"])
def test_thickness_is_what_it_was(renderer: tl.Renderer, few_shadows: None, stage: str) -> None:
    scene = tl.showcase(BALL, GREEN, SIZE, stage=stage)
    alone = tl.Scene(scene.objects[:1], scene.camera)
    on, off = renderer.render(scene, SIZE), renderer.render(alone, SIZE)
    np.testing.assert_array_equal(on.coverage, off.coverage)
    assert on.coverage.any()
    assert on.valid.all()
    np.testing.assert_allclose(on.thickness, off.thickness, rtol=1e-5, atol=2e-6)  # two formulas in float32


def test_pictures_are_the_same_at_every_scale(renderer: tl.Renderer, few_shadows: None) -> None:
    pictures = []
    for unit in (1.0, 1e-6, 1e6):
        mesh = tl.Mesh(unit * BALL.vertices, BALL.faces)
        pictures.append(renderer.render(tl.showcase(mesh, None, SIZE), SIZE).radiance)
    for other in pictures[1:]:
        off = np.abs(other - pictures[0]).max(axis=-1)
        assert np.median(off) < 1e-5
        assert (off > 1e-2).mean() < 5e-3  # rays at silhouettes may go either way


def test_the_ground_is_dark_below_and_bright_elsewhere(renderer: tl.Renderer, few_shadows: None) -> None:
    black = tl.Medium(absorption=1e4)
    scene = tl.showcase(BALL, black, SIZE)
    radiance = renderer.render(scene, SIZE, samples=4).radiance.mean(axis=-1)
    unlit = dataclasses.replace(
        scene, objects=[dataclasses.replace(scene.objects[0], medium=tl.Medium(absorption=0.0)), scene.objects[1]]
    )
    bright = renderer.render(unlit, SIZE, samples=4).radiance.mean(axis=-1)
    assert (radiance < 0.6 * bright).any()
    assert radiance[0, 0] == pytest.approx(bright[0, 0], rel=0.02)
    # White, and not burnt out.
    assert 0.3 < np.median(bright) < 1.0


def test_an_eye_below_sees_the_model_and_no_ground(renderer: tl.Renderer) -> None:
    camera = tl.Camera.look_at((0, -4, 3), (0, 0, 0), fov_y=40)
    scene = tl.showcase(BALL, GREEN, SIZE, camera)
    frame = renderer.render(scene, SIZE)
    alone = tl.Scene(scene.objects[:1], camera, environment=scene.environment)
    np.testing.assert_allclose(frame.radiance, renderer.render(alone, SIZE).radiance, atol=1e-5)


@pytest.mark.parametrize(("unit", "metal"), [(1e-6, False), (1.0, False), (1e6, False), (1.0, True)])
def test_the_ground_mirrors_what_a_mirrored_eye_sees(
    renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch, unit: float, metal: bool
) -> None:
    """With a polished coat, bodies change Fresnel's share of what an eye sees from as far below the ground.

    So they do on polished metal, and on grounds that are no shadow catchers.
    """
    # Black and polished: what is seen of the ball is mirrored once, and above the horizon without any tracing.
    ball = tl.Object(tl.Mesh(unit * BALL.vertices, BALL.faces), tl.Medium(absorption=1e4 / unit, ior=1.5))
    color = (0.9, 0.5, 0.3) if metal else (0.2, 0.2, 0.2)
    coat = tl.Surface(color=color, roughness=0.0, double_sided=False, metallic=float(metal))
    ground = dataclasses.replace(catcher(unit), surface=coat, shadow_catcher=not metal)
    lift = np.eye(4)
    lift[1, 3] = 1.2 * unit
    eye, target = np.array([0.0, 3.0, 7.0]) * unit, np.array([0.0, 0.0, 1.0]) * unit
    sky = tl.Environment.gradient((0.9, 0.9, 0.9), (0.2, 0.4, 0.8))
    camera = tl.Camera.look_at(eye, target, fov_y=40)
    scene = tl.Scene([dataclasses.replace(ball, transform=lift), ground], camera, environment=sky)
    with_image = renderer.render(scene, SIZE)
    assert "'mesh' reflects the objects on it, once" in str(with_image.plan)
    with monkeypatch.context() as patch:
        patch.setattr("translucent.gpu.job.mirror_of", lambda scene: None)
        without = renderer.render(scene, SIZE)
    changed = (with_image.radiance - without.radiance)[~with_image.coverage]
    down = np.array([1.0, -1.0, 1.0])
    below = dataclasses.replace(scene, camera=tl.Camera.look_at(eye * down, target * down, fov_y=40))
    seen = renderer.render(below, SIZE)
    _, rays = camera.rays(SIZE)
    cosine = np.abs(rays[..., 1])
    facing = np.array(color if metal else (0.04,) * 3)
    # Schlick's curve, as coats of opaque objects have it.
    fresnel = facing + (1.0 - facing) * (1.0 - cosine[..., None]) ** 5
    image = fresnel * (seen.radiance[::-1] - sky.lighting(rays * down))
    expected = np.where(seen.coverage[::-1, :, None], image, 0.0)[~with_image.coverage]
    assert (np.abs(expected).max(axis=1) > 0.02).sum() > 100
    off = np.abs(changed - expected).max(axis=1)
    # The table of the split sum has steps of 1/31; at the edge of the ball two pixels may see different things.
    assert np.mean(off < 5e-3) > 0.97
    assert np.median(off[np.abs(expected).max(axis=1) > 0.02]) < 1.5e-3
