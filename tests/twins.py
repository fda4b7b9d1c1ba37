"""Arguments for functions in shaders/lib, and how near they must be to their float64 twins in Python."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import numpy.typing as npt

from translucent.formulas import (
    bsdf,
    color,
    diffusion,
    interface,
    light,
    optics,
    phase,
    spherical_harmonics,
    thin_film,
    tone,
    two_stream,
)
from translucent.formulas.diffuse_interface import diffuse_interface
from translucent.media import density
from translucent.scene import camera, environment

MODULES: dict[str, ModuleType] = {
    "optics": optics,
    "interface": interface,
    "thin_film": thin_film,
    "light": light,
    "bsdf": bsdf,
    "phase": phase,
    "two_stream": two_stream,
    "diffusion": diffusion,
    "spherical_harmonics": spherical_harmonics,
    "color": color,
    "density": density,
    "environment": environment,
    "ray": camera,
    "tone": tone,
}

DEPTHS = np.concatenate(
    [[0.0], np.geomspace(1e-30, 1e4, 200), [0.5, np.nextafter(0.5, 0), 87.0, 88.8, 104.0, 1e5, 1e30]]
)
COSINES = np.concatenate([np.linspace(-1, 1, 41), [1e-30, 1e-6, 1e-3, 1 - 1e-6]])
UNIT = np.concatenate([np.linspace(0, 1, 33), np.geomspace(1e-30, 1, 40), 1 - np.geomspace(1e-7, 0.1, 20)])


def _mixed(*grids: np.ndarray) -> list[np.ndarray]:
    """All combinations, as one float32 array per parameter."""
    return [axis.ravel().astype(np.float32) for axis in np.meshgrid(*grids, indexing="ij")]


def _triples(values: np.ndarray) -> np.ndarray:
    return np.stack([values, np.roll(values, 7), values[::-1]], axis=1).astype(np.float32)


def _unit_vectors() -> np.ndarray:
    vectors = np.random.default_rng(5).normal(size=(200, 3))
    return (vectors / np.linalg.norm(vectors, axis=1, keepdims=True)).astype(np.float32)


def _facet_arguments() -> list[np.ndarray]:
    rng = np.random.default_rng(6)
    towards = _unit_vectors()
    towards[:, 2] = np.abs(towards[:, 2])
    shares = rng.random((len(towards), 2)).astype(np.float32)
    return [towards, np.resize([1e-3, 0.09, 0.5, 1.0], len(towards)).astype(np.float32), shares]


def _emission_arguments() -> list[np.ndarray]:
    sigma, distance = _mixed(
        np.concatenate([[0.0], np.geomspace(1e-12, 1e6, 60)]), np.concatenate([[0.0], np.geomspace(1e-6, 1e3, 25)])
    )
    return [_triples(np.full_like(sigma, 3.0)), _triples(sigma), distance]


def _color_arguments() -> list[np.ndarray]:
    value, distance = _mixed(
        np.concatenate([np.geomspace(1e-30, 1, 80), 1 - np.geomspace(1e-7, 0.1, 20)]), np.geomspace(1e-6, 1e6, 13)
    )
    return [_triples(value), distance]


def _ray_arguments() -> list[np.ndarray]:
    pixels = np.stack(_mixed(np.array([0, 0.5, 320.25, 640.0]), np.array([0, 0.5, 240.0, 480.0])), axis=1)
    repeat = lambda row: np.tile(np.float32(row), (len(pixels), 1))  # noqa: E731
    return [pixels, repeat([640, 480]), repeat([0.55, 0, 0]), repeat([0, 0.41, 0.1]), repeat([0, 0, -1])]


def _backdrop_arguments() -> list[np.ndarray]:
    x, y, tiles = _mixed(np.linspace(0, 1.7, 60) + 1e-3, np.linspace(0, 1, 40) + 1e-3, np.array([1, 7, 8, 2.5]))
    return [np.stack([x, y], axis=1), tiles]


def _directions_and_normals() -> list[np.ndarray]:
    """Unit vectors and normals against them, with indices; without those within rounding of total reflection's edge."""
    normal = np.repeat(_unit_vectors(), 9, axis=0)
    side = np.cross(normal, np.roll(normal, 1, axis=1))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    cosine = np.resize([0.0, 1e-6, 1e-3, 0.1, 0.5, 0.7, 0.9, 0.9999, 1.0, 0.3], len(normal))[:, None]
    direction = (np.sqrt(1 - cosine**2) * side - cosine * normal).astype(np.float32)
    ior = np.resize([0.4, 1 / 1.5, 0.9, 1.0, 1.0001, 1.33, 1.5, 2.4], len(normal)).astype(np.float32)
    c = (direction.astype(np.float64) * normal).sum(axis=1)
    clear = np.abs((ior - 1.0) * (ior + 1.0) + c * c) > 1e-5
    return [direction[clear], normal[clear], ior[clear]]


