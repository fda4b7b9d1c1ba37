"""Names of files and folders that cannot be used as what was asked for."""

from __future__ import annotations

import errno
import os
import signal
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from translucent.files.images import write_png
from translucent.files.paths import (
    require_file,
    require_folder,
    require_output,
    write_atomically,
    write_text_atomically,
)


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    (tmp_path / "file").write_text("")
    (tmp_path / "folder").mkdir()
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere")
    (tmp_path / "loop").symlink_to(tmp_path / "back")
    (tmp_path / "back").symlink_to(tmp_path / "loop")
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe")
        (tmp_path / "to a pipe").symlink_to(tmp_path / "pipe")
    return tmp_path


@pytest.mark.parametrize(
    ("check", "name", "message"),
    [
        (require_file, "folder", "the path is a folder; give the path of a file"),
        (require_file, "absent", "no file has this path; check the path"),
        (require_file, "dangling", "no file has this path; check the path"),
        (require_file, "a\0b", "no file has this path; check the path"),
        (require_file, "long" * 100, "no file has this path; check the path"),
        (require_output, "folder", "a folder of this name already exists; choose another name"),
        (require_output, "loop", "the symbolic links of this path point at each other; choose another path"),
        (require_output, "absent/x", "absent' does not exist; create the folder first"),
        (require_output, "file/x", "file' is not a folder; choose another path"),
        (require_output, "a\0b/x", "create the folder first"),
        (require_output, "long" * 100 + "/x", "create the folder first"),
        (require_folder, "file", "file' is not a folder; choose another path"),
        (require_folder, "file/x/y", "file' is not a folder; choose another path"),
    ],
)
def test_a_name_that_cannot_be_used_is_refused(
    directory: Path, check: Callable[[Path, str], None], name: str, message: str
) -> None:
    with pytest.raises(tl.InputError) as error:
        check(directory / name, "what was asked")
    assert str(error.value).startswith("what was asked; ")
    assert str(error.value).endswith(message)


@pytest.mark.parametrize("name", [".", "made/below"])
def test_a_folder_that_takes_nothing_is_found_at_once(
    directory: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    def refuse(path: Path, mode: str) -> None:
        assert (path.parent, mode) == (directory, "x+b")
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(tl.RenderError, match=r"asked; the file cannot be written \(Read-only file system\)"):
        require_folder(directory / name, "asked")


@pytest.mark.parametrize(
    ("check", "name"),
    [
        (require_file, "file"),
        (require_output, "file"),
        (require_output, "absent"),
        (require_output, "dangling"),
        (require_output, "folder/x"),
        (require_folder, "folder"),
        (require_folder, "absent/x/y"),
    ],
)
def test_a_name_that_can_be_used_is_let_through(directory: Path, check: Callable[[Path, str], None], name: str) -> None:
    check(directory / name, "what was asked")


# Writing


@pytest.mark.parametrize("name", ["pipe", "to a pipe", "loop", "folder"])
def test_only_files_are_replaced(directory: Path, name: str) -> None:
    if name.endswith("pipe") and not hasattr(os, "mkfifo"):
        pytest.skip("no pipes with a name here")
    before = sorted((path.name, path.lstat().st_mode) for path in directory.iterdir())
    for write in (require_output, write_text_atomically):
        with pytest.raises(
            tl.InputError,
            match=r"(of this name already exists; choose another name|point at each other; choose another path)$",
        ):
            write(directory / name, "")
    assert before == sorted((path.name, path.lstat().st_mode) for path in directory.iterdir())


def test_a_file_is_written_as_any_new_file_is_without_touching_the_umask(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = os.umask(0o027)
    try:
        # What other threads write meanwhile would have that umask, too.
        monkeypatch.setattr(os, "umask", lambda _: pytest.fail("the umask belongs to all threads"))
        write_text_atomically(tmp_path / "a.txt", "text")
    finally:
        monkeypatch.undo()
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a.txt").stat().st_mode) == 0o640


def partial_files(folder: Path) -> list[str]:
    return [name for name in os.listdir(folder) if name.startswith(".partial-")]


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_what_a_killed_process_left_is_removed_by_the_next_write_of_that_file(tmp_path: Path) -> None:
    code = (
        "import os, signal, sys, pathlib; from translucent.files.paths import write_atomically\n"
        "write_atomically(pathlib.Path(sys.argv[1]), lambda path: os.kill(os.getpid(), signal.SIGKILL))\n"
    )
    for name in ("a.png", "b.png"):
        killed = subprocess.run([sys.executable, "-c", code, str(tmp_path / name)], check=False)
        assert killed.returncode == -signal.SIGKILL
    assert len(partial_files(tmp_path)) == 2
    pixels = np.zeros((2, 2, 3), dtype=np.uint8)
    write_atomically(tmp_path / "a.png", lambda path: write_png(path, pixels))
    assert len(partial_files(tmp_path)) == 1
    write_atomically(tmp_path / "b.png", lambda path: write_png(path, pixels))
    assert sorted(os.listdir(tmp_path)) == ["a.png", "b.png"]


@pytest.mark.skipif(sys.platform == "win32", reason="no locks")
def test_what_somebody_is_writing_now_is_not_removed(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"

    def slow(temporary: Path) -> None:
        write_text_atomically(path, "the first to finish")
        assert path.read_text() == "the first to finish"
        assert temporary.exists()
        temporary.write_text("the last to finish")

    write_atomically(path, slow)
    assert path.read_text() == "the last to finish"
    assert os.listdir(tmp_path) == ["a.txt"]
