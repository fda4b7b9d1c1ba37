"""Promises of every bake: the same bits again, honest errors, a way out, and clear refusals."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from translucent.bake import measure, strips
from translucent.bake import rays as directions
from translucent.bake import rays as following
from translucent.bake.measure import RayMean, block_edges
from translucent.bake.rays import Directions, _plain_sobol
from translucent.bake.settings import BakeSettings
from translucent.formulas.sampling import MOST_POINTS
from translucent.geometry.solids import Box, Sphere, Torus

MEDIUM = tl.Medium(absorption=(10.0, 20.0, 40.0))


@pytest.fixture(scope="module")
def bumpy() -> tl.Mesh:
    """A ring with bumps, and with texture coordinates."""
    ring = Torus(0.04, 0.012).tessellate(32)
    bumps = 1.0 + 0.1 * np.sin(300.0 * ring.vertices[:, [1, 2, 0]])
    return tl.bake_thickness(tl.Mesh(ring.vertices * bumps, ring.faces), 64, mode="normal").mesh


def same(one: tl.ThicknessMap, other: tl.ThicknessMap) -> bool:
    return all(
        np.array_equal(getattr(one, name), getattr(other, name)) for name in ("values", "coverage", "standard_error")
    )


@pytest.mark.parametrize(
    "asked",
    [
        {"mode": "cone"},
        {"mode": "cone", "gaps": "total", "supersample": 2},
        {"mode": "cone", "tolerance": 1e-3},
        {"mode": "transmittance", "medium": MEDIUM, "weighting": "uniform"},
        {"mode": "local"},
        {"mode": "inscribed"},
    ],
    ids=str,
)
def test_the_same_bits_in_any_number_of_threads_and_chunks(
    asked: dict, bumpy: tl.Mesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = tl.bake_thickness(bumpy, 24, rays=16, threads=1, **asked)
    assert same(one, tl.bake_thickness(bumpy, 24, rays=16, threads=2, **asked))
    for texels, rays in ((24 * 7, 1001), (1 << 20, 1 << 20)):
        monkeypatch.setattr(strips, "STRIP_TEXELS", texels)
        monkeypatch.setattr(measure, "CHUNK_RAYS", rays)
        monkeypatch.setattr(directions, "CACHED_RAYS", rays // 3)
        monkeypatch.setattr(following, "CACHED_RAYS", rays // 3)
        monkeypatch.setattr(following, "FOLLOWED_RAYS", rays // 5)
        assert same(one, tl.bake_thickness(bumpy, 24, rays=16, threads=2, **asked))


def test_settings_and_their_keywords_are_one(bumpy: tl.Mesh) -> None:
    asked = tl.BakeSettings(size=32, mode="normal", padding=2)
    whole = tl.bake_thickness(bumpy, asked)
    assert same(whole, tl.bake_thickness(bumpy, size=32, mode="normal", padding=2))
    assert same(whole, tl.bake_thickness(bumpy, tl.BakeSettings(size=32, mode="normal"), padding=2))
    assert whole.settings.summary() == asked.summary()
    of_vertices = tl.bake_vertex_thickness(bumpy, asked)
    assert np.array_equal(of_vertices.values, tl.bake_vertex_thickness(bumpy, mode="normal").values)
    assert (of_vertices.settings.size, of_vertices.settings.padding) == (1, 0)
    with pytest.raises(
        tl.InputError, match="thickness is baked per vertex; padding applies only to thickness maps; omit this setting"
    ):
        tl.bake_vertex_thickness(bumpy, padding=2)
    with pytest.raises(TypeError, match="unexpected keyword argument 'colour'"):
        tl.bake_thickness(bumpy, colour="red")


def test_a_seed_makes_another_map_of_the_same_mesh(bumpy: tl.Mesh) -> None:
    first, again, other = (tl.bake_thickness(bumpy, 32, rays=16, seed=seed) for seed in (3, 3, 4))
    assert same(first, again)
    assert not np.array_equal(first.values, other.values)
    both = np.hypot(first.standard_error, other.standard_error)[first.coverage]
    assert (np.abs(first.values - other.values)[first.coverage] <= 4 * both).mean() > 0.99


@pytest.mark.parametrize("weighting", ["cosine", "uniform"])
@pytest.mark.parametrize("rays", [8, 16, 64, 100])
def test_the_standard_error_is_an_upper_estimate(weighting: str, rays: int) -> None:
    """The spread of 256 independent estimates of a smooth mean and of a step's is at most the error they tell."""
    settings = BakeSettings(weighting=weighting, rays=rays)  # type: ignore[arg-type]
    cosine = Directions.of(settings).table[2].astype(float)
    edges = block_edges(0, rays, min(8, rays))
    for length in (2.0 * cosine, cosine**2, np.where(cosine > 0.77, 1.0, 0.2), 1.0 / (cosine + 0.1)):
        values, errors = RayMean("cone", np.inf, None).estimate(length, edges)
        assert values.std() <= 1.1 * np.sqrt((errors**2).mean())
        # And it is of use: no more than what as many independent rays would have.
        assert np.sqrt((errors**2).mean()) <= 1.2 * length.std() / np.sqrt(rays)


