# Every command of the project; `make` alone lists them.

.DEFAULT_GOAL := help

# What a recipe runs has its own make inside, which this one's job server is not for.
unexport MAKEFLAGS MAKEOVERRIDES MFLAGS

# Python keeps what it compiled: tests start hundreds of programs, a second quicker each.
unexport PYTHONDONTWRITEBYTECODE

BIN := .venv/bin
BUILD := build

# A subset: make test ARGS="-k divide", make timing MODULES="divide multiply".
ARGS :=
MODULES :=
export PYTHON ?= python3

# Of make board and make bitstream.
SCENE := default
BOARD := ulx3s

# Tests that share a fixture stay together. Workers are as many as processors, each with one thread.
PYTEST := OPENBLAS_NUM_THREADS=1 $(BIN)/pytest --numprocesses auto --dist loadgroup

.PHONY: help setup simulate scan test soak board mutate numbers bench docs lint formal timing \
  bitstream clean distclean

help: ## list these targets
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  make \1|\2/p' Makefile | \
	  while IFS='|' read -r target words; do printf '%-16s %s\n' "$$target" "$$words"; done

# What the script complains of is then the one line that Make ends with.
set_up = $(eval complaint := $(shell scripts/setup.sh $(1)))$\
  $(if $(filter-out 0,$(.SHELLSTATUS)),$(error $(complaint)))

setup: ## build .venv where that is needed; every other target does so by itself
	@:$(call set_up)

simulate:
	@:$(call set_up,simulate)

scan: setup ## run the default scene through the RTL: points, picture and error table in build/scan
	@$(BIN)/vrscan scan --out $(BUILD)/scan

test: simulate ## run every test; ARGS="-k divide" picks some
	@$(PYTEST) $(ARGS)

soak: simulate ## run the long tests: more random data, a million bytes, every scene in full
	@$(PYTEST) -m soak $(ARGS)

board: simulate ## simulate a board with a serial port, until stopped; SCENE=corner picks what it sees
	@$(BIN)/vrscan board $(SCENE) $(ARGS)

mutate: simulate ## put faults into a copy, which the tests must notice; ARGS="--systematic 1000" has more
	@$(BIN)/python tb/mutate.py $(MODULES) $(ARGS)

numbers: setup ## print the number table: measured, predicted, floor
	@$(BIN)/vrscan numbers

bench: setup ## speed against error, as a page in build/report; ARGS="--quick --scheduler ADDRESS"
	@$(BIN)/vrscan bench report $(ARGS)

docs: setup ## make the pages of docs a site in build/site, which opens without the internet
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

lint: setup ## Verilator -Wall, Yosys and Verible on the RTL, ruff and mypy on the Python
	@$(BIN)/python scripts/lint.py

formal: setup ## prove the limits of the light, and the contracts of link and sensor side
	@$(BIN)/python scripts/formal.py $(ARGS)

timing: setup ## synthesise, place and route each module; MODULES="divide multiply" picks some
	@$(BIN)/python scripts/timing.py $(MODULES) $(ARGS)

bitstream: setup ## build the bitstream of BOARD=ulx3s; it fails where a clock is not met
	@$(BIN)/python scripts/bitstream.py $(BOARD) $(ARGS)

clean: ## remove what was built
	@rm -rf $(BUILD) .pytest_cache .hypothesis .mypy_cache .ruff_cache

distclean: clean ## the same, and .venv
	@rm -rf .venv
