"""Choice of the ray tracer: Embree on the processors, or shaders."""

from __future__ import annotations

from translucent.arguments import brief
from translucent.errors import InputError
from translucent.geometry.ray_caster import embree_refusal

#: What finds the surfaces that rays hit, by its names; and what plans call it.
HITS = {"embree": "Embree", "gl": "OpenGL"}

#: Time with Embree, as a fraction of that with shaders.
EMBREE_COST = 0.5


def check_hits(what: str, hits: str | None) -> None:
    """Raise `InputError` unless this is one of `HITS`, or None."""
    if hits is not None and hits not in HITS:
        raise InputError(f"{what} hits {brief(hits)}", "not a known one", f"use {' or '.join(map(repr, HITS))}")


def chosen_hits(what: str, requested: str | None, software: bool, shader_storage: bool) -> tuple[str, str]:
    """Ray tracer of a plan, one of `HITS`, and the reason why it is not Embree where that would be faster.

    Parameters
    ----------
    what : str
        Whose rays: the name of its class.
    requested : str, optional
        One of `HITS`.
    software : bool
        OpenGL draws on the processors.
    shader_storage : bool
        It has compute shaders that write to buffers.

    Raises
    ------
    InputError
        If Embree is requested and cannot be used.
    """
    if requested == "gl" or (requested is None and not (software and shader_storage)):
        return "gl", ""
    refusal = embree_refusal() if shader_storage else "this OpenGL has no compute shaders, which came with 4.3"
    if not refusal:
        return "embree", ""
    if requested is not None:
        do = "pip install -U embreex, or leave hits out" if shader_storage else "leave hits out"
        raise InputError(f'{what}(hits="embree")', refusal, do)
    return "gl", f"{refusal}: OpenGL finds the surfaces that rays hit, in about twice the time; pip install -U embreex"
