"""Sentences to paraphrase: drawn at random from the README, the docs, the help texts and the messages.

``python tools/draw_sentences.py 60 --seed 1`` prints 60 of them, each with its place, for a reader who knows graphics
and not this project. ``--context`` prints before each what a reader has just read: the headings of a page and the two
sentences before; the header of a table and the row; the verb and the option that a help text describes.
``--only messages`` draws from one part alone. ``--lengths`` prints how long sentences and pages are instead.

These texts are no sentences, and are never drawn:

- headings, code, formulas, pictures, HTML, the pages that a program writes, and the list of sources;
- texts of fewer than five words;
- cells of a table that neither end in a full stop nor have a verb, such as "linear RGB, 1/m" (see `VERB`).

All other texts can be drawn. A message is one text, however many sentences it has, as its reader sees it: what was
asked, what was found, what to do. Values that a message inserts are printed as the expression in angle brackets;
beside them, a text has at least five words.
Several verbs share options: an option with the same text is drawn once.
"""

from __future__ import annotations

import argparse
import ast
import random
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import click

ROOT = Path(__file__).resolve().parents[1]

#: Made by the build of the site; its tables have no sentences.
MADE = ("generated", "gallery_of_examples")

#: The list of sources, which has titles and no sentences.
SOURCES = "sources.md"

#: Calls whose texts a user reads, beside all calls that are raised.
MESSAGES = {"InputError", "RenderError", "Note", "PassSpec", "TranslucentWarning", "warn"}

#: What a reader knows before the text of a call.
HEADS = {
    "Note": "a note of a plan:",
    "PassSpec": "why a plan has this pass:",
    "TranslucentWarning": "a warning:",
    "warn": "a warning:",
}

#: Words of the shortest sentence.
SHORTEST = 5

#: A verb in a cell of a table: a common one anywhere, or a first word as in "renders a picture" and "set the unit".
VERB = re.compile(
    r"\b(is|are|was|has|have|does|do|can|cannot|must|may|will|needs?|takes?|gives?|uses?|makes?|shows?|follows?|costs?)\b"
    r"|^(?:add|choose|clear|close|compare|move|place|read|see|set|state|use|write)\b"
    r"|^(?!(?:this|its|less|glass|pixels|samples|lights|media)\b)[A-Za-z]+[^s\W]s\b",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Drawn:
    """Sentence with its place, and what its reader has read before it."""

    place: str
    text: str
    before: str = ""


def pages() -> list[Path]:
    """Handwritten prose files: the README and the pages of the site."""
    docs = (ROOT / "docs").rglob("*.md")
    return [
        ROOT / "README.md",
        *sorted(page for page in docs if page.relative_to(ROOT).parts[1] not in MADE and page.name != SOURCES),
    ]


def prose(text: str) -> str:
    """Text without code, formulas, pictures and the addresses of links; rows of tables are paragraphs."""
    text = re.sub(r"(?ms)^ *```.*?^ *```$", "\n\n", text)
    text = re.sub(r"\$\$.*?\$\$", "\n\n", text, flags=re.DOTALL)
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)", "", text)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    return re.sub(r"(?m)^(\|.*\|)$", r"\n\n\1\n\n", text)


def sentences(text: str, shortest: int = SHORTEST) -> list[str]:
    """Sentences of a paragraph."""
    line = " ".join(re.sub(r"^\s*(?:- |\d+\. |> )", "", text).split())
    found = re.split(r"(?<=[.!?:])\s+(?=[A-Z`*\"(])", line)
    return [one.strip() for one in found if len(re.findall(r"[A-Za-z]{2,}", one)) >= shortest]


def written(page: Path) -> Iterator[Drawn]:
    """Sentences of a page, with the headings above and the two sentences before, or the table's header and the row."""
    source = page.read_text(encoding="utf-8")
    headings: list[str] = []
    before: list[str] = []
    header = ""
    for paragraph in re.split(r"\n\s*\n|\n(?=\s*(?:- |\d+\. ))|(?<=\n)(?=#)", prose(source)):
        paragraph = paragraph.strip()
        if title := re.match(r"(#+) (.*)", paragraph):
            headings, before = [*headings[: len(title[1]) - 1], title[2]], []
            paragraph = paragraph[title.end() :].strip()
        if not paragraph or paragraph.startswith(("<", ":::")):
            continue
        above = f"[{' > '.join(headings)}]"
        if paragraph.startswith("|"):
            if re.fullmatch(r"[|\s:-]+", paragraph):
                continue
            header = header or paragraph
            for cell in re.split(r"(?<!\\)\|", paragraph.strip("|")) if paragraph != header else ():
                if cell.strip().endswith((".", "!", "?")) or VERB.search(cell.strip()):
                    row = f"{above} a table: {header}\n   row: {paragraph}"
                    yield from (Drawn(_line(page, source, one), one, row) for one in sentences(cell))
            continue
        header = ""
        for one in sentences(paragraph, 1):
            if sentences(one):
                yield Drawn(_line(page, source, one), one, f"{above} {' '.join(before[-2:])}".rstrip())
            before.append(one)


