"""Records of bakes and the encoding of their values: ``thickness.exr`` has ``thickness.exr.json`` beside it.

Values are stored so that value = offset + scale * stored; for thickness, value is in metres:

=============  ===========  =======================  =====================================
file           requested    stored                   value = offset + scale * stored
=============  ===========  =======================  =====================================
float          metric       t                        t = 0 + 1 * stored
float          normalize    t / max                  t = 0 + max * stored
float          invert       1 - t / max              t = max - max * stored
16-bit gray    metric,      round(65535 t / max)     t = 0 + (max / 65535) * stored
               normalize
16-bit gray    invert       65535 - the same         t = max - (max / 65535) * stored
glTF, G        (none)       round(255 t / max)       t = 0 + (max / 255) * stored
=============  ===========  =======================  =====================================
"""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.files.paths import OutputFiles, fill_text
from translucent.files.reading import json_value, read_text
from translucent.geometry.mesh import Mesh
from translucent.version import VERSION

Record = dict[str, Any]


@dataclass(frozen=True)
class Encoding:
    """Encoding of values in a file, and its inverse.

    Parameters
    ----------
    scale, offset : float
        value = offset + scale * stored.
    levels : int
        Largest whole number that the file stores; 0 for floats, which are stored as they are.
    unit : str
        Of the values: ``"m"``, or ``"1"`` for those without a unit.
    """

    scale: float = 1.0
    offset: float = 0.0
    levels: int = 0
    unit: str = "m"

    @classmethod
    def of(
        cls, values: npt.ArrayLike, levels: int = 0, *, normalize: bool = False, invert: bool = False, unit: str = "m"
    ) -> Encoding:
        """Encoding for these values; `invert` also normalizes, so that thin parts are 1 and the thickest 0.

        Raises
        ------
        InputError
            If the largest value must divide the others, and is 0.
        """
        if not (levels or normalize or invert):
            return cls(unit=unit)
        largest = float(np.max(values, initial=0.0))
        if largest == 0:
            if normalize or invert:
                raise InputError(
                    "thickness as a fraction of its largest value",
                    "the largest thickness is 0",
                    "omit --normalize and --invert",
                )
            largest = 1.0  # what does not matter where all are 0, and yet must not divide by 0
        scale = largest / (levels or 1)
        return cls(-scale, largest, levels, unit) if invert else cls(scale, 0.0, levels, unit)

    @property
    def quantum(self) -> float:
        """Quantization step of the values; 0 for floats."""
        return abs(self.scale) if self.levels else 0.0

    def encode(self, values: npt.ArrayLike) -> npt.NDArray[Any]:
        """Encode values as float32, uint8 or uint16."""
        with np.errstate(under="ignore"):
            stored = (np.asarray(values, dtype=np.float64) - self.offset) / self.scale
            if not self.levels:
                return stored.astype(np.float32)
        whole = np.clip(np.rint(stored), 0, self.levels)
        return whole.astype(np.uint8 if self.levels < 256 else np.uint16)

    def decode(self, stored: npt.ArrayLike) -> Array:
        """Decode values to float64."""
        with np.errstate(invalid="ignore", over="ignore", under="ignore"):  # what is no number stays none
            return self.offset + self.scale * np.asarray(stored, dtype=np.float64)

    def summary(self) -> Record:
        """Formula as values that JSON can hold."""
        return {
            "formula": "value = offset + scale * stored",
            "scale": self.scale,
            "offset": self.offset,
            "unit": self.unit,
            "bits": 32 if not self.levels else self.levels.bit_length(),
            "quantum": self.quantum,
        }


def write_record(path: Path, record: Record) -> Record:
    """Write the record of the file at `path` beside it, with the file's hash; returns the record.

    It is written after the file, so that a record whose hash is that of its file vouches for both.
    """
    with OutputFiles() as files:
        return add_record(files, path, {**fingerprint(path), **record})


def add_record(files: OutputFiles, path: Path, record: Record) -> Record:
    """Write the record of the file at `path` together with other files; returns the record."""
    from translucent.geometry.ray_caster import embree_versions

    versions = {"translucent": VERSION, "numpy": np.__version__, **embree_versions()}
    machine = {"python": platform.python_version(), "machine": platform.machine()}
    full = {**record, "provenance": versions | machine}
    text = json.dumps(full, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    files.write(sidecar_of(path), partial(fill_text, text=text))
    return full


def read_record(path: Path) -> Record | None:
    """Read the record of a file, if it exists and is valid."""
    try:
        found = json_value(read_text(sidecar_of(path), f"record of {str(path)!r}"))
    except ValueError:
        return None
    return found if isinstance(found, dict) else None


def sidecar_of(path: Path) -> Path:
    """Path of the record of a file."""
    return path.with_name(f"{path.name}.json")


def fingerprint(path: Path, filled: Path | None = None) -> Record:
    """Name and hash of a file for a record; the file may still have a temporary name."""
    return {"file": path.name, "sha256": file_hash(filled or path)}


def file_hash(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def parts_of(record: Record) -> list[Record]:
    """Records of the maps, or of the primitives with thickness at their vertices, within a record."""
    found: list[Record] = record.get("maps") or record.get("primitives") or [record]
    return found


def files_of(record: Record) -> list[Record]:
    """Names and hashes of the files of a record: maps, and meshes with new UVs."""
    maps, uv_file = record.get("maps"), record.get("uv_file")
    parts = [record, *(maps if isinstance(maps, list) else []), uv_file]
    return [part for part in parts if isinstance(part, dict) and isinstance(part.get("file"), str)]


def mesh_record(mesh: Mesh) -> Record:
    """Name and size of a mesh, as records have them."""
    return {"name": mesh.name, "vertices": len(mesh.vertices), "faces": len(mesh.faces)}


def plain(value: Any) -> Any:
    """Convert a value for JSON: NumPy's numbers become Python's, infinity and NaN null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value
