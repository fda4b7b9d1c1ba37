"""The ways of finding interfaces, one file for each: its configuration, its passes and its traits."""

from __future__ import annotations

from translucent.planning.interfaces.base import Interfaces
from translucent.planning.interfaces.front import FrontInterface
from translucent.planning.interfaces.screen import ScreenInterfaces
from translucent.planning.interfaces.traced import TracedInterfaces

__all__ = ["INTERFACES", "FrontInterface", "Interfaces", "ScreenInterfaces", "TracedInterfaces"]

#: Names on the command line.
INTERFACES: dict[str, type[Interfaces]] = {
    one.name: one for one in (TracedInterfaces, ScreenInterfaces, FrontInterface)
}
