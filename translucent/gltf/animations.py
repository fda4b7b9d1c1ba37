"""Poses of animated nodes: translation, rotation and scale at a time.

Source: glTF 2.0, section 3.11 and appendix C (interpolation): STEP, LINEAR (spherical for rotations, along the shorter
way) and CUBICSPLINE. Before the first key of a sampler its first value holds, after the last its last. A time after all
keys is told.

All animations of a file play at once, since exporters write one for each object as well as one for each take; where two
move the same property of a node, the first does, and the other is told.
"""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Iterator

import numpy as np

from translucent.arrays import Array
from translucent.errors import InputError, TranslucentWarning
from translucent.gltf.accessors import Accessors
from translucent.gltf.fields import LeftOut, label
from translucent.gltf.file import GltfFile, Json

_KINDS = {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3"}
_MODES = ("LINEAR", "STEP", "CUBICSPLINE")

#: Cosine between quaternions from which a straight way between them is as good as an arc.
_NEAR = 1.0 - 1e-9


def posed(file: GltfFile, seconds: float, left_out: LeftOut) -> GltfFile:
    """The file with its nodes as its animations have them at a time.

    Parameters
    ----------
    file : GltfFile
    seconds : float
        >= 0, on the clock of the keys.
    left_out : LeftOut
        Gets what moves and is not supported: weights of morph targets, and what extensions point at.

    Raises
    ------
    InputError
        If the time is negative or not finite, the file has no animation, or one is wrong.
    """
    if not 0 <= seconds < math.inf:
        raise InputError(f"time {seconds!r}", "negative or not finite", "give seconds from the start")
    animations = file.items("animations")
    if not animations:
        raise InputError(f"time {seconds:g} of {str(file.path)!r}", "it has no animations", "leave the time out")
    accessors, moved = Accessors(file), [dict(node) for node in file.items("nodes")]
    ends: list[float] = []
    taken: set[tuple[int, str]] = set()
    for number, animation in enumerate(animations):
        name = label(animations, number)
        for channel, target in _channels(file, animation, name):
            path, node = target.get("path"), target.get("node")
            if not isinstance(path, str) or path not in _KINDS or node is None:
                left_out.add(f"animated {path if isinstance(path, str) else 'properties'}", name)
                continue
            file.item("nodes", node)
            if "matrix" in moved[node]:
                raise file.refused(f"animation {name} moves node {label(moved, node)}, which has a matrix")
            if (node, path) in taken:
                left_out.add(f"animations that move what another does ({path})", name)
                continue
            taken.add((node, path))
            value, end = _value(file, accessors, animation, channel, path, seconds, name)
            moved[node][path] = value.tolist()
            ends.append(end)
    if ends and seconds > max(ends):
        text = f"its animations end after {max(ends):g} s; at {seconds:g} s all stays as it is then"
        warnings.warn(f"scene {file.path.name!r}: {text}", TranslucentWarning, stacklevel=4)
    return dataclasses.replace(file, tree={**file.tree, "nodes": moved})


def _channels(file: GltfFile, animation: Json, name: str) -> Iterator[tuple[Json, Json]]:
    """Channels of an animation, with their targets."""
    channels = animation.get("channels", [])
    if not (isinstance(channels, list) and all(isinstance(one, dict) for one in channels)):
        raise file.refused(f"animation {name}: channels is not a list of objects")
    for channel in channels:
        target = channel.get("target")
        if not isinstance(target, dict):
            raise file.refused(f"animation {name}: a channel has no target")
        yield channel, target


def _value(
    file: GltfFile, accessors: Accessors, animation: Json, channel: Json, path: str, seconds: float, name: str
) -> tuple[Array, float]:
    """Value of a channel, and the time of its last key."""
    samplers, index = animation.get("samplers", []), channel.get("sampler")
    if not isinstance(samplers, list) or not isinstance(index, int) or not 0 <= index < len(samplers):
        raise file.refused(f"animation {name}: sampler {index!r} is not one of its samplers")
    sampler = samplers[index]
    if not isinstance(sampler, dict) or (mode := sampler.get("interpolation", "LINEAR")) not in _MODES:
        raise file.refused(f"animation {name}: sampler {index} is no object with an interpolation of glTF 2.0")
    times = accessors.vectors(sampler.get("input"), "SCALAR")[:, 0]
    values = accessors.vectors(sampler.get("output"), _KINDS[path])
    per_key = 3 if mode == "CUBICSPLINE" else 1
    if len(values) != per_key * len(times) or not (np.isfinite(times).all() and np.isfinite(values).all()):
        raise file.refused(f"animation {name}: {len(values)} values for {len(times)} keys, or one that is not finite")
    if (np.diff(times) <= 0).any():
        raise file.refused(f"animation {name}: its keys are not in the order of time")
    found = sample(times, values.reshape(len(times), per_key, -1), seconds, mode, arc=path == "rotation")
    end = float(times[-1])
    if path != "rotation":
        return found, end
    length = float(np.linalg.norm(found))
    if not length > 0:
        raise file.refused(f"animation {name}: a rotation of length 0")
    return found / length, end


def sample(times: Array, values: Array, seconds: float, mode: str, *, arc: bool) -> Array:
    """(w,): value at a time of keys (n,), which ascend, with values (n, 1, w); (n, 3, w) of tangents for CUBICSPLINE.

    `arc` says that values are unit quaternions, which LINEAR joins by arcs.
    """
    middle = values.shape[1] // 2
    after = int(np.searchsorted(times, seconds, side="right"))
    if after == 0 or after == len(times) or mode == "STEP":
        return np.asarray(values[max(after - 1, 0), middle])
    start, end = values[after - 1], values[after]
    span = float(times[after] - times[after - 1])
    t = (seconds - float(times[after - 1])) / span
    if mode == "CUBICSPLINE":
        t2, t3 = t * t, t * t * t
        ends = (2 * t3 - 3 * t2 + 1) * start[1] + (3 * t2 - 2 * t3) * end[1]
        return np.asarray(ends + span * ((t3 - 2 * t2 + t) * start[2] + (t3 - t2) * end[0]))
    return _slerp(start[0], end[0], t) if arc else np.asarray((1.0 - t) * start[0] + t * end[0])


def _slerp(start: Array, end: Array, t: float) -> Array:
    cosine = float(start @ end)
    if cosine < 0:  # the same rotation, the shorter way
        end, cosine = -end, -cosine
    if cosine > _NEAR:
        return np.asarray((1.0 - t) * start + t * end)
    angle = math.acos(cosine)
    return np.asarray((math.sin((1.0 - t) * angle) * start + math.sin(t * angle) * end) / math.sin(angle))
