"""Record of features that a file asks for and a scene does not support."""

from __future__ import annotations

#: Largest number of names in a line.
FIRST = 3


class LeftOut:
    """Record of features left out: one line per kind, with the names of the objects concerned."""

    def __init__(self) -> None:
        self._names: dict[str, dict[str, None]] = {}

    def add(self, what: str, name: str) -> None:
        """Record a loss; the same one again counts once."""
        self._names.setdefault(what, {})[name] = None

    def lines(self) -> tuple[str, ...]:
        """Lines of text such as ``base color textures ('Label', 'Table', 'Wall' and 2 more)``."""
        return tuple(f"{what} ({_listed(list(names))})" for what, names in self._names.items())


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - FIRST} more" if len(names) > FIRST else ""
    return ", ".join(names[:FIRST]) + more
