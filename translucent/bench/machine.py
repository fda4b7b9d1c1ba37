"""Provenance of numbers: machine, driver, versions, commit."""

from __future__ import annotations

import os
import platform
import subprocess
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from translucent.bench.drawing import is_software
from translucent.bench.record import Provenance
from translucent.renderer import Renderer

#: Packages on which results and times depend.
PACKAGES = ("numpy", "moderngl", "scipy", "trimesh", "embreex")

#: Seed of all random numbers: those of ray marching, which every frame starts anew.
SEED = 0


def provenance(renderer: Renderer, command: str, *, quick: bool) -> Provenance:
    """Provenance of a report that is begun now."""
    found = renderer.provenance
    commit, dirty = _commit(Path(__file__).parents[2])
    return Provenance(
        command=command,
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        platform=platform.platform(),
        processor=_processor(),
        processors=os.cpu_count() or 1,
        backend=found["backend"],
        renderer=found["renderer"],
        driver=found["driver"],
        software=is_software(renderer),
        versions={"translucent": found["translucent"], "python": found["python"], **_versions()},
        commit=commit,
        dirty=dirty,
        seed=SEED,
        quick=quick,
    )


def _versions() -> dict[str, str]:
    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def _processor() -> str:
    """Name of the CPU, from Linux, or as well as other systems tell it."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in text.splitlines() if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def _commit(root: Path) -> tuple[str | None, bool | None]:
    """Commit of a checkout, and whether files that are part of it have changed since; None without one."""
    if not (root / ".git").exists():
        return None, None
    try:
        commit = _git(root, "rev-parse", "HEAD")
        return commit, bool(_git(root, "status", "--porcelain", "--untracked-files=no"))
    except (OSError, subprocess.SubprocessError):
        return None, None


def _git(root: Path, *arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=True, timeout=30)
    return done.stdout.strip()
