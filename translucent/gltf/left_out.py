"""What a file asks for and a scene does not hold, gathered while it is read."""

from __future__ import annotations

#: How many names a line tells.
FIRST = 3


class LeftOut:
    """One line per kind of loss, with the names of those that have it."""

    def __init__(self) -> None:
        self._names: dict[str, dict[str, None]] = {}

    def add(self, what: str, name: str) -> None:
        """Note a loss; the same one again counts once."""
        self._names.setdefault(what, {})[name] = None

    def lines(self) -> tuple[str, ...]:
        """Such as ``base color textures ('Label', 'Table', 'Wall' and 2 more)``."""
        return tuple(f"{what} ({_listed(list(names))})" for what, names in self._names.items())


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - FIRST} more" if len(names) > FIRST else ""
    return ", ".join(names[:FIRST]) + more
