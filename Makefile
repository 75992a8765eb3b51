# `make demo` and `make test` install everything that they need, once, into .venv; see docs/install.md.
# PYTHON=/path/to/python3.12 chooses the interpreter.
PYTHON ?=
export PYTHON

.PHONY: help demo test docs bench faults sanitize wheel release corrected surfaces design setup clean
help:
	@echo "make demo     water on a knot: a page and a video in out/demo"
	@echo "make test     style, types, import rules, all tests, and the documentation"
	@echo "make docs     the documentation as a site in out/site"
	@echo "make bench    speed beside the reference solver, growth with the number of particles, a pool at rest; half an hour, alone"
	@echo "make faults   the fault campaign: damaged files, kills, full disks; an hour"
	@echo "make sanitize the tests of the C++ code with the sanitizers of the compiler; some minutes"
	@echo "make wheel    a wheel with the C++ code for the present Python, in dist"
	@echo "make release  wheels, source archive, notes and checksums, in dist"
	@echo "make corrected  data and training of the corrected simulator; hours, resumable"
	@echo "make surfaces fit the shipped neural surfaces: coral, chairs, bowls; half an hour, resumable"
	@echo "make design   bowl, funnel, chair and three balls, in out/design; half an hour, resumable"
	@echo "make setup    only .venv and the system packages"
	@echo "make clean    remove .venv and all output"

# Without the system packages there is no video, but the simulation and the page work.
demo: .venv/ready
	@video=; scripts/system-packages pictures || video=--no-video; \
	.venv/bin/surfsup simulate examples/knot.obj -o out/demo $$video

# Two processes of one thread each: more threads of torch would compete for the cores. The second run is that of a
# machine without a compiler, where Warp and torch compute what C++ computes elsewhere.
test: setup docs
	.venv/bin/python -m ruff check .
	.venv/bin/python -m ruff format --check src tests benchmarks examples
	.venv/bin/lint-imports
	.venv/bin/mypy
	OMP_NUM_THREADS=1 .venv/bin/python -m pytest -n 2
	SURFSUP_NATIVE=0 OMP_NUM_THREADS=1 .venv/bin/python -m pytest -n 2 $(without_native)
	scripts/run-notebooks

without_native = tests/native tests/test_simulation.py tests/sph/test_environment.py tests/sph/test_crossings.py \
	tests/sph/test_solver.py tests/sph/test_collision.py tests/sdf/mesh tests/io tests/fitting/test_deepsdf_fit.py

docs: .venv/ready
	NO_MKDOCS_2_WARNING=1 .venv/bin/mkdocs build --strict --quiet --site-dir out/site

# Ratios are valid only if nothing else runs meanwhile.
bench: setup
	.venv/bin/python benchmarks/against_solver.py
	.venv/bin/python benchmarks/against_solver.py --particles 3000 --no-warp --surface knot coral chair
	.venv/bin/python benchmarks/growth.py --long 200 10000
	.venv/bin/python benchmarks/stability.py
	.venv/bin/python benchmarks/at_rest.py --solver

faults: setup
	.venv/bin/python benchmarks/faults.py

sanitize: setup
	scripts/sanitize-native

# For Linux systems without a compiler; pyproject.toml has the configuration of cibuildwheel for all systems.
wheel:
	scripts/build-wheel $(or $(PYTHON),python3)

release:
	scripts/release $(PYTHON)

# The corrected simulator, which does not ship.
corrected: setup
	.venv/bin/surfsup generate prim-shapes -o data/train -n 150 --seed 1
	.venv/bin/surfsup generate assorted -o data/assorted-train -n 112 --seed 11
	.venv/bin/surfsup generate tanks -o data/tanks-train -n 24 --seed 21
	.venv/bin/surfsup generate hills -o data/hills-train -n 36 --seed 31
	.venv/bin/surfsup generate bowls -o data/bowls-train -n 24 --seed 36 --frames 400
	.venv/bin/surfsup generate prim-shapes -o data/validation -n 10 --seed 2
	.venv/bin/surfsup train corrected --data data/train --data data/assorted-train --data data/tanks-train \
		--data data/hills-train --data data/bowls-train --validation data/validation -o runs/corrected \
		$(if $(wildcard runs/corrected/checkpoint.safetensors),--resume)

# The surfaces that ship: see the cards in src/surfsup/sdf/neural/shipped.
surfaces: setup
	.venv/bin/surfsup fit siren coral -o runs/surfaces/coral.safetensors steps=9000 $(call again,coral)
	.venv/bin/surfsup fit deepsdf chairs --shapes 500 -o runs/surfaces/chairs.safetensors $(call again,chairs)
	.venv/bin/surfsup fit deepsdf bowls --shapes 200 -o runs/surfaces/bowls.safetensors width=96 layers=4 code=8 \
		steps=8000 $(call again,bowls)
	cp runs/surfaces/*.safetensors src/surfsup/sdf/neural/shipped/

again = $(if $(wildcard runs/surfaces/$(1).fit/checkpoint.safetensors),--resume)

# A design is resumed; of a finished one only figures and tables are made again.
design: setup
	.venv/bin/surfsup design bowl -o out/design/bowl --baselines --resume
	.venv/bin/surfsup design funnel -o out/design/funnel --baselines --resume
	.venv/bin/surfsup design latent -o out/design/chair --shape chair-0100 --iterations 30 --resume
	.venv/bin/python examples/deflectors.py
	.venv/bin/python benchmarks/design_searches.py

# A compiler installed since the last set-up is noticed.
setup: .venv/ready
	@if [ -e .venv/without-native ] && scripts/system-packages compiler .venv/bin/python; then scripts/setup; fi
	@scripts/system-packages pictures

.venv/ready: pyproject.toml scripts/setup $(shell find src/surfsup/native -name "*.[ch]pp" -o -name CMakeLists.txt)
	@scripts/setup

clean:
	rm -rf .venv build dist out .pytest_cache .ruff_cache .hypothesis
