#!/bin/sh
# Runs the add-on's tests in a version of Blender: tools/test_addon.sh VERSION [ARGUMENT...]   (for example: tools/test_addon.sh 4.5.15 -m '')
# VERSION is one of the bpy module; its environment, build/environments/test-VERSION, is made once. The arguments are pytest's.
set -eu
cd "$(dirname "$0")/.."
version=${1:?usage: tools/test_addon.sh VERSION [ARGUMENT...], for example tools/test_addon.sh 4.5.15}
shift
export VENV="build/environments/test-$version"

# Blender up to 5.0 includes Python 3.11, later versions 3.13.
case $version in
4.* | 5.0.*) python=python3.11 ;;
*) python=python3.13 ;;
esac

if ! [ -e "$VENV/.ready" ]; then
    mkdir -p build/environments
    { grep -v '^bpy==' constraints.txt; printf 'bpy==%s\n' "$version"; } >"$VENV.txt"
    PYTHON=${PYTHON:-$python} CONSTRAINTS="$VENV.txt" sh tools/setup.sh blender,dev
    touch "$VENV/.ready"
fi
exec "$VENV/bin/python" -m pytest tests/addon "$@"
