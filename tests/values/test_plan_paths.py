"""Plans of random paths: how thickness is found beside them, what they leave out, and what they refuse."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.values.plan_scenes import plan_over_backdrop
from translucent.geometry.solids import Box
from translucent.planning import bodies
from translucent.planning.bodies import halvings
from translucent.planning.passes import NoteKind, PassName
from translucent.planning.plan import plan, plan_scene
from translucent.planning.request import RenderRequest
from translucent.scene.surface import Surface

METHOD = tl.PathTraced(paths=16)
MILK = tl.Medium(0.1, (3.0, 2.0, 1.0), 0.5, anisotropy=0.5, ior=1.4)
CLEAR = tl.Medium(1.0, ior=1.5)
SUN = tl.DirectionalLight((0, -1, 0), 1.0)


def body(medium: tl.Medium | None = MILK, x: float = 0.0, **options: Any) -> tl.Object:
    return tl.Object(Box((x, 0, 0), (x + 1, 1, 1)).tessellate(), medium, **options)


def scene(*objects: tl.Object, **options: Any) -> tl.Scene:
    return tl.Scene(objects or [body()], tl.Camera.look_at((0.5, 0.5, 9), (0.5, 0.5, 0)), **options)


def test_thickness_is_found_as_if_light_went_straight() -> None:
    """Scattering, emission and interfaces ask for nothing: paths follow them."""
    found = plan(scene(body(), body(tl.Medium(1.0, 2.0, 3.0), 2.0), lights=[SUN]), METHOD)
    assert [step.name for step in found.passes] == [PassName.SIGNED_DEPTH, PassName.TRANSMITTANCE, PassName.PATH_TRACE]
    assert (found.method, found.paths, found.interfaces) == (tl.SignedDepth(), METHOD, None)
    assert "16 random paths for each pixel" in found.passes[-1].reason
    assert found.says(NoteKind.NOISE)
    assert not found.exact
    assert str(found).startswith("PathTraced(paths=16, seed=0), thickness by SignedDepth(anchored=True): not exact")
    assert found.summary()["method"] == found.runs
    overlapping = scene(body(), body(tl.Medium(1.0), 0.5, priority=1), overlap="priority")
    assert plan(overlapping, METHOD).method == tl.FragmentLists()
    assert plan(scene(body(), body(None, 2.0)), METHOD).passes[0].name is PassName.OPAQUE
    assert plan(scene(), tl.PathTraced(32)).cost > plan(scene(), METHOD).cost


def test_nobody_gets_paths_unasked() -> None:
    for one in (scene(), scene(lights=[SUN]), scene(body(tl.Medium(1.0)))):
        assert plan(one).paths is None
        assert not plan(one).has(PassName.PATH_TRACE)


@pytest.mark.parametrize(
    ("objects", "kind", "words"),
    [
        ([body()], NoteKind.LIGHTS_LEFT_OUT, "caustics and refracted light of point, spot"),
        ([body(surface=Surface(dispersion=1.0))], NoteKind.REFRACTION, "no dispersion; all colors are refracted alike"),
        (
            [body(surface=Surface(clearcoat=0.5, clearcoat_roughness=0.2))],
            NoteKind.COATS,
            "rough clear coats are rendered as polished",
        ),
        ([body(surface=Surface(emissive=(1, 1, 1)))], NoteKind.GLOW, "light that these surfaces emit is missing"),
    ],
)
def test_what_no_path_shows_is_told(objects: list[tl.Object], kind: NoteKind, words: str) -> None:
    notes = [note for note in plan(scene(*objects, lights=[SUN]), METHOD).unmodelled if note.kind is kind]
    assert len(notes) == 1
    assert words in notes[0]


def test_paths_find_shadows_by_themselves() -> None:
    """Shadow maps serve diffuse bases, and opaque objects with textures that rays do not read."""
    ground, lamp = body(None, 2.0), tl.SphereLight((0, 5, 0), 1.0, 0.1)
    found = plan(scene(body(), ground, lights=[lamp]), METHOD)
    assert not found.has(PassName.SHADOW_MAPS)
    assert not found.says(NoteKind.LIGHTS_LEFT_OUT)
    assert plan(scene(body(surface=Surface(transmission=0.5)), ground, lights=[lamp]), METHOD).has(PassName.SHADOW_MAPS)


def test_what_paths_do_not_read_of_surfaces_is_told() -> None:
    mesh, texture = body().mesh, tl.Texture(np.ones((4, 4, 3)))
    unwrapped = tl.Mesh(mesh.vertices, mesh.faces, uv=np.zeros((len(mesh.vertices), 2)))
    read = tl.Surface(color_texture=texture, roughness_texture=texture, transmission_texture=texture)
    assert not plan(scene(tl.Object(unwrapped, MILK, surface=read)), METHOD).says(NoteKind.TEXTURES)
    for surface in (replace(read, normal_texture=texture), replace(read, occlusion_texture=texture)):
        assert plan(scene(tl.Object(unwrapped, MILK, surface=surface)), METHOD).says(NoteKind.TEXTURES)
    holes = tl.Object(unwrapped, None, surface=replace(read, alpha_cutoff=0.5))
    assert plan(scene(body(), holes), METHOD).says(NoteKind.TEXTURES)


def test_textures_that_do_not_fit_are_halved_and_told(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh, small, large = body().mesh, tl.Texture(np.ones((8, 8, 3))), tl.Texture(np.ones((5, 40, 3)))
    unwrapped = tl.Mesh(mesh.vertices, mesh.faces, uv=np.zeros((len(mesh.vertices), 2)))
    surface = tl.Surface(color_texture=large, roughness_texture=small)
    one = scene(tl.Object(unwrapped, MILK, surface=surface))
    assert halvings(one) == {large: 0, small: 0}
    monkeypatch.setattr(bodies, "MOST_TEXELS", 64 + 2 * 20)
    assert halvings(one) == {large: 1, small: 0}
    assert plan(one, METHOD).says(NoteKind.TEXTURES)
    monkeypatch.setattr(bodies, "MOST_TEXELS", 2)
    assert halvings(one) == {large: 5, small: 3}


def test_frosted_and_matched_bodies_leave_no_light_out() -> None:
    for one in (body(surface=Surface(roughness=0.5)), body(tl.Medium(1.0, 2.0))):
        assert not plan(scene(one, lights=[SUN]), METHOD).unmodelled


@pytest.mark.parametrize(
    ("objects", "options", "message"),
    [
        ([tl.Object(tl.Mesh(body().mesh.vertices, body().mesh.faces[1:]), MILK)], {}, "not closed, .* close it, or"),
        ([body(density=tl.LinearDensity(2, 0.5, 1.0))], {}, r"density varies, .* tl\.reference\.path_trace"),
        ([body(sheet_thickness=0.1)], {}, "path tracing does not support sheets that scatter; use a closed body"),
        (
            [body(tl.Medium(1.0, ior=1.5), sheet_thickness=0.1, surface=Surface(roughness=0.5))],
            {},
            "path tracing does not support rough sheets",
        ),
        ([body(tl.Medium(), sheet_thickness=0.1, surface=Surface(opacity=0.5))], {}, "partly transparent layers"),
        ([body()], {"ambient": (1, 1, 1)}, "PathTraced with ambient radiance; .* omit the ambient radiance"),
    ],
)
def test_what_paths_cannot_follow_is_refused(objects: list[tl.Object], options: dict[str, Any], message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        plan(scene(*objects, **options), METHOD)


def test_what_paths_take_the_place_of_cannot_be_asked_for() -> None:
    with pytest.raises(tl.InputError, match=r"interfaces=TracedInterfaces\(.*; path tracing replaces interfaces"):
        plan(scene(), METHOD, interfaces=tl.TracedInterfaces())
    with pytest.raises(tl.InputError, match=r"scattering=Diffusion\(.*; path tracing replaces scattering"):
        plan(scene(), METHOD, scattering=tl.Diffusion())
    with pytest.raises(tl.InputError, match=r"in front of a backdrop; .* no mesh that a path could hit"):
        plan_over_backdrop(scene(), METHOD)
    with pytest.raises(tl.InputError, match=r"works on the CPU; use tl\.reference\.path_trace\(scene, size, paths\)"):
        plan(scene(), METHOD, tl.Capabilities(opengl=False))


@pytest.mark.parametrize("paths", [1, 0, -3, (1 << 20) + 1, 2.0, True, "8", None])
def test_paths_are_counted_in_whole_numbers(paths: Any) -> None:
    with pytest.raises(
        tl.InputError,
        match=r"PathTraced paths .* the value must be a whole number in 2 to 1048576; use a value such as",
    ):
        tl.PathTraced(paths)


@pytest.mark.parametrize("seed", [-1, 1 << 32, 0.5, True])
def test_seeds_are_whole_numbers(seed: Any) -> None:
    with pytest.raises(tl.InputError, match="PathTraced seed"):
        tl.PathTraced(seed=seed)


def test_embree_finds_hits_where_opengl_draws_on_processors_and_nothing_scatters() -> None:
    software = tl.Capabilities(software=True)
    clear = plan(scene(body(CLEAR)), METHOD, software)
    assert clear.hits == "embree"
    assert "Embree finds" in clear.passes[-1].reason
    assert plan(scene(body(CLEAR)), METHOD).hits == "gl"
    assert plan(scene(body(MILK)), METHOD, software).hits == "gl"
    assert plan(scene(body(MILK)), replace(METHOD, hits="embree"), software).hits == "embree"
    assert plan(scene(body(CLEAR)), replace(METHOD, hits="gl"), software).hits == "gl"
    assert clear.passes[-1].cost < plan(scene(body(CLEAR)), METHOD).passes[-1].cost


@pytest.mark.parametrize(
    ("asked", "hits"),
    [
        ({"pixels": 64 * 64}, "gl"),
        ({"pixels": 64 * 64, "samples": 2}, "embree"),
        ({"pixels": 0}, "embree"),
        ({"pixels": 64 * 64, "caustics": tl.Caustics(10_000)}, "embree"),
        ({"pixels": 64 * 64, "interfaces": tl.TracedInterfaces(hits="embree")}, "embree"),
    ],
)
def test_few_samples_are_not_worth_embree_s_shaders(asked: dict[str, Any], hits: str) -> None:
    shown = scene(body(tl.Medium(ior=1.5)), body(None, x=3), lights=[tl.DirectionalLight((0, -1, 0), 1.0)])
    assert plan_scene(shown, RenderRequest(**asked), tl.Capabilities(software=True)).hits == hits


def test_hits_that_are_no_choice_are_refused() -> None:
    with pytest.raises(tl.InputError, match="PathTraced hits 'optix'; no ray caster has this name"):
        tl.PathTraced(hits="optix")
    with pytest.raises(tl.InputError, match="no compute shaders"):
        plan(scene(body(CLEAR)), replace(METHOD, hits="embree"), tl.Capabilities(shader_storage=False))
