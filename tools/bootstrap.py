"""Make .venv in this checkout, with the project, its dependency groups and a working OpenGL.

Run by any Python 3.11 to 3.13 with its standard library only: ``python tools/bootstrap.py --group test``.
A second run installs nothing unless pyproject.toml changed, another Python is used or a group is missing.
"""

# This file parses on Python 3.6 (hence the quoted annotations), so that an old Python gets to its error message.

import argparse
import hashlib
import importlib.util
import json
import platform
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
VENV = ROOT / ".venv"
PYTHON = VENV / "bin" / "python"
STAMP = VENV / "bootstrap.json"
OLDEST, NEWEST = (3, 11), (3, 13)


class SetupError(Exception):
    """Something that the reader can repair: what was asked, what was found, what to do."""

    def __init__(self, what: str, found: str, do: str) -> None:
        super().__init__(f"{what}; {found}; {do}")


def check_python() -> None:
    """This Python is one that the project supports, and can make virtual environments."""
    found = f"{sys.executable} is Python {platform.python_version()}"
    if not OLDEST <= sys.version_info[:2] <= NEWEST:
        raise SetupError("Python 3.11 to 3.13", found, "install one, or name it: make PYTHON=/path/to/python3.13")
    if not (importlib.util.find_spec("ensurepip") and importlib.util.find_spec("venv")):
        package = f"python{sys.version_info[0]}.{sys.version_info[1]}-venv"
        raise SetupError(
            "a virtual environment in .venv",
            f"{found} without the modules venv and ensurepip",
            f"on Debian and Ubuntu: apt install {package} (or python3-venv); else name another: make PYTHON=...",
        )


def pip_install(python: Path, *arguments: str) -> None:
    """Install into the environment of `python`; pip explains itself on stderr."""
    command = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *arguments]
    code = subprocess.run(command, cwd=ROOT, check=False).returncode
    if code:
        raise SetupError(
            f"pip install {' '.join(arguments)}",
            f"pip failed with code {code}, see its message above",
            "repair that (network, disk space, package index) and run the same command again",
        )


def make_venv(python: Path) -> None:
    """Make the environment of `python` with this interpreter, in place of what is there.

    Raises
    ------
    SetupError
        If a link leads there: what is in another checkout's environment would be removed.
    """
    folder = python.parents[1]
    if folder.is_symlink():
        raise SetupError(
            f"a virtual environment in {folder}",
            f"it is a link to {folder.resolve()}, and making one there would remove what that holds",
            "remove the link, or call the tool itself, for example .venv/bin/python tools/build_web.py",
        )
    command = [sys.executable, "-m", "venv", "--clear", str(folder)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if done.returncode:
        raise SetupError(
            f"a virtual environment in {folder}",
            f"`python -m venv` said: {' '.join((done.stdout + done.stderr).split())}",
            "repair that, or name another Python: make PYTHON=...",
        )


def install(groups: "list[str]") -> None:
    """Bring .venv up to date with pyproject.toml and the dependency groups."""
    home = {"root": str(ROOT), "python": platform.python_version()}
    content = hashlib.sha256((ROOT / "pyproject.toml").read_bytes()).hexdigest()
    stamp = _read_stamp()
    same_home = all(stamp.get(key) == value for key, value in home.items()) and _runs(PYTHON)
    installed = set(stamp.get("groups", ())) if same_home else set()
    if same_home and stamp.get("pyproject") == content and installed.issuperset(groups):
        return
    started = time.monotonic()
    if not same_home:
        print(f"making .venv with Python {home['python']} ({sys.executable})", flush=True)
        make_venv(PYTHON)
        pip_install(PYTHON, "--upgrade", "pip>=25.1")  # the first that knows --group
    STAMP.write_text(json.dumps(home))
    wanted = sorted(installed.union(groups))
    print(f"installing {', '.join(['the project', *wanted])} and what they need (about 100 MB once)", flush=True)
    pip_install(PYTHON, "--editable", ".", *(word for group in wanted for word in ("--group", group)))
    STAMP.write_text(json.dumps({**home, "pyproject": content, "groups": wanted}))
    print(f"installed in {time.monotonic() - started:.0f} s", flush=True)


def _read_stamp() -> "dict[str, Any]":
    try:
        stamp = json.loads(STAMP.read_text())
    except (OSError, ValueError):
        return {}
    return stamp if isinstance(stamp, dict) else {}


def _runs(python: Path) -> bool:
    try:
        return subprocess.run([str(python), "-c", "import pip"], check=False, capture_output=True).returncode == 0
    except OSError:
        return False


def ensure_opengl(python: Path, cwd: Path = ROOT) -> None:
    """Find an OpenGL for the project installed for `python`: the system's, else OSMesa from a wheel."""
    report = _probe(python, cwd)
    if report["backend"] is None and (sys.platform, platform.machine()) == ("linux", "x86_64"):
        print("no OpenGL on this system: installing OSMesa, a software OpenGL (81 MB once)", flush=True)
        # Only the libraries in the wheel are used, so not the sixty packages that it depends on.
        pip_install(python, "--no-deps", *_osmesa_requirements())
        report = _probe(python, cwd)
    if report["backend"] is None:
        tried = "; ".join(f"{a['backend']}: {a['error']}" for a in report.get("attempts", ()))
        raise SystemExit(f"error: {report.get('message') or 'OpenGL 3.3; none found, tried ' + tried}")
    source = {"egl": "the system's, through EGL", "osmesa": "OSMesa, in software"}
    print(f"OpenGL: {source.get(report['backend'], report['backend'])}: {report['renderer']}", flush=True)


def _osmesa_requirements() -> "list[str]":
    import tomllib  # not at the top: an older Python must get as far as its error message

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    requirements: list[str] = project["optional-dependencies"]["osmesa"]
    return requirements


def _probe(python: Path, cwd: Path) -> "dict[str, Any]":
    command = [str(python), "-m", "translucent.gpu.context", "--probe"]
    done = subprocess.run(command, cwd=cwd, check=False, capture_output=True, text=True)
    try:
        report: dict[str, Any] = json.loads(done.stdout)
    except ValueError:
        lines = done.stderr.strip().splitlines() or ["nothing on stderr"]
        raise SetupError(
            "which OpenGL works here",
            f"`{' '.join(command)}` ended with code {done.returncode}: {lines[-1]}",
            "run that command to see more",
        ) from None
    return report


def main() -> None:
    parser = argparse.ArgumentParser(description="Make .venv with the project, its dependencies and an OpenGL.")
    parser.add_argument("--group", action="append", default=[], help="dependency group of pyproject.toml; repeatable")
    arguments = parser.parse_args()
    try:
        check_python()
        install(arguments.group)
        ensure_opengl(PYTHON)
    except SetupError as error:
        raise SystemExit(f"error: {error}") from None


if __name__ == "__main__":
    main()
