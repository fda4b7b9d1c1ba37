"""Options that choose the method, and the reader of their values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import click

from translucent.errors import InputError

if TYPE_CHECKING:
    from translucent.planning.caustics import Caustics
    from translucent.planning.methods import Method
    from translucent.planning.shadow_maps import ShadowMaps
    from translucent.scene.scene import Scene

F = TypeVar("F", bound=Callable[..., Any])


class _MethodOption(click.Option):
    """An option whose help names the methods, which are imported only where it is shown."""

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        from translucent.planning.methods import METHODS

        record = super().get_help_record(ctx)
        *names, last = METHODS
        sheets = " and ".join(name for name, method in METHODS.items() if method.makes_sheets)
        told = (
            f"{', '.join(names)} or {last}. Default: by plan. Without OpenGL all but {sheets} give way to all surfaces "
            "on each ray."
        )
        return None if record is None else (record[0], told)


def method_option(command: F) -> F:
    """The option for how thickness is found."""
    return click.option("--method", "method_name", cls=_MethodOption, metavar="NAME")(command)


def paths_option(command: F) -> F:
    """Option for the number of random paths."""
    told = "Of --method path-traced: random paths of each pixel. Default: 64. Four times as many halve the noise."
    return click.option("--paths", type=int, metavar="N", help=told)(command)


def caustics_option(command: F) -> F:
    """Option for photons from lights through interfaces onto opaque objects."""
    told = (
        "Let N photons carry the light of lamps through interfaces onto opaque objects, into fog, wax and milk. "
        "Default: none; without N: a million; at most 2^30. Four times as many halve the noise."
    )
    return click.option("--caustics", type=int, is_flag=False, flag_value=1_000_000, metavar="[N]", help=told)(command)


def shadow_options(command: F) -> F:
    """Options for shadows on opaque objects."""
    command = click.option(
        "--environment-shadows",
        type=int,
        metavar="N",
        help="Directions of the environment that throw shadows onto opaque objects, 0 to 256. Default: 128 on a stage, "
        "else none.",
    )(command)
    told = "Texels along a side of each light's map of shadows, 64 to 8192. Default: 1024. More make edges sharper."
    return click.option("--shadow-size", type=int, metavar="N", help=told)(command)


def read_shadows(size: int | None) -> ShadowMaps | None:
    """Maps of shadows of this size, if one is asked for."""
    from translucent.planning.shadow_maps import ShadowMaps

    return None if size is None else ShadowMaps(size)


def with_environment_shadows(scene: Scene, count: int | None) -> Scene:
    """Scene with so many directions of the environment that throw shadows, if a number is given."""
    return scene if count is None else replace(scene, environment_shadows=count)


def read_caustics(photons: int | None) -> Caustics | None:
    """Caustics by so many photons, if any are asked for."""
    from translucent.planning.caustics import Caustics

    return None if photons is None else Caustics(photons)


def read_method(name: str | None, thickness: str | None, paths: int | None = None) -> Method | None:
    """Thickness method of this name, if one is given."""
    from translucent.planning.methods import METHODS, method_from_name
    from translucent.units import parse_length

    method = method_from_name(name) if name else None
    if paths is not None:
        if method is None or not method.follows_paths:
            names = " or ".join(name for name, known in METHODS.items() if known.follows_paths)
            raise InputError("--paths", f"only --method {names} takes it", f"add --method {names}")
        method = method.with_paths(paths)
    if thickness is None:
        return method
    if method is None or not method.makes_sheets:
        names = " or ".join(name for name, known in METHODS.items() if known.makes_sheets)
        raise InputError("--thickness", f"only --method {names} takes it", f"add --method {names}")
    return method.with_thickness(parse_length(thickness))
