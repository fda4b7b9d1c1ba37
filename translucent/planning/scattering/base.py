"""Base class of the ways of showing light that is scattered many times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from translucent.scene.scene import Object


@dataclass(frozen=True)
class Scattering:
    """A way to show light that media scatter more than once; see its subclasses.

    Attributes
    ----------
    name : str
        On the command line.
    gives_back : bool
        Bodies give back what they scatter many times.
    """

    name: ClassVar[str] = ""
    gives_back: ClassVar[bool] = False

    def refusal(self, body: Object) -> str | None:
        """Reason why a body cannot be shown so; None if it can."""
        return None
