"""Files that others made: which are opened, how much may come out of them, and what is refused in one line."""

from __future__ import annotations

import io
import json
import os
import struct
import subprocess
import sys
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import translucent as tl
from tests.boxes import box_buffer, linked_box
from translucent.bake.thickness_map import load_thickness_map
from translucent.bench.codec import Packed
from translucent.files import reading
from translucent.files.reading import json_value, open_file, require_room, toml_value
from translucent.gltf import file as file_module
from translucent.gltf.write import write_medium
from translucent.materials import load_medium
from translucent.materials.usd import read_usda
from translucent.media.colors import pixel_color, read_encoded
from translucent.media.fitting import fit_wedge
from translucent.media.preset import read_presets

JADE = tl.Medium.from_color((0.18, 0.62, 0.35), distance=0.02)


@pytest.fixture
def model(tmp_path: Path) -> Callable[[str], Path]:
    """Makes a model in a folder of its own, beside which there is a file that is not the model's business."""
    (tmp_path / "model" / "parts").mkdir(parents=True)
    (tmp_path / "model" / "parts" / "a b.bin").write_bytes(box_buffer())
    (tmp_path / "secret.bin").write_bytes(box_buffer())
    (tmp_path / "model" / "link.bin").symlink_to(tmp_path / "secret.bin")
    (tmp_path / "model" / "inner.bin").symlink_to(tmp_path / "model" / "parts" / "a b.bin")
    os.mkfifo(tmp_path / "model" / "pipe.bin")

    def make(uri: str) -> Path:
        path = tmp_path / "model" / "scene.gltf"
        path.write_text(json.dumps(linked_box(uri.replace("{}", str(tmp_path)))))
        return path

    return make


READERS: dict[str, Callable[[Path], object]] = {
    "load_scene": tl.load_scene,
    "load_mesh": tl.load_mesh,
    "write_medium": lambda path: write_medium(path, path.with_name("out.glb"), JADE),
}


@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
@pytest.mark.parametrize(
    ("uri", "message"),
    [
        (
            "../secret.bin",
            "leads outside the folder of the model; keep all files together, or add --allow-outside",
        ),
        ("%2e%2e/secret.bin", "leads outside the folder of the model"),
        ("parts/../../secret.bin", "leads outside the folder of the model"),
        ("{}/secret.bin", "leads outside the folder of the model"),
        ("link.bin", "leads outside the folder of the model"),
        ("/dev/zero", "leads outside the folder of the model"),
        ("/dev/stdin", "leads outside the folder of the model"),
        ("file://{}/secret.bin", "is not a valid path"),
        ("https://example.org/a.bin", "is not a valid path"),
        ("a%00b", "names no file"),
        ("pipe.bin", "the path is a pipe or a device"),
        ("parts", "the path is a folder"),
    ],
)
def test_a_model_reads_no_file_that_is_not_its_own(
    model: Callable[[str], Path], read: Callable[[Path], object], uri: str, message: str
) -> None:
    path = model(uri)
    with pytest.raises(tl.InputError, match=message):
        read(path)
    assert not path.with_name("out.glb").exists()


@pytest.mark.parametrize("uri", ["parts/a%20b.bin", "parts/a b.bin", "parts/../parts/a b.bin", "inner.bin"])
def test_a_model_reads_what_is_below_its_folder(model: Callable[[str], Path], uri: str) -> None:
    assert tl.load_mesh(model(uri)).volume == pytest.approx(48.0)


@pytest.mark.parametrize("uri", ["../secret.bin", "{}/secret.bin", "link.bin"])
def test_who_means_it_reads_files_outside(model: Callable[[str], Path], uri: str) -> None:
    path = model(uri)
    assert tl.load_mesh(path, allow_outside=True).volume == pytest.approx(48.0)
    assert len(tl.load_scene(path, allow_outside=True).objects) == 1
    write_medium(path, path.with_name("out.glb"), JADE, allow_outside=True)
    assert tl.load_mesh(path.with_name("out.glb")).volume == pytest.approx(48.0)
    with pytest.raises(tl.InputError, match="the path is a pipe or a device"):
        tl.load_mesh(model("/dev/zero"), allow_outside=True)


