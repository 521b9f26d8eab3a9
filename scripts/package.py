#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Build what a release consists of, into dist/: the wheel and the two archives for Blender.

    python scripts/package.py              everything, for this Python (3.11)
    python scripts/package.py wheel        only the wheel
    python scripts/package.py --python /path/to/python3.13    another Python's wheel and archives

The wheel carries every library it needs (CHOLMOD, METIS, OpenBLAS, libgfortran, libgomp), so it
runs on any x86-64 Linux with the same or a newer glibc. There is one archive of each kind for each
Python ABI: Blender 4.2.0 unpacks the wrong wheel where one archive holds two, and says all is well.

Nothing is built again whose inputs have not changed. Uses the standard library only; the tools it
calls are those of scripts/requirements.txt.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DIST = ROOT / "dist"
BUILD = ROOT / "build"
REQUIREMENTS = ROOT / "scripts" / "requirements.txt"
ADDON = ROOT / "addon" / "supple_blender"
PLATFORM = "linux_x86_64"

# The oldest date a zip can hold: archives of equal content are equal byte for byte.
ZIP_DATE = (1980, 1, 1, 0, 0, 0)
ZIP_EPOCH = "315532800"

# What the wheel is made of; its build is repeated when any of this changes.
WHEEL_INPUTS = (
    *("CMakeLists.txt", "pyproject.toml", "README.md", "LICENSE", "native"),
    *("scripts/package.py", "scripts/requirements.txt"),
)

# Blender versions that run each Python, as the manifest's minimum and (exclusive) maximum.
BLENDER_VERSIONS = {"cp311": ("4.2.0", "5.1.0"), "cp313": ("5.1.0", None)}

# OpenBLAS's OpenMP build by name: the system's preference may be the pthread build.
OPENBLAS_FOLDER = "/usr/lib/x86_64-linux-gnu/openblas-openmp"


class PackageError(Exception):
    """A step that cannot go on: what is wrong, where, and the fix."""


@dataclass(frozen=True)
class Target:
    """A Python to build for."""

    python: str  # interpreter that has the build requirements
    abi: str  # "cp311"


def say(message: str) -> None:
    print(f"-- {message}", flush=True)


