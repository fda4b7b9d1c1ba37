"""Maps as files: what is written is read back, the record tells all, and a failure leaves nothing half-written."""

from __future__ import annotations

import dataclasses
import errno
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

import translucent as tl
from translucent.bake import thickness_map
from translucent.bake.record import Encoding, file_hash, plain, sidecar_of
from translucent.bake.settings import DEFINITIONS
from translucent.bake.thickness_map import load_thickness_map, save_map, save_vertices

MapMaker = Callable[..., Any]


def told(path: Path) -> dict[str, Any]:
    found = json.loads(sidecar_of(path).read_text(encoding="utf-8"))
    assert isinstance(found, dict)
    return found


@pytest.mark.parametrize("suffix", [".exr", ".npy", ".npz"])
def test_floats_are_kept_bit_for_bit(suffix: str, make_map: MapMaker, ramp: np.ndarray, tmp_path: Path) -> None:
    path = tmp_path / f"t{suffix}"
    make_map(ramp).save(path)
    np.testing.assert_array_equal(load_thickness_map(path), ramp)


def test_a_png_has_16_bits(make_map: MapMaker, ramp: np.ndarray, tmp_path: Path) -> None:
    path = tmp_path / "t.png"
    save_map(make_map(ramp), path)
    with Image.open(path) as image:
        assert image.mode == "I;16"
        levels, text = np.array(image), dict(image.text)
    assert levels.max() == 65535
    assert (levels[ramp == 0] == 0).all()
    quantum = float(ramp.max()) / 65535
    assert float(text["translucent:scale"]) == quantum
    assert (text["translucent:offset"], text["translucent:unit"], text["translucent:mode"]) == ("0.0", "m", "cone")
    assert json.loads(text["translucent:settings"])["seed"] == 7
    # Half a level, and the rounding of the arithmetic.
    assert np.abs(load_thickness_map(path) - ramp).max() <= 0.5 * quantum * (1 + 1e-9)
    assert told(path)["encoding"]["quantum"] == quantum


@pytest.mark.parametrize("suffix", [".exr", ".npy", ".npz", ".png"])
@pytest.mark.parametrize("invert", [False, True])
def test_shares_are_stored_on_request_and_read_back_as_metres(
    suffix: str, invert: bool, make_map: MapMaker, ramp: np.ndarray, tmp_path: Path
) -> None:
    path = tmp_path / f"t{suffix}"
    save_map(make_map(ramp), path, normalize=not invert, invert=invert)
    found = load_thickness_map(path)
    # Stored in float32 (relative to 1), or in 65535 levels.
    step = 0.5 / 65535 if suffix == ".png" else 2.0**-24
    assert np.abs(found - ramp).max() <= step * ramp.max() * (1 + 1e-6)
    if suffix == ".npy":
        stored = np.load(path)
        assert (stored.dtype, stored.shape) == (np.float32, (8, 8))
        share = 1 - ramp / ramp.max() if invert else ramp / ramp.max()
        np.testing.assert_allclose(stored, share, atol=2.0**-23)
        assert stored.min() == 0
        assert stored.max() == 1


def test_an_exr_says_what_it_holds(make_map: MapMaker, ramp: np.ndarray, tmp_path: Path) -> None:
    import OpenEXR

    path = tmp_path / "t.exr"
    save_map(make_map(ramp, spread=90.0, medium=tl.Medium(absorption=(1, 2, 3)), mode="transmittance"), path)
    with OpenEXR.File(str(path), separate_channels=True) as file:
        header = dict(file.header())
        channels = {name: np.array(channel.pixels) for name, channel in file.channels().items()}
    assert (header["unit"], header["mode"], header["seed"], header["scale"]) == ("m", "transmittance", 7, "1.0")
    settings = json.loads(header["settings"])
    assert (settings["spread"], settings["extinction"]) == (90.0, [1.0, 2.0, 3.0])
    assert set(channels) == {"Y", "standard_error.Y", "coverage.Y"}
    np.testing.assert_array_equal(channels["coverage.Y"], ramp > 0)
    assert (channels["standard_error.Y"] == 0.25).all()


def test_the_record_tells_all(make_map: MapMaker, ramp: np.ndarray, tmp_path: Path) -> None:
    path = tmp_path / "t.exr"
    returned = save_map(make_map(ramp, max_distance=2.0), path, about={"model": "a.obj"})
    found = told(path)
    assert found == returned
    assert found["file"] == "t.exr"
    assert found["sha256"] == file_hash(path)
    assert found["definition"].startswith("mean distance")
    assert (found["unit"], found["mode"], found["size"], found["model"]) == ("m", "cone", [8, 8], "a.obj")
    covered = ramp[ramp > 0]
    assert found["range"] == {"min": covered.min(), "median": np.median(covered), "max": covered.max()}
    assert found["settings"]["max_distance"] == 2.0
    assert found["report"]["rays"] == 1000
    assert found["provenance"]["translucent"] == tl.__version__
    assert {"embree", "numpy", "python"} <= set(found["provenance"])