def _slab_arguments() -> list[np.ndarray]:
    reflectance, depth = _mixed(UNIT, DEPTHS[::7])
    return [reflectance, _triples(depth)]


def _film_arguments() -> list[np.ndarray]:
    """Films of all thicknesses, without those within rounding of total reflection's edge, and grazing rays."""
    cosine, ior, film, metres = _mixed(
        np.array([1e-3, 0.1, 0.4, 0.8, 1.0]),
        np.array([1 / 1.5, 1.0, 1.5, 2.4]),
        np.array([1 / 1.5, 1.0, 1.33, 2.0]),
        np.array([0.0, 1e-9, 50e-9, 150e-9, 400e-9, 1.2e-6, 1e-4]),
    )
    clear = [np.abs((n - 1.0) * (n + 1.0) + cosine * cosine) > 1e-5 for n in (ior, film)]
    return [column[clear[0] & clear[1]] for column in (cosine, ior, film, metres)]


def _film_slab_arguments() -> list[np.ndarray]:
    front, back, depth = _mixed(UNIT[::4], np.array([0.0, 0.04, 0.5, 1.0]), DEPTHS[::13])
    return [_triples(front), back, np.repeat(depth[:, None], 3, axis=1)]


def _layer_arguments() -> list[np.ndarray]:
    grid = np.concatenate([[0.0], np.geomspace(1e-30, 1e4, 60), [1e5, 1e15]])
    k, s = _mixed(grid, grid)
    return [np.stack([k, np.roll(k, 7), k], axis=1), np.stack([s, np.roll(s, 7), s], axis=1)]


def _mirrored_arguments() -> list[np.ndarray]:
    """Layers with and without losses, between interfaces up to those of ior 4."""
    lossless = np.array([0.0, 1e-30, 1e-6, 1e-3, 0.1, 0.5, 0.9, 0.999, 1.0])
    back, kept, mirrored = _mixed(
        lossless, np.array([0.0, 1e-7, 0.3, 0.99, 1.0]), np.array([0.0, 1e-7, 0.3, 0.6, 0.95])
    )
    through = ((1.0 - back.astype(np.float64)) * kept).astype(np.float32)
    return [
        np.stack([back, np.roll(back, 225), back], axis=1),
        np.stack([through, 0 * back, through], axis=1),
        mirrored,
    ]


def _emergent_arguments() -> list[np.ndarray]:
    """From darkness to the light of the sun, along the surface and straight out of it."""
    light = np.array([0.0, 1e-30, 1e-3, 1.0, 1e5])
    fluence, entering, albedo, cosine = _mixed(
        light, light, np.array([0.0, 0.3, 1.0]), np.array([0, 1e-6, 0.3, 0.9, 1])
    )
    conductance = np.resize(np.float32([0.01, 0.2, 0.5]), len(cosine))
    mean_cosine = np.resize(np.float32([2 / 3, 0.85, 0.97, 1.0]), len(cosine))
    return [_triples(fluence), _triples(entering), _triples(albedo), conductance, mean_cosine, cosine]


