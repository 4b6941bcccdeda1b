#!/bin/sh
# The comparison with other packages, from nothing: they hold NumPy back, so they get an environment of their own.
# `sh benchmarks/peers.sh pytest ...` runs benchmarks there.
set -eu
cd "$(dirname "$0")/.."
ENVIRONMENT=.venv/peers
[ -x "$ENVIRONMENT/bin/python" ] || "${PYTHON:-python3}" -m venv "$ENVIRONMENT"
"$ENVIRONMENT/bin/python" -m pip install --quiet --disable-pip-version-check -e '.[peers]'
[ "${1:-}" = pytest ] || set -- benchmarks.peers "$@"
exec "$ENVIRONMENT/bin/python" -m "$@"
