"""Checked values of the objects of a glTF material, whose problems are gathered and told together."""

from __future__ import annotations

import math

from translucent.gltf.file import Json
from translucent.gltf.textures import TEXTURE_TRANSFORM, TextureTransform

Triple = tuple[float, float, float]


class Fields:
    """Reader of the checked values of one JSON object; errors go into `problems`."""

    def __init__(self, owner: object, where: str, problems: list[str]) -> None:
        self.problems = problems
        if not isinstance(owner, dict):
            problems.append(f"{where} is {owner!r}, not an object")
        self.values: Json = owner if isinstance(owner, dict) else {}

    def number(self, key: str, default: float, low: float, high: float = math.inf, *, above: bool = False) -> float:
        """A number in `low`..`high`; excluding `low` itself with `above`."""
        value = self.values.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.problems.append(f"{key} is {value!r}, not a number")
            return default
        if not low <= value <= high or (above and value == low):
            allowed = f"above {low:g}" if above else f"{low:g} or more" if math.isinf(high) else f"in {low:g}..{high:g}"
            self.problems.append(f"{key} {value:g} is not {allowed}")
            return default
        return float(value)

    def triple(self, key: str, default: Triple) -> Triple:
        """Three numbers in 0..1."""
        value = self.values.get(key, list(default))
        if not isinstance(value, list) or len(value) != 3:
            self.problems.append(f"{key} is {value!r}, not three numbers")
            return default
        channels = Fields({f"{key}[{i}]": channel for i, channel in enumerate(value)}, key, self.problems)
        red, green, blue = (channels.number(f"{key}[{i}]", default[i], 0.0, 1.0) for i in range(3))
        return red, green, blue

    def pair(self, key: str, default: tuple[float, float]) -> tuple[float, float]:
        """Two numbers."""
        value = self.values.get(key, list(default))
        if not isinstance(value, list) or len(value) != 2:
            self.problems.append(f"{key} is {value!r}, not two numbers")
            return default
        parts = Fields({f"{key}[{i}]": part for i, part in enumerate(value)}, key, self.problems)
        return parts.number(f"{key}[0]", default[0], -math.inf), parts.number(f"{key}[1]", default[1], -math.inf)

    def whole(self, key: str, default: int) -> int:
        """A nonnegative integer."""
        value = self.values.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            self.problems.append(f"{key} is {value!r}, not a whole number of 0 or more")
            return default
        return value

    def texture(self, key: str, count: int) -> tuple[int | None, TextureTransform]:
        """Index and transform of a texture, if there is one."""
        if key not in self.values:
            return None, TextureTransform()
        info = Fields(self.values[key], key, self.problems)
        index = info.values.get("index")
        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < count:
            self.problems.append(f"{key} index {index!r} is not one of {count} textures")
            return None, TextureTransform()
        extensions = Fields(info.values.get("extensions", {}), f"{key} extensions", self.problems).values
        stated = Fields(extensions.get(TEXTURE_TRANSFORM, {}), TEXTURE_TRANSFORM, self.problems)
        return index, TextureTransform(
            stated.pair("offset", (0.0, 0.0)),
            stated.number("rotation", 0.0, -math.inf),
            stated.pair("scale", (1.0, 1.0)),
            stated.whole("texCoord", info.whole("texCoord", 0)),
        )
