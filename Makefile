# `make demo` and `make test` need Python 3.11 or later and nothing else: they make .venv when it is missing or out of date.
# What they do stands in make.py, which also works without make: python make.py demo
PYTHON ?= $(shell command -v python3.11 || echo python3)
BIN := .venv/bin
# Idle OpenMP threads sleep instead of spinning: two test processes share two cores.
export OMP_WAIT_POLICY := PASSIVE
PYTEST := OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m pytest

.PHONY: demo test test-browser site test-real notebooks lint bench clean

demo test test-browser site lint:
	$(PYTHON) make.py $@

test-real: .venv/made
	@test -n "$(KITTI)" || { echo "usage: make test-real KITTI=<folder that holds 2011_09_26>"; exit 2; }
	KITTI="$(abspath $(KITTI))" SEMANTIC_KITTI="$(abspath $(SEMANTIC_KITTI))" PANDASET="$(abspath $(PANDASET))" $(PYTEST) -m real tests

notebooks: .venv/made
	$(BIN)/semgrid-edu course notebooks

bench: .venv/made
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[bench]'
	for script in benchmarks/bench_*.py; do $(BIN)/python $$script || exit 1; done

.venv/made: pyproject.toml constraints.txt
	$(PYTHON) make.py environment

clean:
	rm -rf .venv out
