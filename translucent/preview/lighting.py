"""Environments read from files in the background, with the last one on show meanwhile."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

from translucent.formulas.brdf_table import brdf_table
from translucent.formulas.sampling import sample_shifts
from translucent.geometry.normals import corner_normals
from translucent.geometry.solids import Box
from translucent.preview.document import Document
from translucent.preview.scenes import environment_of
from translucent.preview.tasks import Lane, Task
from translucent.scene.environment_files import READERS
from translucent.scene.environment_filter import filtered

#: Environments: the one that lights, and the one in the background.
Names = tuple[str, str]


@dataclass
class Lighting:
    """Reader of the environments of documents.

    Parameters
    ----------
    lane : Lane
    """

    lane: Lane
    _ready: Names = ("", "")
    _asked: Names | None = None

    def lit(self, document: Document) -> Document:
        """Document with the last environments in place of its own, if these have not been read."""
        look = document.look
        wanted = look.environment, look.background
        if not any(map(_is_file, wanted)):
            self._ready, self._asked = wanted, None
        elif wanted != self._asked:
            self._asked = wanted
            self.lane.start("reading the environment", lambda _: _prepare(wanted), lambda _: self._take(wanted))
        if wanted == self._ready:
            return document
        environment, background = self._ready
        return dataclasses.replace(
            document, look=dataclasses.replace(look, environment=environment, background=background)
        )

    def _take(self, names: Names) -> None:
        self._ready = names


def prepare(_: Task) -> None:
    """Prepare the data of frames with surfaces or smooth edges, before it is waited for."""
    sample_shifts(1)  # these two import large parts of SciPy
    corner_normals(Box().tessellate())
    brdf_table()
    for name in ("light-table", "studio"):
        filtered(environment_of(name))


def _is_file(name: str) -> bool:
    return Path(name).suffix.lower() in READERS


def _prepare(names: Names) -> None:
    for name in filter(None, names):
        filtered(environment_of(name))
