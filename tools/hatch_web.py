"""Hook of the build: what `make web` built goes along, into the sdist as it is and into the wheel as translucent/web.

Where it was not built, sdist and wheel do without; what needs it then says so.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

#: Scripts that the package itself hands out.
SCRIPTS = ("page.js", "widget.js")


class WebHook(BuildHookInterface):
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        dist = Path(self.root) / "web" / "dist"
        folder = "web/dist" if self.target_name == "sdist" else "translucent/web"
        built = [name for name in SCRIPTS if (dist / name).is_file()]
        if not built:
            self.app.display_warning("web/dist is not built, so pages for browsers are left out; `make web` builds it")
        if version != "editable":
            build_data["force_include"].update({str(dist / name): f"{folder}/{name}" for name in built})
