"""The benchmark: measures against analytic errors, wrong pictures told as such, results of strangers, the command."""

from __future__ import annotations

import dataclasses
import json
import zipfile
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import translucent as tl
from tests.benchmark.lambert import render
from translucent.benchmark.adapters import ALL, Adapter, Session, run_adapter
from translucent.benchmark.export import (
    corner_thickness,
    divided,
    environment_pixels,
    export_scene,
    lacking_in_mitsuba,
    mitsuba_scene,
)
from translucent.benchmark.measures import _zoomed, score_picture, score_thickness, suspicions
from translucent.benchmark.page import write_benchmark_page
from translucent.benchmark.results import Results, SceneResult, merge, read_results, safe_name, unpacked
from translucent.benchmark.scenes import FEATURES, SCENES, promise_kept, scene_named
from translucent.benchmark.truth import TruthPicture, agreement_with, read_records, stored_truth_of, truth_path
from translucent.cli import cli
from translucent.errors import InputError
from translucent.geometry.solids import Box, Sphere

pytest.importorskip("OpenEXR")

NOISE, NOISE_SCATTERING = 0.03, 0.08


def truth_of(radiance: Any, noise: float = 0.0) -> TruthPicture:
    rng = np.random.default_rng(1)
    halves = radiance + noise * rng.standard_normal((2, *radiance.shape))
    return TruthPicture(halves.astype(np.float32), np.ones(radiance.shape[:2], bool), None, np.zeros(1), 2)


def landscape() -> Any:
    """A picture without symmetries, in which edges and colors are."""
    y, x = np.mgrid[0:128, 0:128] / 128
    base = 0.2 + 0.5 * x * y + 0.3 * ((x - 0.3) ** 2 + (y - 0.6) ** 2 < 0.04) + 0.2 * (y > 0.8)
    return np.stack([base, 0.8 * base, 0.5 * base + 0.2 * x], axis=-1)


def srgb(linear: Any) -> Any:
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


class TestScenes:
    def test_there_are_thirty_of_all_groups_and_every_feature(self) -> None:
        assert len(SCENES) == len({scene.name for scene in SCENES}) == 30
        assert {scene.group for scene in SCENES} == {
            "thickness", "color", "interfaces", "rough", "scattering", "light", "emission",
        }  # fmt: skip
        assert {need for scene in SCENES for need in scene.needs} == set(FEATURES)

    def test_stored_truths_are_of_these_scenes_quiet_enough_and_small(self) -> None:
        size = 0
        for scene in SCENES:
            if not truth_path(scene.name).is_file():
                continue
            truth = stored_truth_of(scene)
            assert truth.noise <= (NOISE_SCATTERING if "scattering" in scene.needs else NOISE), scene.name
            assert truth.halves.shape == (2, 128, 128, 3)
            assert (truth.thickness is not None) == scene.thickness
            size += truth_path(scene.name).stat().st_size
        assert size <= 12e6

    def test_two_renderers_agree_with_the_truth_or_it_is_said_why(self) -> None:
        for name, record in read_records().items():
            assert len(record.agreements) == 2
            for judge in record.agreements:
                assert judge.agrees or judge.explained, (name, judge)