def test_points_before_scrambling_go_on_beyond_the_stored_ones() -> None:
    """A sequence of 5,000 points begins with the stored 4,096, and each of its blocks of 8 is in 8 different rows."""
    points = _plain_sobol(5000)
    assert np.array_equal(points[:MOST_POINTS], _plain_sobol(MOST_POINTS))
    rows = np.floor(8 * points).astype(int).reshape(-1, 8, 2)
    assert (np.sort(rows, axis=1) == np.arange(8)[:, None]).all()


def test_directions_have_the_density_that_is_said() -> None:
    for weighting, spread in (("cosine", 180.0), ("cosine", 70.0), ("uniform", 180.0), ("uniform", 70.0)):
        table = Directions.of(BakeSettings(weighting=weighting, spread=spread, rays=256)).table.astype(float)  # type: ignore[arg-type]
        x, y, z = table.reshape(3, -1)
        least = np.cos(np.radians(spread / 2))
        assert np.allclose(x * x + y * y + z * z, 1.0, atol=1e-6)
        assert z.min() >= least - 1e-6
        # The share of the density between the axis and z, which is uniform in 0..1.
        share = (1 - z * z) / (1 - least**2) if weighting == "cosine" else (1 - z) / (1 - least)
        assert np.allclose(np.histogram(share, 16, (0, 1))[0] / share.size, 1 / 16, atol=1e-3)
        assert abs(x.mean()) < 1e-3
        assert abs(y.mean()) < 1e-3


def test_a_tolerance_adds_rays_only_where_they_are_needed(bumpy: tl.Mesh) -> None:
    plain = tl.bake_thickness(bumpy, 64, rays=16)
    tolerance = float(np.median(plain.standard_error[plain.coverage])) / 2
    fine = tl.bake_thickness(bumpy, 64, rays=16, tolerance=tolerance)
    assert fine.report.max_standard_error <= tolerance
    assert fine.report.above_tolerance == 0
    assert 2 * plain.report.rays < fine.report.rays < 32 * plain.report.rays
    with pytest.warns(tl.TranslucentWarning, match="samples have an error above the tolerance"):
        never = tl.bake_thickness(Box().tessellate(), 8, rays=2, tolerance=1e-9)
    assert never.report.above_tolerance > 0


def test_a_tolerance_that_is_met_changes_nothing(bumpy: tl.Mesh) -> None:
    assert same(tl.bake_thickness(bumpy, 32), tl.bake_thickness(bumpy, 32, tolerance=10.0))


def holed(mesh: tl.Mesh, without: int) -> tl.Mesh:
    return tl.Mesh(mesh.vertices, mesh.faces[without:])


