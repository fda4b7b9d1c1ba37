"""Sentences to paraphrase: drawn at random from the README, the docs, the help texts and the messages.

``python tools/draw_sentences.py 60 --seed 1`` prints 60 of them, each with its place, for a reader who knows graphics
and not this project. ``--context`` prints before each what a reader of the page has just read: its headings and the two
sentences before. ``--lengths`` prints how long sentences and pages are instead.
"""

from __future__ import annotations

import argparse
import ast
import random
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import click

ROOT = Path(__file__).resolve().parents[1]

#: Made by the build of the site; its tables have no sentences.
MADE = ("generated", "gallery_of_examples")

#: Calls whose texts a user reads.
MESSAGES = {"InputError", "RenderError", "Note", "PassSpec", "TranslucentWarning", "warn", "option"}

#: Words of the shortest sentence.
SHORTEST = 5


def pages() -> list[Path]:
    """Handwritten prose files: the README and the pages of the site."""
    docs = (ROOT / "docs").rglob("*.md")
    return [ROOT / "README.md", *sorted(page for page in docs if page.relative_to(ROOT).parts[1] not in MADE)]


def prose(text: str) -> str:
    """Text without code, pictures, tables of numbers and the addresses of links; cells of tables are paragraphs."""
    text = re.sub(r"(?ms)^ *```.*?^ *```$", "\n\n", text)
    text = re.sub(r"\$\$.*?\$\$", "\n\n", text, flags=re.DOTALL)
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)", "", text)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"(?m)^\|[\s:|-]+\|$", "", text)
    return re.sub(r"(?m)^\|(.*)\|$", lambda row: "\n\n" + row.group(1).replace(" | ", "\n\n") + "\n\n", text)


def sentences(text: str) -> list[str]:
    """Sentences of a text, without headings."""
    found = []
    for paragraph in re.split(r"\n\s*\n|\n(?=\s*(?:- |\d+\. ))", text):
        if paragraph.lstrip().startswith(("#", "<", ":::")):
            continue
        line = " ".join(re.sub(r"^\s*(?:- |\d+\. |> )", "", paragraph).split())
        found += re.split(r"(?<=[.!?:])\s+(?=[A-Z`*\"(])", line)
    return [sentence.strip() for sentence in found if len(re.findall(r"[A-Za-z]{2,}", sentence)) >= SHORTEST]


def helps() -> Iterator[tuple[str, str]]:
    """Place and sentence of the help of each verb, without its options."""
    from translucent.cli import cli

    def walk(command: click.Command, name: str) -> Iterator[tuple[str, str]]:
        yield from ((f"{name} --help", one) for one in sentences(command.help or ""))
        if isinstance(command, click.Group):
            for key, child in command.commands.items():
                yield from walk(child, f"{name} {key}")

    yield from walk(cli, "translucent")


def messages() -> Iterator[tuple[str, str]]:
    """Place and sentence of the texts of errors, notes and options; values stand as …."""
    for path in sorted((ROOT / "translucent").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", getattr(node.func, "attr", "")) in MESSAGES:
                texts = [_text(one) for one in (*node.args, *(keyword.value for keyword in node.keywords))]
                # An error is one line: what was asked, what was found, what to do.
                is_error = getattr(node.func, "id", "").endswith("Error")
                whole = ["; ".join(filter(None, texts))] if is_error else texts
                place = f"{path.relative_to(ROOT)}:{node.lineno}"
                yield from ((place, one) for text in whole for one in sentences(text))


def _text(node: ast.expr) -> str:
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else ""
    if isinstance(node, ast.JoinedStr):
        return "".join(_text(one) if isinstance(one, ast.Constant) else "…" for one in node.values)
    return ""


def written() -> Iterator[tuple[str, str]]:
    """Place and sentence of all pages."""
    for page in pages():
        text = page.read_text(encoding="utf-8")
        for one in sentences(prose(text)):
            begin = " ".join(one.split()[:3])
            line = next((i for i, row in enumerate(text.splitlines(), 1) if begin in row), 0)
            yield f"{page.relative_to(ROOT)}:{line}", one


def context(place: str, sentence: str) -> str:
    """Headings above a sentence of a page and the two sentences before it in its section; empty for a message."""
    name = place.split(":")[0]
    if not name.endswith(".md"):
        return ""
    headings: list[str] = []
    for section in re.split(r"(?m)^(?=#+ )", prose((ROOT / name).read_text(encoding="utf-8"))):
        first, _, body = section.partition("\n")
        if first.startswith("#"):
            depth, title = first.split(" ", 1)
            headings = [*headings[: len(depth) - 1], title]
        found = sentences(body)
        if sentence in found:
            at = found.index(sentence)
            return f"   [{' > '.join(headings)}] {' '.join(found[max(0, at - 2) : at])}\n"
    return ""


def main() -> int:
    """Draw sentences, or measure them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("count", nargs="?", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--context", action="store_true", help="headings and two sentences before each as well")
    parser.add_argument("--lengths", action="store_true", help="words of sentences and pages instead")
    given = parser.parse_args()
    if given.lengths:
        words = [len(one.split()) for _, one in written()]
        longest = max(pages(), key=lambda page: len(page.read_text(encoding="utf-8").split()))
        print(f"{len(words)} sentences, {sum(words) / len(words):.1f} words on average, {max(words)} at most")
        print(f"longest page: {longest.relative_to(ROOT)}, {len(longest.read_text(encoding='utf-8').split())} words")
        return 0
    everything = [*written(), *helps(), *messages()]
    for number, (place, one) in enumerate(random.Random(given.seed).sample(everything, given.count), 1):
        print(f"{number}. {one}\n{context(place, one) if given.context else ''}   {place}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
