"""The toolkit in a process of its own: which Python runs it, and tasks that report progress and can be stopped.

Blender's Python has another NumPy than the toolkit needs, and add-ons that draw by OpenGL break under Vulkan. So
nothing of the toolkit is imported here. A task ends with what it printed, or with the sentence of its error.
"""

import json
import os
import subprocess
import sys
import tempfile
import threading
from importlib.machinery import PathFinder
from pathlib import Path
from typing import IO

from .preferences import python_of_preferences

#: Environment variable that names the Python with the toolkit; the preferences go first.
VARIABLE = "TRANSLUCENT_PYTHON"

#: Program that bakes; it imports the toolkit, and nothing of Blender.
WORKER = Path(__file__).with_name("worker.py")

#: Seconds that a process has to end by itself when it is stopped.
PATIENCE = 2.0

_ABSENT = (
    "The translucent toolkit was not found in {python}. Install a build of this extension that brings it, or choose a "
    "Python with translucent-shading in the preferences of the extension"
)

_running: set["Task"] = set()


class ToolkitError(Exception):
    """Failure of the toolkit, as a sentence for `Operator.report`."""


def interpreter() -> tuple[str, dict[str, str]]:
    """Python that has the toolkit, and the environment in which it finds it."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONHOME"}
    if chosen := python_of_preferences() or environment.get(VARIABLE, ""):
        if not Path(chosen).is_file():
            raise ToolkitError(f"There is no Python at {chosen}. Correct it in the preferences of the extension")
        return chosen, environment
    # What Blender has installed from the wheels of this extension goes before its own packages, NumPy among them.
    found = PathFinder.find_spec("translucent")
    if found is None or found.origin is None:
        raise ToolkitError(_ABSENT.format(python="Blender"))
    return sys.executable, {**environment, "PYTHONPATH": str(Path(found.origin).parents[1]), "PYTHONNOUSERSITE": "1"}


class Task:
    """Process of the toolkit: arguments of its Python, and what it has printed so far."""

    def __init__(self, *arguments: str | Path) -> None:
        python, environment = interpreter()
        self.progress = 0.0
        self.warnings: list[str] = []
        self._python, self._lines = python, []
        self._errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed when the task is forgotten
        try:
            self._process = subprocess.Popen(
                [python, *map(str, arguments)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                env={**environment, "PYTHONIOENCODING": "utf-8"},
                encoding="utf-8",
                errors="replace",
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )
        except OSError as error:
            self._errors.close()
            raise ToolkitError(f"{python} cannot be run: {error.strerror}. Choose another in the preferences") from None
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        _running.add(self)

    def _read(self) -> None:
        """Keep what the process prints; lines of progress and warnings apart."""
        assert self._process.stdout is not None
        for line in self._process.stdout:
            message = json.loads(line) if line.startswith(('{"progress"', '{"warning"')) else {}
            self.progress = message.get("progress", self.progress)
            if "warning" in message:
                self.warnings.append(message["warning"])
            elif not message:
                self._lines.append(line)

    def ended(self) -> bool:
        """Whether the process has ended by itself."""
        return self._process.poll() is not None

    def output(self, *, accept: tuple[int, ...] = (0,)) -> str:
        """Wait for the end, and return what was printed; raises `ToolkitError` unless the exit code is accepted."""
        code = self._process.wait()
        self._reader.join()
        self._errors.seek(0)
        said = self._errors.read().decode("utf-8", "replace")
        self._forget()
        self.warnings += [line.removeprefix("warning: ") for line in said.splitlines() if line.startswith("warning: ")]
        if code not in accept or (code and not self._lines):
            raise ToolkitError(self._sentence(said, code))
        return "".join(self._lines)

    def _sentence(self, said: str, code: int) -> str:
        lines = [line for line in said.splitlines() if line.strip()]
        if errors := [line for line in lines if line.startswith("error: ")]:
            return errors[-1].removeprefix("error: ")
        if lines and any(name in lines[-1] for name in ("No module named", "PackageNotFoundError")):
            return _ABSENT.format(python=self._python)
        return f"The toolkit ended with code {code}: {lines[-1] if lines else 'it printed nothing'}"

    def stop(self) -> None:
        """End the process, whatever it is doing."""
        if self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._reader.join()
        self._forget()

    def _forget(self) -> None:
        _running.discard(self)
        if self._process.stdout is not None:
            self._process.stdout.close()
        self._errors.close()


def stop_all() -> None:
    """End all processes that run."""
    for task in list(_running):
        task.stop()
