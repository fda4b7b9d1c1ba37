"""Plans with caustics: where photons come, what they leave out, which bodies stop straight light, what is refused."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import translucent as tl
from translucent.geometry.solids import Box
from translucent.planning.passes import NoteKind, PassName
from translucent.planning.plan import plan, plan_scene
from translucent.planning.render_plan import Capabilities
from translucent.planning.rendered import Treatment
from translucent.planning.request import RenderRequest

CLEAR = tl.Medium(1.0, ior=1.5)
SUN = tl.DirectionalLight((0, -1, 0), 1.0)
FEW = tl.Caustics(photons=1000)


def body(medium: tl.Medium | None = CLEAR, x: float = 0.0, **options: Any) -> tl.Object:
    return tl.Object(Box((x, 0, 0), (x + 1, 1, 1)).tessellate(), medium, **options)


def scene(*objects: tl.Object, lights: Any = (SUN,), **options: Any) -> tl.Scene:
    given = objects or (body(), body(None, 3.0))
    return tl.Scene(given, tl.Camera.look_at((0.5, 0.5, 9), (0.5, 0.5, 0)), lights, **options)


def test_photons_land_on_the_picture_of_what_is_opaque() -> None:
    found = plan(scene(), caustics=FEW)
    assert [step.name for step in found.passes][:3] == [PassName.SHADOW_MAPS, PassName.OPAQUE, PassName.CAUSTICS]
    assert "1,000 photons from 1 light through 'box'" in found.passes[2].reason
    assert found.cost - plan(scene()).cost == pytest.approx(FEW.cost_of_a_million * 1e-3)
    assert (found.caustics, found.summary()["caustics"]) == (FEW, "Caustics(photons=1000, seed=0)")
    notes = [str(note) for note in found.unmodelled if note.kind is NoteKind.CAUSTICS]
    assert notes[0] == "the environment causes no caustics"
    assert len(notes) == 2
    milk = plan(scene(body(tl.Medium(1.0, 50.0, ior=1.4)), body(None, 3.0)), caustics=FEW)
    assert "no caustics in these scattering media: 'box'" in str(milk)


def test_photons_that_read_no_textures_are_told() -> None:
    """Those into media, and those of a renderer without OpenGL; what lands on a picture of OpenGL knows textures."""
    mesh = body().mesh
    unwrapped = tl.Mesh(mesh.vertices, mesh.faces, uv=mesh.vertices[:, :2])
    painted = tl.Object(unwrapped, CLEAR, surface=tl.Surface(color_texture=tl.Texture(np.full((1, 1, 3), 0.5))))
    fog = tl.Object(Box((-9, -9, -9), (9, 9, 9)).tessellate(), tl.Medium(scattering=0.1))
    for objects, machine, told in (
        ([painted, body(None, 3.0)], Capabilities(), False),
        ([painted, body(None, 3.0)], Capabilities(shader_storage=False, opengl=False, scattering=False), True),
        ([painted, fog], Capabilities(), True),
        ([body(), fog], Capabilities(), False),
    ):
        notes = plan(scene(*objects), capabilities=machine, caustics=FEW).unmodelled
        assert any("ignore the textures of these interfaces" in str(note) for note in notes) == told


def test_photons_light_fog() -> None:
    """In place of straight light, from the views of lights on; on what is opaque, too, if anything is."""
    fog = body(tl.Medium(scattering=2.0), 1.0)
    found = plan(scene(body(), fog), caustics=tl.Caustics(1_000_000))
    assert (found.treated(Treatment.VOLUME), found.opaque_to_shadows) == ((1,), {0})
    assert found.method == tl.RayMarched(64)
    assert not found.has(PassName.CAUSTICS)
    (views,) = (step for step in found.passes if step.name is PassName.LIGHT_VIEWS)
    assert "requested: 250,000 photons carry light through" in views.reason
    assert "carry light through 'box' into 'box'; the CPU traces them in about 12 s" in views.reason
    assert "no caustics in these scattering media" not in str(found)
    assert "photons that a medium scatters are lost" in str(found)
    both = plan(scene(body(), fog, body(None, 3.0)), caustics=FEW)
    assert both.has(PassName.CAUSTICS)
    assert plan(scene(body(), fog), caustics=FEW).caustics.in_media == 65_536  # type: ignore[union-attr]


def test_photons_light_bodies_that_scatter_behind_interfaces() -> None:
    """From other bodies: what has bent light itself has had it by then."""
    milk = body(tl.Medium(1.0, 50.0, ior=1.4), 1.0)
    found = plan(scene(body(), milk), caustics=tl.Caustics(1_000_000))
    assert (found.treated(Treatment.DIFFUSION), found.opaque_to_shadows) == ((1,), {0, 1})
    (traced,) = (step for step in found.passes if step.name is PassName.TRACED)
    assert "250,000 photons" in traced.reason
    assert "no caustics in these scattering media" not in str(found)
    alone = plan(scene(milk, body(None, 3.0)), caustics=FEW)
    assert "the CPU traces them" not in str(alone)
    assert "no caustics in these scattering media: 'box'" in str(alone)


def test_without_opengl_photons_land_where_opaque_objects_are_shaded() -> None:
    found = plan(scene(), capabilities=Capabilities(shader_storage=False, opengl=False), caustics=FEW)
    assert "photons from 1 light" in found.passes[-1].reason
    assert "the CPU traces them" in found.passes[-1].reason
    assert not [note for note in found.unmodelled if "objects that are visible only through interfaces" in note]


def test_fog_that_photons_do_not_light_is_told() -> None:
    fog, ground = body(tl.Medium(scattering=2.0), 1.0), body(None, 3.0)
    once = plan(scene(body(), fog, ground), scattering=tl.SingleScattering(), caustics=FEW)
    assert "no caustics in these scattering media: 'box'" in str(once)
    # Without steps that gather it, light leaves through the surface of fog, where photons come in.
    old = plan(scene(body(), fog, ground), capabilities=Capabilities(shader_storage=False), caustics=FEW)
    assert old.treated(Treatment.DIFFUSION) == (1,)
    assert "carry light through 'box' into 'box'" in str(old)
    ahead = plan(scene(body(), body(tl.Medium(scattering=2.0, anisotropy=0.5), 1.0)), caustics=FEW)
    assert "'box': caustic light is scattered equally in all directions" in str(ahead)


def test_a_plan_names_the_option_that_shows_the_light_in_a_shadow() -> None:
    """The plan names `--caustics` for a light, a clear refracting body and a receiver, as long as photons are off."""
    offered = "the caustic in the shadow of 'box' is missing, a spot several times as bright as the ground"
    assert any(offered in note and "--caustics" in note for note in plan(scene()).unmodelled)
    others = [
        scene(lights=()),
        scene(body()),
        scene(body(tl.Medium(1.0)), body(None, 3.0)),
        scene(body(tl.Medium(1.0, 50.0, ior=1.4)), body(None, 3.0)),
        scene(body(sheet_thickness=0.01), body(None, 3.0)),
    ]
    assert not any("the caustic in the shadow" in str(plan(other)) for other in others)
    assert "the caustic in the shadow" not in str(plan(scene(), caustics=FEW))


def test_pictures_of_many_samples_have_caustics() -> None:
    """Where they take less than a third of the time: more samples, lights and pixels pay for photons."""

    def photons(samples: int, one: tl.Scene, **options: Any) -> float:
        request = RenderRequest(samples=samples, pixels=options.pop("pixels", 10_000), **options)
        machine = Capabilities(software=True)
        found = plan_scene(one, request, machine).caustics
        return 0.0 if found is None else found.photons / 10_000

    assert photons(1, scene()) == photons(8, scene()) == 0.0
    assert 1.0 < photons(16, scene()) < photons(32, scene()) <= 4.0
    assert photons(16, scene(), pixels=20_000) == pytest.approx(2.0 * photons(16, scene()))
    assert photons(16, scene(lights=[tl.SphereLight((0, 5, 0), 1.0, 0.2)])) == 4.0
    for options in ({"pixels": 0}, {"caustics": tl.Caustics(0)}, {"transparent": True}, {"method": tl.ThinLayer()}):
        assert photons(16, scene(), **options) == 0.0
    wax = body(tl.Medium(1.0, 50.0, ior=1.4), 5.0)
    assert photons(16, scene(body(), body(None, 3.0), wax)) == photons(16, scene(body())) == 0.0
    text = str(plan_scene(scene(), RenderRequest(samples=32, pixels=10_000)))
    assert "photons take less than 33% of the render time" in text


def test_nobody_gets_caustics_unasked() -> None:
    """The samples of a plan alone are one."""
    found = plan(scene())
    assert not found.has(PassName.CAUSTICS)
    assert (found.caustics, found.opaque_to_shadows, found.summary()["caustics"]) == (None, frozenset(), None)


def test_what_bends_light_stops_it_on_its_straight_way() -> None:
    """Solids alone: sheets let light straight through, and so does what has the index of air."""
    tinted = body(tl.Medium(1.0), 4.0, surface=tl.Surface(color=(1.0, 0.5, 0.5)))
    one = scene(body(None, 3.0), body(), body(x=2.0, sheet_thickness=1e-3), tinted)
    assert plan(one, caustics=FEW).opaque_to_shadows == {1}


@pytest.mark.parametrize(
    ("one", "options", "message"),
    [
        (
            scene(lights=()),
            {},
            "caustics; the scene has no lights that can emit photons; add a tl.PointLight, tl.SpotLight or",
        ),
        (
            scene(body(tl.Medium(1.0)), body(None, 3.0)),
            {},
            "caustics; no interface of 'box' refracts or reflects light",
        ),
        (scene(body()), {}, "caustics; no opaque object and no scattering body can receive the light"),
        (scene(), {"method": tl.PathTraced()}, "omit the caustics, or choose another method"),
        (scene(), {"method": tl.ThinLayer()}, "this method treats every face as a sheet, which does not refract light"),
        (
            scene(body(density=tl.LinearDensity(1, 0.0, 1.0)), body(None, 3.0)),
            {},
            "the density of 'box' varies",
        ),
        (
            scene(body(sheet_thickness=1e-3, surface=tl.Surface(roughness=0.5)), body(None, 3.0)),
            {},
            "'box': photons cannot cross a rough sheet; use a closed body instead of the sheet",
        ),
    ],
)
def test_scenes_that_no_photon_could_light_are_refused(one: tl.Scene, options: Any, message: str) -> None:
    with pytest.raises(tl.InputError, match=re.escape(message)):
        plan(one, caustics=FEW, **options)


@pytest.mark.parametrize("photons", [-1, 10**12, 1e6, True, "many"])
def test_numbers_of_photons_that_make_no_sense_are_refused(photons: Any) -> None:
    with pytest.raises(
        tl.InputError, match=r"Caustics photons .*; the value must be a whole number in 0 to 1073741824"
    ):
        tl.Caustics(photons)
    with pytest.raises(tl.InputError, match=r"caustics 7; this is not tl\.Caustics; give for example tl.Caustics"):
        plan(scene(), caustics=7)  # type: ignore[arg-type]
    with pytest.raises(tl.InputError, match="Caustics seed -1"):
        tl.Caustics(seed=-1)
