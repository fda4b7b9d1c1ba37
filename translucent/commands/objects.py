"""Media for single objects: what stands behind an ``--object`` on the command line is that object's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from translucent.commands.common import (
    medium_options,
    read_any_medium,
    read_roughness,
    roughness_option,
    scattering_medium_options,
)
from translucent.errors import InputError

if TYPE_CHECKING:
    from translucent.media.medium import Medium

#: Key under which a verb finds the options that stand behind each ``--object``.
_GROUPS = "translucent.objects"

_OBJECT = "--object"


class NamedMedium(NamedTuple):
    """Medium of the objects of a name, and the roughness of their surfaces, if any is asked for."""

    name: str
    medium: Medium
    roughness: float | None


@click.command()
@medium_options
@scattering_medium_options
@roughness_option
def _of_one_object(**_: Any) -> None:
    """The options that may stand behind an --object."""


class ObjectCommand(click.Command):
    """Verb in which the options of a medium belong to the ``--object`` before them; before the first, to all others."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Take the options of single objects out of the arguments, and parse the rest."""
        rest, groups = _grouped(args)
        ctx.meta[_GROUPS] = groups
        return super().parse_args(ctx, rest)


def read_objects(names: Sequence[str]) -> list[NamedMedium]:
    """Media of the objects that are named, of the verb that runs.

    Raises
    ------
    InputError
        If an object is named twice or gets no medium, or its options are wrong.
    """
    found: list[NamedMedium] = []
    for name, options in zip(names, click.get_current_context().meta[_GROUPS], strict=True):
        if name in [one.name for one in found]:
            raise InputError(f"{_OBJECT} {name!r}", "it is named twice", "give it one medium")
        given = _of_one_object.make_context("render", options).params
        roughness, preset_name = given.pop("roughness"), given["preset_name"]
        medium = read_any_medium(**given)
        if medium is None:
            do = "add --preset NAME, or --color C and --distance D, behind it"
            raise InputError(f"{_OBJECT} {name!r}", "no medium is named for it", do)
        found.append(NamedMedium(name, medium, read_roughness(roughness, preset_name)))
    return found


def _grouped(arguments: list[str]) -> tuple[list[str], list[list[str]]]:
    """Arguments without the options of single objects, and those options, for each ``--object``."""
    takes_value = {name: not option.is_flag for option in _options() for name in (*option.opts, *option.secondary_opts)}
    rest: list[str] = []
    groups: list[list[str]] = []
    words = iter(arguments)
    for word in words:
        name, sign, _ = word.partition("=")
        if word == "--":
            rest += [word, *words]
        elif groups and name in takes_value:
            groups[-1].append(word)
            if takes_value[name] and not sign:
                groups[-1] += [value for value in [next(words, None)] if value is not None]
        else:
            rest.append(word)
            if name == _OBJECT:
                groups.append([])
                if not sign:
                    rest += [value for value in [next(words, None)] if value is not None]
    return rest, groups


def _options() -> list[click.Option]:
    return [one for one in _of_one_object.params if isinstance(one, click.Option)]
