# `make demo` and `make test` need git, make and a Rust toolchain; they install what else is missing.

.PHONY: help demo test check docs setup

help:
	@echo 'make demo    install what is missing, build, render the default room to parhelion.png'
	@echo 'make test    install what is missing, build and run all tests'
	@echo 'make docs    measure every method, write docs/methods.md anew; long on a CPU'
	@echo 'make check   formatting, lints and documentation, warnings as errors'

demo: setup
	cargo build --release
	cargo run --release --quiet -- render -o parhelion.png

test: setup
	cargo test --features compile,denoise

check: setup
	cargo fmt --all --check
	cargo clippy --workspace -- -D warnings
	cargo clippy --workspace --all-targets --features compile,denoise -- -D warnings
	cargo clippy --no-default-features --lib --examples -- -D warnings
	RUSTDOCFLAGS='-D warnings' cargo doc --workspace --no-deps --features compile,denoise

# What `make docs` measures, and where; on a GPU: `make docs SIZE=800x600 SEEDS=3 OPTIONS='--device 0'`.
SCENES = office conference
SIZE = 240x180
SEEDS = 1
OPTIONS =
measured = out/docs
run = cargo run --release --quiet --

# A stress scene that fails unexpectedly is a result too.
docs: setup
	cargo build --release
	rm -rf $(measured) && mkdir -p $(measured)
	for scene in $(SCENES); do \
	    $(run) chart builtin:$$scene --grid docs/methods.toml --size $(SIZE) --seeds $(SEEDS) $(OPTIONS) \
	        -o $(measured)/$$scene || exit; \
	done
	-$(run) stress $(OPTIONS) -o $(measured)/stress
	rm -f docs/methods/*
	$(run) methods $(SCENES:%=--chart $(measured)/%) --stress $(measured)/stress -o docs/methods.md

setup:
	@./setup.sh