def run(*command: str | Path, env: dict[str, str] | None = None) -> str:
    """Run a command; its output is returned, and shown only where it fails."""
    result = subprocess.run(
        [str(part) for part in command],
        cwd=ROOT,
        env=env,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    if result.returncode != 0:
        raise PackageError(
            f"{' '.join(str(part) for part in command)}\nended with code {result.returncode}:\n"
            + result.stdout[-6000:]
        )
    return result.stdout


def project_version() -> str:
    """The version of project() in CMakeLists.txt, the one place it is written."""
    text = (ROOT / "CMakeLists.txt").read_text()
    match = re.search(r"project\(supple VERSION (\d+\.\d+\.\d+)", text)
    if not match:
        raise PackageError("CMakeLists.txt: no 'project(supple VERSION x.y.z' found")
    return match[1]


def pinned(name: str) -> str:
    """The line of scripts/requirements.txt that pins a package."""
    match = re.search(rf"^{re.escape(name)}==\S+$", REQUIREMENTS.read_text(), re.MULTILINE)
    if not match:
        raise PackageError(f"scripts/requirements.txt: {name} is not pinned there")
    return match[0]


def source_files(folder: Path) -> list[Path]:
    """Files below a folder (or the file itself), sorted, without caches."""
    if folder.is_file():
        return [folder]
    return sorted(
        path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts
    )


def content_hash(paths: tuple[str, ...], *more: str) -> str:
    digest = hashlib.sha256()
    for name in paths:
        for path in source_files(ROOT / name):
            digest.update(f"{path.relative_to(ROOT)}\0".encode())
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    for text in more:
        digest.update(f"{text}\0".encode())
    return digest.hexdigest()


# --- the wheel ------------------------------------------------------------------------------------


def build_target(python: str) -> Target:
    """The Python to build with: this one as it is, another in an environment of its own."""
    code = "import sys; print('cp%d%d' % sys.version_info[:2])"
    abi = run(python, "-c", code).strip()
    if abi not in BLENDER_VERSIONS:
        raise PackageError(f"{python} is {abi}; Blender runs {', '.join(BLENDER_VERSIONS)}")
    if os.path.samefile(python, sys.executable):
        return Target(python, abi)
    venv = BUILD / f"venv-{abi}"
    inside = venv / "bin" / "python"
    if not inside.exists():
        say(f"making build/{venv.name} for {abi}")
        run(python, "-m", "venv", venv)
    tools = ["scikit-build-core", "pybind11", "ninja", "cmake"]
    run(inside, "-m", "pip", "install", "--no-input", *[pinned(tool) for tool in tools])
    return Target(str(inside), abi)


def build_wheel(target: Target, version: str) -> Path:
    """Build, bundle and check the wheel for one Python; returns its path in dist/."""
    # Debian's libraries go into the wheel: when they are upgraded, it is another wheel.
    libraries = str(os.stat(f"{OPENBLAS_FOLDER}/libopenblas.so.0").st_mtime_ns)
    wanted = content_hash(WHEEL_INPUTS, target.abi, libraries)
    stamp = BUILD / "stamps" / f"wheel-{target.abi}"
    existing = sorted(DIST.glob(f"supple-{version}-{target.abi}-*.whl"))
    if len(existing) == 1 and stamp.exists() and stamp.read_text() == wanted:
        say(f"{existing[0].name} is up to date")
        return existing[0]

    say(f"building the wheel for {target.abi}")
    raw = BUILD / f"wheel-{target.abi}-raw"
    repaired = BUILD / f"wheel-{target.abi}-repaired"
    for folder in (raw, repaired):
        shutil.rmtree(folder, ignore_errors=True)
    tools = Path(target.python).parent
    path = f"{tools}{os.pathsep}{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    env = {
        # libigl's wheel, which training/ installs, carries a CMake file for Spectra that would be
        # found first and cannot be used.
        "spectra_ROOT": "/usr",
        **os.environ,
        "PATH": path,
        "CMAKE_BUILD_PARALLEL_LEVEL": str(os.cpu_count() or 1),
        "SOURCE_DATE_EPOCH": ZIP_EPOCH,
    }
    pip_wheel = [target.python, "-m", "pip", "wheel", ROOT, "--wheel-dir", raw]
    pip_wheel += ["--no-deps", "--no-build-isolation", "--no-input", "--disable-pip-version-check"]
    # One build folder an ABI that stays: a second build compiles only what has changed.
    run(*pip_wheel, f"--config-settings=build-dir={BUILD / f'wheel-{target.abi}'}", env=env)
    (wheel,) = raw.glob("*.whl")

    say("bundling its libraries")
    paths = [OPENBLAS_FOLDER, os.environ.get("LD_LIBRARY_PATH", "")]
    env["LD_LIBRARY_PATH"] = os.pathsep.join(filter(None, paths))
    run(sys.executable, "-m", "auditwheel", "repair", "--wheel-dir", repaired, wheel, env=env)
    (wheel,) = repaired.glob("*.whl")
    check_wheel(wheel)

    DIST.mkdir(exist_ok=True)
    for old in DIST.glob(f"supple-*-{target.abi}-*.whl"):
        old.unlink()
    result = DIST / wheel.name
    shutil.copyfile(wheel, result)
    stamp.parent.mkdir(parents=True, exist_ok=True)
    stamp.write_text(wanted)
    say(f"{result.name}: {result.stat().st_size / 1e6:.1f} MB")
    return result