def _first_event_arguments(count: int) -> list[np.ndarray]:
    """Phase functions, albedos and `count` cosines."""
    phases = np.array([(0, 0, 0, 0), (0.2, 0, 0, 0), (-0.5, 0, 0, 0), (0.85, 0, 0, 0), (0.6, -0.3, 4, 0.3)])
    number, *cosines = _mixed(np.arange(len(phases)), *[np.array([0.0, 0.3, 0.9, 1.0])] * count)
    scale = np.resize([1.0, 1.25, 4.0], len(number))
    return [phases[number.astype(int)].astype(np.float32), _triples(scale), *cosines]


def _ahead_arguments() -> list[np.ndarray]:
    """Optical depths, fractions of events ahead, g, cosines, and fractions that stay."""
    grids = [0, 1e-3, 0.5, 3, 30, 1e4], [0.0, 0.3, 0.9], [0.05, 0.4, 0.9, 0.98], [-1.0, 0.0, 0.75, 1.0]
    depth, ahead, anisotropy, cosine = _mixed(*map(np.array, grids))
    staying = np.resize(np.float32([1.0, 0.0, 0.4]), len(depth))
    return [_triples(depth), np.repeat(ahead[:, None], 3, axis=1), anisotropy, cosine, staying]


def _ahead_mirrored_arguments() -> list[np.ndarray]:
    """Cosines, interfaces, depths and g; beside the critical angle, at which the reflectance begins to be whole."""
    rows = [
        (cosine, ior, diffuse_interface(ior).reflected, diffuse_interface(ior).reflected_flux, depth, g)
        for cosine in (0.05, 0.4, 0.6, 0.8, 0.9, 0.97, 1.0)
        for ior in (1.0, 1.2, 1.33, 1.5, 2.4)
        for depth in (0.0, 1e-3, 0.5, 3.0, 30.0, 1e4)
        for g in (0.05, 0.6, 0.98)
    ]
    cosine, ior, reflected, reflected_flux, depth, g = np.array(rows, np.float32).T
    return [cosine, ior, reflected, reflected_flux, _triples(depth), g]


def _harmonic_arguments() -> list[np.ndarray]:
    """Transfer and light of both signs, some of whose products cancel or sum to less than nothing."""
    rng = np.random.default_rng(8)
    transfer, light = rng.normal(size=(2, 400, 9, 3)) * 10.0 ** rng.integers(-6, 7, (2, 400, 1, 1))
    light[:20] = 0.0
    return [transfer.astype(np.float32), light.astype(np.float32)]


def _turned_arguments() -> list[np.ndarray]:
    directions, turns = _unit_vectors(), np.array([0.0, 0.25, -0.7, 3.0], np.float32)
    directions = np.concatenate([directions, np.float32([[0, 1, 0], [0, -1, 0], [0, 0, -1], [1, 0, 0], [0, 1, 1e-18]])])
    return [np.repeat(directions, len(turns), axis=0), np.tile(turns, len(directions))]


def _cone_arguments() -> list[np.ndarray]:
    """Cones of all widths, and of no edge, about directions from next to their middle to the other side."""
    travel, cones = [], []
    for i, (inner, outer) in enumerate(((0.0, 0.8), (0.3, 0.31), (0.0, 0.001), (1.0, np.pi / 2), (0.0, 0.0))):
        axis = _unit_vectors()[i].astype(np.float64)
        aside = np.cross(axis, _unit_vectors()[i + 9])
        aside /= np.linalg.norm(aside)
        for angle in np.concatenate([np.linspace(0, 1.5, 40) * (outer or 1.0), np.linspace(0, np.pi, 9)]):
            travel.append(np.cos(angle) * axis + np.sin(angle) * aside)
            cones.append(light.light_cone(axis, inner, outer) if outer else light.ALL_AROUND)
    return [np.float32(travel), np.float32(cones)]


