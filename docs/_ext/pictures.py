"""The pictures that an example saves, for its page in the gallery."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from sphinx_gallery.scrapers import figure_rst


def new_pictures(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Move what the example has saved beside itself into the gallery; no more of it than its page needs."""
    taken = []
    for picture in sorted(Path(block_vars["src_file"]).parent.glob("*.png"), key=lambda path: path.stat().st_mtime):
        taken.append(next(block_vars["image_path_iterator"]))
        shutil.move(picture, taken[-1])
    return str(figure_rst(taken, gallery_conf["src_dir"]))