def check_wheel(wheel: Path) -> None:
    """Refuse a wheel that points back to this machine or lacks what it must carry."""
    here = {str(ROOT).encode(), str(Path.home()).encode() + b"/"}
    names = []
    with zipfile.ZipFile(wheel) as archive:
        for name in archive.namelist():
            data = archive.read(name)
            names.append(name)
            for path in here:
                if path in data:
                    raise PackageError(f"{wheel.name}: {name} contains the path {path.decode()}")
            if data[:4] == b"\x7fELF":
                check_search_path(wheel, name, data)
    for part in ("libcholmod", "libmetis", "libopenblas", "libgfortran", "libgomp"):
        if not any(name.split("/")[-1].startswith(part) for name in names):
            raise PackageError(f"{wheel.name}: {part} is not bundled")


def check_search_path(wheel: Path, name: str, data: bytes) -> None:
    """A bundled library may look for others beside itself only."""
    scratch = BUILD / "elf-under-check"
    scratch.write_bytes(data)
    for entry in run("patchelf", "--print-rpath", scratch).strip().split(":"):
        if entry and not entry.startswith("$ORIGIN"):
            raise PackageError(f"{wheel.name}: {name} searches for libraries in {entry}")
    scratch.unlink()


# --- the archives for Blender ---------------------------------------------------------------------


def safetensors_wheel(target: Target) -> Path:
    """The pinned safetensors wheel for a Python, from the package index, kept in build/."""
    folder = BUILD / f"vendor-{target.abi}"
    wanted = pinned("safetensors")
    version = wanted.split("==")[1]
    kept = list(folder.glob(f"safetensors-{version}-*.whl"))
    if not kept:
        say(f"fetching {wanted}")
        shutil.rmtree(folder, ignore_errors=True)
        download = ["-m", "pip", "download", "--no-deps", "--only-binary=:all:", "--no-input"]
        run(target.python, *download, "--dest", folder, wanted)
        kept = list(folder.glob("safetensors-*.whl"))
    return kept[0]


def substitute(text: str, pattern: str, value: str, where: str) -> str:
    """Replace the one match of a pattern; none, or several, is an error and not a guess."""
    result, count = re.subn(pattern, lambda _: value, text, flags=re.MULTILINE)
    if count != 1:
        raise PackageError(f"{where}: expected one match of {pattern!r}, found {count}")
    return result


def addon_files(version: str) -> dict[str, bytes]:
    """The add-on's files by name within its folder, the version filled in."""
    if not ADDON.is_dir():
        raise PackageError(f"{ADDON.relative_to(ROOT)} is missing")
    files = {path.relative_to(ADDON).as_posix(): path.read_bytes() for path in source_files(ADDON)}
    numbers = ", ".join(version.split("."))
    files["__init__.py"] = substitute(
        files["__init__.py"].decode(),
        r'"version": \(\d+, \d+, \d+\)',
        f'"version": ({numbers})',
        "addon/supple_blender/__init__.py",
    ).encode()
    files["LICENSE"] = (ROOT / "LICENSE").read_bytes()
    return files


def filled_manifest(text: str, version: str, abi: str, wheels: list[Path]) -> str:
    """The manifest with the version, the Blender versions of this ABI and the wheels."""
    where = "addon/supple_blender/blender_manifest.toml"
    text = substitute(text, r'^version = ".*"$', f'version = "{version}"', where)
    oldest, newest = BLENDER_VERSIONS[abi]
    lines = [f'blender_version_min = "{oldest}"']
    if newest:
        lines.append(f'blender_version_max = "{newest}"')
    text = substitute(text, r'^blender_version_min = ".*"$', "\n".join(lines), where)
    text = substitute(text, r"^platforms = \[\]$", 'platforms = ["linux-x64"]', where)
    listed = "".join(f'    "./wheels/{wheel.name}",\n' for wheel in wheels)
    return substitute(text, r"^wheels = \[[^\]]*\]$", f"wheels = [\n{listed}]", where)