#: Radiance from below 0 to far above white, where curves bend, and in all mixtures of channels.
RADIANCE = np.concatenate([[-1.0, 0.0], np.geomspace(1e-6, 1e6, 90), np.linspace(0.01, 1.5, 60)])


def _cell_arguments() -> list[np.ndarray]:
    rng = np.random.default_rng(6)
    low, high = rng.random((2, 300, 4)) * 10.0 ** rng.integers(-6, 7, (2, 300, 1))
    share = np.concatenate([rng.random((292, 3)), np.indices((2, 2, 2)).reshape(3, 8).T])
    return [values.astype(np.float32) for values in (low, high, share)]


ANISOTROPIES = np.array([-0.99, -0.5, 0, 1e-7, 0.3, 0.9, 0.999])
#: Parameters of phase functions.
PHASES = np.array(
    [
        *([g, 0.0, 0.0, 0.0] for g in ANISOTROPIES),
        *([0.0, g, alpha, 1.0] for g in ANISOTROPIES[1:-1] for alpha in (0.0, 1.0, 30.0)),
        [0.99, 0.6, 27.0, 0.5],
    ],
    np.float32,
)


def _phase_arguments(values: np.ndarray) -> list[np.ndarray]:
    numbers, at = _mixed(np.arange(len(PHASES)), values)
    return [PHASES[numbers.astype(int)], at]


def _after_scattering_arguments() -> list[np.ndarray]:
    cosines, g = np.clip(COSINES[::3], -1, 1), np.array([0.0, 0.3, 0.85, 0.97])
    depths, levers = np.geomspace(1e-6, 200.0, 13), np.array([0.6, 1.0])
    *others, depth, lever = _mixed(cosines, g, np.array([0.0, 0.7]), depths, levers)
    return [*others, _triples(depth), lever]


#: Within the box, on its boundary, and what rounding puts outside.
ALONG = np.concatenate([np.linspace(0, 1, 13), [-1e-6, 1 + 1e-6, 1e-30, 1 - 1e-7]])

FILM = [np.float32([share, ior, metres]) for share in (0.0, 0.4, 1.0) for ior in (1.33, 2.0) for metres in (0.0, 4e-7)]


def _filmed_arguments() -> list[np.ndarray]:
    iors = np.array([1 / 1.5, 1.5]), np.array([1.0, 1.4])
    columns = _mixed(np.array([0.0, 0.04, 0.5]), np.array([0.1, 0.8, 1.0]), *iors, np.arange(len(FILM)))
    bare, cosine, ior, before, number = columns
    return [bare, cosine, ior, np.array(FILM)[number.astype(int)], before]


def _facing_arguments() -> list[np.ndarray]:
    facing, cosine, number = _mixed(np.array([0.02, 0.5, 1.0]), np.array([0.05, 0.5, 1.0]), np.arange(len(FILM)))
    return [np.array(FILM)[number.astype(int)], np.stack([facing, 0.5 * facing, facing], axis=1), cosine]


def _disc_arguments() -> list[np.ndarray]:
    middle, direction, _ = _directions_and_normals()
    radius = np.resize([0.0, 1e-3, 0.2, 0.9], len(middle)).astype(np.float32)
    return [np.concatenate([middle, radius[:, None]], axis=1), direction]


def _highlight_disc_arguments() -> list[np.ndarray]:
    disc, _ = _disc_arguments()
    aside = np.roll(disc[:, :3], 5, axis=0) * disc[:, 3:]
    towards = (disc[:, :3] + 0.9 * aside).astype(np.float64)
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    alpha = np.resize([1e-3, 0.02, 0.1, 0.3, 1.0], len(disc))
    return [column.astype(np.float32) for column in (towards, disc, alpha)]


