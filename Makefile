# make train: learn a grasp-force policy and compare it with the hand-written controller. make test: the tests.
# make test-long: the tests of whole searches and command lines. make check: both, and all else that must hold before a commit.
# make docs: the documentation as a site, in build/docs.
# They set themselves up in .venv; set PYTHON to use another interpreter (3.11 or newer).
PYTHON ?= python3
VENV := .venv
RUN := runs/latest_$(shell date +%Y-%m-%d_%H-%M-%S)

# what Python compiled is kept: the tests start many a process, which would each compile it again
unexport PYTHONDONTWRITEBYTECODE

.PHONY: train test test-long check docs setup clean

train: setup
	$(VENV)/bin/forcegrasp train experiment=quick hydra.run.dir=$(RUN)
	$(VENV)/bin/forcegrasp evaluate 'policies=[$(RUN),force_pi]' trials=30 out=$(RUN)/evaluation

PYTEST := $(VENV)/bin/python -m pytest -q -n auto --dist loadfile --no-loadscope-reorder

test: setup
	$(PYTEST) -m "not long"

test-long: setup
	$(PYTEST) -m long

check: $(VENV)/.docs
	$(VENV)/bin/python tools/check.py

docs: $(VENV)/.docs
	$(VENV)/bin/python tools/check.py docs

setup: $(VENV)/.ready

$(VENV)/.ready: pyproject.toml constraints.txt tools/setup.sh
	PYTHON=$(PYTHON) sh tools/setup.sh $(VENV)
	touch $@

# what makes the site is of no use to those who train or test
$(VENV)/.docs: $(VENV)/.ready
	$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[docs]'
	touch $@

clean:
	rm -rf $(VENV)