def write_zip(path: Path, files: dict[str, bytes]) -> None:
    """Write a zip that depends on nothing but its content."""
    temporary = path.with_suffix(".part")
    with zipfile.ZipFile(temporary, "w") as archive:
        for name in sorted(files):
            info = zipfile.ZipInfo(name, ZIP_DATE)
            packed = name.endswith(".whl")
            info.compress_type = zipfile.ZIP_STORED if packed else zipfile.ZIP_DEFLATED
            info.create_system = 3  # Unix, for the permissions
            info.external_attr = 0o644 << 16
            archive.writestr(info, files[name], compresslevel=9)
    temporary.replace(path)
    say(f"{path.name}: {path.stat().st_size / 1e6:.1f} MB")


def unpacked(wheel: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist() if not name.endswith("/")}


def build_archives(target: Target, version: str, wheel: Path) -> list[Path]:
    """Both archives for one ABI: legacy with the wheels unpacked, extension with them listed."""
    # A wheel without weights can train them; an add-on without weights can do nothing.
    if not any(
        name.startswith("supple/models/") and name.endswith(".safetensors")
        for name in unpacked(wheel)
    ):
        raise PackageError(f"{wheel.name}: no weights in supple/models")
    wheels = [wheel, safetensors_wheel(target)]
    stem = f"supple_blender-{version}-{target.abi}-{PLATFORM}"
    legacy, extension = DIST / f"{stem}-legacy.zip", DIST / f"{stem}-extension.zip"
    listing = [f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}" for path in wheels]
    wanted = content_hash(("addon", "LICENSE", "scripts/package.py"), version, *listing)
    stamp = BUILD / "stamps" / f"archives-{target.abi}"
    if legacy.exists() and extension.exists() and stamp.exists() and stamp.read_text() == wanted:
        say(f"{legacy.name} and {extension.name} are up to date")
        return [legacy, extension]

    for old in DIST.glob(f"supple_blender-*-{target.abi}-{PLATFORM}-*.zip"):
        old.unlink()
    files = addon_files(version)
    manifest = files.pop("blender_manifest.toml").decode()

    vendor = {name: data for path in wheels for name, data in unpacked(path).items()}
    content = {f"supple_blender/{name}": data for name, data in files.items()}
    content |= {f"supple_blender/vendor/{name}": data for name, data in vendor.items()}
    write_zip(legacy, content)

    content = dict(files)
    content["blender_manifest.toml"] = filled_manifest(
        manifest, version, target.abi, wheels
    ).encode()
    content |= {f"wheels/{path.name}": path.read_bytes() for path in wheels}
    write_zip(extension, content)
    stamp.write_text(wanted)
    return [legacy, extension]


def validate_extension(extension: Path) -> None:
    """Ask Blender's own checker, where a bpy module that carries it is installed."""
    pattern = "lib/python*/site-packages/bpy/*/scripts/addons_core/bl_pkg/cli/blender_ext.py"
    checkers = sorted(path for venv in ROOT.glob(".venv*") for path in venv.glob(pattern))
    if not checkers:
        say("no bpy module at hand: the extension was not put to Blender's validator")
        return
    run(sys.executable, checkers[-1], "validate", extension)
    say(f"{extension.name} is valid by Blender's own checker")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", nargs="?", choices=("all", "wheel"), default="all")
    parser.add_argument(
        "--python",
        default=sys.executable,
        help="the Python to build for (3.11 or 3.13); this one if not given",
    )
    arguments = parser.parse_args()
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    BUILD.mkdir(exist_ok=True)
    try:
        python = shutil.which(arguments.python)
        if not python:
            raise PackageError(f"--python {arguments.python}: there is no such program")
        version = project_version()
        target = build_target(python)
        wheel = build_wheel(target, version)
        if arguments.what == "all":
            _, extension = build_archives(target, version, wheel)
            validate_extension(extension)
    except PackageError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
