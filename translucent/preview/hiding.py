"""Objects to show, to hide and to isolate."""

from __future__ import annotations

from translucent.errors import InputError
from translucent.preview.actions import Hide
from translucent.preview.desk import Desk


def hide(desk: Desk, number: int) -> None:
    """Hide an object, or show it again; the last one on show stays."""
    hidden = set(desk.work.document.hidden) ^ {number}
    if hidden >= set(range(len(desk.objects))):
        found = "it is the only one on show"
        return desk.work.refuse(InputError(f"hiding {desk.name_of(number)}", found, "show another object first"))
    return desk.work.do(Hide(tuple(hidden)))


def isolate(desk: Desk, number: int) -> None:
    """Show an object alone, or all if it is alone."""
    every = range(len(desk.objects))
    alone = desk.work.document.shown_among(len(every)) == (number,)
    desk.work.do(Hide(() if alone else tuple(i for i in every if i != number)))


def show_all(desk: Desk) -> None:
    """Show all objects."""
    desk.work.do(Hide(()))
