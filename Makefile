# `make demo` and `make test` set up everything that they need, once, in .venv; see docs/install.md.
# PYTHON=/path/to/python3.12 chooses the interpreter.
PYTHON ?=
export PYTHON

.PHONY: help demo test bench weights surfaces design setup clean
help:
	@echo "make demo    water on a knot: a page and a video in out/demo"
	@echo "make test    the linter and all tests"
	@echo "make bench   the default model's speed beside the solver's on four surfaces, its growth, its pool at rest; half an hour, alone"
	@echo "make weights train the shipped model anew: data by the solver, then a run; hours"
	@echo "make surfaces fit the shipped neural surfaces anew: coral, chairs, bowls; half an hour, can be started again"
	@echo "make design  the bowl, the funnel, the chair that holds water and the three balls, in out/design; half an hour"
	@echo "make setup   only what these two need: .venv and the system libraries"
	@echo "make clean   remove .venv and what demo and tests left"

# Without the system libraries there are no pictures, but the water and the page can still be had.
demo: .venv/ready
	@video=; scripts/system-libraries || video=--no-video; \
	.venv/bin/surfsup simulate examples/knot.obj -o out/demo $$video

# Two processes at most, of one thread each: the threads of torch in several processes only get in each other's way.
test: setup
	.venv/bin/python -m ruff check .
	OMP_NUM_THREADS=1 .venv/bin/python -m pytest -n 2

# Ratios mean something only where nothing else computes meanwhile.
bench: setup
	.venv/bin/python benchmarks/against_solver.py
	.venv/bin/python benchmarks/against_solver.py --particles 3000 --no-torch --surface knot coral chair
	.venv/bin/python benchmarks/growth.py --long 200 10000
	.venv/bin/python benchmarks/stability.py
	.venv/bin/python benchmarks/at_rest.py --solver

# The corrected simulator, which does not ship. What is done is kept, so it can be started again.
weights: setup
	.venv/bin/surfsup generate prim-shapes -o data/train -n 150 --seed 1
	.venv/bin/surfsup generate assorted -o data/assorted-train -n 112 --seed 11
	.venv/bin/surfsup generate tanks -o data/tanks-train -n 24 --seed 21
	.venv/bin/surfsup generate hills -o data/hills-train -n 36 --seed 31
	.venv/bin/surfsup generate bowls -o data/bowls-train -n 24 --seed 36 --frames 400
	.venv/bin/surfsup generate prim-shapes -o data/validation -n 10 --seed 2
	.venv/bin/surfsup train corrected --data data/train --data data/assorted-train --data data/tanks-train \
		--data data/hills-train --data data/bowls-train --validation data/validation -o runs/corrected \
		$(if $(wildcard runs/corrected/checkpoint.safetensors),--resume)

# The surfaces that ship: see the cards in src/surfsup/sdf/neural/shipped. What is done is kept, so it can be started again.
surfaces: setup
	.venv/bin/surfsup fit siren coral -o runs/surfaces/coral.safetensors steps=9000 $(call again,coral)
	.venv/bin/surfsup fit deepsdf chairs --shapes 500 -o runs/surfaces/chairs.safetensors $(call again,chairs)
	.venv/bin/surfsup fit deepsdf bowls --shapes 200 -o runs/surfaces/bowls.safetensors width=96 layers=4 code=8 \
		steps=8000 $(call again,bowls)
	cp runs/surfaces/*.safetensors src/surfsup/sdf/neural/shipped/

again = $(if $(wildcard runs/surfaces/$(1).fit/checkpoint.safetensors),--resume)

# A design that is there already is gone on with; one that is finished is only looked at again.
design: setup
	.venv/bin/surfsup design bowl -o out/design/bowl --baselines --resume
	.venv/bin/surfsup design funnel -o out/design/funnel --baselines --resume
	.venv/bin/surfsup design latent -o out/design/chair --shape chair-0100 --iterations 30 --resume
	.venv/bin/python examples/deflectors.py
	.venv/bin/python benchmarks/design_searches.py

setup: .venv/ready
	@scripts/system-libraries

.venv/ready: pyproject.toml scripts/setup $(shell find src/surfsup/native -name "*.[ch]pp" -o -name CMakeLists.txt)
	@scripts/setup

clean:
	rm -rf .venv build out .pytest_cache .ruff_cache .hypothesis
