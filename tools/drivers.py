"""Run the tests of rendering on every OpenGL driver of this machine, and say what holds where.

Each file of tests has a process of its own, since a driver may end it. Prints what does not pass, and one line for each
driver. What is known of drivers is in docs/drivers.md.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
SUITES = ("tests/glsl", "tests/gpu")

#: Seconds that a file of tests may take.
LIMIT = 1800

#: Environments that ask for a driver, how the name of its device begins, and what brings it along.
DRIVERS = {
    "default": ({}, "", "libegl1 libgl1 libgl1-mesa-dri"),
    "llvmpipe": ({"LIBGL_ALWAYS_SOFTWARE": "1", "GALLIUM_DRIVER": "llvmpipe"}, "llvmpipe", "libgl1-mesa-dri"),
    "softpipe": ({"LIBGL_ALWAYS_SOFTWARE": "1", "GALLIUM_DRIVER": "softpipe"}, "softpipe", "libgl1-mesa-dri"),
    "zink over lavapipe": (
        {"LIBGL_ALWAYS_SOFTWARE": "1", "MESA_LOADER_DRIVER_OVERRIDE": "zink", "EGL_PLATFORM": "surfaceless"},
        "zink (llvmpipe",
        "mesa-vulkan-drivers",
    ),
    # Without an EGL the next backend is taken.
    "osmesa": ({"GLCONTEXT_LINUX_LIBEGL": "none"}, "llvmpipe", "pip install --no-deps lavavu-osmesa"),
}


def device(environment: dict[str, str]) -> tuple[str, str]:
    """Backend and name of the device that an environment leads to; empty if none."""
    command = [sys.executable, "-m", "translucent.gpu.context", "--probe"]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    try:
        found = json.loads(done.stdout)
    except ValueError:
        return "", ""
    return found["backend"] or "", found["renderer"] or ""


def run(path: Path, environment: dict[str, str]) -> tuple[str, dict[str, int]]:
    """Result of a file of tests, in words where it did not pass, and how many tests did what."""
    command = [sys.executable, "-m", "pytest", str(path), "-q", "-p", "no:cacheprovider"]
    try:
        done = subprocess.run(
            command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=LIMIT, check=False
        )
    except subprocess.TimeoutExpired:
        return f"did not end within {LIMIT} s", {}
    last = done.stdout.strip().splitlines()[-1:] or [""]
    counts = {kind: int(number) for number, kind in re.findall(r"(\d+) (passed|failed|skipped|errors?)", last[0])}
    if done.returncode < 0:
        return f"the driver ended the process (signal {-done.returncode})", counts
    failed = re.findall(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    return "\n    ".join(failed) if done.returncode else "", counts


def test(name: str) -> bool:
    """Run all files on a driver; False if one does not pass."""
    settings, begins, source = DRIVERS[name]
    environment = {**os.environ, **settings}
    backend, found = device(environment)
    if not found.startswith(begins) or not found or (backend == "osmesa") != (name == "osmesa"):
        print(f"{name}: skipped, not here (found {found or 'none'}); it comes with {source}", flush=True)
        return True
    print(f"{name}: {found}", flush=True)
    started, sums, fine = time.monotonic(), dict[str, int](), True
    for path in sorted(file for suite in SUITES for file in (ROOT / suite).glob("test_*.py")):
        trouble, counts = run(path.relative_to(ROOT), environment)
        fine = fine and not trouble
        if trouble:
            print(f"  {path.relative_to(ROOT)}: {trouble}", flush=True)
        for kind, number in counts.items():
            sums[kind] = sums.get(kind, 0) + number
    counted = ", ".join(f"{number} {kind}" for kind, number in sums.items())
    print(f"  {counted}, in {time.monotonic() - started:.0f} s", flush=True)
    return fine


if __name__ == "__main__":
    wanted = sys.argv[1:] or [name for name in DRIVERS if name != "llvmpipe"]
    if unknown := [name for name in wanted if name not in DRIVERS]:
        sys.exit(f"no such driver: {', '.join(unknown)}; there are {', '.join(DRIVERS)}")
    passed = [test(name) for name in wanted]  # all of them, whatever one comes to
    sys.exit(0 if all(passed) else 1)