def test_an_obj_follows_no_links(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.mtl").write_text("newmtl a\nmap_Kd a.png\n")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    opened = []
    real = open
    monkeypatch.setattr("builtins.open", lambda path, *more, **named: opened.append(path) or real(path, *more, **named))
    tl.load_mesh(tmp_path / "a.obj")
    assert [path for path in opened if str(path).startswith(str(tmp_path))] == [tmp_path / "a.obj"]


@pytest.mark.parametrize(
    "read", [tl.load_mesh, tl.Environment.image, tl.DensityGrid.load, load_medium, fit_wedge, load_thickness_map]
)
def test_pipes_and_devices_are_no_files(tmp_path: Path, read: Callable[[Path], object]) -> None:
    for suffix in (".ply", ".hdr", ".npy", ".json", ".csv"):
        os.mkfifo(tmp_path / f"pipe{suffix}")
        (tmp_path / f"zero{suffix}").symlink_to("/dev/zero")
        for name in ("pipe", "zero"):
            with pytest.raises(tl.InputError, match=r"the path is a pipe or a device|suffix|format"):
                read(tmp_path / f"{name}{suffix}")


def test_a_large_text_is_refused_unread(tmp_path: Path) -> None:
    with (tmp_path / "a.csv").open("wb") as file:
        file.truncate(1 << 40)  # takes no place on the disk
    with pytest.raises(tl.InputError, match=r"it has 1e\+03 GiB|the file has 1024 GiB, more than the limit of 8 MiB"):
        fit_wedge(tmp_path / "a.csv")


@pytest.mark.parametrize("read", [tl.load_scene, tl.load_mesh])
def test_json_with_too_much_data_in_its_links_is_refused_unread(
    tmp_path: Path, read: Callable[[Path], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    with (tmp_path / "a.gltf").open("wb") as file:
        file.truncate(file_module.MAX_JSON + 1)
    with pytest.raises(tl.InputError, match="the JSON of the file has 256 MiB, more than the limit of 256 MiB"):
        read(tmp_path / "a.gltf")
    monkeypatch.setattr(file_module, "MAX_JSON", 1 << 10)
    json_chunk = struct.pack("<II", 2000, file_module.JSON_CHUNK) + b" " * 2000
    (tmp_path / "a.glb").write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(json_chunk)) + json_chunk)
    with pytest.raises(tl.InputError, match=r"the JSON of the file has 1\.96 kiB, more than the limit of 1 kiB"):
        read(tmp_path / "a.glb")


def test_a_small_file_unpacks_into_no_more_than_this() -> None:
    require_room("a", "b", reading.FREE, 0)
    require_room("a", "b", reading.FREE * 4, reading.FREE * 4 // reading.RATIO)
    with pytest.raises(tl.InputError, match="a; 9 pixels take 2 GiB; the limit for a file of this size is 1 GiB"):
        require_room("a", "9 pixels", reading.FREE * 4, reading.FREE * 2 // reading.RATIO)


def _bomb_png() -> bytes:
    stream = io.BytesIO()
    Image.new("1", (13000, 13000)).save(stream, format="PNG")
    return stream.getvalue()


def _npy_header(shape: str) -> bytes:
    text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}}}".ljust(117).encode() + b"\n"
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(text)) + text


def _sparse(count: int) -> bytes:
    tree = linked_box("data:;base64,AAAA")
    tree["accessors"][0] = {"componentType": 5126, "count": count, "type": "VEC3", "sparse": {"count": 1}}
    return json.dumps(tree).encode()


BOMBS: dict[str, tuple[str, Callable[[], bytes], Callable[[Path], object], str]] = {
    "hdr": (
        "a.hdr",
        lambda: b"#?RADIANCE\n\n-Y 16384 +X 16384\n\1\2\3\4" + b"\1\1\1\xff" * 4,
        tl.Environment.image,
        "16384x16384 pixels take",
    ),
    "png": ("a.png", _bomb_png, tl.Environment.image, "13000x13000 pixels take"),
    "pixel": ("a.png", _bomb_png, lambda path: pixel_color(path, 0, 0), "13000x13000 pixels take"),
    "sparse": ("a.gltf", lambda: _sparse(2**30), tl.load_mesh, "1073741824 elements take"),
    "npy": ("a.npy", lambda: _npy_header("(99999, 99999, 9)"), tl.DensityGrid.load, "the file is cut off: 0 of"),
    "negative": ("a.npy", lambda: _npy_header("(-1, 5, 9)"), tl.DensityGrid.load, "the file is cut off:"),
    "zip": ("a.zip", lambda: b"PK", tl.load_mesh, r"the mesh format '\.zip' is not supported"),
    "bz2": ("a.bz2", lambda: b"BZh", tl.load_mesh, r"the mesh format '\.bz2' is not supported"),
    "tar.gz": ("a.tar.gz", lambda: b"\x1f\x8b", tl.load_mesh, r"the mesh format '\.gz' is not supported"),
    "entities": (
        "a.mtlx",
        lambda: b'<!DOCTYPE a [<!ENTITY b "c"><!ENTITY d "&b;&b;">]><materialx>&d;</materialx>',
        load_medium,
        "the file declares XML entities, which may expand without limit",
    ),
}


