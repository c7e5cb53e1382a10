# make demo    renders the paper's cup, and the same by the reference tracer: out/cup.png
# make figures the paper's figures and claims, measured here: out/figures/index.html
# make bench   error against run time on demo scenes, in minutes: out/bench/cup/index.html and others
# make samples samples against error, measured here: out/samples.md; SCENES='a.glb b.glb' adds files
# make test    the whole suite; CI runs it, then the promises
# make promises  what `vtrace profile --check` promises of visibility, and the memory of a million triangles, in the
#              profile that users run; ROOM=2 allows twice the time, for machines that have other work to do
# make test-models DIR=folder   renders a folder of models, release and debug, and holds them against its
#              manifest.json, 3 GB and, what is broken, 10 seconds each
# make setup   installs what building needs (libraries by apt-get; nothing if all is there)

.PHONY: demo figures bench samples test promises test-models setup setup-tests
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

# Small pictures, so that two cores with a software device are done in under ten minutes.
BENCH_SCENES := cup cup-and-glass sphere
BENCH := --size 320x256 --repeats 3

bench: setup
	cargo build --release --locked --bins --example demo_assets
	target/release/examples/demo_assets out/bench $(BENCH_SCENES)
	$(foreach scene,$(BENCH_SCENES),$(VTRACE) bench out/bench/$(scene).glb --out out/bench/$(scene) $(BENCH) \
		$(if $(filter cup,$(scene)),--scaling) &&) true

samples: setup
	@mkdir -p out
	cargo run --release --locked --example samples -- out/samples.md $(SCENES)

# On Mesa's software driver, whose images the tests know, unless DRIVER says otherwise; with core and
# synchronization validation, whose errors fail a test.
DRIVER ?= *lvp_icd*

test: export VTRACE_VALIDATION := 1
test: export VK_LOADER_DRIVERS_SELECT := $(DRIVER)
test: setup-tests
	cargo fmt --all --check
	cargo clippy --all-targets --locked --features view -- -D warnings
	cargo clippy --all-targets --locked --no-default-features -- -D warnings
	cargo test --locked --features view
	RUSTDOCFLAGS='-D warnings' cargo doc --locked --no-deps --features view

# Other work on the machine only ever adds to a time, so that one try of some is enough.
ROOM ?= 1
promises: export VK_LOADER_DRIVERS_SELECT := $(DRIVER)
promises: setup
	cargo build --release --locked --bins --example check_memory
	for try in 1 2 3 4 5; do target/release/examples/check_memory && break; test $$try -lt 5 || exit 1; done
	for try in 1 2 3 4 5 6 7 8 9 10; do $(VTRACE) profile assets/cup.glb --quick --check=$(ROOM) && exit 0; done; exit 1

test-models: setup
	@test -n "$(DIR)" || { echo 'error: name the folder: make test-models DIR=folder' >&2; exit 1; }
	@test -d "$(DIR)" || { echo 'error: $(DIR): no such folder' >&2; exit 1; }
	cargo build --release --locked --bins --example check_models
	target/release/examples/check_models "$(DIR)"
	cargo build --locked --bins --example check_models
	target/debug/examples/check_models "$(DIR)"
