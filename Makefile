# `make demo` and `make test` need Python 3.11 or later and nothing else: they make .venv when it is missing or out of date.
PYTHON ?= $(shell command -v python3.11 || echo python3)
BIN := .venv/bin
# Idle OpenMP threads sleep instead of spinning: two test processes share two cores.
export OMP_WAIT_POLICY := PASSIVE
PYTEST := OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m pytest

.PHONY: demo test test-real notebooks lint bench clean

demo: .venv/made
	$(BIN)/semgrid-edu demo --out out/demo

test: lint
	$(PYTEST) -n 2 --dist loadfile --doctest-modules semgrid_edu tests
	$(BIN)/python -m pytest --nbval --nbval-current-env --nbval-cell-timeout=300 -n 2 --dist loadscope -p no:cacheprovider $(wildcard notebooks/*.ipynb notebooks/deeper/*.ipynb)

test-real: .venv/made
	@test -n "$(KITTI)" || { echo "usage: make test-real KITTI=<folder that holds 2011_09_26>"; exit 2; }
	KITTI="$(abspath $(KITTI))" SEMANTIC_KITTI="$(abspath $(SEMANTIC_KITTI))" $(PYTEST) -m real tests

notebooks: .venv/made
	$(BIN)/semgrid-edu course notebooks

lint: .venv/made
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

bench: .venv/made
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[bench]'
	for script in benchmarks/bench_*.py; do $(BIN)/python $$script || exit 1; done

.venv/made: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; v = sys.version.split()[0]; sys.exit(None if sys.version_info >= (3, 11) else f"Python 3.11 or later is needed, {sys.executable} is {v}; set PYTHON=...")'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[test]'
	touch $@

clean:
	rm -rf .venv out
