"""Environments and stages made ready in the background, with the last ones on show meanwhile."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path

from translucent.formulas.brdf_table import brdf_table
from translucent.geometry.normals import corner_normals
from translucent.geometry.solids import Box
from translucent.preview.document import Document
from translucent.preview.loaded import Loaded
from translucent.preview.staging import environment_of, prepare_stage, stage_name
from translucent.preview.tasks import Lane, Task
from translucent.scene.environment import filtered
from translucent.scene.environment_files import READERS
from translucent.scene.stages import NO_STAGE

#: Environments: the one that lights, and the one in the background; and the stage.
Names = tuple[str, str, str]


@dataclass
class Lighting:
    """Reader of the environments of documents, and maker of their stages.

    Parameters
    ----------
    lane : Lane

    Attributes
    ----------
    begun : bool
        The first picture is there: it is one without a stage, and waits for none.
    """

    lane: Lane
    begun: bool = False
    _ready: Names = ("", "", NO_STAGE)
    _asked: Names | None = None
    #: Stages whose light is known.
    _made: set[str] = field(default_factory=lambda: {NO_STAGE})

    def lit(self, document: Document, loaded: Loaded) -> Document:
        """Document with the last environments and the last stage in place of its own, if these are not ready."""
        look = document.look
        wanted = look.environment, look.background, stage_name(look, loaded)
        if not any(map(_is_file, wanted[:2])) and wanted[2] in self._made:
            self._ready, self._asked = wanted, None
        elif wanted != self._asked and (self.begun or wanted[2] == NO_STAGE):
            self._asked = wanted
            name = "reading the environment" if wanted[2] == NO_STAGE else "setting the stage"
            self.lane.start(name, lambda _: _prepare(wanted), lambda _: self._take(wanted))
        environment, background, stage = wanted if wanted == self._ready else self._ready
        return dataclasses.replace(
            document, look=dataclasses.replace(look, environment=environment, background=background, stage=stage)
        )

    def _take(self, names: Names) -> None:
        self._ready = names
        if not any(names[:2]):
            self._made.add(names[2])


def prepare(_: Task) -> None:
    """Prepare the data of frames with surfaces or smooth edges, before it is waited for."""
    corner_normals(Box().tessellate())
    brdf_table()
    for name in ("light-table", "studio"):
        filtered(environment_of(name))


def _is_file(name: str) -> bool:
    return Path(name).suffix.lower() in READERS


def _prepare(names: Names) -> None:
    environment, background, stage = names
    for name in filter(None, (environment, background)):
        filtered(environment_of(name))
    prepare_stage(stage, environment, background)