def _base_arguments() -> list[np.ndarray]:
    light = _triples(np.array([0.0, 1e-3, 1.0, 1e5] * 6))
    share = np.resize([0.0, 0.3, 1.0], len(light)).astype(np.float32)
    color, passed = (_triples(np.linspace(*ends, len(light))) for ends in ((0, 1), (0.5, 0)))
    return [light, light[::-1].copy(), color, passed, share]


def _microfacet_arguments() -> list[np.ndarray]:
    direction, normal, _ = _directions_and_normals()
    alpha = np.resize([1e-3, 0.09, 0.5, 1.0], len(normal)).astype(np.float32)
    shares = np.random.default_rng(8).random((len(normal), 2)).astype(np.float32)
    # Where no component decides by rounding which axis the frame is made with.
    clear = np.abs(np.abs(normal[:, 0]) - 0.7) > 1e-5
    return [column[clear] for column in (normal, direction, alpha, shares)]


ARGUMENTS = {
    "filmed_reflectance": _filmed_arguments(),
    "thin_wall_exitance": _film_slab_arguments(),
    "microfacet_normal": _microfacet_arguments(),
    "masking_ratio": _mixed(UNIT[::3], np.linspace(-1, 1, 21), np.array([1e-4, 1e-2, 0.25, 1.0])),
    "kept_on_side": _directions_and_normals()[:2],
    "diffuse_radiance": _base_arguments(),
    "filmed_facing": _facing_arguments(),
    "microfacet_value": _mixed(UNIT[::3], UNIT[::4], UNIT[::5], np.array([1e-2, 0.25, 1.0])),
    "cone_attenuation": _cone_arguments(),
    "sphere_point": [np.random.default_rng(4).random((200, 3)).astype(np.float32)],
    "nearest_on_disc": _disc_arguments(),
    "highlight_disc": _highlight_disc_arguments(),
    "disc_peak": _mixed(np.array([1e-3, 0.09, 1.0]), np.array([0.0, 1e-6, 0.1, 0.9]), np.array([1e-3, 0.3, 1.0])),
    "linear_density": _mixed(ALONG, np.array([0.0, 1.0, 1e-6, 1e12]), np.array([0.0, 1.0, 3.0])),
    "exponential_density": _mixed(ALONG, np.array([1e-6, 1.0, 1e12]), np.array([0.0, -1e-7, 1e-3, -0.5, 3.0, -60.0])),
    "exponential_density_mean": _mixed(
        ALONG, ALONG, np.array([1e-6, 1e12]), np.array([0.0, -1e-7, 1e-3, -0.5, 3.0, -60.0])
    ),
    "trilinear": _cell_arguments(),
    "transmittance": [_triples(DEPTHS)],
    "opacity": [_triples(DEPTHS)],
    "mean_transmittance": [_triples(DEPTHS)],
    "extinction_from_color": _color_arguments(),
    "log_one_minus": [UNIT[UNIT < 0.999].astype(np.float32)],
    "emitted_radiance": _emission_arguments(),
    "opacity_for_step": _mixed(
        np.concatenate([np.linspace(0, 1, 33), np.geomspace(1e-12, 0.5, 40)]), np.array([0.0, 1e-3, 0.5, 1, 2, 64])
    ),
    "composite_over": [_triples(UNIT), UNIT.astype(np.float32), _triples(UNIT[::-1])],
    "fresnel_dielectric": _mixed(UNIT, np.array([0.5, 1 / 1.5, 0.9, 1.0, 1.0001, 1.33, 1.5, 2.4])),
    "refracted_cosine": _mixed(UNIT, np.array([1 / 1.5, 1.0, 1.0001, 1.33, 1.5, 2.4])),
    "thin_layer_thickness": _mixed(np.array([1e-6, 1e-3, 1.0]), COSINES, np.array([1.0, 1.33, 1.5])),
    "henyey_greenstein": _mixed(np.clip(COSINES, -1, 1), ANISOTROPIES),
    "henyey_greenstein_cosine": _mixed(UNIT, ANISOTROPIES),
    "draine": _mixed(np.clip(COSINES, -1, 1), ANISOTROPIES, np.array([0.0, 1.0, 30.0, 1e4])),
    "draine_cosine": _mixed(UNIT, ANISOTROPIES[1:-1], np.array([0.0, 1.0, 30.0])),
    "phase_value": _phase_arguments(np.clip(COSINES, -1, 1)),
    "phase_after_scattering": _after_scattering_arguments(),
    "phase_cosine": _phase_arguments(UNIT),
    "reflected_direction": _directions_and_normals()[:2],
    "refracted_direction": _directions_and_normals(),
    "channel_iors": _mixed(np.array([1.0, 1.0001, 1.33, 1.5, 2.4]), np.array([0.0, 0.1, 0.36, 1.0, 20.0, 100.0])),
    "ggx_distribution": _mixed(UNIT, np.array([1e-4, 1e-2, 0.25, 1.0])),
    "ggx_visibility": _mixed(UNIT[::3], UNIT[::2], np.array([1e-4, 1e-2, 0.25, 1.0])),
    "smith_lambda": _mixed(UNIT, np.array([0.0, 1e-4, 1e-2, 0.25, 1.0])),
    "ggx_visible_normal": _facet_arguments(),
    "slab_transmittance": _slab_arguments(),
    "slab_reflectance": _slab_arguments(),
    "film_interference": [np.concatenate([[0.0], np.geomspace(1e-10, 1e-4, 200)]).astype(np.float32)],
    "thin_film_reflectance": _film_arguments(),
    "film_slab_transmittance": _film_slab_arguments(),
    "film_slab_reflectance": _film_slab_arguments(),
    "two_stream_absorption": [_triples(DEPTHS)],
    "two_stream_scattering": [_triples(DEPTHS), np.resize([-0.9, 0.0, 0.5, 0.99], len(DEPTHS)).astype(np.float32)],
    **dict.fromkeys(
        (
            "two_stream_depth",
            "two_stream_denominator",
            "two_stream_reflectance",
            "two_stream_transmittance",
            "multiple_reflectance",
        ),
        _layer_arguments(),
    ),
    "mirrored_reflectance": _mirrored_arguments(),
    "mirrored_transmittance": _mirrored_arguments(),
    "emergent_radiance": _emergent_arguments(),
    "first_events_excess": _first_event_arguments(1),
    "mean_first_events_excess": _first_event_arguments(2),
    "staying_fraction": _mixed(np.array([0.0, 0.1, 0.7, 1.0]), np.array([0.05, 0.4, 0.9, 0.98])),
    "last_event_fraction": [np.array([0.0, 1e-4, 0.03, 0.1, 1.0, 10.0, 80.0, 1e4], np.float32)],
    "scattered_ahead": _ahead_arguments(),
    "ahead_mirrored": _ahead_mirrored_arguments(),
    "real_harmonics": [np.concatenate([_unit_vectors(), np.eye(3, dtype=np.float32), -np.eye(3, dtype=np.float32)])],
    "scattered_radiance": _harmonic_arguments(),
    "exit_lobe": _mixed(UNIT, np.array([1.0, 1.0001, 1.33, 1.5, 2.4]), np.array([0.5, 0.91, 1.0])),
    "srgb_to_linear": [_triples(np.linspace(-1, 2, 301))],
    "linear_to_srgb": [_triples(np.concatenate([np.linspace(-1, 2, 301), np.geomspace(1e-9, 1, 60)]))],
    "luminance": [_triples(UNIT)],
    "exposure_scale": [np.linspace(-12, 12, 49, dtype=np.float32)],
    "gradient_share": [_unit_vectors()],
    "gradient_irradiance_share": [_unit_vectors()],
    "checkerboard_share": _backdrop_arguments(),
    "equirectangular_uv": _turned_arguments(),
    "view_ray": _ray_arguments(),
    "tone_none": [_triples(RADIANCE)],
    "tone_neutral": [_triples(RADIANCE)],
    "tone_agx": [_triples(RADIANCE)],
    "agx_sigmoid": [np.linspace(0, 1, 301, dtype=np.float32)],
}

