# SPDX-License-Identifier: GPL-3.0-or-later
"""What the native module's libraries are told, and that nobody else hears it."""

import os
import subprocess
import sys


def run(code: str, **environment: str) -> str:
    """Standard output of Python code in a process of its own without our variables."""
    env = {k: v for k, v in os.environ.items() if k not in ("OPENBLAS_CORETYPE", "OMP_WAIT_POLICY")}
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=env | environment,
        check=True,
        capture_output=True,
        text=True,
    )
    return done.stdout.strip()


def test_blas_has_kernels_for_the_instruction_set():
    level, blas = run("import supple; print(supple.simd_level(), supple.blas_name())").split(" ", 1)
    if level == "avx512":
        assert "SkylakeX" in blas
    elif level == "avx2":
        assert "Haswell" in blas


def test_what_the_user_chose_stays():
    code = "import supple; print(supple.blas_name())"
    assert "Nehalem" in run(code, OPENBLAS_CORETYPE="Nehalem")


def test_nothing_is_left_in_the_environment():
    code = "import os; before = dict(os.environ); import supple; print(before == dict(os.environ))"
    assert run(code) == "True"
