# SPDX-License-Identifier: GPL-3.0-or-later
"""Pose, correct a sequence or match without a window, from a job file.

    blender -b [FILE.blend] --python-exit-code 1 -P job.py -- JOB.toml [--out DIR] [--part K/N]
    blender --command supple JOB.toml [--out DIR]                    (Blender 4.2 and later)

The installed add-on does the work, enabled for this process if it is not; without one, the add-on
that this file is part of. The exit code is 0 when everything asked for was written, else 1; then
stderr says why and nothing was saved; of several targets of a match, only those that failed are
left out. docs/blender.md describes the job file.
"""

import argparse
import importlib
import sys
from pathlib import Path


def main(arguments):
    """Run the job that `arguments` (a list of strings) name; return the exit code."""
    from . import (
        job_file,
        job_run,
        job_table,
        match_job,
        match_job_run,
        sequence_job,
        sequence_job_run,
    )
    from .errors import UserError

    parser = argparse.ArgumentParser(
        prog="supple",
        description="Pose a mesh, correct a sequence, or match meshes, from a job file.",
    )
    parser.add_argument("job", type=Path, help="the job file (TOML)")
    parser.add_argument(
        "--out", type=Path, help="folder for relative output paths (default: the job file's)"
    )
    parser.add_argument(
        "--part",
        default="",
        help="of a sequence: bake one part of its frames alone, 2/4 for the second of four",
    )
    options = parser.parse_args(arguments)
    try:
        top = job_table.load(options.job)
        if top.has("sequence"):
            sequence_job_run.run(sequence_job.read(options.job, options.out, options.part))
        elif options.part:
            raise UserError("--part: only a job with a table [sequence] can be done in parts.")
        elif top.has("match"):
            match_job_run.run(match_job.read(options.job, options.out))
        else:
            job_run.run(job_file.read(options.job, options.out))
    except UserError as error:
        print(f"Supple: {error}", file=sys.stderr, flush=True)
        return 1
    return 0


def _package():
    """Return the name of the add-on's package, registered in this process."""
    import addon_utils

    for module in addon_utils.modules():
        name = module.__name__
        if name == "supple_blender" or (name.startswith("bl_ext.") and name.endswith(".supple")):
            if not addon_utils.check(name)[1]:
                addon_utils.enable(name, default_set=False)
            return name
    folder = Path(__file__).resolve().parent
    sys.path.insert(0, str(folder.parent))
    importlib.import_module(folder.name).register()
    return folder.name


def _run_as_script():
    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    code = importlib.import_module(f"{_package()}.job").main(arguments)
    if code:
        sys.exit(code)


if __name__ == "__main__":
    _run_as_script()