class TestMeasures:
    def test_errors_are_freed_of_the_noise_of_the_truth(self) -> None:
        flat = np.full((128, 128, 3), 0.5)
        score = score_picture(1.1 * flat, truth_of(flat, noise=0.1))
        assert score.nrmse == pytest.approx(0.1, abs=0.005)  # the noise alone is 0.2 of the mean
        assert score.block == pytest.approx(0.1, abs=0.005)
        assert score.bias == pytest.approx((0.1,) * 3, abs=0.002)

    def test_thickness_counts_what_is_missed_and_marked_apart_from_errors(self) -> None:
        right = np.array([[0.0, 1.0, 2.0, 2.0, np.nan, 1.0]])
        found = np.array([[0.0, 1.02, 0.0, np.nan, 9.0, 1.0]])
        score = score_thickness(found, right)
        assert (score.missed, score.marked) == (0.25, 0.25)
        assert score.median == pytest.approx(0.005)
        assert score.p99 == pytest.approx(0.01, rel=0.02)

    def test_agreement_is_of_pixels_within_four_standard_errors(self) -> None:
        rng = np.random.default_rng(3)
        error = np.full((64, 64, 3), 0.05)
        one = 1.0 + 0.05 * rng.standard_normal((64, 64, 3))
        other = 1.0 + 0.05 * rng.standard_normal((64, 64, 3))
        assert agreement_with("same", 1, (one, error), (other, error)).agrees
        assert not agreement_with("brighter", 1, (one, error), (1.4 * other, error)).agrees

    @pytest.mark.parametrize(
        ("change", "said"),
        [
            (lambda p: p[::-1], "upside down"),
            (lambda p: p[:, ::-1], "mirrored"),
            (lambda p: p[..., ::-1], "red and blue"),
            (srgb, "sRGB-encoded"),
            (lambda p: 2.0 * p, "exposure may be wrong: with 1 stops darker"),
            (lambda p: 0.5 * p, "exposure may be wrong: with 1 stops brighter"),
            (lambda p: _zoomed(p, 1.25), "cropped"),
            (lambda p: np.roll(p, 9, axis=1), "shifted by 9 pixels to the right and 0 pixels down"),
            (lambda p: np.roll(p, 9, axis=0), "shifted by 0 pixels to the right and 9 pixels down"),
        ],
    )
    def test_wrong_pictures_are_told_as_such(self, change: Any, said: str) -> None:
        right = landscape()
        assert any(said in one for one in suspicions(change(right), truth_of(right, noise=0.01)))

    def test_a_picture_that_is_only_inexact_is_not_suspected(self) -> None:
        right = landscape()
        rng = np.random.default_rng(5)
        assert suspicions(right + 0.15 * rng.standard_normal(right.shape), truth_of(right)) == []
        assert suspicions(right * rng.gamma(0.25, 4.0, right.shape), truth_of(right)) == [], (
            "bright specks of few paths"
        )


class TestPromises:
    def test_published_errors_are_within_what_is_promised_or_known_not_to_be(self) -> None:
        folder = Path(__file__).parents[2] / "docs" / "reports" / "benchmark"
        published = json.loads((folder / "ours.json").read_text(encoding="utf-8"))["scenes"]
        assert set(published) == {scene.name for scene in SCENES}
        said = {scene.name: promise_kept(scene, published[scene.name]["score"]["block"]) for scene in SCENES}
        assert {name for name, text in said.items() if "not kept" in text} == set()
        assert {name for name, text in said.items() if "Nothing is promised" in text} == {"caustic"}
        notes = tl.plan(scene_named("caustic").make()).unmodelled
        assert any("environment" in note and "focuses" in note for note in notes)

    def test_frosted_glass_of_16_samples_is_no_more_blurred_than_noisy(self, renderer: tl.Renderer) -> None:
        """A ball before a bright window: a blur that ignores how slants widen refraction has an error of .13."""
        scene = scene_named("frosted-ball")
        found = np.asarray(renderer.render(scene.make(), scene.size, samples=16).radiance)
        score = score_picture(found, stored_truth_of(scene))
        assert score.block < 0.09
        assert score.nrmse < 0.12
        assert max(map(abs, score.bias)) < 0.04

    def test_a_page_names_who_is_nearer_in_no_more_time_first(self, tmp_path: Path) -> None:
        pytest.importorskip("jinja2")
        scene = scene_named("thick-ball")
        right = stored_truth_of(scene).radiance
        results = []
        for name, factor, seconds in (("translucent", 1.05, 2.0), ("Peer", 1.01, 1.0), ("Slow", 1.0, 3.0)):
            score = score_picture(factor * right, stored_truth_of(scene))
            machine = f"machine of {name}"
            one = {"thick-ball": SceneResult(seconds, 0.1, score=score)}
            results.append(Results(name, machine=machine, scenes=one))
        write_benchmark_page(results, tmp_path / "page.html")
        text = (tmp_path / "page.html").read_text(encoding="utf-8")
        assert '<li><a href="#thick-ball">Ball</a>: Peer</li>' in text
        assert "up to 0.5%. Measured: 5." in text
        assert all(f"machine of {one}" in text for one in ("translucent", "Peer", "Slow"))


