#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Runs clang-tidy over the C++ sources: all of them, or those given. Slow, so not a part of ./check.
#
#   scripts/tidy.sh [FILE.cpp...]
set -euo pipefail
# shellcheck source=scripts/lib.sh
source "$(dirname "$0")/lib.sh"

"$ROOT/scripts/setup.sh" build
apt_install clang-tidy-14 libomp-14-dev
cd "$ROOT"
"$VENV/bin/cmake" --preset dev >/dev/null
[ $# -gt 0 ] || mapfile -t -d '' files < <(find native/src -name '*.cpp' -print0 | sort -z)
[ $# -eq 0 ] || files=("$@")
# Options that only GCC knows are no finding.
printf '%s\0' "${files[@]}" | xargs -0 -n 1 -P "$(nproc)" clang-tidy-14 --quiet -p build/dev \
  --extra-arg=-Wno-unknown-warning-option
say "${#files[@]} files, no findings"
