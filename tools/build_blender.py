"""Build the extension for Blender into dist/: ``python tools/build_blender.py [--without-wheels] [--platform P ...]``.

One .zip for each platform, with the wheels of ``integrations/blender/wheels.txt`` (which pip downloads, and checks by
their hashes) and the toolkit's own. With ``--without-wheels`` one small .zip for all, which runs the toolkit of the
Python that its preferences name. Files have fixed times, so that equal contents are equal archives. Where Blender, or
its package bpy, is installed (``--blender-python``, or the variable BLENDER_PYTHON), its own command validates them.

Pictures of presets are cut from the contact sheets in ``docs/presets``.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import re
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

from bootstrap import SetupError
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout, whichever is installed

import preset_sheets

import translucent as tl
from translucent.files.paths import write_atomically
from translucent.version import VERSION

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "integrations" / "blender"

#: Python of Blender 4.2 to 5.0, and the first version with another.
PYTHON, NEXT_BLENDER = "3.11", "5.1.0"

#: Blender's names of platforms, and the tags of wheels for them.
PLATFORMS = {
    "linux-x64": ("manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64"),
    "windows-x64": ("win_amd64",),
    "macos-arm64": ("macosx_14_0_arm64", "macosx_13_0_arm64", "macosx_12_0_arm64", "macosx_11_0_arm64"),
}

#: Date of all files in the archives, the first that zip knows.
DATE = (1980, 1, 1, 0, 0, 0)

#: Finds the command of Blender that validates extensions.
_FIND_COMMAND = """
import addon_utils, importlib.util, pathlib, sys
paths = [pathlib.Path(path, "bl_pkg", "cli", "blender_ext.py") for path in addon_utils.paths()]
print(next(str(path) for path in paths if path.is_file()))
"""


def pictures() -> dict[str, bytes]:
    """JPEG of each preset in daylight, by its name, cut from the contact sheets."""
    found = {}
    (width, height), column = preset_sheets.TILE, preset_sheets.STAGES.index("daylight")
    for name, sources in preset_sheets.SHEETS.items():
        some = [one for one in tl.presets().values() if one.source.startswith(sources)]
        with Image.open(preset_sheets.FOLDER / f"{name}.jpg") as sheet:
            for i, preset in enumerate(some):
                left, top = preset_sheets.corner(i)
                left, top = left + column * width, top + preset_sheets.NAME
                # The ball, which is left of the bear, in a square.
                part = sheet.convert("RGB").crop((left, top, left + height, top + height))
                data = io.BytesIO()
                part.save(data, "JPEG", quality=90)
                found[preset.name] = data.getvalue()
    return found


def common_files() -> dict[str, bytes]:
    """Files of every build, by their names."""
    files = {path.name: path.read_bytes() for path in sorted(SOURCE.glob("*.py"))}
    files["LICENSE"] = (ROOT / "LICENSE").read_bytes()
    shown = pictures()
    listed = [{"name": one.name, "group": one.group, "source": one.source} for one in tl.presets().values()]
    files["presets.json"] = json.dumps(listed, indent=1).encode()
    return files | {f"pictures/{name}.jpg": data for name, data in shown.items()}


def manifest(platform: str | None = None, wheels: tuple[str, ...] = ()) -> bytes:
    """Manifest with the version of the toolkit; and of a build with wheels, their names, platform and Blender."""
    text = (SOURCE / "blender_manifest.toml").read_text("utf-8")
    text, count = re.subn(r'^version = ".*"$', f'version = "{VERSION}"', text, flags=re.M)
    if count != 1:
        raise SetupError("blender_manifest.toml", "it has no version", "write one")
    if platform is not None:
        listed = "".join(f'    "./wheels/{wheel}",\n' for wheel in wheels)
        more = f'blender_version_max = "{NEXT_BLENDER}"\nplatforms = ["{platform}"]\nwheels = [\n{listed}]\n'
        text = text.replace("\nlicense =", f"{more}\nlicense =", 1)
    return text.encode()


def write_zip(path: Path, files: dict[str, bytes]) -> None:
    """Write an archive whose bytes depend on its files alone."""

    def fill(place: Path) -> None:
        with zipfile.ZipFile(place, "w") as archive:
            for name in sorted(files):
                entry = zipfile.ZipInfo(name, DATE)
                entry.external_attr = 0o644 << 16
                entry.compress_type = zipfile.ZIP_STORED if name.endswith((".whl", ".jpg")) else zipfile.ZIP_DEFLATED
                archive.writestr(entry, files[name])

    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, fill)


def own_wheel(folder: Path) -> Path:
    """The wheel of this checkout."""
    run(sys.executable, "-m", "build", "--wheel", "--outdir", folder, ROOT)
    (wheel,) = folder.glob("*.whl")
    return wheel


def other_wheels(platform: str, folder: Path) -> list[Path]:
    """The wheels of a platform, of the versions and hashes that are listed."""
    tags = [word for tag in PLATFORMS[platform] for word in ("--platform", tag)]
    how = ("--no-deps", "--only-binary=:all:", "--require-hashes", "--python-version", PYTHON, *tags)
    run(sys.executable, "-m", "pip", "download", "--quiet", *how, "--dest", folder, "-r", SOURCE / "wheels.txt")
    return sorted(folder.glob("*.whl"))


def run(*command: str | Path) -> str:
    """Output of a command that must succeed."""
    words = [str(word) for word in command]
    done = subprocess.run(words, check=False, capture_output=True, text=True)
    if done.returncode:
        sys.stderr.write(done.stdout + done.stderr)
        raise SetupError(" ".join(words[:4]), f"ended with code {done.returncode}", "see its output above")
    return done.stdout.strip()


def validate(path: Path, python: str) -> None:
    """Let Blender's own command validate an archive."""
    command = run(python, "-c", f"import bpy\n{_FIND_COMMAND}").splitlines()[-1]
    run(python, command, "validate", path)
    print(f"{path.name}: valid for Blender's `extension validate`")


def main() -> None:
    parser = argparse.ArgumentParser(description="Build the extension for Blender.")
    parser.add_argument(
        "--without-wheels", action="store_true", help="one .zip that runs the toolkit of another Python"
    )
    parser.add_argument("--platform", action="append", choices=PLATFORMS, help="repeated for more; default: all")
    parser.add_argument("-o", "--out", type=Path, default=ROOT / "dist", help="folder of the archives")
    parser.add_argument("--blender-python", default=os.environ.get("BLENDER_PYTHON"), help="a Python that has bpy")
    given = parser.parse_args()
    made = []
    try:
        common = common_files()
        if given.without_wheels:
            made.append(given.out / f"translucent-blender-{VERSION}.zip")
            write_zip(made[-1], {**common, "blender_manifest.toml": manifest()})
        else:
            with tempfile.TemporaryDirectory(prefix="translucent-blender-") as name:
                own = own_wheel(Path(name) / "own")
                for platform in given.platform or PLATFORMS:
                    wheels = {
                        path.name: path.read_bytes() for path in [own, *other_wheels(platform, Path(name) / platform)]
                    }
                    files = {f"wheels/{wheel}": data for wheel, data in wheels.items()}
                    made.append(given.out / f"translucent-blender-{VERSION}-{platform}.zip")
                    files["blender_manifest.toml"] = manifest(platform, tuple(wheels))
                    write_zip(made[-1], {**common, **files})
        for path in made:
            print(f"built {path.name} ({path.stat().st_size / 1e6:.1f} MB)", flush=True)
            if given.blender_python:
                validate(path, given.blender_python)
    except SetupError as error:
        raise SystemExit(f"error: {error}") from None


if __name__ == "__main__":
    main()
