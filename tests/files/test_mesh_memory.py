"""Meshes that take more memory than is free: refused by what their headers say, before it is taken."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
import trimesh

import translucent as tl
from tests.values.handmade import ball
from translucent.files import reading
from translucent.geometry.mesh import PER_TRIANGLE
from translucent.mesh_files import PER_SOUP_TRIANGLE


@pytest.fixture
def body(monkeypatch: pytest.MonkeyPatch) -> trimesh.Trimesh:
    monkeypatch.setattr(reading, "SMALL", 0)
    mesh = ball(3)
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


@pytest.mark.parametrize(
    ("suffix", "needed", "found"),
    [
        ("stl", 1280 * PER_SOUP_TRIANGLE, "its 1280 triangles need about 438 kiB of memory"),
        ("ply", 1280 * PER_TRIANGLE, "its 1280 faces need about 188 kiB of memory"),
        ("glb", 1280 * PER_TRIANGLE, "the 1280 triangles of 'mesh 0' need about 188 kiB of memory"),
    ],
)
def test_a_mesh_is_read_where_there_is_memory_and_refused_where_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: trimesh.Trimesh, suffix: str, needed: int, found: str
) -> None:
    body.export(path := tmp_path / f"ball.{suffix}")
    monkeypatch.setattr(reading, "free_memory", lambda: needed)
    assert len(tl.load_mesh(path).faces) == 1280
    monkeypatch.setattr(reading, "free_memory", lambda: needed - 1)
    with pytest.raises(tl.InputError, match=re.escape(found)) as caught:
        tl.load_mesh(path)
    assert str(caught.value).endswith("are free; close other programs, or decimate the mesh")


def test_a_text_is_counted_by_its_length(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: trimesh.Trimesh
) -> None:
    body.export(path := tmp_path / "ball.obj")
    monkeypatch.setattr(reading, "free_memory", lambda: 1000)
    with pytest.raises(tl.InputError, match=r"[\d.]+ kiB of text need about"):
        tl.load_mesh(path)


def test_where_nobody_says_what_is_free_nothing_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: trimesh.Trimesh
) -> None:
    body.export(path := tmp_path / "ball.stl")
    monkeypatch.setattr(reading, "_MACHINE", tmp_path / "none")
    assert reading.free_memory() is None
    assert len(tl.load_mesh(path).faces) == 1280


def test_fifty_million_triangles_are_refused_from_the_header_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, count = tmp_path / "huge.stl", 50_000_000
    with path.open("wb") as stream:
        stream.write(bytes(80) + count.to_bytes(4, "little"))
        stream.truncate(84 + 50 * count)  # sparse: it takes no room on the disk
    monkeypatch.setattr(reading, "free_memory", lambda: 8 << 30)
    with pytest.raises(
        tl.InputError, match=r"its 50000000 triangles need about 16\.3 GiB of memory, but only 8 GiB are free"
    ):
        tl.load_mesh(path)


def test_the_limit_of_a_container_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "meminfo").write_text("MemTotal: 9000 kB\nMemAvailable:    8000 kB\n")
    monkeypatch.setattr(reading, "_MACHINE", tmp_path / "meminfo")
    monkeypatch.setattr(reading, "_GROUP", tmp_path)
    assert reading.free_memory() == 8000 * 1024
    for name, content in (("max", "5000"), ("current", "3000"), ("stat", "anon 1500\ninactive_file 1000\n")):
        (tmp_path / f"memory.{name}").write_text(content)
    assert reading.free_memory() == 3000
    (tmp_path / "memory.max").write_text("max\n")
    assert reading.free_memory() == 8000 * 1024


@pytest.mark.skipif(sys.platform != "linux", reason="no ulimit -v")
def test_what_takes_more_than_the_process_may_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    import resource

    held = resource.getpagesize() * int(Path("/proc/self/statm").read_text().split()[0])
    limit = held + (3 << 30)
    monkeypatch.setattr(resource, "getrlimit", lambda _: (limit, resource.RLIM_INFINITY))
    reading.require_allowed("a lot", 1 << 30)
    with pytest.raises(
        tl.RenderError, match=r"^a lot; this needs 4 GiB of memory, but the limit of this process leaves"
    ):
        reading.require_allowed("a lot", 4 << 30)
    limit = resource.RLIM_INFINITY
    reading.require_allowed("a lot", 1 << 60)
