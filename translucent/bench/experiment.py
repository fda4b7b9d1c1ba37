"""Experiment: scenes on which contenders are measured against a truth, with the claims that its numbers decide."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Sequence
from typing import Any, ClassVar, Generic, NamedTuple, Protocol, TypeVar

from translucent.bench.claims import Judge
from translucent.bench.drawing import BenchContext
from translucent.bench.record import Part, Report
from translucent.errors import TranslucentError, TranslucentWarning


class Named(Protocol):
    """Anything with a name that progress can show."""

    @property
    def name(self) -> str:
        """Unique within the experiment."""


class Whole(NamedTuple):
    """Single step of an experiment that measures all of its scenes together."""

    name: str = ""


SceneT = TypeVar("SceneT", bound=Named)


class Experiment(Generic[SceneT]):
    """One question that a report answers: how contenders do on scenes, compared with a truth.

    Each scene becomes one record: its truth, then a row for each contender. What fails is a row, or a record, with its
    reason, and the rest goes on.

    Attributes
    ----------
    part : str
        Of the report, that it belongs to.
    label : str
        Words before the name of a scene in progress messages.
    into : str
        Field of the report, or of its shadows, that its records are added to: ``cases``, ``shadows.sky``.
    claims : tuple of callables
        Claims that its numbers decide.
    shown : sequence
        Its scenes.
    """

    part: ClassVar[Part]
    label: ClassVar[str]
    into: ClassVar[str]
    claims: ClassVar[tuple[Judge, ...]] = ()

    shown: Sequence[SceneT] = ()

    def scenes(self, bench: BenchContext) -> Sequence[SceneT]:
        """Scenes to measure on this machine, in their order."""
        return self.shown

    def added(self, report: Report, record: Any) -> Report:
        """The report with the record of a scene."""
        return report.plus(self.into, (record,))

    def blank(self, bench: BenchContext, scene: SceneT) -> Any:
        """Record of a scene without numbers; it has a field ``failure``."""
        raise NotImplementedError

    def truth(self, bench: BenchContext, scene: SceneT) -> Any:
        """Truth of a scene."""
        raise NotImplementedError

    def contenders(self, truth: Any) -> Sequence[Any]:
        """Contenders that are measured on a scene."""
        raise NotImplementedError

    def row(self, bench: BenchContext, truth: Any, contender: Any) -> Any:
        """Row of one contender."""
        raise NotImplementedError

    def record(self, bench: BenchContext, blank: Any, truth: Any, rows: Sequence[Any]) -> Any:
        """Record of a scene, of its truth and rows."""
        raise NotImplementedError

    def measure(self, bench: BenchContext, scene: SceneT) -> Any:
        """Measure a scene."""
        blank = self.blank(bench, scene)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", TranslucentWarning)  # rows count the pixels that are not valid
                bench.doing("truth")
                truth = self.truth(bench, scene)
                rows, contenders = [], self.contenders(truth)
                for number, contender in enumerate(contenders, 1):
                    bench.doing(f"method {number} of {len(contenders)}")
                    rows.append(self.row(bench, truth, contender))
                bench.doing("record")
                return self.record(bench, blank, truth, rows)
        except Exception as error:  # noqa: BLE001 - a scene that cannot be measured leaves the others alone
            return dataclasses.replace(blank, failure=one_line(error))


def one_line(error: Exception) -> str:
    """One line of text for an error, as in rows."""
    text = str(error) if isinstance(error, TranslucentError) else f"{type(error).__name__}: {error}"
    return " ".join(text.split())
