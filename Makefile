# Every target works on a fresh machine: `setup` installs and builds what is missing, and is quick
# when nothing is.

CARGO ?= cargo
# More arguments for cargo: make test ARGS="--test frames"
ARGS ?=
# How `build` and `demo` build: PROFILE=dev builds with little optimisation, as the tests are built
PROFILE ?= release

.DEFAULT_GOAL := help
.PHONY: help setup setup-tests build capi install wheel header demo view test-window captures pictures test test-all bench clean distclean

help: ## This list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-11s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: ## Install what building and running need (Debian 12, Ubuntu 24.04)
	@tools/setup.sh

setup-tests:
	@tools/setup.sh --tests

build bench: export VOLRASTER_COMMIT ?= $(shell git describe --always --dirty --exclude "*" 2>/dev/null)
build: setup ## Build the library and the program, optimised
	$(CARGO) build --profile $(PROFILE) $(ARGS)

capi: setup ## Build the libraries for C, dynamic and static, optimised
	$(CARGO) build --release -p volraster-capi $(ARGS)
	$(CARGO) rustc --release -p volraster-capi --crate-type staticlib $(ARGS)

install: setup ## Install the libraries for C with header, pkg-config and CMake files (PREFIX=/usr/local, DESTDIR=)
	@PREFIX="$(PREFIX)" DESTDIR="$(DESTDIR)" tools/install.sh

wheel: setup-tests ## Build the Python package as a wheel into out/
	@tools/python.sh --wheel out

header: ## Write include/volraster.h anew
	$(CARGO) run -q -p volraster-header >include/volraster.h.new
	mv include/volraster.h.new include/volraster.h

demo: build ## Draw the head; print device, time, error and where the picture is
	@PROFILE=$(PROFILE) tools/demo.sh

view: ## Open a file in a window (ARGS=FILE)
	@tools/setup.sh --window
	$(CARGO) run --release --features window -- view $(ARGS)

test-window: ## Try the window on a display of its own
	@tools/window.sh $(ARGS)

captures: ## Make captures of every technique and route, and replay them
	@tools/captures.sh $(ARGS)

pictures: build ## Draw the pictures of docs/TECHNIQUES.md
	@tools/pictures.sh

test: setup-tests ## Run the tests under the validation layers, on the default device (ARGS="-- WORD": some)
	@tools/test.sh $(ARGS)

test-all: setup-tests ## Run every case of every test on the default device, some on two more drivers (three hours on two cores)
	@tools/lavapipe25.sh >/dev/null
	@tools/test.sh --all $(ARGS)

bench: setup ## Run the benchmark
	$(CARGO) bench $(ARGS)

clean: ## Remove what was built and drawn (but not .deps, see distclean)
	$(CARGO) clean
	rm -rf out

distclean: clean ## Remove .deps as well: shader compiler, second driver
	rm -rf .deps
