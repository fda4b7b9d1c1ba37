"""Surfaces and textures as values: what they hold, what they refuse, and where textures are read."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import translucent as tl

SQUARE = tl.Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 1, 2]], [[0, 0], [1, 0], [1, 1]])
PICTURE = np.arange(24, dtype=np.float64).reshape(2, 4, 3) / 24


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"roughness": 1.01}, "surface roughness 1.01; the value must lie in 0 to 1"),
        ({"roughness": float("nan")}, "surface roughness nan; the value must lie in 0 to 1"),
        ({"metallic": -0.1}, "surface metallic -0.1; the value must lie in 0 to 1"),
        ({"ior": 0.9}, "surface ior 0.9; the value must lie in 1 to 100"),
        ({"alpha_cutoff": 2}, "surface alpha_cutoff 2; the value must lie in 0 to 1"),
        ({"dispersion": 11}, "surface dispersion 11; the value must lie in 0 to 10"),
        (
            {"iridescence_thickness": 400},
            r"surface iridescence_thickness 400; the value must lie in 0 to 0\.0001",
        ),  # nm
        ({"iridescence_ior": 0.9}, "surface iridescence_ior 0.9; the value must lie in 1 to 100"),
        ({"clearcoat": 1.5}, "surface clearcoat 1.5; the value must lie in 0 to 1"),
        ({"color": (1, 2, 0)}, r"surface color \(1, 2, 0\); the value must be three numbers in 0 to 1"),
        ({"emissive": (-1, 0, 0)}, r"surface emissive \(-1, 0, 0\); the value must be three numbers in 0 to 1e\+18"),
        ({"emissive": "glow"}, "'glow'"),
        (
            {"emissive_texture": PICTURE},
            r"surface emissive_texture; a texture cannot have the type ndarray; use a tl\.Texture",
        ),
    ],
)
def test_a_surface_out_of_range_is_refused(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        tl.Surface(**fields)


def test_the_color_of_an_opaque_object_is_that_of_its_surface() -> None:
    assert tl.Object(SQUARE, color=(0.1, 0.2, 0.3)).base_color.tolist() == [0.1, 0.2, 0.3]
    painted = tl.Object(SQUARE, color=(0.1, 0.2, 0.3), surface=tl.Surface(color=(0.5, 0.5, 1.0)))
    assert painted.base_color.tolist() == [0.5, 0.5, 1.0]
    assert not painted.has_interface


def test_textures_need_coordinates() -> None:
    bare = tl.Mesh(SQUARE.vertices, SQUARE.faces)
    with pytest.raises(
        tl.InputError, match="the surface has textures, but the mesh has no texture coordinates; unwrap the mesh"
    ):
        tl.Object(bare, surface=tl.Surface(emissive_texture=tl.Texture(PICTURE)))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((PICTURE[..., :2],), r"the pixels have the shape \(2, 4, 2\)"),
        ((PICTURE * 2,), "numbers of the pixels are outside 0 to 1"),
        ((PICTURE * np.nan,), "24 numbers of the pixels are outside 0 to 1"),
        (("red",), "the pixels are not numbers"),
        ((PICTURE, (1, 2, 3)), "texture scale"),
        ((PICTURE, (1, 1), (0, 0), float("inf")), "texture rotation inf; the rotation must be finite"),
        (
            (PICTURE, (1, 1), (0, 0), 0.0, ("repeat", "mirror")),
            "texture wrap .* the value must be two of the words repeat and clamp",
        ),
    ],
)
def test_a_texture_that_is_none_is_refused(arguments: tuple[Any, ...], message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        tl.Texture(*arguments)


def test_row_0_is_the_top_and_texels_are_met_at_their_centers() -> None:
    texture = tl.Texture(PICTURE)
    np.testing.assert_allclose(texture.sample([0.125, 0.75]), PICTURE[0, 0], atol=1e-7)
    np.testing.assert_allclose(texture.sample([0.875, 0.25]), PICTURE[1, 3], atol=1e-7)
    np.testing.assert_allclose(texture.sample([0.25, 0.25]), (PICTURE[1, 0] + PICTURE[1, 1]) / 2, atol=1e-7)


@pytest.mark.parametrize("wrap", ["repeat", "clamp"])
def test_beyond_the_picture_it_is_repeated_or_its_edge_goes_on(wrap: Any) -> None:
    texture = tl.Texture(PICTURE, wrap=(wrap, wrap))
    expected = PICTURE[0, 1] if wrap == "repeat" else PICTURE[0, 3]
    np.testing.assert_allclose(texture.sample([1.375, 0.75]), expected, atol=1e-7)
    expected = PICTURE[0, 1] if wrap == "repeat" else PICTURE[1, 1]
    np.testing.assert_allclose(texture.sample([0.375, -0.25]), expected, atol=1e-7)


def test_coordinates_are_scaled_then_turned_then_moved() -> None:
    texture = tl.Texture(PICTURE, (2.0, 3.0), (0.5, 0.25), 90.0)
    np.testing.assert_allclose(texture.rows @ [1, 0, 1], [0.5, 2.25], atol=1e-15)
    np.testing.assert_allclose(texture.rows @ [0, 1, 1], [-2.5, 0.25], atol=1e-15)
