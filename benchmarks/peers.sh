#!/bin/sh
# The comparison with other packages, from nothing: they hold NumPy back, so they get an environment of their own.
set -eu
cd "$(dirname "$0")/.."
ENVIRONMENT=.venv/peers
[ -x "$ENVIRONMENT/bin/python" ] || "${PYTHON:-python3}" -m venv "$ENVIRONMENT"
"$ENVIRONMENT/bin/python" -m pip install --quiet --disable-pip-version-check -e '.[peers]'
exec "$ENVIRONMENT/bin/python" -m benchmarks.peers "$@"
