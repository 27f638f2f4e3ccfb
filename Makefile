# hdTrapeze: every common task by one word. `make help` lists them.
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help
.PHONY: help setup demo hydra test lint format bench peers figures contact-sheet clean distclean

PY := .venv/bin/python
# Flags of `hdtrapeze record` for the demo: make demo DEMO_FLAGS="--samples 16"
DEMO_FLAGS ?=
# Flags of scripts/contact_sheet.py: make contact-sheet DIR=scenes SHEET_FLAGS="--width 480"
SHEET_FLAGS ?=
# Parts of the figures: make figures FIGURES="scale effects"
FIGURES ?=
# Flags of the comparison with Embree, see make peers PEERS_FLAGS=--help
PEERS_FLAGS ?=

help: ## List the targets
	@awk -F':.*## ' '/^[a-z-]+:.*## / { printf "  make %-13s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: ## Install what is missing, make .venv, build the release libraries and the command
	@scripts/setup.sh

demo: setup ## Render examples/demo to out/demo.exr and out/demo.png
	@$(PY) scripts/demo.py $(DEMO_FLAGS)

hydra: setup ## Build the Hydra plugin for the OpenUSD that OPENUSD_* name, see scripts/hydra.sh
	@scripts/hydra.sh

test: ## Everything CI runs: formats, lints, layers, Rust, C and Python tests, documentation
	@scripts/setup.sh --tools
	@scripts/test.sh

lint: ## Only formats, lints and the direction of imports
	@scripts/setup.sh --tools --no-build
	@scripts/test.sh lint

format: ## Rewrite Rust, Python and C++ sources in the project's format
	@scripts/setup.sh --tools --no-build
	@scripts/test.sh format

bench: ## Run the benches; figures go to the terminal
	@scripts/setup.sh --tools
	@scripts/bench.sh

peers: ## Our tracer beside Embree 3, where that is installed (apt-get install libembree3-3)
	@cargo run --release --locked -p hdtrapeze-peers -- $(PEERS_FLAGS)

figures: ## Measure again what docs/bvh.md shows; for an idle machine with 24 GiB
	@scripts/setup.sh --tools --figures --no-build
	@scripts/figures.sh $(FIGURES)

contact-sheet: ## Render every USD file below DIR into one picture, out/contact_sheet.png
	@scripts/setup.sh --tools
	@$(PY) scripts/contact_sheet.py $(SHEET_FLAGS) "$(or $(DIR),$(error DIR=folder says where the USD files are))"

clean: ## Remove build products and rendered pictures
	rm -rf target build out

distclean: clean ## Also remove the virtual environment
	rm -rf .venv