class TestAdapters:
    @pytest.mark.parametrize("error", [NotImplementedError("rough"), InputError("asked", "found", "do")])
    def test_a_defect_is_a_failure_and_not_a_feature_that_is_lacking(self, error: Exception, tmp_path: Path) -> None:
        def draw(scene: Any, folder: Path) -> Any:
            raise error

        adapter = Adapter("x", "X", "", ALL, str, lambda: nullcontext(Session(draw, "1")))
        found = run_adapter(adapter, [scene_named("wedge")], tmp_path / "results").scenes["wedge"]
        assert not found.lacking
        assert str(error).split("; ")[0] in found.failure

    def test_mitsuba_has_words_for_bodies_in_each_other_and_none_for_sums(self) -> None:
        assert lacking_in_mitsuba(scene_named("core").make()) == ""
        assert "overlap" in lacking_in_mitsuba(scene_named("two-media").make())

    def test_mitsuba_gets_each_interface_of_nested_bodies_once(self, tmp_path: Path) -> None:
        pytest.importorskip("mitsuba").set_variant("scalar_rgb")
        made = scene_named("core").make()
        described = mitsuba_scene(made, (8, 8), tmp_path, samples=2)
        assert {name for name in described if name.startswith(("object", "interface"))} == {
            "interface_0_2", "interface_1_0",
        }  # fmt: skip
        core = described["interface_1_0"]
        assert core["bsdf"]["ext_ior"] == pytest.approx(1.33)
        assert core["exterior"] == described["interface_0_2"]["interior"]


class TestResultsOfStrangers:
    def test_names_are_escaped_and_stay_in_the_folder(self, tmp_path: Path) -> None:
        pytest.importorskip("jinja2")
        evil = "<script>alert(1)</script>/../../x"
        theirs = tmp_path / "theirs"
        theirs.mkdir()
        scene = scene_named("thick-ball")
        np.save(theirs / "thick-ball.npy", stored_truth_of(scene).radiance.astype(np.float32))
        Results(evil, settings="<img src=x>", scenes={"thick-ball": SceneResult(seconds=0.5)}).write(theirs)
        merged = merge([theirs, theirs], tmp_path / "all", tmp_path / "unpacked")
        assert sorted(one.name for one in (tmp_path / "all").iterdir()) == [
            "script-alert-1-script-x", "script-alert-1-script-x-2",
        ]  # fmt: skip
        assert merged[0].scenes["thick-ball"].score is not None
        write_benchmark_page(merged, tmp_path / "page.html")
        text = (tmp_path / "page.html").read_text(encoding="utf-8")
        assert "<script>alert" not in text
        assert "<img src=x>" not in text
        assert "&lt;script&gt;alert(1)" in text
        assert safe_name("../..") == "renderer"

    def test_an_archive_takes_nothing_but_its_own_files(self, tmp_path: Path) -> None:
        with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
            archive.writestr("../evil.txt", "x")
            archive.writestr("/etc/evil", "x")
            archive.writestr("results.json", json.dumps({"format": "other"}))
        folder = unpacked(tmp_path / "a.zip", tmp_path / "out")
        assert [one.name for one in folder.iterdir()] == ["results.json"]
        assert not (tmp_path / "evil.txt").exists()
        with pytest.raises(InputError, match=r"the format of this results.json is not"):
            read_results(folder)
        (tmp_path / "b.zip").write_bytes(b"no archive")
        with pytest.raises(InputError, match=r"not a readable \.zip"):
            unpacked(tmp_path / "b.zip", tmp_path / "out2")

    def test_a_picture_of_another_size_or_type_says_what_to_do(self, tmp_path: Path) -> None:
        for number, array in enumerate((np.zeros((100, 128, 3), np.float32), np.zeros((128, 128, 3), np.uint8))):
            folder = tmp_path / str(number)
            folder.mkdir()
            np.save(folder / "thick-ball.npy", array)
            result = CliRunner().invoke(cli, ["benchmark", "score", str(folder)], standalone_mode=True)
            assert result.exception is not None
            failure = read_results(folder).scenes["thick-ball"].failure
            assert ("do not crop" if number == 0 else "linear radiance as floats") in failure


