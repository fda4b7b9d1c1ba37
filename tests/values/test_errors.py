"""Messages quote files that others made: they are one printable line, and not a long one."""

from __future__ import annotations

import warnings

import pytest

import translucent as tl
from translucent.errors import LONGEST, message_of, printable, shortened

NASTY = "a\x1b]0;title\x07b\u202ec\nd\x9be\udc80"


def test_what_commands_a_terminal_is_escaped() -> None:
    assert printable(NASTY) == r"a\x1b]0;title\x07b\u202ec\nd\x9be\udc80"
    assert str(tl.InputError("mesh", NASTY, "é")) == rf"mesh; {printable(NASTY)}; é"
    with pytest.warns(tl.TranslucentWarning) as told:
        warnings.warn(NASTY, tl.TranslucentWarning, stacklevel=1)
    assert str(told[0].message) == printable(NASTY)


@pytest.mark.parametrize(
    "parts", [("x" * 999, "found", "do"), ("what", "y" * 999, "z" * 999), ("w" * 99, "f" * 99, "d" * 999)]
)
def test_a_long_message_keeps_the_ends_of_its_parts(parts: tuple[str, str, str]) -> None:
    text = message_of(*parts)
    assert 200 < len(text) <= LONGEST
    for part in parts:
        assert part[:9] in text
        assert part[-9:] in text


def test_a_message_that_fits_is_left_alone() -> None:
    assert message_of("what", "", "do") == "what; do"
    assert shortened("x" * LONGEST) == "x" * LONGEST
    nested = tl.InputError("outer", str(tl.InputError("inner", "n" * 500)), "do this")
    assert len(str(nested)) <= LONGEST
    assert str(nested).endswith("; do this")
