# SPDX-License-Identifier: GPL-3.0-or-later
# shellcheck shell=bash
# What the set-up, ./demo and ./check share. Sourced by bash; expects `set -euo pipefail`.

ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
# shellcheck disable=SC2034  # used by the scripts that source this
VENV=$ROOT/.venv
STAMPS=$ROOT/build/stamps
export DEBIAN_FRONTEND=noninteractive PIP_DISABLE_PIP_VERSION_CHECK=1 PYTHONUNBUFFERED=1

section() { printf '\n==== %s  (%s)\n' "$1" "$(date +%H:%M:%S)"; }
say() { printf -- '-- %s\n' "$*"; }
die() {
  printf 'error: %s\n' "$*" >&2
  exit 1
}

# One set-up at a time in one checkout; a second one waits. The lock ends with the shell.
lock_setup() {
  mkdir -p "$ROOT/build"
  exec 9>"$ROOT/build/.setup.lock"
  flock -n 9 || { say "waiting for another set-up in this folder"; flock 9; }
}

# --- Debian packages ------------------------------------------------------------------------------

# apt_install PACKAGE...: installs those that are missing, and nothing where none is.
apt_install() {
  local package missing=() first=() rest=()
  command -v dpkg-query >/dev/null ||
    die "set-up knows Debian's packages only, and this is no Debian system. Needed: $*"
  for package in "$@"; do
    [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null)" = installed ] ||
      missing+=("$package")
  done
  [ ${#missing[@]} -gt 0 ] || return 0

  local as_root=()
  if [ "$(id -u)" -ne 0 ]; then
    sudo -n true 2>/dev/null ||
      die "these Debian packages are missing, and neither root nor sudo without a password is at" \
        "hand to install them. Run: sudo apt-get install --no-install-recommends ${missing[*]}"
    as_root=(sudo -n env "DEBIAN_FRONTEND=$DEBIAN_FRONTEND")
  fi
  local apt=("${as_root[@]}" apt-get -q -o Acquire::Retries=3 -o DPkg::Lock::Timeout=300)

  say "Debian packages to install: ${missing[*]}"
  # A stale list of one foreign source is no reason to stop: a missing package is, and says so below.
  "${apt[@]}" update >/dev/null || say "apt-get update reported errors; going on with what it has"
  # SuiteSparse takes whatever BLAS is there, and Debian's first choice is the slow reference one;
  # with the OpenMP build of OpenBLAS already there it brings no other.
  for package in "${missing[@]}"; do
    case $package in
      libopenblas-openmp-dev) first+=("$package") ;;
      *) rest+=("$package") ;;
    esac
  done
  local group
  for group in "${first[*]}" "${rest[*]}"; do
    [ -n "$group" ] || continue
    # shellcheck disable=SC2086  # package names, split on purpose
    "${apt[@]}" install -y --no-install-recommends $group >"$ROOT/build/apt.log" 2>&1 || {
      tail -n 20 "$ROOT/build/apt.log" >&2
      die "apt-get could not install: $group (all of its output is in build/apt.log)"
    }
  done
}

# --- stamps: a step whose inputs are as they were is not run again --------------------------------

# stamp_is NAME VALUE: true where step NAME last ended well with VALUE.
stamp_is() { [ "$(cat "$STAMPS/$1" 2>/dev/null)" = "$2" ]; }
stamp_set() {
  mkdir -p "$STAMPS"
  printf '%s\n' "$2" >"$STAMPS/$1"
}

# hash_of PATH...: one hash over the contents of files and folders (caches and builds left out).
hash_of() {
  (cd "$ROOT" && find "$@" -type f -not -path '*/__pycache__/*' -not -path '*.egg-info/*' -print0 |
    LC_ALL=C sort -z | xargs -0 sha256sum | sha256sum | cut -d' ' -f1)
}

# --- Python ---------------------------------------------------------------------------------------

python_is_311() {
  "$1" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' >/dev/null 2>&1
}

# find_python: prints a Python 3.11 that can make environments and compile modules. 3.11 because
# Debian 12's Blender and the bpy 4.x modules run it, and a native module fits one Python only.
find_python() {
  local candidate found=""
  for candidate in ${PYTHON:-} python3.11 python3 /usr/bin/python3.11; do
    if command -v "$candidate" >/dev/null && python_is_311 "$candidate"; then
      found=$(command -v "$candidate")
      break
    fi
  done
  if [ -z "$found" ]; then
    apt_install python3.11 python3.11-venv python3.11-dev >&2
    found=/usr/bin/python3.11
  fi
  if [ "$(readlink -f "$found")" = /usr/bin/python3.11 ]; then
    apt_install python3.11-venv python3.11-dev >&2
  fi
  "$found" - >&2 <<'PY' || die "$found cannot be used; give another Python 3.11 as PYTHON=..."
import pathlib, sys, sysconfig
try:
    import ensurepip, venv
except ImportError as error:
    sys.exit(f"{sys.executable}: no module {error.name}: install this Python's venv package")
if not (pathlib.Path(sysconfig.get_path("include")) / "Python.h").exists():
    sys.exit(f"{sys.executable}: no Python.h: install this Python's headers")
PY
  echo "$found"
}

# make_venv FOLDER PYTHON: a virtual environment, made anew where it is missing or broken.
make_venv() {
  if "$1/bin/python" -c 'import pip' >/dev/null 2>&1; then return 0; fi
  say "making ${1#"$ROOT"/} with $2"
  rm -rf "$1"
  "$2" -m venv "$1"
}

# pip_install VENV ARGUMENT...: pip without questions, its output only where it fails.
pip_install() {
  local venv=$1 log
  shift
  log=$(mktemp "${TMPDIR:-/tmp}/supple-pip.XXXXXX")
  if ! "$venv/bin/python" -m pip install --no-input --retries 5 "$@" >"$log" 2>&1; then
    tail -n 30 "$log" >&2
    rm -f "$log"
    return 1
  fi
  rm -f "$log"
}

# --- Blender --------------------------------------------------------------------------------------

# use_blender_home FOLDER: this shell's Blenders keep settings, add-ons and prepared meshes in FOLDER,
# made empty, and leave the user's own alone. The first variable is for Blender 4.2 and later, the
# others of Blender's for 3.4.
use_blender_home() {
  rm -rf "$1"
  mkdir -p "$1/config" "$1/scripts" "$1/datafiles"
  export BLENDER_USER_RESOURCES=$1 BLENDER_USER_CONFIG=$1/config \
    BLENDER_USER_SCRIPTS=$1/scripts BLENDER_USER_DATAFILES=$1/datafiles \
    SUPPLE_CACHE_DIR=$1/prepared
}

# debian_blender ARGUMENT...: Debian's Blender with Debian's Python. It takes the modules of the first
# python3 on the path, so .venv/bin or another Python there would swap its NumPy for one it can't use.
debian_blender() {
  env -u PYTHONPATH -u PYTHONHOME -u VIRTUAL_ENV PATH=/usr/bin:/bin /usr/bin/blender "$@"
}
