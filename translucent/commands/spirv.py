"""Names in SPIR-V (the Khronos specification of its binary form) that translators take over."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

_NAME, _TYPE_POINTER, _VARIABLE = 5, 32, 59
_HEADER = 5  # words


def with_block_names(module: bytes) -> bytes:
    """Module whose uniform blocks without a name of their own are called as their types, in small letters.

    Translators put the names in front of those of the members, or numbers that change with every edit.
    """
    words = np.frombuffer(module, "<u4")
    names: dict[int, str] = {}
    pointees: dict[int, int] = {}
    blocks: dict[int, str] = {}
    for code, operands in _instructions(words):
        if code == _NAME:
            names[int(operands[0])] = operands[1:].tobytes().split(b"\0")[0].decode()
        elif code == _TYPE_POINTER:
            pointees[int(operands[0])] = int(operands[2])
        elif code == _VARIABLE and not names.get(int(operands[1])):
            blocks[int(operands[1])] = names.get(pointees[int(operands[0])], "").lower()
    named = [words[:_HEADER]]
    for code, operands in _instructions(words):
        block = blocks.get(int(operands[0])) if code == _NAME else None
        rest = _text(block) if block else operands[1:]
        first = operands[:1]
        length = 1 + len(first) + len(rest)
        named += [np.array([length << 16 | code], "<u4"), first, rest]
    return np.concatenate(named).astype("<u4").tobytes()


def _instructions(words: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """Opcode and operands of each instruction."""
    at = _HEADER
    while at < len(words):
        length, code = divmod(int(words[at]), 1 << 16)
        yield code, words[at + 1 : at + length]
        at += length


def _text(text: str) -> np.ndarray:
    """Words of a string, which ends with a zero."""
    data = text.encode()
    return np.frombuffer(data + b"\0" * (4 - len(data) % 4), "<u4")
