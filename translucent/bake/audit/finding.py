"""Findings of the audit of a glTF file, and its result."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

Severity = Literal["error", "warning", "note"]

#: From the worst to the mildest.
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")


@dataclass(frozen=True)
class MaterialFinding:
    """Finding about a material, or about a body that it fills.

    Attributes
    ----------
    severity : {"error", "warning", "note"}
        Error: viewers or ray tracers show something else than what is meant. Warning: they disagree, or it is likely a
        mistake. Note: worth a look.
    code : str
        Kind of finding, such as ``"thickness-too-large"``; all of them are in ``docs/gltf.md``.
    where : str
        Material, mesh with primitive, and node, by name or index.
    text : str
        What was found, with numbers.
    do : str
        What to change.
    material : int
        Index of the material in the file.
    place : (int, int), optional
        Indices of the mesh, and of the primitive in it; None of what is of the material alone.
    """

    severity: Severity
    code: str
    where: str
    text: str
    do: str
    material: int
    place: tuple[int, int] | None = None

    def __str__(self) -> str:
        return f"{self.severity} {self.code}: {self.where}: {self.text}; {self.do}"


@dataclass(frozen=True, eq=False)
class MaterialCheck:
    """Result of the audit of a glTF file, from `translucent.check_materials`.

    Attributes
    ----------
    path : Path
    findings : tuple of MaterialFinding
        Errors first.
    bodies : tuple of dict
        What was measured of each body, as values that JSON can hold: lengths in metres of the world, colors linear.
    """

    path: Path
    findings: tuple[MaterialFinding, ...]
    bodies: tuple[dict[str, Any], ...]

    @property
    def errors(self) -> tuple[MaterialFinding, ...]:
        """Findings of severity error."""
        return tuple(found for found in self.findings if found.severity == "error")

    @property
    def codes(self) -> tuple[str, ...]:
        """Kinds of findings, each once."""
        return tuple(dict.fromkeys(found.code for found in self.findings))

    def summary(self) -> dict[str, Any]:
        """Findings and measurements as values that JSON can hold."""
        return {
            "model": str(self.path),
            "findings": [asdict(found) for found in self.findings],
            "counts": {name: sum(found.severity == name for found in self.findings) for name in SEVERITIES},
            "bodies": list(self.bodies),
        }

    def __str__(self) -> str:
        return "\n".join(map(str, self.findings)) or "no findings"
