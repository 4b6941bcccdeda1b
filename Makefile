# The two commands: `make study` and `make test`. Both set themselves up in .venv first. `make test-long` runs the tests that
# `make test` leaves out: whole workflows, sessions in a browser, climbs, other processors, rows of the long trials.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
STUDY_READY := $(VENV)/.ready-study
COMPILED := setup.py $(wildcard study/equations/c/*)

.PHONY: study report test test-long test-cluster checks lint picture fault_pictures howto_pictures report_picture next_test notebooks docs gallery readme estimators trials benchmarks wheel clean

study: $(STUDY_READY)
	$(BIN)/snakemake -j2

report: study
	$(BIN)/snakemake --report report.html

test: $(READY)
	$(MAKE) --no-print-directory -j2 lint checks

# A one-node SLURM on this machine (Debian, as root), then a store of results on it: the same bytes as without.
test-cluster: $(READY)
	scripts/test_cluster.sh
	scripts/test_store.sh

# As many workers as cores: more threads would only wait for each other.
PYTEST := OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -n logical --dist loadfile --no-loadscope-reorder -p no:benchmark

checks: $(READY)
	$(PYTEST) -m "not long"

test-long: $(READY)
	$(PYTEST) -m long

lint: $(READY)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/pyright

picture: $(READY)
	$(BIN)/snakemake -j2 silverbox_climb
	$(BIN)/python scripts/page_picture.py results/silverbox/climb.html docs/explore.png 1

fault_pictures: $(READY)
	$(BIN)/python scripts/fault_pictures.py models docs/faults

howto_pictures: $(READY)
	$(BIN)/python scripts/howto_pictures.py models docs/howto

report_picture: $(READY)
	$(BIN)/python scripts/report_picture.py models docs/report.png

next_test: $(READY)
	$(BIN)/python scripts/next_test_docs.py docs

notebooks: $(READY)
	$(BIN)/python scripts/notebooks.py docs/notebooks/*.ipynb

docs: $(READY)
	$(BIN)/mkdocs build --strict --quiet
	@echo "open site/index.html"

gallery: $(READY)
	$(BIN)/snakemake -j2 gallery
	PYTHONPATH=. $(BIN)/python scripts/gallery_docs.py

readme: study
	$(BIN)/python scripts/readme.py
	$(BIN)/python scripts/trial_docs.py

estimators: $(READY)
	$(BIN)/snakemake -j2 estimators
	$(BIN)/python scripts/estimator_docs.py

benchmarks: $(READY)
	$(BIN)/python -m benchmarks.ratios

# One wheel for every Python 3 of this platform, which installs without a compiler; cibuildwheel makes those of others.
wheel: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[wheel]'
	$(BIN)/python -m build --wheel --outdir dist/built
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/python -m auditwheel repair --wheel-dir dist dist/built/*.whl

# TABLE: trials, trials_by_test, trials_of_structures, trials_like_rigs, trials_of_next_tests or trials_of_changes.
TABLE = trials
trials: $(READY)
	$(BIN)/snakemake -j2 $(TABLE)
	$(BIN)/python scripts/trial_docs.py $(TABLE) results/$(TABLE)/trials.csv

define ENVIRONMENT
@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
  || { echo "study: $(PYTHON) is older than 3.11; name a newer one: make PYTHON=python3.12 study"; exit 2; }
@$(PYTHON) -m venv $(VENV) \
  || { echo "study: $(PYTHON) cannot make a virtual environment; on Debian, install python3-venv"; exit 2; }
endef

$(READY): requirements.lock pyproject.toml $(COMPILED)
	$(ENVIRONMENT)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps -e .
	@touch $@ $(STUDY_READY)

# The study needs half of that: of the same versions what the workflow asks for.
$(STUDY_READY): requirements.lock pyproject.toml $(COMPILED)
	$(ENVIRONMENT)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c requirements.lock -e '.[workflow]'
	@touch $@

clean:
	rm -rf results figures .snakemake report.html site dist
