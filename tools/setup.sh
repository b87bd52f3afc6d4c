#!/bin/sh
# Makes the virtual environment that the Makefile uses: sh tools/setup.sh FOLDER
set -eu
venv="$1"
python="${PYTHON:-python3}"
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || {
    echo "forcegrasp needs Python 3.11 or newer; '$python' is not: make PYTHON=/path/to/python3.11 ..." >&2
    exit 2
}
"$python" -m venv "$venv" 2>/dev/null || {
    echo "could not make a virtual environment: install the venv module (Debian: apt install python3-venv)" >&2
    exit 2
}
# torch alone first, by its exact version: a CPU build is taken where the package index offers one
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check "$(grep '^torch==' constraints.txt)"
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev,onnx]'
# compiled once, here: where files may not be written later, each start would compile all that it imports
"$venv/bin/python" -m compileall -q forcegrasp
