"""Formats of the targets that passes draw into: the one place that knows them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Format:
    """Format of the attachments of a framebuffer.

    Attributes
    ----------
    components : tuple of int
        Of each texture of float32, or of bytes where negative.
    with_depth : bool
        There is a depth buffer.
    windings : int
        Textures of RGBA32UI behind these.
    """

    components: tuple[int, ...]
    with_depth: bool = False
    windings: int = 0

    @property
    def attachment_bytes(self) -> tuple[int, ...]:
        """Bytes of a pixel in each color attachment."""
        return (*(4 * count if count > 0 else -count for count in self.components), *(16,) * self.windings)

    def bytes_of(self, *attachments: int) -> int:
        """Bytes of a pixel in some of the color attachments, or in all of them where none is named."""
        sizes = self.attachment_bytes
        return sum(sizes[i] for i in attachments) if attachments else sum(sizes)


FORMATS = {
    "accumulated": Format((2,)),
    "accumulated-spectral": Format((4, 1)),
    "nearest_and_farthest": Format((4,)),
    "opaque": Format((1, 4), with_depth=True),
    "paint": Format((4, 4), with_depth=True),
    "photons": Format((4,)),
    "photon_spread": Format((2,)),
    "entered": Format((4, 4, 4), with_depth=True),
    "left": Format((4, 4), with_depth=True),
    "surfaced": Format((4, 4), with_depth=True),
    "ordered": Format((4, 4, 4)),
    "peeled": Format((4,), with_depth=True),
    "peel_state": Format((4, 4, 4, 4, 4), windings=2),
    "nothing": Format((-1,)),
    "steepest": Format((1,)),
    "result": Format((4, 4, 4, 1, -1)),
    "compact": Format((4, 1)),
    "compact-spectral": Format((4, 1, 4)),
    "average": Format((4, 4), with_depth=True),
    "bent": Format((4, 4), with_depth=True),
    "unsettled": Format((-1,)),
    "opaque_mean": Format((4,)),
    "paths": Format((4, 4)),
    "layers": Format((4, 4)),
    "fronts": Format((1,), with_depth=True),
}


def accumulator_format(spectral: bool) -> Format:
    """Format of `Targets.path_and_count`."""
    return FORMATS["accumulated-spectral" if spectral else "accumulated"]


def compact_format(spectral: bool) -> Format:
    """Format of `Targets.compact`."""
    return FORMATS["compact-spectral" if spectral else "compact"]
