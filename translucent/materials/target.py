"""Export targets: systems that a medium is written for, and readers of the numbers in texts written for them.

Nothing of a text is ever run. What is read is what the writers of this package wrote, also where somebody has changed a
number since.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.media.medium import Medium

_NUMBERS = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


@dataclass(frozen=True)
class ExportTarget:
    """System that a medium is written for, and whose files may be read.

    Attributes
    ----------
    title : str
    write : callable
        Text for a medium, the distance in metres at which its color is stated, and the roughness of its surface, 0
        (polished) to 1: the square root of the GGX alpha.
    suffix : str
        Of the files that are read; empty for none.
    read : callable
        Medium of the text of such a file, with lengths in a unit where it states none.
    roughness : callable
        Roughness that such a text states for the surface. Where it states none, the shader's own default; where a
        texture or a node states it, 0.
    """

    title: str
    write: Callable[[Medium, float, float], str]
    suffix: str = ""
    read: Callable[[str, str], Medium] | None = None
    roughness: Callable[[str], float] | None = None


def roughness_behind(start: str) -> Callable[[str], float]:
    """Reader of the roughness that stands behind a text, 0 where that is missing."""
    return lambda text: float(stated("surface", text, start, default=0.0)[0])


def stated_color(what: str, text: str, start: str) -> Array:
    """(3,): a color behind `start`, each channel in 0..1; raises `InputError` otherwise."""
    color = stated(what, text, start, 3)
    if not ((color >= 0) & (color <= 1)).all():
        raise InputError(what, f"the color {color.tolist()} is outside 0..1", "correct the color")
    return color


def stated_length(what: str, text: str, start: str) -> float:
    """A length behind `start`, > 0; raises `InputError` otherwise."""
    length = float(stated(what, text, start)[0])
    if not length > 0:
        raise InputError(what, f"{start.strip()!r} is {length:g}, but must be above 0", "correct this value")
    return length


def stated(what: str, text: str, start: str, count: int = 1, default: float | None = None) -> Array:
    """(count,): the numbers that stand behind the first `start` of a text, in its line.

    Parameters
    ----------
    what : str
        Of whom an error speaks.
    text : str
    start : str
        Literal text, right before the numbers or a bracket, a comma or a sign of equality before them.
    count : int
    default : float, optional
        Value where the text has no `start`.

    Raises
    ------
    InputError
        If there is no `start` and no default, or there are not so many finite numbers behind it.
    """
    _, found, rest = text.partition(start)
    if not found:
        if default is None:
            raise InputError(
                what, f"the text has no {start.strip()!r}", "give the text exactly as the command printed it"
            )
        return np.full(count, default)
    line = rest.partition("\n")[0]
    numbers = np.array([float(number) for number in _NUMBERS.findall(line)[:count]])
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        kind = "a number" if count == 1 else f"{count} numbers"
        raise InputError(
            what, f"{start.strip()!r} is not followed by {kind}", "give the text exactly as the command printed it"
        )
    return numbers
