#!/bin/sh
# Makes the project's own .venv and installs the package there: tools/setup.sh EXTRAS   (for example: tools/setup.sh synth,dev)
# The variables VENV, CONSTRAINTS and PYTHON select another folder, other constraints and the interpreter.
# Runs on Debian and on macOS. As root on Debian it installs missing system packages; otherwise it prints the command that does.
set -eu
cd "$(dirname "$0")/.."
extras=$1
venv=${VENV:-.venv}
constraints=${CONSTRAINTS:-constraints.txt}

fail() {
    printf 'setup: %s\n' "$*" >&2
    exit 1
}

# `command -v` is not enough: version managers leave launchers for Pythons that they do not run.
suitable() {
    "$1" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] < (3, 15))' >/dev/null 2>&1
}

candidates=${PYTHON:-python3.11 python3.13 python3.12 python3.14 python3}

find_python() {
    for name in $candidates; do
        if suitable "$name"; then
            printf '%s\n' "$name"
            return
        fi
    done
}

# system_packages WHY PACKAGE...: installs Debian packages as root, else prints the command; false if neither is possible.
system_packages() {
    why=$1
    shift
    command -v apt-get >/dev/null 2>&1 || return 1
    if [ "$(id -u)" -ne 0 ]; then
        printf 'setup: %s needs system packages: sudo apt-get install -y %s\n' "$why" "$*" >&2
        return 1
    fi
    printf 'setup: installing %s for %s\n' "$*" "$why"
    export DEBIAN_FRONTEND=noninteractive
    apt-get install -y -qq --no-install-recommends "$@" >/dev/null 2>&1 && return
    apt-get update -qq >/dev/null 2>&1 || true
    apt-get install -y -qq --no-install-recommends "$@" >/dev/null 2>&1
}

python=$(find_python)
if [ -z "$python" ]; then
    system_packages "the virtual environment" python3 python3-venv || true
    python=$(find_python)
fi
[ -n "$python" ] || fail "no Python 3.11 to 3.14 (looked for: $candidates): install one (Debian: apt-get install python3 python3-venv; macOS: brew install python@3.11)"

if ! { [ -x "$venv/bin/python" ] && suitable "$venv/bin/python" && "$venv/bin/python" -m pip --version >/dev/null 2>&1; }; then
    if ! "$python" -c 'import ensurepip, venv' >/dev/null 2>&1; then
        system_packages "the virtual environment" python3-venv || true
        "$python" -c 'import ensurepip, venv' >/dev/null 2>&1 || fail "$python cannot make virtual environments: apt-get install python3-venv"
    fi
    printf 'setup: making %s with %s\n' "$venv" "$("$python" --version)"
    "$python" -m venv --clear "$venv"
fi

pip() {
    "$venv/bin/python" -m pip --disable-pip-version-check "$@"
}

printf 'setup: installing isc3d[%s] (once; it takes a few minutes)\n' "$extras"
pip install --quiet -c "$constraints" setuptools
pip install --quiet -c "$constraints" --no-build-isolation -e ".[$extras]"
# As pip does for its packages: commands start faster, even if Python may not cache bytecode.
"$venv/bin/python" -m compileall -q isc_core synth benchmarks blender_addon

# Mitsuba compiles its kernels with the system's libLLVM, 19 or later; without one it renders more slowly.
case $extras in
*synth*)
    newest_llvm() {
        "$venv/bin/python" -c 'import drjit; print(drjit.detail.llvm_version()[0])' 2>/dev/null || printf '0\n'
    }
    if [ "$(uname)" = Linux ] && "$venv/bin/python" -c 'import drjit' >/dev/null 2>&1 && [ "$(newest_llvm)" -lt 19 ]; then
        system_packages "fast rendering" libllvm19 || printf 'setup: continuing without libLLVM 19; rendering is slower\n' >&2
    fi
    ;;
esac

# The bpy module does not use a display, but links against display libraries.
case $extras in
*blender*)
    if [ "$(uname)" = Linux ] && pip show bpy >/dev/null 2>&1 && ! "$venv/bin/python" -c 'import bpy' >/dev/null 2>&1; then
        system_packages "the bpy module" libxrender1 libxi6 libxkbcommon0 libsm6 libxfixes3 libxxf86vm1 libgl1 libegl1 ||
            printf 'setup: continuing without bpy; what needs it is skipped\n' >&2
    fi
    ;;
esac
