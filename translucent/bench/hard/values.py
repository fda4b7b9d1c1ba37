"""Hard cases of numbers: colors, distances, optical depths, angles, anisotropy, densities."""

from __future__ import annotations

import dataclasses
from functools import partial

import numpy as np

from translucent import reference
from translucent.bench.hard.cases import SIZE, Checks, Hard
from translucent.formulas import optics
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Sphere
from translucent.media.density import DensityGrid
from translucent.media.medium import Medium
from translucent.planning.methods import FragmentLists
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import PointLight
from translucent.scene.scene import Object, Scene
from translucent.scene.showcase import showcase

#: Relative rounding error of a formula of a few steps in float64.
ROUNDING = 1e-14


def _grazing(checks: Checks) -> None:
    cosines = np.array([1.0, 1e-3, 1e-6, 0.0, -1e-6, -0.5])
    path = optics.thin_layer_thickness(1e-3, cosines)
    checks.error("t / max(0.001, n.v)", np.max(np.abs(path / (1e-3 / np.maximum(cosines, 1e-3)) - 1)))
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], dtype=np.float64)
    square = Mesh(corners, np.array([(0, 1, 2), (0, 2, 3)], dtype=np.int32), name="square")
    sheet = Object(square, Medium(absorption=(1, 1, 1)), sheet_thickness=1e-3)
    for height in (1e-2, 0.0, -1e-2):
        camera = Camera.look_at((0, -4, height), (0, 0, 0), up=(0, 0, 1), fov_y=40)
        frame = checks.render(Scene([sheet], camera))
        finite = np.isfinite(frame.radiance).all() and np.isfinite(frame.thickness).all()
        checks.holds(f"sheet seen from {height:g} m above its plane: finite, at most 1000 t", finite)
        checks.holds("and within its bound", frame.thickness.max() <= 1.0 + 1e-4)


def _channels(checks: Checks) -> None:
    kept = Medium.from_color((1.0, 1e-30, 0.5), 0.1)
    checks.error("1, 1e-30 and 0.5 come back", np.max(np.abs(kept.transmittance(0.1) / (1.0, 1e-30, 0.5) - 1)))
    checks.holds("t_c = 1 absorbs exactly nothing", kept.extinction[0] == 0)
    for value in (0.0, 1.0 + 1e-9, -0.1, np.nan):
        checks.refused(f"t_c = {value:.3g}", partial(Medium.from_color, (0.5, value, 0.5), 1.0), "color")


def _distances(checks: Checks) -> None:
    for distance in (0.0, -1.0, np.nan):
        what = f"distance {distance:g}"
        checks.refused(what, partial(Medium.from_color, (0.5, 0.5, 0.5), distance), "distance")
    checks.refused("1e-320 m", lambda: Medium.from_color((0.5, 0.5, 0.5), 1e-320), "overflows")
    for distance in (1e-30, 1e30):
        medium = Medium.from_color((0.5, 0.5, 0.5), distance)
        checks.error(f"{distance:g} m comes back", np.max(np.abs(medium.transmittance(distance) - 0.5)))
    checks.holds("infinity leaves light as it is", (Medium.from_color((0.5,) * 3, np.inf).extinction == 0).all())


