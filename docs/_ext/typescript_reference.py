"""Reference of the web module, which TypeDoc reads from its sources; a sentence where npm has not installed it."""

from __future__ import annotations

import re
import subprocess
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

WEB = Path(__file__).resolve().parents[2] / "web"
TYPEDOC = WEB / "node_modules" / "typedoc" / "bin" / "typedoc"

#: Sources by what imports name.
ENTRIES = {
    "translucent-three": "index",
    "translucent-three/webgpu": "webgpu",
    "translucent-three/react": "react",
    "translucent-three/gltf-transform": "gltf-transform",
}

OPTIONS = (
    *("--plugin", "typedoc-plugin-markdown", "--readme", "none", "--router", "module"),
    *(word for name in ENTRIES.values() for word in ("--entryPoints", f"src/{name}.ts")),
    *("--hideBreadcrumbs", "--hidePageHeader", "--disableSources", "--excludePrivate", "--excludeProtected"),
    *("--excludeExternals", "--useCodeBlocks", "--parametersFormat", "table", "--propertiesFormat", "table"),
    *("--logLevel", "Error"),
)

ABSENT = "This site was built without npm. `make web`, then `make docs`, writes the reference here.\n"


def as_section(text: str, entry: str) -> str:
    """Text of TypeDoc for the middle of a page: without its title, and with code in place of links to deep headings."""
    body = re.sub(r"\A# .*\n", "", text)
    body = re.sub(r"^## References\n.*?(?=^## |\Z)", "", body, flags=re.M | re.S)  # to what other entries have
    body = re.sub(r"^## (.+)$", lambda found: f"## {found[1]} of `{entry}`", body, flags=re.M)
    return re.sub(r"\[(`[^`]+`)\]\([^)]*#[^)]*\)", r"\1", body)


def write_reference(app: Sphinx) -> None:
    """Write ``generated/typescript.md``, which ``typescript.md`` includes."""
    text = ABSENT
    if TYPEDOC.is_file():
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run(["node", TYPEDOC, *OPTIONS, "--out", folder], cwd=WEB, check=True)
            pages = {
                entry: (Path(folder) / f"{name}.md").read_text(encoding="utf-8") for entry, name in ENTRIES.items()
            }
            text = "\n".join(as_section(page, entry) for entry, page in pages.items())
    path = Path(app.srcdir) / "generated" / "typescript.md"
    path.parent.mkdir(exist_ok=True)
    path.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", write_reference)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
