"""Undo and redo: documents before and after each step, with drags as one step."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from translucent.preview.actions import CAMERA_ACTIONS, Action, Adopt, Assign, Change, apply
from translucent.preview.document import Document

#: Largest number of steps that can be undone.
MAX_STEPS = 200


@dataclass(frozen=True)
class History:
    """History of a document: its past and undone states.

    Attributes
    ----------
    present : Document
    past, future : tuple of Document
        The last of `past` is what undo shows, the last of `future` what redo shows.
    drag : tuple of (str, int), optional
        Field, or object, and number of the drag that made the present one.
    """

    present: Document = dataclasses.field(default_factory=Document)
    past: tuple[Document, ...] = ()
    future: tuple[Document, ...] = ()
    drag: tuple[str, int] | None = None

    def done(self, action: Action) -> History:
        """History after an action; one that changes nothing leaves no step, and a drag leaves one."""
        after = apply(self.present, action)
        if isinstance(action, (*CAMERA_ACTIONS, Adopt)):
            return dataclasses.replace(self, present=after)
        if after == self.present:
            return self
        drag = None
        if isinstance(action, (Change, Assign)) and action.drag is not None:
            drag = action.field if isinstance(action, Change) else f"object {action.object}", action.drag
        if drag is not None and drag == self.drag:
            return dataclasses.replace(self, present=after, future=())
        return History(after, (*self.past, self.present)[-MAX_STEPS:], (), drag)

    def undone(self) -> History:
        """History one step back; the camera stays, unless the model is another."""
        if not self.past:
            return self
        before = _seen_as(self.present, self.past[-1])
        return History(before, self.past[:-1], (*self.future, self.present))

    def redone(self) -> History:
        """History one step forward."""
        if not self.future:
            return self
        after = _seen_as(self.present, self.future[-1])
        return History(after, (*self.past, self.present), self.future[:-1])


def _seen_as(present: Document, other: Document) -> Document:
    return dataclasses.replace(other, orbit=present.orbit) if other.model == present.model else other
