"""Hard cases: inputs that break renderers, each measured against its promise."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from translucent import reference
from translucent.bench.record import HardCase
from translucent.errors import InputError, TranslucentError, TranslucentWarning
from translucent.frames.frame import Frame
from translucent.frames.metrics import Errors, Quantity, compare, interior
from translucent.planning.methods import Method
from translucent.renderer import Renderer
from translucent.scene.scene import Scene

Size = tuple[int, int]

#: Largest error of an exact promise in float32: a hundred roundings of a path as long as the diagonal.
EXACT = 100 * float(np.finfo(np.float32).eps) / 2

#: Size of frames, small so that each case takes a fraction of a second.
SIZE: Size = (96, 96)


@dataclass
class Checks:
    """Findings of one hard case, gathered while it runs.

    Attributes
    ----------
    renderer : Renderer
    worst : float or None
        Largest of all errors so far.
    told, failed : list of str
        Findings in words.
    """

    renderer: Renderer
    limit: float
    worst: float | None = None
    told: list[str] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)

    def error(self, what: str, value: float) -> None:
        """Record an error, which must stay within the limit; NaN does not."""
        value = abs(float(value))
        self.worst = value if self.worst is None else float(np.maximum(self.worst, value))
        self._note(f"{what} {value:.1e}", value <= self.limit)

    def holds(self, what: str, held: bool | np.bool_) -> None:
        """Record a condition that must be true."""
        self._note(what, bool(held))

    def refused(self, what: str, make: Callable[[], object], word: str) -> None:
        """Record that a call must raise an `InputError` whose message has this word."""
        try:
            made = make()
        except InputError as error:
            self._note(f"{what} refused", word in str(error))
        else:
            self._note(f"{what} gave {type(made).__name__}, no error", held=False)

    def picture(self, what: str, scene: Scene) -> Frame:
        """Render, and record the error in thickness: its 99.9th percentile, as a share of the diagonal."""
        frame, truth = self.render(scene, SIZE), reference.render(scene, SIZE)
        inside = interior(reference.hit_counts(scene, SIZE))
        self.error(what, compare(frame, truth, mask=inside).p999 / scene.diagonal)
        self.holds(f"{what}: no pixel marked", frame.valid[inside].all())
        return frame

    def compared(self, frame: Frame, truth: Frame, scene: Scene, quantity: Quantity = "thickness") -> Errors:
        """Errors of a frame away from silhouettes."""
        return compare(frame, truth, quantity, mask=interior(reference.hit_counts(scene, frame.size)))

    def render(self, scene: Scene, size: Size = SIZE, method: Method | None = None) -> Frame:
        """Render without warnings about invalid pixels."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TranslucentWarning)
            return self.renderer.render(scene, size, method)

    def _note(self, what: str, held: bool) -> None:
        (self.told if held else self.failed).append(what)


@dataclass(frozen=True)
class Hard:
    """One hard case.

    Attributes
    ----------
    id, title, promise : str
        As in the record.
    check : callable
        Fills in `Checks`.
    limit : float
        Of all errors that it notes.
    unit : str
    """

    id: str
    title: str
    promise: str
    check: Callable[[Checks], None]
    limit: float = EXACT
    unit: str = "of the diagonal"

    def measure(self, renderer: Renderer) -> HardCase:
        """Measure the case; one that raises has failed."""
        checks = Checks(renderer, self.limit)
        try:
            self.check(checks)
        except Exception as error:  # noqa: BLE001 - a hard case that breaks something is a finding, and the others go on
            words = str(error) if isinstance(error, TranslucentError) else f"{type(error).__name__}: {error}"
            checks.failed.append(words)
        passed = not checks.failed
        result = "; ".join(checks.told) if passed else f"wrong: {'; '.join(checks.failed)}"
        # JSON has no word for infinity: an error that is not finite is told in words.
        worst = checks.worst if checks.worst is not None and np.isfinite(checks.worst) else None
        limit, unit = (self.limit, self.unit) if checks.worst is not None else (None, "")
        return HardCase(self.id, self.title, self.promise, result, passed, worst, limit, unit)
