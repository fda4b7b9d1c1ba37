"""The command line: parse, call the public API, write. Errors are one line; ``--debug`` shows the traceback."""

from __future__ import annotations

import os
import re
import signal
import sys
import threading
import warnings
from itertools import pairwise

import click

from translucent.commands.bake import bake, lithophane
from translucent.commands.benchmark import benchmark
from translucent.commands.console import echo
from translucent.commands.explain import doctor, explain
from translucent.commands.extinction import extinction
from translucent.commands.material import material
from translucent.commands.presets import presets
from translucent.commands.render import render
from translucent.commands.report import report
from translucent.commands.shader import shader
from translucent.commands.viewers import page, preview
from translucent.errors import InputError, TranslucentError, message_of

#: Options after which a shell drops a color that is not quoted.
TAKE_COLORS = ("--color", "--background", "--environment")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code: 0 done, 1 failed at run time, 2 bad usage or input."""
    given = sys.argv[1:] if arguments is None else arguments
    if threading.current_thread() is threading.main_thread():
        # Asked to end, unwind as for Ctrl-C, so that no half-written file stays behind.
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    warnings.showwarning = lambda message, *_, **__: echo(f"warning: {message_of(str(message))}", err=True)
    try:
        _require_values(given)
        cli.main(args=given, prog_name="translucent", standalone_mode=False)
    except click.exceptions.Abort:
        return _failed("interrupted", 130)
    except click.ClickException as error:
        context = getattr(error, "ctx", None)
        command = context.command_path if context else "translucent"
        message = _below_zero(error, given) or _dashed_file(error, given) or error.format_message().rstrip(".")
        return _failed(f"{message}{_quoting(error)}; see '{command} --help'", 2)
    except TranslucentError as error:
        if "--debug" in given:
            raise
        return _failed(str(error), 2 if isinstance(error, InputError) else 1)
    except KeyboardInterrupt:
        return _failed("interrupted", 130)
    except Exception as error:  # a defect of ours, or a full memory: still one line
        if "--debug" in given:
            raise
        if _out_of_memory(error):
            found = f"the limit of the process is reached ({error or 'no details'})"
            return _failed(message_of("memory", found, "use smaller settings, or raise the limit (ulimit -v)"), 1)
        return _failed(f"unexpected {type(error).__name__}; {error or 'no details'}; --debug shows the traceback", 1)
    return 0


def _require_values(given: list[str]) -> None:
    """Raise where an option that takes a value stands before another option: that would be taken for the value."""
    _refuse_two_words(given)
    verb = cli.commands.get(given[0]) if given else None
    if verb is None or isinstance(verb, click.Group):
        return
    options = [one for one in verb.params if isinstance(one, click.Option)]
    names = {name for one in options for name in (*one.opts, *one.secondary_opts) if name.startswith("--")}
    valued = {
        name for one in options if not one.is_flag and not getattr(one, "_flag_needs_value", False) for name in one.opts
    }
    for word, after in pairwise(given):
        if word == "--":
            return
        if word in valued and after in names:
            raise InputError(
                word, f"the next word is the option {after}", f"give {word} a value before the next option"
            )


def _refuse_two_words(given: list[str]) -> None:
    """Raise where a length is in two words, as ``1 cm``: the second would be taken for a model."""
    from translucent.units import METRES_PER_UNIT

    for option, number, unit in zip(given, given[1:], given[2:], strict=False):
        is_length = re.fullmatch(r"[\d.]+", number) and unit in METRES_PER_UNIT and not os.path.exists(unit)
        if option.startswith("--") and is_length:
            raise InputError(f"{option} {number} {unit}", "two words", f"write {number}{unit}")


def _out_of_memory(error: Exception) -> bool:
    """True if the message of an error says that memory is exhausted."""
    words = "can't start new thread", "failed to map segment", "cannot allocate memory"
    return isinstance(error, MemoryError) or any(said in str(error).lower() for said in words)


def _below_zero(error: click.ClickException, given: list[str]) -> str | None:
    """The message for a number below 0 that was read as an option, where a value may be left out or an argument is."""
    if not (isinstance(error, click.NoSuchOption) and re.match(r"-[\d.]", error.option_name)):
        return None
    word = next((word for word in given if error.option_name in word), error.option_name)
    return f"{word!r}; a negative number is read as an option; give a number above 0"


def _dashed_file(error: click.ClickException, given: list[str]) -> str | None:
    """The message for a file whose name begins with a dash, which was read as an option."""
    if not isinstance(error, click.NoSuchOption):
        return None
    word = next((word for word in given if word.startswith(error.option_name) and os.path.exists(word)), None)
    return word and f"{word!r}; a file has this name, but words that begin with a dash are options; write ./{word}"


def _quoting(error: click.ClickException) -> str:
    """Hint about quoting for a color after an option at the end of the line, which a shell may have dropped."""
    if not (isinstance(error, click.BadOptionUsage) and error.option_name in TAKE_COLORS):
        return ""
    from translucent.media.colors import QUOTE_HINT

    return f"; {QUOTE_HINT}"


def _failed(message: str, code: int) -> int:
    echo(f"error: {message_of(message)}", err=True)
    return code


@click.group(no_args_is_help=False, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(package_name="translucent-shading", prog_name="translucent")
def cli() -> None:
    """Translucent materials on meshes, with the exact thickness along every view ray."""


for command in (
    render,
    preview,
    page,
    bake,
    lithophane,
    explain,
    extinction,
    presets,
    material,
    report,
    benchmark,
    shader,
    doctor,
):
    cli.add_command(command)


if __name__ == "__main__":
    sys.exit(main())
