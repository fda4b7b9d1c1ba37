"""Names of files and folders that cannot be used as what was asked for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import translucent as tl
from translucent.paths import require_file, require_folder, require_place


@pytest.fixture
def place(tmp_path: Path) -> Path:
    (tmp_path / "file").write_text("")
    (tmp_path / "folder").mkdir()
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere")
    return tmp_path


@pytest.mark.parametrize(
    ("check", "name", "message"),
    [
        (require_file, "folder", "it is a folder; give a file in it"),
        (require_file, "absent", "no such file; check the path"),
        (require_file, "dangling", "no such file; check the path"),
        (require_file, "a\0b", "no such file; check the path"),
        (require_file, "long" * 100, "no such file; check the path"),
        (require_place, "folder", "a folder of that name is there; choose another name"),
        (require_place, "absent/x", "absent'; make the folder first"),
        (require_place, "file/x", "file' is no folder; choose another one"),
        (require_place, "a\0b/x", "make the folder first"),
        (require_place, "long" * 100 + "/x", "make the folder first"),
        (require_folder, "file", "file' is no folder; choose another one"),
        (require_folder, "file/x/y", "file' is no folder; choose another one"),
    ],
)
def test_a_name_that_cannot_be_used_is_refused(
    place: Path, check: Callable[[Path, str], None], name: str, message: str
) -> None:
    with pytest.raises(tl.InputError) as error:
        check(place / name, "what was asked")
    assert str(error.value).startswith("what was asked; ")
    assert str(error.value).endswith(message)


@pytest.mark.parametrize(
    ("check", "name"),
    [
        (require_file, "file"),
        (require_place, "file"),
        (require_place, "absent"),
        (require_place, "dangling"),
        (require_place, "folder/x"),
        (require_folder, "folder"),
        (require_folder, "absent/x/y"),
    ],
)
def test_a_name_that_can_be_used_is_let_through(place: Path, check: Callable[[Path, str], None], name: str) -> None:
    check(place / name, "what was asked")