#: Relative error in units of float32 rounding (6e-8), and absolute floor, by function. exp(-x) multiplies the rounding
#: of x by x, which `_allowed` adds; what is listed covers the few roundings of a formula and the driver's exp and log.
ROUNDINGS = dict.fromkeys(ARGUMENTS, 16.0) | {
    "opacity_for_step": 64.0,  # log of a rounded 1 - alpha, restored by a quotient
    "srgb_to_linear": 64.0,  # pow multiplies the error of the logarithm by 2.4 log(x)
    "linear_to_srgb": 64.0,
    "henyey_greenstein": 64.0,  # a power of 1.5 of a small difference
    "draine": 64.0,
    "phase_value": 64.0,
    "first_events_excess": 64.0,
    "mean_first_events_excess": 64.0,
    "phase_after_scattering": 256.0,  # the same, 16 times
    "scattered_ahead": 256.0,
    "equirectangular_uv": 4096.0,
    "tone_agx": 64.0,  # powers
}
FLOOR = {
    "last_event_fraction": 1e-4,  # difference of inverse depths
    "ahead_mirrored": 1e-3,  # drivers find angles to 4e-4
    "scattered_ahead": 2e-5,  # differences of moments of order 0
    "first_events_excess": 1e-5,  # less 1
    "mean_first_events_excess": 1e-5,
    "filmed_reflectance": 4e-5,  # as thin_film_reflectance
    "filmed_facing": 2e-4,  # the same, over 1 - (1 - cos)^5, which is above 0.2 here
    "microfacet_normal": 1e-5,  # near normal incidence the axes across it are as wrong as its sine is small
    "kept_on_side": 4e-7,
    "phase_after_scattering": 4e-6,  # differences of moments up to 8 times that of order 0
    "fresnel_dielectric": 2e-7,
    "refracted_cosine": 1e-7,
    # Cosines of some 50 radians, good to a rounding of those; mixed by a matrix whose rows add up to 5.
    "film_interference": 4e-5,
    "thin_film_reflectance": 4e-5,
    "film_slab_reflectance": 4e-7,
    "exit_lobe": 4e-7,  # that of Fresnel's reflectance, over half
    "real_harmonics": 4e-7,  # differences of squares up to 1
    "composite_over": 1e-7,
    "gradient_share": 1e-7,
    "view_ray": 1e-7,
    "luminance": 1e-9,
    "extinction_from_color": 0.0,
    "reflected_direction": 4e-7,  # sums of products of components up to 1
    "refracted_direction": 4e-7,
    # Differences of shares up to 1, each good to a few roundings.
    "tone_neutral": 2e-7,
    "agx_sigmoid": 4e-7,
    "tone_agx": 1e-6,
    "multiple_reflectance": 5e-7,
    "ggx_visible_normal": 1e-6,  # of a unit vector; sine and cosine are as good as that
}


