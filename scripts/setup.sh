#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Sets up what a checkout needs, and only what is missing; quick when run again.
#
#   scripts/setup.sh [build] [blender] [tests]
#
# build    compiler, libraries, .venv with the supple wheel and its command line (the default)
# blender  Debian's Blender
# tests    what ./check needs beside those: a virtual screen, bpy 4.5 in .venv-bpy, PyTorch, training/
set -euo pipefail
# shellcheck source=scripts/lib.sh
source "$(dirname "$0")/lib.sh"

BPY=bpy==4.5.15    # Blender 4.5 LTS as a Python module
BPY_NUMPY='numpy<2' # what 4.5 itself ships
TORCH=2.13.0       # the reference in tests, never what users install

setup_build() {
  section "Set-up: build tools and libraries"
  apt_install g++ libopenblas-openmp-dev libsuitesparse-dev libeigen3-dev libspectra-dev \
    libnanoflann-dev libxxhash-dev libgtest-dev libbenchmark-dev

  if ! python_is_311 "$VENV/bin/python"; then
    local python
    python=$(find_python)
    rm -rf "$VENV"
    make_venv "$VENV" "$python"
  fi
  make_venv "$VENV" "$(readlink -f "$VENV/bin/python")"
  local wanted
  wanted="$(hash_of scripts/requirements.txt) $(stat -c %i "$VENV")"
  if ! stamp_is requirements "$wanted"; then
    say "installing scripts/requirements.txt into .venv"
    pip_install "$VENV" -r "$ROOT/scripts/requirements.txt"
    stamp_set requirements "$wanted"
  fi

  "$VENV/bin/python" "$ROOT/scripts/package.py" wheel
  local wheel
  wheel=$(ls "$ROOT"/dist/supple-*-cp311-*.whl)
  wanted="$(sha256sum "$wheel" | cut -d' ' -f1) $(stat -c %i "$VENV")"
  if ! stamp_is wheel-installed "$wanted"; then
    say "installing $(basename "$wheel") into .venv"
    pip_install "$VENV" --force-reinstall --no-deps "$wheel"
    pip_install "$VENV" "$wheel"
    stamp_set wheel-installed "$wanted"
  fi
  say "command line: .venv/bin/supple"
}

setup_blender() {
  section "Set-up: Debian's Blender"
  # Blender's Python scripts import NumPy, and Workbench draws through EGL where there is no display:
  # its package asks for neither.
  apt_install blender python3-numpy libegl1 libgl1-mesa-dri
}

setup_tests() {
  section "Set-up: test environments"
  # The second line is what the bpy module links to but its wheel does not carry.
  apt_install xvfb xauth xdotool \
    libx11-6 libxi6 libxxf86vm1 libxfixes3 libxrender1 libxkbcommon0 libsm6 libice6 libgl1

  local wanted
  make_venv "$ROOT/.venv-bpy" "$(readlink -f "$VENV/bin/python")"
  wanted="$BPY $BPY_NUMPY $(stat -c %i "$ROOT/.venv-bpy")"
  if ! stamp_is bpy "$wanted"; then
    say "installing $BPY into .venv-bpy (370 MB)"
    pip_install "$ROOT/.venv-bpy" "$BPY" "$BPY_NUMPY" \
      "$(grep '^pytest==' "$ROOT/scripts/requirements.txt")"
    stamp_set bpy "$wanted"
  fi

  # Debian's Blender brings its own Python, which sees no virtual environment: pytest goes in a folder.
  wanted="$(hash_of scripts/requirements.txt)"
  if ! stamp_is blender-pytest "$wanted" || [ ! -d "$ROOT/build/blender-site" ]; then
    say "installing pytest for Debian's Blender into build/blender-site"
    rm -rf "$ROOT/build/blender-site"
    pip_install "$VENV" --target "$ROOT/build/blender-site" \
      "$(grep '^pytest==' "$ROOT/scripts/requirements.txt")"
    stamp_set blender-pytest "$wanted"
  fi

  setup_training
}

# PyTorch's CPU build is asked for by name: the plain name may bring gigabytes of CUDA libraries.
setup_training() {
  local wanted
  wanted="torch $TORCH $(stat -c %i "$VENV") $(hash_of training/pyproject.toml)"
  if stamp_is training "$wanted"; then return 0; fi
  if ! "$VENV/bin/python" -c 'import torch' >/dev/null 2>&1; then
    say "installing PyTorch $TORCH (CPU) into .venv, for the tests"
    pip_install "$VENV" "torch==$TORCH+cpu" 2>/dev/null || {
      say "no package index of yours has torch $TORCH+cpu; taking its default build (gigabytes)"
      pip_install "$VENV" "torch==$TORCH"
    }
  fi
  say "installing training/ into .venv, editable"
  pip_install "$VENV" -e "$ROOT/training"
  stamp_set training "$wanted"
}

lock_setup
[ $# -gt 0 ] || set -- build
for part in "$@"; do
  case $part in
    build | blender | tests) "setup_$part" ;;
    *) die "unknown part '$part': use build, blender or tests" ;;
  esac
done
