"""``translucent presets``: the named media, in a table or one in full."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING

import click

from translucent.commands.console import echo, takes_colors
from translucent.commands.options import triple_text
from translucent.commands.verbs import common_options
from translucent.errors import InputError

if TYPE_CHECKING:
    from translucent.media.preset import Preset

#: Names of presets in a hint.
MOST_NAMED = 3

_LISTED = ("name", "kind", "group", "regime", "colors", "diffuse_color", "source")


class _WordsAreSearched(click.Group):
    """Group of commands whose message for an unknown command says which presets have this word."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        word = args[0]
        if self.get_command(ctx, word) is None and word[:1].isalnum() and (hint := _search_hint(word)):
            ctx.fail(f"No such command {word!r}; {hint}")
        return super().resolve_command(ctx, args)


def _search_hint(word: str) -> str:
    """Hint on the commands that show the presets with this word; empty if no preset has it."""
    from translucent.media.presets import matching
    from translucent.media.presets import presets as all_presets

    found = list(matching(all_presets(), word))
    if not found:
        return ""
    named, more = ", ".join(found[:MOST_NAMED]), len(found) - MOST_NAMED
    every = f"{named} and {more} more" if more > 0 else named
    return (
        f"'translucent presets show {found[0]}' prints {found[0]}, 'translucent presets --search {word}' lists {every}"
    )


@click.group(cls=_WordsAreSearched, invoke_without_command=True, epilog="Example: translucent presets --search wine")
@click.option(
    "--group",
    metavar="G",
    help="List only the presets of this group, such as 'stone and resin', or a part of its name.",
)
@click.option("--search", metavar="WORDS", help="List only presets with these words in their name, note or source.")
@common_options
@click.pass_context
def presets(context: click.Context, group: str | None, search: str | None, as_json: bool) -> None:
    """List the named media with their colors.

    The first three colors are the colors of white light after 1 mm, 1 cm and 10 cm in the medium. The fourth color, for
    media that scatter, is the color of a thick slab in white light. Terminals with colors also show slabs of 1, 5 and
    20 mm on a white card and on a black card. Your own presets, .toml files that the previewer saves, come last.
    """
    if context.invoked_subcommand is not None:
        return
    found = _listed(group, search)
    if as_json:
        rows = [{key: one.summary()[key] for key in _LISTED} for one in found]
        echo(json.dumps({"presets": rows}))
        return
    echo(_table(found), color=takes_colors(sys.stdout))


def _listed(group: str | None, search: str | None) -> list[Preset]:
    """Presets of the toolkit and of the user, of a group and with some words."""
    from translucent.media.presets import grouped, matching, read_own_presets
    from translucent.media.presets import presets as all_presets

    own, wrong = read_own_presets()
    for error in wrong:
        echo(f"warning: {error}", err=True)
    known = own | all_presets()
    found = {name: known[name] for name in [*all_presets(), *(name for name in own if name not in all_presets())]}
    if group is not None:
        groups = grouped(found)
        chosen = [one for key, members in groups.items() if group.lower() in key for one in members]
        if not chosen:
            raise InputError(f"--group {group!r}", "no group has this name", f"use one of {', '.join(groups)}")
        found = {one.name: one for one in chosen}
    if search is not None and not re.search(r"[^\W_]", search):
        raise InputError(f"--search {search!r}", "the search text has no letters or digits", "give words, such as wine")
    if search is not None and not (found := matching(found, search)):
        which = "no preset" if group is None else f"no preset of --group {group!r}"
        raise InputError(
            f"--search {search!r}", f"{which} has all of these words", "use fewer words, or run 'translucent presets'"
        )
    return list(found.values())


@presets.command(epilog="Example: translucent presets show merlot")
@click.argument("name")
@common_options
@click.pass_context
def show(context: click.Context, name: str, as_json: bool) -> None:
    """Print the coefficients, colors and source of a named medium."""
    from translucent.media.presets import preset

    one = preset(name)
    above = context.parent.params if context.parent else {}
    if as_json or above.get("as_json"):
        echo(json.dumps(one.summary()))
        return
    echo(_details(one), color=takes_colors(sys.stdout))


