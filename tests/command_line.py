"""Output and exit code of a command line, and what both are held against; the fixture `run` makes it."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any, NamedTuple

import pytest


class Result(NamedTuple):
    code: int
    out: str
    err: str


Run = Callable[..., Result]


def one_error_line(result: Result, code: int = 2) -> str:
    """The line, of a command that failed with this code and printed nothing else."""
    assert result[:2] == (code, ""), result
    (line,) = result.err.splitlines()
    assert line.startswith("error: ")
    return line


def strict_json(text: str) -> Any:
    """One JSON object; NaN and infinities, which JSON does not have, fail."""

    def refuse(word: str) -> None:
        pytest.fail(f"{word} is no JSON")

    value = json.loads(text, parse_constant=refuse)
    assert isinstance(value, dict)
    return value
