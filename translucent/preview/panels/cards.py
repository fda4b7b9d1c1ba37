"""Cards: small pictures to click, side by side as far as a panel is wide."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from imgui_bundle import ImVec2, imgui

from translucent.preview.desk import em

#: Ems between two cards.
GAP = 0.5

CHOSEN, HOVERED, PLAIN = 0xFFFFB050, 0xFFC0C0C0, 0x40FFFFFF

T = TypeVar("T")


def draw_cards(
    members: Sequence[T], least: float, height: Callable[[float], float], draw: Callable[[T, ImVec2], None]
) -> None:
    """Draw the cards of a list in rows, as far as they can be seen.

    Parameters
    ----------
    members : sequence
    least : float
        Width of a card in ems, at least.
    height : callable
        From the width of a card to its height, in pixels.
    draw : callable
        Draws the card of a member, in a size.
    """
    room = imgui.get_content_region_avail().x
    across = max(int((room + em(GAP)) / em(least + GAP)), 1)
    width = (room - em(GAP) * (across - 1)) / across
    size = ImVec2(width, height(width))
    for i, member in enumerate(members):
        if i % across:
            imgui.same_line(0.0, em(GAP))
        if imgui.is_rect_visible(size):
            draw(member, size)
        else:
            imgui.dummy(size)


def draw_frame(over: imgui.ImDrawList, low: ImVec2, high: ImVec2, *, chosen: bool, hovered: bool) -> None:
    """Draw the frame of a card's picture, which tells whether it is chosen."""
    over.add_rect(low, high, CHOSEN if chosen else HOVERED if hovered else PLAIN, 0.0, em(0.12) if chosen else 1.0)