def test_an_open_mesh_bakes_and_says_what_escaped() -> None:
    mesh = holed(Sphere().tessellate(32), 60)
    with pytest.warns(tl.TranslucentWarning, match=r"of the rays found no exit \(the mesh has holes\)"):
        baked = tl.bake_thickness(mesh, 32)
    assert 0.01 < baked.escaped < 0.2
    assert baked.escaped == baked.report.escaped
    assert np.isfinite(baked.values).all()
    with pytest.warns(tl.TranslucentWarning, match="found no exit"):
        limited = tl.bake_thickness(mesh, 32, max_distance=3.0)
    # Who escapes counts as the limit, or not at all.
    assert limited.values[baked.coverage].mean() > baked.values[baked.coverage].mean()
    assert tl.bake_thickness(Sphere().tessellate(32), 32).escaped == 0.0


def test_a_sheet_has_no_thickness() -> None:
    sheet = tl.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)], [(0, 0), (1, 0), (0, 1)])
    with pytest.warns(tl.TranslucentWarning, match=r"100\.00%"):
        baked = tl.bake_thickness(sheet, 8)
    assert (baked.values == 0).all()


def test_faces_without_area_are_left_out() -> None:
    solid = Sphere().tessellate(16)
    more = tl.Mesh(solid.vertices, np.concatenate([solid.faces, [(3, 3, 5), (1, 2, 1)]]))
    with pytest.warns(tl.TranslucentWarning, match="2 faces without an area were left out"):
        found = tl.bake_vertex_thickness(more)
    assert np.array_equal(found.values, tl.bake_vertex_thickness(solid).values)
    with pytest.raises(tl.InputError, match="no face of the mesh has an area"):
        tl.bake_vertex_thickness(tl.Mesh([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)]))


def test_an_inverted_mesh_is_refused() -> None:
    solid = Sphere().tessellate(16)
    with pytest.raises(
        tl.InputError,
        match=r"all faces of the mesh point inwards; flip the faces \(tl\.load_mesh does so automatically\), or",
    ):
        tl.bake_thickness(tl.Mesh(solid.vertices, solid.faces[:, ::-1]), 16)


REFUSALS = [
    ({"rays": 0}, "rays 0; not a whole number in 2 to"),
    ({"rays": 1}, "rays 1; not a whole number in 2 to"),
    ({"rays": 2.5}, "rays 2.5; not a whole number"),
    ({"size": 0}, "size 0; not a whole number in 1 to"),
    ({"size": 10**6}, "size 1000000; not a whole number in 1 to"),
    ({"spread": 0.0}, "spread 0.0; the angle must satisfy 0 < spread <= 180 degrees"),
    ({"spread": 181}, "spread 181; the angle must satisfy 0 < spread <= 180 degrees"),
    ({"spread": float("nan")}, "spread nan; the angle must satisfy 0 < spread <= 180 degrees"),
    ({"mode": "mean"}, "mode 'mean'; not known; use one of normal, cone, transmittance, inscribed, local"),
    ({"weighting": "linear"}, "weighting 'linear'; not known; use one of cosine, uniform"),
    ({"gaps": "all"}, "gaps 'all'; not known; use one of first-exit, total"),
    ({"mode": "transmittance"}, "mode 'transmittance'; this mode needs a medium"),
    ({"mode": "transmittance", "medium": tl.Medium()}, "the medium is clear"),
    ({"max_distance": 0.0}, "max_distance 0.0; the value must be positive and finite"),
    ({"tolerance": float("inf")}, "tolerance inf; the value must be positive and finite"),
    ({"seed": -1}, "seed -1; not a whole number"),
    ({"supersample": 0}, "supersample 0; not a whole number"),
    ({"padding": -1}, "padding -1; not a whole number"),
    ({"tile": 5}, "tile 5; this number is not a UDIM tile"),
    ({"threads": 0}, "threads 0; the number of threads must be a whole number above 0"),
    ({"high_distance": 1.0}, "a cage or a ray distance is set; no detailed mesh (high) is given"),
]


@pytest.mark.parametrize(("asked", "message"), REFUSALS, ids=lambda value: str(value)[:40])
def test_refusals(asked: dict, message: str) -> None:
    with pytest.raises(tl.InputError, match=re.escape(message)):
        tl.bake_thickness(Box().tessellate(), **{"size": 16, **asked})


