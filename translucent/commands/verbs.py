"""Options of verbs as values: groups of fields that carry their options.

A verb takes its options as one frozen value, which the decorator `takes` makes of what stands on the command line::

    @dataclass(frozen=True, kw_only=True)
    class PrintOptions:
        output: Path = option(names=("-o", "--output"), required=True, help="A .png file.")
        medium: MediumOptions = group(MediumOptions)
        print_size: str = option("10cm", metavar="W", help="Width of the print.")

    @click.command("print")
    @takes(PrintOptions)
    def print_picture(given: PrintOptions, as_json: bool) -> None:

A field is named as its option is, ``--print-size``, unless it says otherwise; its annotation is the option's type, and
its default, stated here alone, is the one that ``--help`` shows. Options come in the order of the fields.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Iterator
from functools import wraps
from importlib import import_module
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import click

from translucent.commands.console import echo

Verb = Callable[..., Any]
Value = TypeVar("Value")


#: Name of the parameter, and key of a context, that shows all options.
_HELP_ALL = "help_all"


def option(default: Any = None, *, names: tuple[str, ...] = (), help: str | Callable[[], str], **more: Any) -> Any:
    """Field of a group that is an option.

    Parameters
    ----------
    default : object
    names : tuple of str
        As on the command line. Default: the field's.
    help : str or callable
        Text, or a function for it that imports more than a command line should.
    **more
        For `click.option`.
    """
    default = dataclasses.MISSING if more.get("required") else default
    return dataclasses.field(default=default, metadata={"names": names, "help": help, **more})


def group(kind: type, without: Collection[str] = ()) -> Any:
    """Field that includes another group of options, without the options of these names."""
    return dataclasses.field(default_factory=kind, metadata={"group": kind, "without": without})


def takes(kind: type) -> Callable[[Verb], Verb]:
    """Decorator of a verb that gets its options as one value, `given`, and whether to print JSON, `as_json`."""

    def decorate(verb: Verb) -> Verb:
        @wraps(verb)
        def collecting(*arguments: Any, **found: Any) -> Any:
            given: Any = collected(kind, found)
            rest = {name: value for name, value in found.items() if name not in set(_names(kind))}
            return verb(*arguments, given=given, **rest)

        return with_options(kind, common_options(collecting))

    return decorate


class VerbCommand(click.Command):
    """Command whose ``--help`` lists its usual options; ``--help-all`` lists all of them.

    Parameters
    ----------
    *arguments, **more
        As of `click.Command`.
    usual : str
        Names of the usual options as parameters, with spaces between them.
    """

    def __init__(self, *arguments: Any, usual: str, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self._usual = [*usual.split(), _HELP_ALL]
        shown = click.Option(["--help-all"], is_flag=True, is_eager=True, expose_value=False, help="Show all options.")
        shown.callback = self._show_all
        self.params.append(shown)

    def _show_all(self, ctx: click.Context, _: click.Parameter, requested: bool) -> None:
        if requested:
            ctx.meta[_HELP_ALL] = True
            echo(ctx.get_help())
            ctx.exit()

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the usual options, or all of them, in their order."""
        shown = [one for one in self.get_params(ctx) if ctx.meta.get(_HELP_ALL) or one.name in self._usual]
        with formatter.section("Options" if ctx.meta.get(_HELP_ALL) else "Usual options"):
            formatter.write_dl([record for one in shown if (record := one.get_help_record(ctx)) is not None])


def with_options(kind: type, verb: Verb) -> Verb:
    """Add the options of a group to a verb."""
    for one in reversed(list(_options(kind))):
        verb = one(verb)
    return verb


def common_options(verb: Verb) -> Verb:
    """Options of every verb."""
    verb = click.option("--debug", is_flag=True, expose_value=False, help="Show the Python traceback of an error.")(
        verb
    )
    return click.option("--json", "as_json", is_flag=True, help="Print the result as one JSON object.")(verb)


def collected(kind: type[Value], found: dict[str, Any]) -> Value:
    """Value of a group from parsed options by name."""
    values = {}
    for field in dataclasses.fields(kind):  # type: ignore[arg-type]
        if (inner := field.metadata.get("group")) is not None:
            values[field.name] = collected(inner, found)
        elif field.name in found:
            values[field.name] = found[field.name]
    return kind(**values)


def _names(kind: type) -> Iterator[str]:
    for field in dataclasses.fields(kind):
        inner = field.metadata.get("group")
        yield from [field.name] if inner is None else _names(inner)


def _options(kind: type, without: Collection[str] = ()) -> Iterator[Callable[[Verb], Verb]]:
    """Options of a group as decorators, in its order."""
    hints = get_type_hints(kind)
    for field in dataclasses.fields(kind):
        more = dict(field.metadata)
        if (inner := more.pop("group", None)) is not None:
            yield from _options(inner, {*more["without"], *without})
        elif field.name not in without:
            yield _decorator(field, hints[field.name], more)


def _decorator(field: dataclasses.Field[Any], hint: Any, more: dict[str, Any]) -> Callable[[Verb], Verb]:
    name = field.name.replace("_", "-")
    names, words = (
        more.pop("names") or (f"--{name}/--no-{name}" if field.default is True else f"--{name}",),
        more.pop("help"),
    )
    if isinstance(hint, UnionType):
        (hint,) = (one for one in get_args(hint) if one is not type(None))
    if get_origin(hint) is tuple:
        hint, more["multiple"] = get_args(hint)[0], True
    if hint is Path:
        hint = click.Path(path_type=Path)
    if hint is bool and "/" not in names[0]:
        more["is_flag"] = True
    elif hint is not bool:
        more.setdefault("type", hint)
    stated = not (field.default is dataclasses.MISSING or field.default in (None, ()))
    if stated or "/" in names[0]:
        more["default"] = field.default
        more.setdefault("show_default", not isinstance(field.default, bool | None))
    if isinstance(words, str):
        return click.option(*names, field.name, help=words, **more)
    return click.option(*names, field.name, cls=_LateOption, words=words, **more)


class _LateOption(click.Option):
    """Option whose help is made only where it is shown, since that imports more."""

    def __init__(self, *names: Any, words: Callable[[], str], **more: Any) -> None:
        super().__init__(*names, **more)
        self._words = words

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        record = super().get_help_record(ctx)
        return None if record is None else (record[0], self._words())


class NamesOf(click.Choice):  # type: ignore[type-arg] # click below 8.4 has no parameters
    """Choice among the names in a table, which is imported late.

    Parameters
    ----------
    module, table : str
        Where it is.
    """

    def __init__(self, module: str, table: str) -> None:
        self._module, self._table = module, table
        self.case_sensitive = True

    @property
    def choices(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names, in the table's order."""
        return tuple(getattr(import_module(self._module), self._table))
