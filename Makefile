# The commands of this project. tools/ has the scripts; this file gives them their names.

.PHONY: help book demo demo-lab demo-peeler demo-profibus demo-robot demo-cell test platforms python bench soak worlds storm lint dist release build setup clean
.DEFAULT_GOAL := help

help: ## this list
	@awk -F ':.*## ' '/^[a-z%-]+:.*## / { printf "make %-13s %s\n", $$1, $$2 }' $(firstword $(MAKEFILE_LIST))

demo: ## build, then watch the PLC program run the rig: three cycles, one jam, one PLC killed
	@exec tools/demo

demo-lab: ## build, then watch two controllers and two tanks in a virtual laboratory, patched over text
	@exec tools/demo-lab

demo-peeler: ## build, then watch two PLCs peel blocks of wood to veneer over the link of 2018
	@exec tools/demo-peeler

demo-profibus: ## build, then watch the PLC program run the rig over PROFIBUS, by a master that others wrote
	@exec tools/demo-profibus

demo-robot: ## build, then run a servo robot and its PLC in lock-step and free-wheeling, and draw the paths
	@exec tools/demo-robot

demo-cell: ## build, then watch Petri nets make twelve cylinders in the manufacturing cell, with jams on the way
	@exec tools/demo-cell

test: setup ## build and test everything that CI checks
	@exec tools/test

platforms: setup ## build for Windows, Linux arm64 and musl, and test that in emulators
	@exec tools/platforms

test-%: setup ## the tests in Rust of one folder of crates/, such as make test-lab
	@cargo test --locked $$(sed -n 's/^name = "\(tickbus-.*\)"/-p \1/p' crates/$*/*/Cargo.toml)

python: setup ## the wheel of the Python package, built and tested
	@tools/peers --python && exec tools/python

bench: setup ## measure, and print each figure beside the one asked for
	@exec tools/bench

soak: setup ## a device and a peer that dies again and again, for MINUTES (3)
	@exec tools/soak $(MINUTES)

worlds: setup ## simulated worlds, judged by a model, for MINUTES (10)
	@exec tools/worlds $(MINUTES)

storm: setup ## the built artefacts in every language on every bus, killed, suspended and cut off, for MINUTES (5)
	@exec tools/storm $(MINUTES)

lint: setup ## formatting, clippy, documentation, Java warnings, shell scripts
	@exec tools/lint

dist: setup ## a zip with the DeviceDriver folder and the simulator; needs only a JRE to run
	@exec tools/dist

release: setup ## everything that a release has, for all platforms, and each part tried
	@exec tools/release/all

book: ## the documents as a site with a search, in target/book; needs no build of tickbus
	@exec tools/book

build: setup ## the native library, the tickbus command and the jars
	@exec tools/build

setup: ## check for the tools, and install what lacks on Debian or Ubuntu where allowed
	@exec tools/setup

clean: ## remove all that was built
	@exec tools/clean