def _depths(checks: Checks) -> None:
    tau = 1e-12
    checks.error("opacity at tau = 1e-12", float(optics.opacity(tau)) / (tau - tau**2 / 2) - 1)
    checks.holds("T at 1e4 is 0", optics.transmittance(1e4) == 0)
    ball = Sphere().tessellate(32)
    for extinction, what in ((5e3, "1e4"), (1e30, "1e30")):
        frame = checks.render(showcase(ball, Medium(absorption=(extinction,) * 3), SIZE, stage="none"))
        middle = frame.transmittance[SIZE[1] // 2, SIZE[0] // 2]
        checks.holds(f"a body of depth {what} is black, nothing is NaN", (middle == 0).all())
        checks.holds("and finite", np.isfinite(frame.radiance).all() and np.isfinite(frame.optical_depth).all())
    thin = checks.render(showcase(ball, Medium(absorption=(1e-30,) * 3, emission=(1e-3,) * 3), SIZE, stage="none"))
    glow = thin.thickness.astype(np.float64) * 1e-3 + 0.0
    emitted = (
        thin.radiance[..., 0]
        - checks.render(showcase(ball, Medium(absorption=(1e-30,) * 3), SIZE, stage="none")).radiance[..., 0]
    )
    # The two pictures differ by the emission, each rounded to float32 near 1.
    checks.holds("emission without extinction is q d", np.abs(emitted - glow).max() <= 4 * np.finfo(np.float32).eps)


def _phases(checks: Checks) -> None:
    for g in (1.0, -1.0, np.nan):
        checks.refused(f"g = {g:g}", partial(Medium, scattering=(1,) * 3, anisotropy=g), "anisotropy")
    ball = Sphere().tessellate(24)
    eye = Camera.look_at((0, 0.3, 3.2), (0, 0, 0), fov_y=45)
    for g, where, position in (
        (0.99, "behind", (0.0, 0.4, -3.0)),
        (-0.99, "beside", (2.5, 0.5, 1.0)),
        (0.2, "inside", (0.2, 0.3, 0.1)),
        (0.2, "on the surface", tuple(ball.vertices[200])),
    ):
        milky = Medium(absorption=(0.1,) * 3, scattering=(1.0,) * 3, anisotropy=g)
        scene = Scene([Object(ball, milky)], eye, [PointLight(position, (5.0,) * 3)], Environment.constant((0, 0, 0)))
        size = (20, 20)
        frame, truth = (
            checks.render(scene, size, FragmentLists(light_points=16)),
            reference.render(scene, size, tolerance=1e-3),
        )
        checks.holds(f"light {where}, g = {g:g}: all finite", np.isfinite(frame.radiance).all())
        both = frame.coverage & truth.coverage & frame.valid & truth.valid
        right = truth.radiance[both]
        error = np.abs(frame.radiance[both] - right)
        checks.error(f"light {where}, g = {g:g}: median", np.median(error) / np.sqrt(np.mean(right**2)))


def _densities(checks: Checks) -> None:
    checks.refused("NaN", lambda: DensityGrid([[[np.nan]]]), "densit")
    checks.refused("a negative density", lambda: DensityGrid([[[-1.0]]]), "densit")
    ball = Sphere().tessellate(32)
    medium = Medium(absorption=(1.0, 0.5, 0.2))
    plain = showcase(ball, medium, SIZE, stage="none")
    truth = reference.render(plain, SIZE)

    def filled(values: object) -> Scene:
        return dataclasses.replace(plain, objects=[Object(ball, medium, density=DensityGrid(values))])  # type: ignore[arg-type]

    one = reference.render(filled([[[1.0]]]), SIZE)
    checks.error("one voxel of 1 is no grid", np.abs(one.transmittance - truth.transmittance).max())
    empty = reference.render(filled(np.zeros((3, 3, 3))), SIZE)
    checks.error("a grid of zeros is clear", np.abs(empty.transmittance - 1.0).max())
    mixed = np.zeros((4, 4, 4))
    mixed[:2] = 1.0
    half = reference.render(filled(mixed), SIZE)
    checks.holds("zeros beside ones are finite", np.isfinite(half.radiance).all() and half.valid.all())


CASES = (
    Hard(
        "H01",
        "grazing n.v, 0 and below",
        "bounded: a sheet's path is t / max(0.001, n.v), from any side, to float64's rounding",
        _grazing,
        ROUNDING,
        "relative",
    ),
    Hard(
        "H02",
        "transmitted color 0, 1, above 1, NaN",
        "1 absorbs nothing; all others that no medium can have are a clear error",
        _channels,
        1e-13,  # exp and log of a depth of 69, of which each rounding is 69 times as large in the color
        "relative",
    ),
    Hard(
        "H03",
        "distance 0, negative, 1e-30, 1e30, infinite",
        "infinity is clear, 1e-30 and 1e30 exact; all that give no finite extinction are a clear error",
        _distances,
        ROUNDING,
        "absolute",
    ),
    Hard(
        "H04",
        "optical depth 1e-12 and 1e4",
        "no cancellation (expm1), and underflow to exactly 0; no NaN",
        _depths,
        ROUNDING,
        "relative",
    ),
    Hard(
        "H23",
        "anisotropy near 1 and -1, light inside and on the surface",
        "|g| = 1 is a clear error; all else finite, with a median error of 1 % (16 points against a near light)",
        _phases,
        1e-2,
        "of the RMS radiance",
    ),
    Hard(
        "H24",
        "density grid with zeros, NaN, one voxel",
        "zeros are clear, one voxel of 1 is a homogeneous body, NaN is a clear error",
        _densities,
        1e-12,
        "transmittance",
    ),
)