def test_every_mode_has_a_definition() -> None:
    from typing import get_args

    from translucent.bake.settings import Mode

    assert set(DEFINITIONS) == set(get_args(Mode))


def test_numbers_of_numpy_and_infinity_fit_into_the_record() -> None:
    given = {"a": np.float32(0.5), "b": [np.int64(3), float("inf")], "c": (float("nan"), True, None, "x")}
    assert plain(given) == {"a": 0.5, "b": [3, None], "c": [None, True, None, "x"]}


def test_the_local_mode_has_no_unit(make_map: MapMaker, ramp: np.ndarray, tmp_path: Path) -> None:
    path = tmp_path / "t.npy"
    save_map(make_map(ramp, mode="local"), path)
    assert (told(path)["unit"], told(path)["encoding"]["unit"]) == ("1", "1")
    with pytest.raises(tl.InputError, match="values of mode 'local' have no unit of length"):
        save_map(make_map(ramp, mode="local"), tmp_path / "t.glb")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["t.npy", "t.npy.json"]


def test_a_map_of_zeros_can_be_written_but_not_normalized(make_map: MapMaker, tmp_path: Path) -> None:
    nothing = make_map(np.zeros((4, 4)))
    save_map(nothing, tmp_path / "t.png")
    assert (load_thickness_map(tmp_path / "t.png") == 0).all()
    assert told(tmp_path / "t.png")["range"] is None
    with pytest.raises(tl.InputError, match="thickness as a fraction of its largest value; the largest thickness is 0"):
        save_map(nothing, tmp_path / "t.npy", normalize=True)
    with pytest.raises(tl.InputError, match="the thickness is 0 at all points"):
        save_map(nothing, tmp_path / "t.glb")


def test_the_smallest_values_are_no_trouble() -> None:
    tiny = np.array([0.0, 1e-45, 1e-44], dtype=np.float32)
    for options in ({}, {"normalize": True}, {"levels": 65535}, {"levels": 255, "invert": True}):
        encoding = Encoding.of(tiny, **options)
        error = encoding.decode(encoding.encode(tiny)) - tiny
        assert np.abs(error).max() <= 0.51 * encoding.quantum + 1e-46


# Errors


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("t.tif", {}, "suffix '.tif'; use .exr, .png, .npy, .npz or .glb"),
        ("t", {}, "suffix ''"),
        ("no/t.exr", {}, "does not exist"),
        ("folder.exr", {}, "a folder of this name already exists"),
        (
            "t.glb",
            {"invert": True},
            "glTF always stores fractions of the largest thickness; omit --normalize and --invert",
        ),
        ("bad\0name/t.exr", {}, "does not exist"),
    ],
)
def test_an_output_that_cannot_be_is_refused(
    name: str, options: Any, message: str, make_map: MapMaker, ramp: np.ndarray, tmp_path: Path
) -> None:
    (tmp_path / "folder.exr").mkdir()
    with pytest.raises(tl.InputError, match=message.replace(".", r"\.").replace("(", r"\(")):
        save_map(make_map(ramp), tmp_path / name, **options)
    assert [p.name for p in tmp_path.iterdir()] == ["folder.exr"]


def test_without_openexr_the_error_says_how_to_get_it(
    make_map: MapMaker, ramp: np.ndarray, tmp_path: Path, uninstalled: Callable[[str], None]
) -> None:
    uninstalled("OpenEXR")
    with pytest.raises(tl.RenderError, match=r"package OpenEXR is not installed; pip install .*\[exr\]"):
        save_map(make_map(ramp), tmp_path / "t.exr")


