#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Print the counts of a JUnit report, as pytest and GoogleTest write it.

    count_tests.py REPORT.xml

Prints "PASSED FAILED SKIPPED". A report that is missing, unreadable or of no test counts as one
failure: a suite that ran nothing has shown nothing.
"""

import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path


def counts(report: Path) -> tuple[int, int, int]:
    """Passed, failed (errors among them) and skipped test cases of a report."""
    cases = ElementTree.parse(report).getroot().iter("testcase")
    passed = failed = skipped = 0
    for case in cases:
        if case.find("failure") is not None or case.find("error") is not None:
            failed += 1
        elif case.find("skipped") is not None or case.get("status") == "notrun":
            skipped += 1
        else:
            passed += 1
    return passed, failed, skipped


def main() -> int:
    try:
        result = counts(Path(sys.argv[1]))
    except (OSError, ElementTree.ParseError) as error:
        print(f"{sys.argv[1]}: no report of its tests: {error}", file=sys.stderr)
        result = (0, 1, 0)
    if not any(result):
        print(f"{sys.argv[1]}: no test was run", file=sys.stderr)
        result = (0, 1, 0)
    print(*result)
    return 0


if __name__ == "__main__":
    sys.exit(main())
