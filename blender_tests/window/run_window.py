# SPDX-License-Identifier: GPL-3.0-or-later
"""A person's path through the panel, in a real Blender window under Xvfb.

    python blender_tests/window/run_window.py [--out out/window] [--parts sequence ...]

Needs Xvfb, a `blender` (or the program that SUPPLE_BLENDER names) and the packaged add-on in dist/.
Screenshots go to --out. The exit code is 0 when every check in scenario.py held.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
ROOT = FOLDER.parent.parent
LIMIT_SECONDS = 1200  # it takes about two minutes; a busy machine, many


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "window")
    parser.add_argument(
        "--parts", nargs="+", default=[], help="of scenario.py, by name (the default is all)"
    )
    arguments = parser.parse_args()
    blender = os.environ.get("SUPPLE_BLENDER", "blender")
    programs = [shutil.which(name) for name in ("xvfb-run", blender)]
    if None in programs:
        print(f"xvfb-run and {blender} must be installed", file=sys.stderr)
        return 1
    arguments.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="supple-window-") as user:
        environment = {
            **os.environ,
            "LIBGL_ALWAYS_SOFTWARE": "1",
            # Debian's Blender takes the modules of the first python3 here, which must be Debian's.
            "PATH": os.defpath,
            "BLENDER_USER_RESOURCES": user,
            "BLENDER_USER_CONFIG": f"{user}/config",
            "BLENDER_USER_SCRIPTS": f"{user}/scripts",
            "BLENDER_USER_DATAFILES": f"{user}/datafiles",
            "SUPPLE_CACHE_DIR": f"{user}/prepared",
        }
        command = [
            *(programs[0], "--auto-servernum", "-s", "-screen 0 1280x800x24", programs[1]),
            *("--factory-startup", "--enable-event-simulate", "-p", "0", "0", "1280", "800"),
            *("--python-exit-code", "1", "-P", str(FOLDER / "scenario.py")),
            *("--", str(arguments.out.resolve()), *arguments.parts),
        ]
        # A file, not a pipe: a window that hangs would keep a pipe open.
        with tempfile.TemporaryFile("w+") as output:
            try:
                code = subprocess.run(
                    command,
                    env=environment,
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    timeout=LIMIT_SECONDS,
                ).returncode
            except subprocess.TimeoutExpired:
                code = f"none: it did not end within {LIMIT_SECONDS} s"
            output.seek(0)
            text = output.read()
    done = "scenario: done" in text
    print(text if not done else "\n".join(ln for ln in text.splitlines() if "scenario:" in ln))
    if code == 0 and done:
        return 0
    print(f"window test failed (exit code {code})", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