@pytest.mark.parametrize("suffix", [".exr", ".npy", ".npz", ".png", ".glb"])
def test_a_read_only_folder_is_noticed_before_any_work(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.access", lambda *_: False)  # root may write everywhere
    with pytest.raises(tl.RenderError, match="is read-only"):
        thickness_map.check_map_output(tmp_path / f"t{suffix}")


# In a process of its own, whose files must stay below a limit as those of a full disk do: writes fail in the middle.
FULL = """
import resource, signal, sys
from pathlib import Path
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
sys.dont_write_bytecode = True  # modules that are imported below the limit would be cut off in the cache
import numpy as np
sys.path.insert(0, {tests!r})
import conftest, translucent as tl
from translucent.bake.settings import BakeSettings
from translucent.bake.thickness_map import ThicknessMap
from translucent.bake.thickness_map import save_map
values = np.random.default_rng(1).uniform(0.1, 1, (256, 256)).astype(np.float32)
made = ThicknessMap(values, values > 0, values, 0.0, conftest.quad(), BakeSettings(size=256), conftest.report())
resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))
for path in sys.argv[1:]:
    try:
        save_map(made, Path(path))
    except tl.RenderError as error:
        print(error)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit on the size of files")
def test_a_disk_that_is_full_leaves_the_old_file(tmp_path: Path) -> None:
    paths = [tmp_path / f"t{suffix}" for suffix in (".exr", ".glb", ".npy", ".npz", ".png")]
    for path in paths:
        path.write_bytes(b"precious")
    script = FULL.format(tests=str(Path(__file__).parent))
    done = subprocess.run([sys.executable, "-c", script, *paths], capture_output=True, text=True, check=False)
    told = done.stdout.splitlines()
    assert len(told) == len(paths), done.stderr
    for path, line in zip(paths, told, strict=True):
        assert str(path) in line
        assert "cannot be written" in line
        assert path.read_bytes() == b"precious"
    assert sorted(tmp_path.iterdir()) == paths  # nothing is left beside them


def test_a_record_that_cannot_be_written_is_an_error(
    make_map: MapMaker, ramp: np.ndarray, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(tl.RenderError, match="No space left"):
        save_map(make_map(ramp), tmp_path / "t.npy")
    assert list(tmp_path.iterdir()) == []  # no map for which nothing vouches


def test_a_map_its_uv_and_its_record_are_renamed_together(
    make_map: MapMaker, ramp: np.ndarray, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever a process is killed at before all three are on the disk, it leaves the old ones together."""
    made = make_map(ramp)
    made = dataclasses.replace(made, report=dataclasses.replace(made.report, uv_from="xatlas"))
    paths = [tmp_path / name for name in ("t.npy", "t.npy.uv.glb", "t.npy.json")]
    for path in paths:
        path.write_bytes(b"precious")
    real, renamed = Path.replace, list[str]()

    def replace(one: Path, other: Path) -> Path:
        if not renamed:
            assert len(list(tmp_path.glob(".partial-*"))) == 3
            assert all(path.read_bytes() == b"precious" for path in paths)
        renamed.append(other.name)
        return real(one, other)

    monkeypatch.setattr(Path, "replace", replace)
    record = save_map(made, paths[0])
    assert sorted(renamed) == sorted(path.name for path in paths)
    assert renamed[-1] == "t.npy.json"  # which vouches for both
    assert [record["sha256"], record["uv_file"]["sha256"]] == [file_hash(path) for path in paths[:2]]
    assert sorted(tmp_path.iterdir()) == sorted(paths)


# Reading


def test_what_says_nothing_of_its_scale_is_refused(ramp: np.ndarray, tmp_path: Path) -> None:
    Image.fromarray((ramp * 1000).astype(np.uint16)).save(tmp_path / "t.png")
    with pytest.raises(tl.InputError, match="the image does not contain its scale from stored values to metres"):
        load_thickness_map(tmp_path / "t.png")
    with pytest.raises(tl.InputError, match="no file has this path"):
        load_thickness_map(tmp_path / "none.exr")
    with pytest.raises(tl.InputError, match=r"suffix '\.jpg'"):
        load_thickness_map(tmp_path / "t.jpg")
    for suffix in (".exr", ".png", ".npy", ".npz"):
        (tmp_path / f"broken{suffix}").write_bytes(b"not what it says")
        with pytest.raises(
            tl.InputError, match=r"cannot be read|not an OpenEXR file|not a readable image|not a NumPy array"
        ):
            load_thickness_map(tmp_path / f"broken{suffix}")


# Vertices


def test_vertices_are_written_as_ply_and_npy(make_vertices: MapMaker, tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(1)
    mesh = tl.Mesh(ball.vertices, ball.faces, name="ball")
    values = np.arange(len(mesh.vertices), dtype=np.float32) + 0.5
    make_vertices(values, mesh).save(tmp_path / "t.ply")
    save_vertices(make_vertices(values, mesh), tmp_path / "t.npy")
    again = trimesh.load(tmp_path / "t.ply", process=False)
    data = again.metadata["_ply_raw"]["vertex"]["data"]
    np.testing.assert_array_equal(data["thickness"], values)
    np.testing.assert_allclose(again.vertices, mesh.vertices, atol=1e-7)
    np.testing.assert_array_equal(again.faces, mesh.faces)
    np.testing.assert_array_equal(np.load(tmp_path / "t.npy"), values)
    assert told(tmp_path / "t.ply")["kind"] == "vertex thickness"
    with pytest.raises(tl.InputError, match=r"suffix '\.exr'; use \.ply, \.glb or \.npy"):
        save_vertices(make_vertices(values, mesh), tmp_path / "t.exr")
