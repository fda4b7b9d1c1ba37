"""Record of a bake, written beside it as JSON: ``thickness.exr`` has ``thickness.exr.json``."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from translucent.bake.baked import BakedMap, BakedVertices
from translucent.bake.encoding import Encoding
from translucent.files.paths import OutputFiles, fill_text
from translucent.files.reading import json_value, read_text
from translucent.version import VERSION

Record = dict[str, Any]

#: Definitions of the values of each mode; the equations are in ``docs/baking.md``.
DEFINITIONS = {
    "normal": "distance from the surface to the exit along the inward normal",
    "cone": "mean distance from the surface to the exit over the directions of a cone around the inward normal",
    "transmittance": "the distance at which the medium lets through as much as the mean over the cone",
    "inscribed": "diameter of the largest sphere inside that touches the surface there",
    "local": "share of the directions of a cone around the inward normal that go farther than the maximum distance",
}


def unit_of(mode: str) -> str:
    """Unit of the values of a mode: ``"m"``, or ``"1"`` for the dimensionless one."""
    return "1" if mode == "local" else "m"


def sidecar_of(path: Path) -> Path:
    """Path of the record of a file."""
    return path.with_name(f"{path.name}.json")


def plain(value: Any) -> Any:
    """Convert a value for JSON: NumPy's numbers become Python's, infinity and NaN null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value


def describe(result: BakedMap | BakedVertices, encoding: Encoding) -> Record:
    """Description of a bake: definition, unit, range, encoding, settings, report and mesh."""
    values, settings = np.asarray(result.values), result.settings
    coverage = getattr(result, "coverage", None)
    seen = values[coverage] if coverage is not None else values
    known: Record = {
        "kind": "vertex thickness" if coverage is None else "thickness map",
        "mode": settings.mode,
        "definition": DEFINITIONS[settings.mode],
        "unit": unit_of(settings.mode),
        "range": _range(seen),
        "encoding": encoding.summary(),
        "settings": plain(settings.summary()),
        "report": plain(result.report.summary()),
        "mesh": {"name": result.mesh.name, "vertices": len(result.mesh.vertices), "faces": len(result.mesh.faces)},
    }
    if coverage is not None:
        known["size"] = [values.shape[1], values.shape[0]]
        known["covered_texels"] = int(np.count_nonzero(coverage))
    if hasattr(result, "escaped"):
        known["escaped"] = float(result.escaped)
    return known


def shared(parts: list[Record]) -> Record:
    """Common entries of all parts of one bake, for the head of their record."""
    return {key: parts[0][key] for key in ("kind", "mode", "definition", "unit", "settings")}


def _range(values: Any) -> Record | None:
    if not values.size:
        return None
    return {"min": float(values.min()), "median": float(np.median(values)), "max": float(values.max())}


def provenance() -> dict[str, str]:
    """Versions of everything that the numbers depend on."""
    from translucent.geometry.embree import embree_versions

    return {
        "translucent": VERSION,
        "numpy": np.__version__,
        **embree_versions(),
        "python": platform.python_version(),
        "machine": platform.machine(),
    }


def write_record(path: Path, record: Record) -> Record:
    """Write the record of the file at `path` beside it, with the file's hash; returns the record.

    It is written after the file, so that a record whose hash is that of its file vouches for both.
    """
    with OutputFiles() as files:
        return add_record(files, path, {**fingerprint(path), **record})


def add_record(files: OutputFiles, path: Path, record: Record) -> Record:
    """Write a record where that of the file at `path` belongs, together with other files; returns the record."""
    full = {**record, "provenance": provenance()}
    text = json.dumps(full, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    files.write(sidecar_of(path), partial(fill_text, text=text))
    return full


def fingerprint(path: Path, filled: Path | None = None) -> Record:
    """Name and hash of a file, as records have them, which may still be under another name."""
    return {"file": path.name, "sha256": file_hash(filled or path)}


def parts_of(record: Record) -> list[Record]:
    """Records of the maps, or of the primitives with thickness at their vertices, within a record."""
    found: list[Record] = record.get("maps") or record.get("primitives") or [record]
    return found


def files_of(record: Record) -> list[Record]:
    """Names and hashes of the files of a record: maps, and meshes with new UVs."""
    maps, uv_file = record.get("maps"), record.get("uv_file")
    parts = [record, *(maps if isinstance(maps, list) else []), uv_file]
    return [part for part in parts if isinstance(part, dict) and isinstance(part.get("file"), str)]


def file_hash(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def read_record(path: Path) -> Record | None:
    """Read the record of a file, if it exists and is valid."""
    try:
        found = json_value(read_text(sidecar_of(path), f"record of {str(path)!r}"))
    except ValueError:
        return None
    return found if isinstance(found, dict) else None