def _density(name: str, cosine: np.ndarray, arguments: list[np.ndarray]) -> np.ndarray:
    """Phase function in 1/sr by which a cosine is drawn: random numbers as far apart as 1 move it by 1 / (2 pi p)."""
    if name == "henyey_greenstein_cosine":
        return phase.henyey_greenstein(cosine, arguments[1])
    if name == "draine_cosine":
        return phase.draine(cosine, *arguments[1:])
    g, draine_g, alpha, weight = arguments[0].T
    first = (weight > 0) & (arguments[1] <= weight)
    return np.where(first, phase.draine(cosine, draine_g, alpha), phase.henyey_greenstein(cosine, g))


def _allowed(name: str, exact: np.ndarray, arguments: list[np.ndarray]) -> np.ndarray:
    eps = float(np.finfo(np.float32).eps) / 2
    allowed = ROUNDINGS[name] * eps * np.abs(exact) + FLOOR.get(name, 0.0)
    if name == "transmittance":
        allowed = allowed + eps * np.minimum(arguments[0], 200.0) * exact * 4
    if name == "two_stream_transmittance":
        depth = two_stream.two_stream_depth(*arguments)
        allowed = allowed + eps * np.minimum(depth, 200.0) * exact * 4
    if name.startswith("mirrored_"):
        # Each share is divided by 1 - r (R +- T), which is good to a rounding of 1.
        back, through, mirrored = arguments
        left = np.stack([1.0 - mirrored * (back + through), 1.0 - mirrored * (back - through)])
        allowed = allowed + 4 * eps * (np.abs(exact) / left).sum(axis=0)
    if name == "scattered_radiance":
        # Of both signs, too.
        allowed = allowed + 8 * eps * np.abs(arguments[0] * arguments[1]).sum(axis=1)
    if name in ("henyey_greenstein_cosine", "draine_cosine", "phase_cosine"):
        allowed = allowed + 8 * eps / (2 * np.pi * _density(name, exact, arguments)) + 4 * eps
    if name == "cone_attenuation":
        # Each component of the chord is a difference of numbers as large as the length of the cone's vector; the offset
        # is as large as the squared chord at the edge.
        travel, cone = (argument.astype(np.float64) for argument in arguments)
        size = np.linalg.norm(cone[:, :3], axis=1)
        chord = np.linalg.norm(size[:, None] * travel - cone[:, :3], axis=1)
        allowed = allowed + 2 * np.sqrt(exact) * eps * (8 * chord * size + 4 * cone[:, 3]) + (8 * eps * size) ** 2
    if name == "emitted_radiance":
        allowed = allowed + 1e-37
    if name.startswith("exponential_density"):
        # An exponential multiplies the rounding of its exponent, and of the position in it, by up to the exponent.
        allowed = allowed + 4 * eps * np.abs(arguments[-1]) * np.abs(exact)
    if name == "linear_density":
        allowed = allowed + 4 * eps * np.maximum(arguments[1], arguments[2])  # mix may cancel
    if name == "sphere_point":
        allowed = allowed + 8 * eps  # a rounding of 2 pi is one of a cosine of 0
    if name in {"nearest_on_disc", "highlight_disc"}:
        # The middle, 1 long, and what is added to it may cancel down to 1 less the radius.
        allowed = allowed + 8 * eps / (1.0 - arguments[-2 if name == "nearest_on_disc" else 1][:, 3:])
    if name == "trilinear":
        allowed = allowed + 8 * eps * np.maximum(arguments[0], arguments[1]).max(axis=1)
    return allowed + 1.2e-38  # below the smallest normal number everything may flush to 0


def assert_equals_twin(
    library: str, name: str, returns: str, arguments: list[np.ndarray], found: npt.ArrayLike, slack: float = 1.0
) -> None:
    """Fail where what a function has found is off by more than float32 allows, times `slack`."""
    found = np.asarray(found, np.float64)
    wide = [a.astype(np.float64) for a in arguments]
    by_channel = library in {"optics", "two_stream", "diffusion"} or name.startswith(("slab_", "phase_after"))
    if by_channel and returns == "vec3":
        wide = [a[:, None] if a.ndim == 1 else a for a in wide]
    with np.errstate(under="ignore"):
        exact = np.asarray(getattr(MODULES[library], name)(*wide))
    assert np.isfinite(found).all()
    with np.errstate(under="ignore"):
        allowed = slack * _allowed(name, exact, wide)
        excess = np.abs(found - exact) / allowed
    worst = np.unravel_index(excess.argmax(), excess.shape)
    row = worst[0]
    assert (excess <= 1).all(), (
        f"{name}{tuple(np.asarray(a)[row].tolist() for a in arguments)} = {found[worst]:.9g}, "
        f"exact {exact[worst]:.9g}, {excess[worst]:.1f} times the allowed error"
    )
