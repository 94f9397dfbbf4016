#!/bin/sh
# Installs what pack.py has carried into site/ beside this file, without a network, and measures.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
python=${PYTHON:-python3}
[ -d "$here/site" ] || "$python" -m pip install --quiet --no-index --no-deps --target "$here/site" "$here"/wheels/*.whl
PYTHONPATH=$here/site${PYTHONPATH:+:$PYTHONPATH} exec "$python" "$here/measure.py" "$@"
