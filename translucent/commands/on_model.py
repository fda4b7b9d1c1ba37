"""``translucent extinction --on``: the average color of a medium on a model, and the medium for such a color."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from translucent.commands.common import triple_text
from translucent.commands.model import CameraOptions, read_scene

if TYPE_CHECKING:
    from translucent.frames.frame import Frame
    from translucent.media.medium import Medium

#: Pixels of the picture that is averaged; of the shape of the one that ``translucent render`` makes, and so framed.
SIZE = (640, 360)

#: Share of a channel's average beyond which the thin parts alone make its color.
MOST_THIN_SHARE = 0.5


def thickness_on(model: str, unit: str, eye: str | None, allow_outside: bool = False) -> Frame:
    """The model as ``translucent render`` shows it, all of it filled with one medium."""
    import translucent as tl

    # Any medium will do: only the thickness is looked at.
    scene = read_scene(
        model, unit, tl.Medium(absorption=1.0), CameraOptions(eye=eye), SIZE, allow_outside=allow_outside
    )
    with tl.Renderer() as renderer:
        return renderer.render(scene, SIZE)


def told_on(model: str, frame: Frame, medium: Medium) -> dict[str, Any]:
    """Appearance of a medium on a model as values that JSON can hold."""
    from translucent.frames.appearance import appearance_of

    return {"model": model, **appearance_of(frame, medium).summary()}


def doubts_on(told: dict[str, Any]) -> list[str]:
    """Warnings about an average color: channels that next to nothing of the model shows."""
    return [
        f"the average {name} is made by the edges: {share:.0%} of it comes from the thinnest 5 % of the pixels"
        for name, share in zip(("red", "green", "blue"), told["thin_share"], strict=True)
        if share > MOST_THIN_SHARE
    ]


def report_on(told: dict[str, Any]) -> list[str]:
    """Lines of text for what `told_on` says."""
    lines = [
        f"on {told['model']}: {told['pixels']} pixels, {told['mean_thickness']:.4g} m thick on average",
        f"average color   {triple_text(told['average_color'])} linear, {told['average_hex']} sRGB",
    ]
    for part in told["parts"]:
        color = f"{triple_text(part['color'])} linear, {part['hex']}"
        lines.append(f"at {part['thickness']:<9.4g} m  {color}; {part['thinner']:.0%} of it is thinner")
    return lines
