"""Flags of a request for a picture, which the command line, pages and the previewer offer as they stand here."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


def _flag(default: bool, text: str) -> Any:
    """Field with the words for its option on the command line and its tip in the previewer."""
    return field(default=default, metadata={"names": (), "help": text})


@dataclass(frozen=True, kw_only=True)
class Flags:
    """Flags of a `RenderRequest`.

    A field here is an option of ``render``, ``explain`` and ``page``, and a box in the previewer. `Renderer.render` has
    a parameter for each.
    """

    adaptive: bool = _flag(
        True,
        "Stop when more samples no longer change a pixel, or always trace all samples. Default: --adaptive.",
    )