@pytest.mark.parametrize(("name", "content", "read", "message"), BOMBS.values(), ids=BOMBS)
def test_little_does_not_become_much(
    tmp_path: Path, name: str, content: Callable[[], bytes], read: Callable[[Path], object], message: str
) -> None:
    (tmp_path / name).write_bytes(content())
    tracemalloc.start()
    try:
        with pytest.raises(tl.InputError, match=message):
            read(tmp_path / name)
        assert tracemalloc.get_traced_memory()[1] < 10_000_000
    finally:
        tracemalloc.stop()


def test_an_exr_of_few_bytes_is_not_a_large_picture(tmp_path: Path) -> None:
    openexr = pytest.importorskip("OpenEXR", reason="the extra exr is not installed")
    channels = {name: np.zeros((4, 8), np.float32) for name in "RGB"}
    openexr.File({"type": openexr.scanlineimage}, channels).write(str(tmp_path / "a.exr"))
    data = (tmp_path / "a.exr").read_bytes()
    small = struct.pack("<4i", 0, 0, 7, 3)
    assert data.count(small) == 2  # data and display window
    (tmp_path / "a.exr").write_bytes(data.replace(small, struct.pack("<4i", 0, 0, 99_999, 99_999)))
    with pytest.raises(tl.InputError, match=r"100000x100000 pixels take|not an OpenEXR file"):
        tl.Environment.image(tmp_path / "a.exr")


def test_an_npz_that_claims_to_store_more_than_its_file_is_refused(tmp_path: Path) -> None:
    """The size that is stored, four bytes of the directory at the end, would make room for itself."""
    path = tmp_path / "a.npz"
    np.savez(path, scale=np.array(1.0), offset=np.array(0.0), values=np.zeros((4, 4)))
    data = bytearray(path.read_bytes())
    entry = data.rindex(b"PK\1\2", 0, data.rindex(b"offset.npy"))
    data[entry + 20 : entry + 24] = (2**30).to_bytes(4, "little")
    path.write_bytes(data)
    with pytest.raises(tl.InputError, match="would take 1 GiB; the limit for a file of this size is 512 MiB"):
        load_thickness_map(path)


def test_an_npz_that_unpacks_into_too_much_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "FREE", 1000)
    np.savez_compressed(tmp_path / "a.npz", scale=np.array(1.0), offset=np.array(0.0), values=np.zeros((900, 900)))
    with pytest.raises(tl.InputError, match=r"values would take 6.18 MiB; the limit for a file of this size is"):
        load_thickness_map(tmp_path / "a.npz")


