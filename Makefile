# `make demo` and `make test` need git, make and a Rust toolchain; they install what else is missing.

.PHONY: help demo test check setup

help:
	@echo 'make demo    install what is missing, build, render the default room to parhelion.png'
	@echo 'make test    install what is missing, build and run all tests'
	@echo 'make check   formatting, lints and documentation, warnings as errors'

demo: setup
	cargo build --release
	cargo run --release --quiet -- render -o parhelion.png

test: setup
	cargo test --features compile,denoise

check: setup
	cargo fmt --all --check
	cargo clippy --workspace --all-targets -- -D warnings
	cargo clippy --workspace --all-targets --features compile,denoise -- -D warnings
	RUSTDOCFLAGS='-D warnings' cargo doc --workspace --no-deps --features compile,denoise

setup:
	@./setup.sh
