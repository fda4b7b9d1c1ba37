"""Scripts for browsers, as the package finds it."""

from __future__ import annotations

from pathlib import Path

import pytest

from translucent import assets
from translucent.errors import InputError


def test_a_script_that_was_not_built_says_how_to_build_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(assets, "_PACKAGE", tmp_path / "translucent")
    with pytest.raises(
        InputError,
        match=r"the script 'page.js' for browsers; .* does not exist.*; build the script: run `make web`",
    ):
        assets.web_path("page.js")


@pytest.mark.parametrize("folder", ["web/dist", "translucent/web"], ids=["checkout", "wheel"])
def test_scripts_are_where_they_were_built_or_installed(
    folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(assets, "_PACKAGE", tmp_path / "translucent")
    (tmp_path / folder).mkdir(parents=True)
    (tmp_path / folder / "page.js").touch()
    assert assets.web_path("page.js") == tmp_path / folder / "page.js"
