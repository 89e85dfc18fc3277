# `make demo` and `make test` need Python 3.11 or later and nothing else: they make .venv when it is missing or out of date.
# Every target is a function of make.py, which also works without make: python make.py demo
PYTHON ?= $(shell command -v python3.11 || echo python3)
export KITTI SEMANTIC_KITTI PANDASET

.PHONY: demo lint quick test test-browser test-real notebooks bench site clean

demo lint quick test test-browser test-real notebooks bench site:
	$(PYTHON) make.py $@

clean:
	rm -rf .venv out
