# `make demo` and `make test` set up everything that they need, once, in .venv; see docs/install.md.
# PYTHON=/path/to/python3.12 chooses the interpreter.
PYTHON ?=
export PYTHON

.PHONY: help demo test bench weights setup clean
help:
	@echo "make demo    water on a knot: a page and a video in out/demo"
	@echo "make test    the linter and all tests"
	@echo "make bench   the default model's speed beside the solver's, its growth, its pool at rest; half an hour, alone"
	@echo "make weights train the shipped model anew: data by the solver, then two runs; hours"
	@echo "make neural  fit the neural surfaces anew: coral, room, chairs, bowls; an hour, can be started again"
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
	.venv/bin/python benchmarks/growth.py --long 200 10000
	.venv/bin/python benchmarks/stability.py
	.venv/bin/python benchmarks/at_rest.py --solver

# The shipped model: see src/surfsup/weights/first.md. What is done is kept, so it can be started again.
weights: setup
	.venv/bin/surfsup generate prim-shapes -o data/train -n 70 --seed 1
	.venv/bin/surfsup generate prim-shapes -o data/validation -n 10 --seed 2
	.venv/bin/surfsup train first --data data/train --validation data/validation -o runs/first --threads 2 \
		$(if $(wildcard runs/first/checkpoint.safetensors),--resume)
	.venv/bin/surfsup train first-finish --start runs/first/best.safetensors --data data/train \
		--validation data/validation -o runs/first-finish --threads 2 \
		$(if $(wildcard runs/first-finish/checkpoint.safetensors),--resume)

# Neural surfaces of the project's own shapes: see docs/neural-surfaces.md. What is begun goes on.
neural: runs/fit/coral.done runs/fit/room.done runs/fit/chairs.done runs/fit/bowls.done
fit = .venv/bin/surfsup fit $(1) -o runs/fit/$(2).safetensors $(3) \
	$(if $(wildcard runs/fit/$(2).fit/checkpoint.safetensors),--resume) && touch $@

runs/fit/coral.done runs/fit/room.done: runs/fit/%.done: | setup
	$(call fit,siren $*,$*,steps=5000)
runs/fit/chairs.done: | setup
	$(call fit,deepsdf chairs --shapes 500,chairs,steps=20000)
runs/fit/bowls.done: | setup
	$(call fit,deepsdf bowls --shapes 200,bowls,width=96 layers=4 code=8 steps=8000)

setup: .venv/ready
	@scripts/system-libraries

.venv/ready: pyproject.toml scripts/setup $(wildcard src/surfsup/native/*.[ch]pp src/surfsup/native/CMakeLists.txt)
	@scripts/setup

clean:
	rm -rf .venv build out .pytest_cache .ruff_cache .hypothesis