def _table(found: list[Preset]) -> str:
    wide = max(len(one.name) for one in found)
    # A swatch and a space go before each hex color.
    pad = 3 if takes_colors(sys.stdout) else 0
    head = "  ".join(f"{text:<{7 + pad}}" for text in (*found[0].colors(), "thick"))
    cards = "on white, black  " if takes_colors(sys.stdout) else ""
    lines = [f"{'name':<{wide}}  {'kind':<9}  {'regime':<20}  {head}  {cards}source"]
    lines += [
        f"{one.name:<{wide}}  {one.kind:<9}  {one.regime:<20}  "
        f"{'  '.join(_swatch(color) + color for color in one.colors().values())}  "
        f"{_swatch(slab) + slab if (slab := one.diffuse_color()) else '-'.ljust(7 + pad)}  "
        f"{_slab_strip(one)}{one.source}"
        for one in found
    ]
    return "\n".join(lines)


def _slab_strip(one: Preset) -> str:
    """Swatches of slabs on a white and on a black card, or nothing where colors cannot be shown."""
    if not takes_colors(sys.stdout):
        return ""
    strips = ("".join(map(_cell, row.values())) for row in one.slab_colors().values())
    return f"{' '.join(strips)}    "  # as wide as its heading: two times three cells


def _details(one: Preset) -> str:
    from translucent.media.preset import PAPERS

    rows = [
        ("name", ", ".join((one.name, *one.aliases))),
        ("kind", one.kind),
        ("group", one.group),
        ("source", PAPERS.get(one.source, one.source)),
        ("note", one.note),
        ("regime", one.regime),
        ("warning", one.warning),
        ("absorption", _coefficients(one.absorption)),
    ]
    if one.medium.scatters:
        rows += [
            ("scattering*" if one.reduced else "scattering", _coefficients(one.scattering)),
            ("extinction", _coefficients(one.medium.extinction)),
            ("anisotropy", f"{triple_text(one.channel_anisotropy)}       rendered with {one.medium.anisotropy:.5g}"),
            ("albedo", triple_text(one.albedo)),
        ]
    rows += [("mean free path", f"{triple_text(1e3 * one.mean_free_path)} mm"), ("ior", f"{one.medium.ior:10g}")]
    rows.append(("roughness", f"{one.roughness:10g}" if one.roughness else ""))
    alone = one.absorption_colors()
    for text, color in one.colors().items():
        without = f"  (absorption alone {_swatch(alone[text])}{alone[text]})" if one.medium.scatters else ""
        rows.append((f"after {text}", f"{_swatch(color)}{color}{without}"))
    if slab := one.diffuse_color():
        rows.append(("thick slab", f"{_swatch(slab)}{slab}  (scattered back in white light; no mirror image)"))
    for card, row in one.slab_colors().items():
        slabs = "  ".join(f"{_swatch(color)}{color} {thickness}" for thickness, color in row.items())
        rows.append((f"on {card}", f"{slabs}  (slabs on a card, polished; no mirror image)"))
    lines = [f"{label:<15} {text}" for label, text in rows if text]
    if one.reduced:
        lines.append("* reduced, sigma_s (1 - g), all that is known: scatters isotropically")
    return "\n".join(lines)


def _coefficients(per_metre: Iterable[float]) -> str:
    values = list(per_metre)
    return f"{triple_text(1e-3 * v for v in values)} 1/mm  {triple_text(values)} 1/m"


def _swatch(color: str) -> str:
    """Two columns of a hex color and a space, or nothing where colors cannot be shown."""
    return f"{_cell(color)} " if takes_colors(sys.stdout) else ""


def _cell(color: str) -> str:
    red, green, blue = (int(color[i : i + 2], 16) for i in (1, 3, 5))
    return f"\x1b[48;2;{red};{green};{blue}m  \x1b[0m"
