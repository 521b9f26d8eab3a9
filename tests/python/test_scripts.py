# SPDX-License-Identifier: GPL-3.0-or-later
"""The scripts that package and check: what they refuse, and that they count right."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
sys.path.insert(0, str(SCRIPTS))

import package  # noqa: E402

MANIFEST = """\
id = "supple"
version = "0.0.0"
blender_version_min = "4.2.0"
platforms = []
wheels = []
"""


def test_zips_of_equal_content_are_equal(tmp_path):
    content = {"b.txt": b"2", "a/x.whl": b"1"}
    package.write_zip(tmp_path / "one.zip", content)
    package.write_zip(tmp_path / "two.zip", dict(reversed(content.items())))
    assert (tmp_path / "one.zip").read_bytes() == (tmp_path / "two.zip").read_bytes()
    with zipfile.ZipFile(tmp_path / "one.zip") as archive:
        assert archive.namelist() == ["a/x.whl", "b.txt"]


def test_manifest_is_filled_in():
    filled = package.filled_manifest(MANIFEST, "1.2.3", "cp311", [Path("a-cp311.whl")])
    assert 'version = "1.2.3"\n' in filled
    assert 'blender_version_min = "4.2.0"\nblender_version_max = "5.1.0"\n' in filled
    assert 'platforms = ["linux-x64"]\n' in filled
    assert 'wheels = [\n    "./wheels/a-cp311.whl",\n]\n' in filled


@pytest.mark.parametrize("line", MANIFEST.splitlines()[1:])
def test_manifest_without_a_line_to_fill_is_an_error(line):
    with pytest.raises(package.PackageError, match="expected one match"):
        package.filled_manifest(MANIFEST.replace(line, ""), "1.2.3", "cp311", [])


def test_version_is_that_of_cmake():
    assert (
        f"VERSION {package.project_version()} " in (SCRIPTS.parent / "CMakeLists.txt").read_text()
    )


def wheel_with(path, names, content=b""):
    with zipfile.ZipFile(path, "w") as archive:
        for name in names:
            archive.writestr(name, content)
    return path


BUNDLED = [
    f"supple.libs/{name}-0a1b.so"
    for name in ("libcholmod", "libmetis", "libopenblas", "libgfortran", "libgomp")
]


def test_complete_wheel_passes(tmp_path):
    package.check_wheel(wheel_with(tmp_path / "whole.whl", BUNDLED))


def test_wheel_that_names_this_folder_is_refused(tmp_path):
    wheel = wheel_with(tmp_path / "local.whl", BUNDLED, f"{package.ROOT}/native".encode())
    with pytest.raises(package.PackageError, match="contains the path"):
        package.check_wheel(wheel)


def test_wheel_without_a_library_is_refused(tmp_path):
    wheel = wheel_with(tmp_path / "bare.whl", BUNDLED[1:])
    with pytest.raises(package.PackageError, match="libcholmod is not bundled"):
        package.check_wheel(wheel)


def count(report):
    command = [sys.executable, SCRIPTS / "count_tests.py", report]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def test_counts_of_a_report(tmp_path):
    report = tmp_path / "report.xml"
    report.write_text(
        "<testsuites><testsuite>"
        '<testcase name="a"/><testcase name="b"><failure/></testcase>'
        '<testcase name="c"><error/></testcase><testcase name="d"><skipped/></testcase>'
        '<testcase name="e" status="notrun"/>'
        "</testsuite></testsuites>"
    )
    assert count(report) == "1 2 2"


@pytest.mark.parametrize("text", [None, "<testsuites/>", "<testsuites><cut"])
def test_report_of_nothing_is_a_failure(tmp_path, text):
    report = tmp_path / "report.xml"
    if text is not None:
        report.write_text(text)
    assert count(report) == "0 1 0"
