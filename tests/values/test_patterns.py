"""Patterns: veins of marble, bubbles of air in ice, blotches of skin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import translucent as tl
from translucent.errors import InputError
from translucent.geometry.solids import Box, Torus
from translucent.media.preset import preset_text, read_presets
from translucent.scene.patterns import ACROSS, PATTERNS, patterned
from translucent.scene.showcase import with_pattern

OF = {"veins": "marble", "bubbles": "ice", "blotches": "skin"}
BOX = Box((0, 0, 0), (0.1, 0.2, 0.3)).tessellate()


@pytest.mark.parametrize("name", PATTERNS)
def test_a_pattern_has_a_size_in_metres_and_goes_through_the_body(name: str) -> None:
    mesh, surface = patterned(BOX, None, name)
    assert mesh.uv is not None
    assert surface is not None
    np.testing.assert_array_equal(mesh.vertices[: len(BOX.vertices)], BOX.vertices)
    linear = np.allclose(PATTERNS[name].period * mesh.uv, mesh.vertices @ ACROSS.T, rtol=1e-12, atol=0.0)
    assert linear == PATTERNS[name].grain
    assert patterned(BOX, None, name)[0] is mesh  # what renderers keep of it stays
    scaled = tl.Object(BOX, transform=np.diag([2.0, 2.0, 2.0, 1.0]), material=OF[name])
    again = patterned(replace(BOX, vertices=2.0 * BOX.vertices), None, name)[0]
    np.testing.assert_allclose(scaled.mesh.uv, again.uv, rtol=1e-12)
    # It repeats without a seam: texels across the edge differ as neighbors do.
    for texture in filter(None, surface.textures):
        edge = np.abs(texture.pixels[0] - texture.pixels[-1]).mean()
        assert 0.0 < edge < 2.0 * np.abs(np.diff(texture.pixels, axis=0)).mean()


def test_textures_of_a_surface_stay() -> None:
    own = tl.Surface(color_texture=tl.Texture(np.ones((1, 1, 3))))
    assert patterned(BOX, own, "veins") == (BOX, own)
    assert patterned(BOX, None, "") == (BOX, None)
    with pytest.raises(InputError, match=r"no pattern has the name 'wood'; use one of veins, bubbles, blotches"):
        patterned(BOX, None, "wood")


def test_scenes_and_presets_have_patterns() -> None:
    scene = tl.Scene([tl.Object(BOX, tl.Medium(ior=1.3)), tl.Object(BOX)], tl.Camera.framing(BOX.vertices, (8, 8)))
    body, opaque = with_pattern(scene, "bubbles").objects
    assert body.surface is not None
    assert body.surface.normal_texture is not None
    assert opaque is scene.objects[1]
    ice = tl.preset("ice")
    assert read_presets(preset_text(ice))["ice"].pattern == ice.summary()["pattern"] == "bubbles"
    with pytest.raises(InputError, match=r'"veins" or "bubbles" or "blotches"'):
        read_presets(preset_text(ice).replace('"bubbles"', '"wood"'))


def test_bubbles_are_cavities_inside_and_around_the_middle() -> None:
    ring = Torus(0.03, 0.01).tessellate()
    for body in (BOX, ring):
        icy = tl.Object(body, material="ice").mesh
        assert icy.diagnosis.solid
        assert not icy.diagnosis.problems
        assert len(icy.faces) - len(body.faces) > 10_000
        assert 0.95 * body.volume < icy.volume < body.volume
        bubbles = icy.vertices[len(body.vertices) :]
        if body is ring:
            assert (np.hypot(np.hypot(bubbles[:, 0], bubbles[:, 1]) - 0.03, bubbles[:, 2]) < 0.0095).all()
        else:
            assert ((bubbles > 0.002) & (bubbles < body.bounds[1] - 0.002)).all()
    hole = tl.Mesh(BOX.vertices, BOX.faces[1:])  # it has no inside
    assert len(tl.Object(hole, material="ice").mesh.faces) == len(hole.faces)
