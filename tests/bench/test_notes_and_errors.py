"""Notes of plans against errors: what is off by more than a twentieth of the light is named, and how much it may be."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

import translucent as tl
from translucent.assets import mesh_path
from translucent.bench.cases import CASES, DAY, GLASS, WAX, Case
from translucent.bench.shapes import square_ground
from translucent.bench.truth import CaseTruth, stored_truth
from translucent.geometry.solids import Sphere

#: Error in a channel's mean, or in blocks of pixels, as a fraction of the mean, that no plan may keep to itself.
SILENT = 0.05

#: How the clause begins that is about lights behind bodies. No scene here has such a light.
FROM_BEHIND = "where lights shine from behind"

#: Scenes whose truth is light of all kinds.
SCENES = [case for case in CASES if case.effect == "all light"]


@pytest.mark.parametrize("one", SCENES, ids=lambda one: one.name)
def test_no_error_is_larger_than_the_notes_say(one: Case, renderer: tl.Renderer) -> None:
    """The largest percentage in the notes is that of what is left out."""
    scene, size = one.scene((0, 0)), (one.compared, one.compared)
    truth = CaseTruth.of_paths(scene, stored_truth(one.name, scene))
    frame = renderer.render(scene, size, shadows=tl.ShadowMaps(256))
    found = truth.light_errors(frame, None)
    assert found is not None
    off = max(found.block, *map(abs, found.bias))
    largest = max(
        (number for text in clauses(frame.plan) if FROM_BEHIND not in text for number in shares(text)), default=0
    )
    print(one.name, f"{off:.3f} off, {largest:.2f} in notes", np.round(found.bias, 3))
    assert off < max(SILENT, largest), frame.plan


def clauses(plan: tl.RenderPlan) -> list[str]:
    """Clauses of the notes of a plan."""
    return [clause for note in (*plan.limits, *plan.unmodelled) for clause in note.split("; ")]


def shares(text: str) -> list[float]:
    """Percentages in a text, as fractions."""
    return [float(number) / 100 for number in re.findall(r"(\d+) %", text)]


@cache
def bear_of_wax() -> tl.Object:
    """The same object for both lights, so that its diffusion is prepared once."""
    mesh = tl.load_mesh(mesh_path("bear"))
    bear = tl.Mesh(mesh.vertices * (0.06 / np.ptp(mesh.vertices[:, 1])), mesh.faces)
    return tl.Object(bear, tl.Medium(absorption=(60, 130, 320), scattering=(1000, 900, 700), anisotropy=0.3))


#: Mean radiance of the picture below by Mitsuba, whose standard error is 0.6 % at most, for two lights.
LIT_FROM_BEHIND = {(0.35, -0.35, 0.87): (0.00688, 0.00502, 0.00282), (0.0, 0.0, 1.0): (0.00344, 0.00233, 0.00115)}


@pytest.mark.parametrize("direction", LIT_FROM_BEHIND)
def test_notes_tell_how_wrong_bodies_are_that_are_lit_from_behind(
    direction: tuple[float, float, float], renderer: tl.Renderer
) -> None:
    """A bear of wax in the air, and a light 30 degrees beside the view, or straight behind: a rim on a dark body."""
    bear = bear_of_wax()
    middle, light = bear.mesh.vertices.mean(axis=0), tl.DirectionalLight(direction, 2.5)
    camera = tl.Camera.look_at(middle + (0.0, 0.0, 0.17), middle, fov_y=28)
    scene = tl.Scene([bear], camera, [light], tl.Environment.constant(0.0))
    frame = renderer.render(scene, (32, 32), samples=4)
    bias = frame.radiance.mean(axis=(0, 1)) / LIT_FROM_BEHIND[direction] - 1.0
    (clause,) = (text for text in clauses(frame.plan) if FROM_BEHIND in text)
    dark, bright = shares(clause)
    print("lit from behind", np.round(bias, 3), clause)
    assert -dark < bias.min(), frame.plan
    assert bias.max() < bright, frame.plan


def _metal() -> tuple[tl.Scene, str]:
    """A ball of metal beside wax, on a ground."""
    metal = tl.Object(_ball((0.75, 0.61, 0.2)), surface=tl.Surface(color=(0.9, 0.8, 0.6), metallic=1.0, roughness=0.1))
    wax = tl.Object(_ball((-0.7, 0.61, 0.0)), WAX)
    scene = tl.Scene([wax, metal, square_ground((0.7, 0.15, 0.1))], STILL, environment=DAY, environment_shadows=16)
    return scene, "metals reflect the environment alone"


def _lamp() -> tuple[tl.Scene, str]:
    """A ball of glass before a lamp."""
    lamp = tl.SphereLight((-0.3, 0.3, -4.0), 20.0, 0.5)
    return tl.Scene([tl.Object(_ball((0.0, 0.9, 0.0)), GLASS)], STILL, [lamp], DAY), "lights behind are invisible"


STILL = tl.Camera.look_at((0.5, 1.8, 4.8), (0, 0.8, 0), fov_y=30)


def _ball(center: tuple[float, float, float]) -> tl.Mesh:
    return Sphere(radius=0.6, center=center).tessellate(32)


@pytest.mark.parametrize("make", [_metal, _lamp])
def test_notes_tell_how_wrong_what_is_left_out_is(
    make: Callable[[], tuple[tl.Scene, str]], renderer: tl.Renderer
) -> None:
    """More than a twentieth, and less than the notes say, of the light of a block, or of the mean if that is larger."""
    (scene, words), size = make(), (32, 24)
    frame = renderer.render(scene, size, samples=4)
    truth = renderer.render(scene, size, samples=4, method=tl.PathTraced(128)).radiance
    found, true = (one.reshape(6, 4, 8, 4, 3).mean(axis=(1, 3)) for one in (frame.radiance, truth))
    off = float((np.abs(found - true) / np.maximum(true, true.mean())).max())
    (clause,) = (text for text in clauses(frame.plan) if words in text)
    print(words, off, clause)
    assert SILENT < off < shares(clause)[0]


def test_notes_name_what_they_are_about() -> None:
    """A leaf, a glow, and opaque objects in bodies: each has its words, and no other."""
    words = {
        "thin leaf": "spikes and edges are",
        "neon": "light that the bodies emit and scatter is",
        "ball in soap": "the light around 'sphere' inside the bodies",
    }
    texts = {one.name: str(tl.plan(one.scene((0, 0)))) for one in SCENES}
    for name, word in words.items():
        assert word in texts[name]
    for name in ("fog ahead", "ice in a drink", "cubes in and behind glass"):
        assert not any(word in texts[name] for word in words.values())