def _line(page: Path, source: str, sentence: str) -> str:
    begin = " ".join(sentence.split()[:3])
    line = next((i for i, row in enumerate(source.splitlines(), 1) if begin in row), 0)
    return f"{page.relative_to(ROOT)}:{line}"


def helps() -> Iterator[Drawn]:
    """Sentences of the help of each verb and its options, with all of this help that a reader has read before."""
    from translucent.cli import cli

    found: dict[tuple[str, str], Drawn] = {}

    def add(place: str, name: str, text: str) -> None:
        parts = sentences(" ".join(text.split()), 1)
        for i, one in enumerate(parts):
            if sentences(one):
                found.setdefault((name, one), Drawn(place, one, f"{place}: {name}  {' '.join(parts[:i])}".rstrip()))

    def walk(command: click.Command, name: str) -> None:
        add(f"{name} --help", name, command.help or "")
        context = click.Context(command, info_name=name)
        for parameter in command.params:
            if record := parameter.get_help_record(context):
                add(f"{name} --help", record[0], record[1])
        if isinstance(command, click.Group):
            for key, child in command.commands.items():
                walk(child, f"{name} {key}")

    walk(cli, "translucent")
    yield from found.values()


def messages() -> Iterator[Drawn]:
    """Texts of errors, warnings, notes and reasons of passes, each whole."""
    for path in sorted((ROOT / "translucent").rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
        raised = {id(node.exc) for node in ast.walk(tree) if isinstance(node, ast.Raise)}
        for node in ast.walk(tree):
            if not isinstance(node, ast.Call):
                continue
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            if id(node) not in raised and name not in MESSAGES:
                continue
            around = [one for one in functions if one.lineno <= node.lineno <= (one.end_lineno or 0)]
            names = _assigned(around[-1], node.lineno) if around else {}
            said = node.args[
                slice(1, 2) if name in ("Note", "PassSpec") else slice(1) if "arn" in name else slice(None)
            ]
            whole = "; ".join(filter(None, (_text(one, names) for one in said)))
            if sentences(re.sub("<[^<>]*>", "", whole)):
                yield Drawn(f"{path.relative_to(ROOT)}:{node.lineno}", whole, HEADS.get(name, "an error:"))


def _assigned(function: ast.FunctionDef, line: int) -> dict[str, ast.expr]:
    """Expressions that a function has last assigned to its names before a line."""
    found: dict[str, ast.expr] = {}
    for node in ast.walk(function):
        if isinstance(node, ast.Assign) and node.lineno <= line:
            for target in node.targets:
                if isinstance(target, ast.Name):
                    found[target.id] = node.value
                elif isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                    pairs = zip(target.elts, node.value.elts, strict=False)
                    found |= {one.id: value for one, value in pairs if isinstance(one, ast.Name)}
    return found


def _text(node: ast.expr, names: dict[str, ast.expr]) -> str:
    """Text of an expression, with other values in angle brackets; `names` are those of texts."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(_text(one, names) for one in node.values)
    if isinstance(node, ast.FormattedValue):
        return _text(node.value, names)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return _text(node.left, names) + _text(node.right, names)
    if isinstance(node, ast.IfExp):
        return _text(node.body, names) or _text(node.orelse, names)
    if isinstance(node, ast.Name) and isinstance(names.get(node.id), ast.Constant | ast.JoinedStr | ast.IfExp):
        return _text(names[node.id], {key: value for key, value in names.items() if key != node.id})
    return f"<{ast.unparse(node)}>"


def main() -> int:
    """Draw sentences, or measure them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("count", nargs="?", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--context", action="store_true", help="print what a reader has read before each as well")
    parser.add_argument("--only", choices=("pages", "helps", "messages"), help="draw from this part alone")
    parser.add_argument("--lengths", action="store_true", help="words of sentences and pages instead")
    given = parser.parse_args()
    parts = {"pages": [one for page in pages() for one in written(page)]}
    if given.lengths:
        words = [len(one.text.split()) for one in parts["pages"]]
        longest = max(pages(), key=lambda page: len(page.read_text(encoding="utf-8").split()))
        print(f"{len(words)} sentences, {sum(words) / len(words):.1f} words on average, {max(words)} at most")
        print(f"longest page: {longest.relative_to(ROOT)}, {len(longest.read_text(encoding='utf-8').split())} words")
        return 0
    parts |= {"helps": list(helps()), "messages": list(messages())}
    everything = parts[given.only] if given.only else [one for part in parts.values() for one in part]
    for number, one in enumerate(random.Random(given.seed).sample(everything, given.count), 1):
        print(f"{number}. {one.text}\n{f'   {one.before}' + chr(10) if given.context else ''}   {one.place}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