def test_an_archive_within_a_mesh_format_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "FREE", 1000)
    with zipfile.ZipFile(tmp_path / "a.off", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("big", bytes(1_000_000))
    with pytest.raises(tl.InputError, match="its parts take 977 kiB; the limit for a file of this size is"):
        tl.load_mesh(tmp_path / "a.off")


@pytest.mark.parametrize("piece", ["'''", '"', "'", "<", "@", "(", "\\", "float inputs:a = (", "#", '"\\'])
def test_usda_is_read_in_one_go_whatever_it_says(piece: str) -> None:
    with pytest.raises(tl.InputError, match="USD layer"):
        read_usda("#usda 1.0\n" + piece * (200_000 // len(piece)))  # took minutes where each try began anew


@pytest.mark.parametrize("text", ["{" * 5000, 'def "a"\n{\n' * 20_000 + "}\n" * 20_000])  # the latter is valid
def test_many_braces_of_usda_are_refused(text: str) -> None:
    with pytest.raises(tl.InputError, match="more than 100 levels of braces"):
        read_usda("#usda 1.0\n" + text)


def test_a_long_whole_number_of_usda_is_read_in_silence(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(tl.InputError, match="the file has no shader"):
        read_usda('#usda 1.0\ndef "a"\n{\n    int b = ' + "9" * 100_000 + "\n}\n")
    assert capfd.readouterr() == ("", "")


DEEP = "[" * 900 + "]" * 900


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (DEEP, "more than 100 levels"),
        ("[" * 99_999, "more than 100 levels"),
        ('{"a": ' * 150 + "1" + "}" * 150, "more than 100 levels"),
        ("9" * 5000, "a whole number is too long"),
        ("[1e999]", "1e999 is beyond the range of numbers"),
        ("[NaN]", "NaN is not a JSON number"),
        ("{", "Expecting property name"),
    ],
)
def test_json_that_no_reader_could_use(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        json_value(text)


def test_json_and_toml_that_readers_can_use() -> None:
    nested = "[" * 100 + "]" * 100
    assert json_value(nested) == json.loads(nested)
    assert (json_value("3"), json_value('"x"')) == (3, "x")
    assert toml_value("a = [[1, 2.5], {b = 'c'}]") == {"a": [[1, 2.5], {"b": "c"}]}
    dots = "." * 200
    text = f"""a = "\\"{dots}"  # {dots}\nb = [1.5{", 1.5" * 200}]\nc = '''{dots}\n'{dots}'''"""
    assert toml_value(text) == {"a": f'"{dots}', "b": [1.5] * 201, "c": f"{dots}\n'{dots}"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"a = {'9' * 5000}", "a number is too long"),
        (f"a = {'9' * 400}", "a whole number is too long"),
        (f"a = {'[' * 150}{']' * 150}", "more than 100 levels"),
        (f"a = {'[' * 99999}", "more than 100 levels"),
        (f"a{'.a' * 4000} = 1", "more than 100 levels"),
        (f"[a{'.a' * 4000}]", "more than 100 levels"),
        (f"a = {{a{' . a' * 4000} = 1}}", "more than 100 levels"),
        ("a = ['''x'''', 3] # '''\n" + "'b'.\"c\"." * 2000 + "d = 1", "more than 100 levels"),
        ("a = 1\n" * 200_000, "more than 1048576 characters"),
        ("a = ", "Invalid value"),
    ],
)
def test_toml_that_no_reader_could_use(text: str, message: str) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=message):
            toml_value(text)
        assert tracemalloc.get_traced_memory()[1] < 2_000_000  # each beginning of a long key would take 64
    finally:
        tracemalloc.stop()
    with pytest.raises(tl.InputError, match=f"mine.toml; the file is not valid TOML: {message}"):
        read_presets(text, "mine.toml")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"nodes": [{"mesh": 0, "children": [0]}]}, "some nodes are their own ancestors"),
        ({"nodes": [{"children": [1]}, {"mesh": 0, "children": [0]}]}, "some nodes are their own ancestors"),
        ({"extras": json.loads(DEEP)}, "the JSON of the file is broken .more than 100 levels"),
        ({"buffers": [{"bufferView": 0}]}, "the file has no binary chunk"),
    ],
)
def test_graphs_without_an_end_are_refused(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    (tmp_path / "a.gltf").write_text(json.dumps({**linked_box("gone.bin"), **change}))
    for read in (tl.load_scene, tl.load_mesh):
        with pytest.raises(tl.InputError, match=message):
            read(tmp_path / "a.gltf")


@pytest.mark.parametrize(
    "header", [b"", b"\x93NUM", b"\x93NUMPY\1\0v\0{'descr': ", b"\x93NUMPY\1\0\xff\xff" + b"(" * 65535]
)
def test_headers_of_arrays_that_end_early_are_refused(tmp_path: Path, header: bytes) -> None:
    (tmp_path / "a.npy").write_bytes(header)
    with pytest.raises(tl.InputError, match="not a NumPy array"):
        tl.DensityGrid.load(tmp_path / "a.npy")


@pytest.mark.parametrize(
    ("shape", "data"), [((3, 3), None), ((-2, -2), None), ((10**9, 10**9), None), ((2, 2), "!"), ((2, 2), "aGk=")]
)
def test_an_array_of_a_report_has_the_shape_that_it_says(shape: tuple[int, int], data: str | None) -> None:
    good = Packed.of(np.ones((2, 2)))
    with pytest.raises((ValueError, zlib.error), match=r"shape|base64|incorrect header|padding"):
        Packed(shape, "float16", 1.0, good.data if data is None else data).check()


def test_what_was_a_file_and_has_become_a_pipe_is_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    os.mkfifo(tmp_path / "pipe")
    monkeypatch.setattr(reading, "require_file", lambda *_: None)
    with pytest.raises(tl.InputError, match="the path is not a regular file"):
        open_file(tmp_path / "pipe", "this")


SIGNALING = np.full((2, 3, 4), 0x7F800001, dtype=np.uint32).view(np.float32)


def _npy(values: np.ndarray, header: bytes = b"") -> bytes:
    stream = io.BytesIO()
    np.save(stream, values)
    data = stream.getvalue()
    return data.replace(b"}" + b" " * len(header), b"}" + header) if header else data


def _picture(kind: str, mode: str, **named: Any) -> bytes:
    stream = io.BytesIO()
    Image.linear_gradient("L").resize((16, 8)).convert(mode).save(stream, format=kind, **named)
    return stream.getvalue()


@pytest.mark.filterwarnings("error")  # those of NumPy, Pillow and Python
def test_numbers_that_signal_are_refused_or_stay_none(tmp_path: Path) -> None:
    for values in (SIGNALING, SIGNALING.astype(">f4"), np.full((2, 3, 4), 0x7C01, dtype=np.uint16).view(np.float16)):
        (tmp_path / "a.npy").write_bytes(_npy(values))
        with pytest.raises(tl.InputError, match="24 values are outside 0 to"):
            tl.DensityGrid.load(tmp_path / "a.npy")
        (tmp_path / "a.npy").write_bytes(_npy(values[0]))
        assert np.isnan(load_thickness_map(tmp_path / "a.npy")).all()
    (tmp_path / "a.npy").write_bytes(_npy(np.full((2, 2, 2), "x")))
    with pytest.raises(tl.InputError, match="its values are of type '<U1', and not numbers"):
        tl.DensityGrid.load(tmp_path / "a.npy")
    (tmp_path / "a.npy").write_bytes(_npy(SIGNALING, header=b" if 1or 0 else 0"))
    with pytest.raises(tl.InputError, match="not a NumPy array"):
        tl.DensityGrid.load(tmp_path / "a.npy")


@pytest.mark.filterwarnings("error")
@pytest.mark.filterwarnings("default::translucent.TranslucentWarning")
def test_an_exr_is_read_or_refused_without_a_word_of_its_library(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    openexr = pytest.importorskip("OpenEXR", reason="the extra exr is not installed")
    path = tmp_path / "a.exr"
    channels = {name: np.resize(SIGNALING, (4, 8)) for name in "RGB"}
    for values in channels.values():
        values[0] = 0.5
    openexr.File({"type": openexr.scanlineimage, "compression": openexr.NO_COMPRESSION}, channels).write(str(path))
    with pytest.warns(tl.TranslucentWarning, match="24 of 32 pixels are not finite, taken as 0"):
        tl.Environment.image(path)
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(tl.InputError, match=r"the pixel data is damaged|not an OpenEXR file"):
        tl.Environment.image(path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.filterwarnings("error")
def test_odd_pictures_are_read_without_a_word_of_pillow(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(_picture("PNG", "P", transparency=bytes(range(256))))
    assert tl.Environment.image(tmp_path / "a.png").radiance is not None
    assert read_encoded(tmp_path / "a.png", "a picture").shape == (8, 16, 3)
    tiff = _picture("TIFF", "RGB")
    count, where = struct.unpack("<H", tiff[tiff[4] : tiff[4] + 2])[0], tiff[4] + 2
    tags = [tiff[where + 12 * i : where + 12 * i + 12] for i in range(count)]
    unknown = struct.pack("<HHII", 65000, 2, 10**6, 10**6)  # a million characters beyond the end of the file
    damaged = tiff[: tiff[4]] + b"".join([struct.pack("<H", count), *tags[:-1], unknown]) + tiff[where + 12 * count :]
    (tmp_path / "a.tiff").write_bytes(damaged)
    pixel_color(tmp_path / "a.tiff", 0, 0)


def test_what_pillow_logs_of_a_damaged_tiff_is_not_printed(tmp_path: Path) -> None:
    """In a process of its own, since pytest has handlers for what is logged."""
    tiff = _picture("TIFF", "RGB")
    three = struct.pack("<HHIH", 277, 3, 1, 3)  # samples per pixel
    assert tiff.count(three) == 1
    (tmp_path / "a.tiff").write_bytes(tiff.replace(three, struct.pack("<HHIH", 277, 3, 1, 10280)))
    script = """
import sys
import translucent as tl
from translucent.media.colors import pixel_color
try:
    pixel_color(sys.argv[1], 0, 0)
except tl.InputError:
    print("refused")
"""
    command = [sys.executable, "-c", script, tmp_path / "a.tiff"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("refused\n", "")
