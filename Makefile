# make demo    renders the paper's cup, and the same by the reference tracer: out/cup.png
# make figures the paper's figures and claims, measured here: out/figures/index.html
# make test    the whole suite, as CI runs it
# make setup   installs what building needs (libraries by apt-get; nothing if all is there)

.PHONY: demo figures test setup setup-tests
.DEFAULT_GOAL := demo

# Where rustup puts cargo, for shells that were not told.
export PATH := $(PATH):$(HOME)/.cargo/bin

VTRACE := target/release/vtrace

setup:
	@.ci/setup

setup-tests:
	@.ci/setup --tests

demo: setup
	cargo build --release --locked
	@mkdir -p out
	$(VTRACE) render assets/cup.glb -o out/cup.png
	$(VTRACE) reference assets/cup.glb -o out/cup_reference.png
	$(VTRACE) compare out/cup_reference.png out/cup.png

figures: setup
	cargo run --release --locked --example figures -- out/figures

# On Mesa's software driver, whose images the tests know, unless DRIVER says otherwise; with core and
# synchronization validation, whose errors fail a test.
DRIVER ?= *lvp_icd*

test: export VTRACE_VALIDATION := 1
test: export VK_LOADER_DRIVERS_SELECT := $(DRIVER)
test: setup-tests
	cargo fmt --all --check
	cargo clippy --all-targets --locked -- -D warnings
	cargo test --locked
	RUSTDOCFLAGS='-D warnings' cargo doc --locked --no-deps
