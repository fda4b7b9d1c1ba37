"""Denoised pictures: features seen through clear glass, less error, and what is said of them."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import translucent as tl
from translucent.assets import mesh_path
from translucent.frames.denoising import SCATTERED_ALBEDO, features
from translucent.geometry.solids import Box, Sphere
from translucent.planning.passes import NoteKind

GLASS = tl.Medium(ior=1.5)
CAMERA = tl.Camera.look_at((0.0, 0.0, 0.2), (0.0, 0.0, 0.0), fov_y=20.0)
SIZE = (32, 32)


def scene(*objects: tl.Object) -> tl.Scene:
    return tl.Scene(objects, CAMERA, environment=tl.Environment.studio())


def box(size: tuple[float, float, float], z: float, **more: object) -> tl.Object:
    place = np.eye(4)
    place[2, 3] = z
    return tl.Object(Box.slab(size[:2], size[2]).tessellate(), transform=place, **more)  # type: ignore[arg-type]


def test_features_are_those_behind_clear_glass() -> None:
    pane = box((0.2, 0.2, 0.01), 0.0, medium=GLASS)
    wall = box((0.2, 0.2, 0.01), -0.05, color=(0.1, 0.5, 0.9))
    albedo, normals = features(scene(pane, wall), SIZE)
    np.testing.assert_allclose(albedo[16, 16], (0.1, 0.5, 0.9), atol=1e-6)
    np.testing.assert_allclose(normals[16, 16], (0.0, 0.0, 1.0), atol=1e-6)


def test_glass_tints_what_is_behind_by_the_refracted_path() -> None:
    medium = tl.Medium.from_color((0.2, 0.6, 0.4), 0.01, ior=1.5)
    wall = box((0.2, 0.2, 0.01), -0.05, color=(0.5, 0.5, 0.5))
    albedo, _ = features(scene(box((0.2, 0.2, 0.01), 0.0, medium=medium), wall), SIZE)
    np.testing.assert_allclose(albedo[16, 16], 0.5 * np.array((0.2, 0.6, 0.4)), rtol=1e-3)


@pytest.mark.parametrize(
    "front",
    [
        {"medium": GLASS, "surface": tl.Surface(roughness=0.3)},
        {"medium": tl.Medium(scattering=100.0, ior=1.5)},
    ],
)
def test_features_end_at_what_scatters(front: dict[str, object]) -> None:
    wall = box((0.2, 0.2, 0.01), -0.05, color=(0.1, 0.5, 0.9))
    albedo, _ = features(scene(box((0.2, 0.2, 0.01), 0.0, **front), wall), SIZE)
    np.testing.assert_allclose(albedo[16, 16], SCATTERED_ALBEDO)


@pytest.fixture(scope="module")
def frosted() -> tl.Scene:
    mesh = Sphere(radius=0.02).tessellate(48)
    return scene(
        tl.Object(mesh, tl.Medium.from_color((0.8, 0.95, 0.9), 0.02, ior=1.5), surface=tl.Surface(roughness=0.3))
    )


def test_paths_have_a_third_of_the_error_and_no_standard_error(frosted: tl.Scene) -> None:
    pytest.importorskip("pyoidn", reason="the extra denoise is not installed")
    with tl.Renderer() as renderer:
        truth = renderer.render(frosted, (48, 48), tl.PathTraced(1024)).radiance
        plain, clean = (renderer.render(frosted, (48, 48), tl.PathTraced(8), denoise=one) for one in (False, True))
        traced = renderer.render(frosted, (48, 48), samples=4, denoise=True)
    inside = tl.interior(plain.coverage)
    errors = [np.sqrt(np.mean((one.radiance - truth)[inside] ** 2)) for one in (plain, clean, traced)]
    assert errors[1] < 0.35 * errors[0]
    assert errors[2] < 0.35 * errors[0]
    assert plain.standard_error is not None
    assert clean.standard_error is None
    assert clean.plan.says(NoteKind.DENOISED)
    assert "Open Image Denoise 2." in clean.provenance["denoiser"]
    assert clean.seconds["denoise"] > 0
    assert clean.scene is not None


def test_light_that_diffuses_guides_paths_in_media(coarse_light: None, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pyoidn", reason="the extra denoise is not installed")
    mesh = Sphere(radius=0.02).tessellate(32)
    jade = scene(tl.Object(mesh, tl.scattering_medium((0.07, 0.34, 0.17), 0.003, ior=1.6)))
    with tl.Renderer() as renderer:
        truth = renderer.render(jade, (32, 32), tl.PathTraced(1024)).radiance
        guided = renderer.render(jade, (32, 32), tl.PathTraced(16), denoise=True)
        monkeypatch.setattr(renderer, "_guide", lambda *_: None)
        alone = renderer.render(jade, (32, 32), tl.PathTraced(16), denoise=True)
    inside = tl.interior(guided.coverage)
    errors = [np.sqrt(np.mean((one.radiance - truth)[inside] ** 2)) for one in (guided, alone)]
    assert errors[0] < 0.7 * errors[1]


def test_what_has_no_noise_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyoidn", type(sys)("pyoidn"))  # which nothing calls
    glass = scene(tl.Object(tl.load_mesh(mesh_path("bear")), GLASS))
    with tl.Renderer() as renderer:
        frame = renderer.render(glass, (8, 8), denoise=True)
    assert "denoiser" not in frame.provenance
    assert "the picture is not denoised, because it has no random noise" in str(frame.plan)


def test_a_missing_package_is_a_sentence(frosted: tl.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    message = r"denoise; .*pyoidn.*; pip install 'translucent-shading\[denoise\]', or render with more samples"
    with tl.Renderer() as renderer, pytest.raises(tl.RenderError, match=message):
        renderer.render(frosted, (8, 8), denoise=True)


def test_transparent_frames_are_refused(frosted: tl.Scene) -> None:
    with tl.Renderer() as renderer, pytest.raises(tl.InputError, match="denoise; a transparent frame"):
        renderer.render(frosted, (8, 8), transparent=True, denoise=True)