class TestCommand:
    def test_a_renderer_of_sixty_lines_is_scored(self, tmp_path: Path) -> None:
        """From exported files to scores and a page, through the command line."""
        pytest.importorskip("jinja2")
        names = [name for name in ("thin-plate", "wedge") if truth_path(name).is_file()]
        runner = CliRunner()
        chosen = [text for name in names for text in ("--only", name)]
        exported = runner.invoke(cli, ["benchmark", "export", str(tmp_path / "s"), *chosen])
        assert exported.exit_code == 0, exported.output
        (tmp_path / "mine").mkdir()
        with np.errstate(under="ignore"):
            for name in names:
                np.save(tmp_path / "mine" / f"{name}.npy", render(tmp_path / "s" / name).astype(np.float32))
        found = runner.invoke(cli, ["benchmark", "score", str(tmp_path / "mine"), "--name", "Lambert", "--json"])
        assert found.exit_code == 0, found.output
        told = json.loads(found.stdout)
        for name in names:
            assert 0.01 < told["scenes"][name]["score"]["nrmse"] < 2.0
        made = runner.invoke(
            cli,
            ["benchmark", "page", str(tmp_path / "mine"), str(tmp_path / "mine.zip"), "-o", str(tmp_path / "p.html")],
        )
        assert made.exit_code == 0, made.output
        assert "Lambert" in (tmp_path / "p.html").read_text(encoding="utf-8")

    def test_a_scene_as_files_has_its_numbers_and_triangles(self, tmp_path: Path) -> None:
        scene = scene_named("colored-shadow")
        folder = export_scene(scene, tmp_path / scene.name)
        told = json.loads((folder / "scene.json").read_text(encoding="utf-8"))
        made = scene.make()
        assert told["objects"][0]["absorption"] == pytest.approx(np.asarray(made.bodies[0].medium.absorption))
        assert told["lights"][0]["irradiance"] == pytest.approx([2.6, 2.5, 2.3])
        glb = (folder / "scene.glb").read_bytes()
        assert glb[:4] == b"glTF"
        assert int.from_bytes(glb[8:12], "little") == len(glb)

    def test_the_written_environment_has_the_exposure_and_the_rotation(self) -> None:
        picture = np.random.default_rng(3).random((4, 8, 3)).astype(np.float32)
        written = environment_pixels(tl.Environment.image(picture, exposure=-1.0, rotation=90.0))
        np.testing.assert_allclose(written, 0.5 * np.roll(picture, -2, axis=1), rtol=1e-5)

    def test_thickness_below_corners_is_that_of_a_plate_and_a_ball(self) -> None:
        """Median over rays by the cosine: sqrt(2) times the thickness of a plate, and diameter of a ball by sqrt(2)."""
        plate, ball = Box.slab(thickness=0.01).tessellate(), Sphere().tessellate(64)
        corners = divided(divided(plate.vertices[plate.faces]))
        found = corner_thickness(corners)[np.ptp(corners[..., 2], axis=1) == 0]
        assert np.median(found) == pytest.approx(2**0.5 * 0.01, rel=0.03)
        assert np.median(corner_thickness(ball.vertices[ball.faces])) == pytest.approx(2**0.5, rel=0.03)

    def test_scenes_and_renderers_are_listed(self) -> None:
        found = CliRunner().invoke(cli, ["benchmark", "list", "--json"])
        told = json.loads(found.stdout)
        assert len(told["scenes"]) == 30
        assert told["adapters"]["ours"] == ""
        assert dataclasses.is_dataclass(SCENES[0])
