"""The methods of finding thickness, one file for each: its configuration and its traits."""

from __future__ import annotations

import difflib

from translucent.errors import InputError
from translucent.planning.methods.back_face_depth import BackFaceDepth
from translucent.planning.methods.base import Method
from translucent.planning.methods.depth_peeling import DepthPeeling
from translucent.planning.methods.fragment_lists import FragmentLists
from translucent.planning.methods.k_buffer import KBuffer
from translucent.planning.methods.path_traced import PathTraced
from translucent.planning.methods.ray_marched import RayMarched
from translucent.planning.methods.signed_depth import SignedDepth
from translucent.planning.methods.thin_layer import ThinLayer

__all__ = [
    "METHODS",
    "BackFaceDepth",
    "DepthPeeling",
    "FragmentLists",
    "KBuffer",
    "Method",
    "PathTraced",
    "RayMarched",
    "SignedDepth",
    "ThinLayer",
    "method_from_name",
]

#: Names on the command line.
METHODS: dict[str, type[Method]] = {
    method.name: method
    for method in (SignedDepth, BackFaceDepth, ThinLayer, DepthPeeling, FragmentLists, KBuffer, RayMarched, PathTraced)
}


def method_from_name(name: str) -> Method:
    """The method of this name, with its default parameters; raises `InputError` if there is none."""
    try:
        return METHODS[name.replace("_", "-").lower()]()
    except KeyError:
        close = difflib.get_close_matches(name.replace("_", "-").lower(), METHODS, n=1)
        do = f"did you mean {close[0]}?" if close else f"use one of {', '.join(METHODS)}"
        raise InputError(f"method {name!r}", "no method has this name", do) from None
