"""Build the sdist and the wheel, install the wheel in an environment of its own and use it from outside the checkout.

Run by .venv/bin/python, which has `build`. What passes the checks is copied to dist/.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from bootstrap import ROOT, SetupError, ensure_opengl, make_venv, pip_install

FIND_MESH = """
import translucent
from translucent.assets import mesh_names, mesh_path
print(translucent.__file__)
print(mesh_path("sphere" if "sphere" in mesh_names() else mesh_names()[0]))
"""
COUNT_COLORS = """
import sys
from PIL import Image
print(len(set(Image.open(sys.argv[1]).convert("RGB").getdata())))
"""


def run(*command: str | Path, cwd: Path) -> str:
    """Output of a command that must succeed, run where nothing of the checkout can be imported."""
    environment = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "PYTHONHOME")}
    words = [str(word) for word in command]
    done = subprocess.run(words, cwd=cwd, env=environment, check=False, capture_output=True, text=True)
    if done.returncode:
        sys.stderr.write(done.stdout + done.stderr)
        raise SetupError(" ".join(words[:2]), f"ended with code {done.returncode}", "see its output above")
    return done.stdout.strip()


def build(folder: Path) -> Path:
    """Build the sdist, and from it the wheel, so that what the sdist lacks is noticed."""
    run(sys.executable, "-m", "build", "--outdir", folder, ROOT, cwd=ROOT)
    (wheel,) = folder.glob("*.whl")
    return wheel


def check(wheel: Path, folder: Path) -> None:
    """Install the wheel below `folder` and use it there."""
    binaries = folder / "venv" / "bin"
    work = folder / "work"
    work.mkdir()
    make_venv(binaries / "python")
    pip_install(binaries / "python", str(wheel))
    ensure_opengl(binaries / "python", cwd=work)

    package, mesh = map(Path, run(binaries / "python", "-c", FIND_MESH, cwd=work).splitlines())
    for path in (package, mesh):
        if not path.resolve().is_relative_to(folder.resolve()):
            raise SetupError("files of the installed wheel", f"{path} is not among them", "see translucent/assets.py")
    if not (package.parent / "py.typed").is_file():
        raise SetupError("types of the installed wheel", "py.typed is not in it", "see pyproject.toml")
    run(binaries / "translucent", "render", mesh, "-o", "out.png", cwd=work)
    colors = int(run(binaries / "python", "-c", COUNT_COLORS, "out.png", cwd=work))
    if colors < 2:
        raise SetupError(f"a picture of {mesh.name}", "all pixels have one color", "see `translucent explain`")
    run(binaries / "translucent", "doctor", cwd=work)
    run(binaries / "translucent", "extinction", "#7b1e3a", "2cm", cwd=work)
    print(f"render of {mesh.name} ({colors} colors), doctor and extinction work from the installed wheel")


def main() -> None:
    with tempfile.TemporaryDirectory(prefix="translucent-wheel-") as name:
        folder = Path(name)
        try:
            wheel = build(folder / "dist")
            print(f"built {wheel.name} ({wheel.stat().st_size / 1e6:.1f} MB)", flush=True)
            check(wheel, folder)
        except SetupError as error:
            raise SystemExit(f"error: {error}") from None
        shutil.copytree(folder / "dist", ROOT / "dist", dirs_exist_ok=True)


if __name__ == "__main__":
    main()