def test_progress_is_told_in_the_thread_that_asks() -> None:
    told: list[tuple[int, int, int]] = []
    threads = set()

    def progress(done: int, total: int, rays: int) -> None:
        told.append((done, total, rays))
        threads.add(threading.current_thread())

    baked = tl.bake_thickness(Box().tessellate(), 300, rays=2, progress=progress)
    assert threads == {threading.current_thread()}
    assert told == sorted(told)
    assert told[-1] == (300 * 300, 300 * 300, baked.report.rays)
    assert len(told) == -(-300 // (strips.STRIP_TEXELS // 300))


def interrupted(after: int) -> Callable[[int, int, int], None]:
    left = [after]

    def progress(*_: int) -> None:
        left[0] -= 1
        if left[0] == 0:
            raise KeyboardInterrupt

    return progress


def test_an_interruption_ends_the_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    before = set(threading.enumerate())
    with pytest.raises(KeyboardInterrupt):
        tl.bake_thickness(Box().tessellate(), 512, rays=64, progress=interrupted(1))
    assert set(threading.enumerate()) <= before


@pytest.mark.usefixtures("checkpoints_at_once")
def test_a_checkpoint_is_taken_up_again(bumpy: tl.Mesh, tmp_path: Path) -> None:
    path, mesh = tmp_path / "map.partial", bumpy
    whole = tl.bake_thickness(mesh, 300, rays=4)
    with pytest.raises(KeyboardInterrupt):
        tl.bake_thickness(mesh, 300, rays=4, checkpoint=path, progress=interrupted(3))
    assert [file.name for file in tmp_path.iterdir()] == ["map.partial"]
    resumed = tl.bake_thickness(mesh, 300, rays=4, checkpoint=path)
    assert same(resumed, whole)
    assert 0 < resumed.report.rays < whole.report.rays
    assert resumed.escaped == whole.escaped
    assert not path.exists()


@pytest.mark.usefixtures("checkpoints_at_once")
def test_a_checkpoint_of_another_bake_is_refused(bumpy: tl.Mesh, tmp_path: Path) -> None:
    path, mesh = tmp_path / "map.partial", bumpy
    with pytest.raises(KeyboardInterrupt):
        tl.bake_thickness(mesh, 300, rays=4, checkpoint=path, progress=interrupted(1))
    for other, asked in ((mesh, {"seed": 1}), (Torus().tessellate(16), {})):
        with pytest.raises(
            tl.InputError,
            match="the file holds an unfinished bake of another mesh, or with other settings; delete the file",
        ):
            tl.bake_thickness(other, 300, rays=4, checkpoint=path, **asked)
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(tl.InputError, match=r"the file cannot be read \("):
        tl.bake_thickness(mesh, 300, rays=4, checkpoint=path)


def test_a_checkpoint_that_cannot_be_written_is_refused_before_the_bake(tmp_path: Path) -> None:
    for name, error, message in (
        ("no/such.partial", tl.InputError, "does not exist"),
        ("", tl.InputError, "a folder of this name already exists"),
        ("x" * 300, tl.RenderError, "the file cannot be written .File name too long"),
    ):
        with pytest.raises(error, match=message):
            tl.bake_thickness(Box().tessellate(), 64, rays=2, checkpoint=tmp_path / name)


def test_scale_and_place_change_nothing() -> None:
    """The values scale with the mesh, from micrometres to megametres, and far from the origin."""
    solid = Torus().tessellate(32)
    values = tl.bake_vertex_thickness(solid, rays=16).values
    for scale in (1e-6, 1e6):
        scaled = tl.bake_vertex_thickness(tl.Mesh(solid.vertices * scale, solid.faces), rays=16).values
        assert np.isclose(scaled, scale * values, rtol=1e-2).mean() > 0.99
    moved = tl.bake_vertex_thickness(tl.Mesh(solid.vertices + 1e6, solid.faces), "normal").values
    assert np.allclose(moved, tl.bake_vertex_thickness(solid, "normal").values, rtol=1e-6)
