"""Directions that stand for an environment's light: all of it is counted, and shadows converge."""

import numpy as np
import pytest

import translucent as tl
from translucent.scene.environment_map import row_solid_angles, texel_directions
from translucent.scene.shadow_directions import shadow_directions


def _sun():
    """A sky with most of its light in 0.02 % of it, low on one side."""
    pixels = np.full((64, 128, 3), (0.4, 0.5, 0.7), dtype=np.float32)
    pixels[20:22, 30:32] = (900.0, 800.0, 600.0)
    return tl.Environment.image(pixels)


def _colored():
    """Red light from one side, and blue light from the other."""
    x = texel_directions(32, 64)[..., 0]
    return tl.Environment.image(np.stack([np.maximum(x, 0), 0.2 + 0 * x, np.maximum(-x, 0)], axis=-1))


ENVIRONMENTS = {
    "constant": tl.Environment.constant((0.5, 1.0, 2.0)),
    "gradient": tl.Environment.gradient((0.1, 0.1, 0.1), (1.0, 1.2, 1.5)),
    "checkerboard": tl.Environment.checkerboard(),
    "studio": tl.Environment.studio(30.0, 1.0),
    "sun": _sun(),
    "colored": _colored(),
}


def _unit(count, seed=1):
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _irradiance_error(environment, count):
    """Root mean square error of the directions' irradiance over normals, relative to the mean over normals."""
    normals = _unit(200)
    directions, irradiance = shadow_directions(environment, count)
    found = np.maximum(normals @ directions.T, 0.0) @ irradiance
    true = environment.irradiance_on(normals)
    return float(np.sqrt(np.mean((found / true.mean(axis=0) - true / true.mean(axis=0)) ** 2)))


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_directions_carry_the_irradiance_of_their_environment(name):
    # A cell is 0.6 rad wide at 32 directions; its cosine is off where a surface's horizon cuts it.
    errors = [_irradiance_error(ENVIRONMENTS[name], count) for count in (8, 32, 128)]
    assert errors[1] <= 0.025
    assert errors[2] <= 0.6 * errors[1]
    assert errors[1] <= 0.6 * errors[0]


@pytest.mark.parametrize("count", [1, 3, 32])
@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_all_light_is_counted(name, count):
    environment = ENVIRONMENTS[name]
    directions, irradiance = shadow_directions(environment, count)
    assert directions.shape == irradiance.shape == (count, 3)
    assert np.abs(np.linalg.norm(directions, axis=1) - 1.0).max() <= 1e-12
    assert (irradiance >= 0).all()
    # Pictures of 64 rows and less are looked up between their pixels, which moves light next to the poles.
    assert irradiance.sum(axis=0) == pytest.approx(4 * np.pi * environment.mean, rel=1e-3)


@pytest.mark.parametrize("name", ["constant", "studio", "sun", "colored"])
def test_shadow_of_a_cap_converges(name):
    """Irradiance that opaque discs in random directions leave, against sums over all pixels of the sky."""
    environment, normals = ENVIRONMENTS[name], _unit(40)
    centers, cosines = _unit(30, 2), np.random.default_rng(3).uniform(0.2, 0.9, 30)
    ways = texel_directions(128, 256).reshape(-1, 3)
    light = environment.lighting(ways) * np.repeat(row_solid_angles(128, 256), 256)[:, None]

    def left(directions, irradiance):
        cosine, open_to = np.maximum(normals @ directions.T, 0.0), centers @ directions.T < cosines[:, None]
        seen = np.stack([cosine @ (irradiance * way[:, None]) for way in open_to])
        # Green alone: every normal has some of it in each of these.
        return seen[..., 1] / (cosine @ irradiance)[:, 1]

    true = left(ways, light)
    errors = [np.sqrt(np.mean((left(*shadow_directions(environment, count)) - true) ** 2)) for count in (8, 32, 128)]
    assert errors[1] <= 0.06
    # Quadrupling the directions at least halves the error, but for chance.
    assert errors[2] <= 0.55 * errors[1]
    assert errors[1] <= 0.7 * errors[0]


@pytest.mark.parametrize("count", [100, 128])
def test_every_16th_direction_comes_from_all_sides(count):
    """As many even points on a sphere have a mean near its center; a slice of it has one near its surface."""
    directions, _ = shadow_directions(tl.Environment.constant((1.0, 1.0, 1.0)), count)
    for first in range(16):
        assert np.linalg.norm(directions[first::16].mean(axis=0)) < 0.5


def test_every_normal_has_directions():
    normals = _unit(2000)
    for environment in ENVIRONMENTS.values():
        directions, irradiance = shadow_directions(environment, 32)
        assert (np.maximum(normals @ directions.T, 0.0) @ (irradiance.max(axis=1) > 0)).min() > 0.5


def test_an_image_takes_its_directions_along():
    plain, turned = _sun(), tl.Environment.image(_sun().map, 90.0, 2.0)
    directions, irradiance = shadow_directions(plain, 16)
    turned_directions, brighter = shadow_directions(turned, 16)
    # Counterclockwise as seen from above: what was ahead, along -z, is then to the left, along -x.
    assert turned_directions == pytest.approx(directions[:, [2, 1, 0]] * (1, 1, -1), abs=1e-12)
    assert brighter == pytest.approx(4.0 * irradiance, rel=1e-12)
    towards = turned_directions[irradiance.sum(axis=1).argmax()]
    assert turned.lighting(towards)[0] > 100


def test_directions_are_the_same_each_time_and_read_only():
    first, again = (shadow_directions(tl.Environment.studio(), 32) for _ in range(2))
    for one, other in zip(first, again, strict=True):
        assert np.array_equal(one, other)
        with pytest.raises(ValueError, match="read-only"):
            one[0] = 0.0


def test_black_environments_have_directions_without_light():
    directions, irradiance = shadow_directions(tl.Environment.constant(0.0), 32)
    assert np.isfinite(directions).all()
    assert not irradiance.any()


@pytest.mark.parametrize("number", [-1, 257, 0.5, "many", None, True])
def test_scenes_refuse_other_numbers_of_directions(number):
    ball = tl.Object(tl.Mesh(np.eye(3), [[0, 1, 2]]))
    camera = tl.Camera.look_at((0, 0, 3), (0, 0, 0))
    with pytest.raises(tl.InputError, match="environment_shadows"):
        tl.Scene([ball], camera, environment_shadows=number)
