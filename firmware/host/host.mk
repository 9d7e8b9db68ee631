# The core for this computer: a library that Python drives, and the proofs.

HOST := host/fake_hal.c host/drive.c host/simulated.c
HOST_HEADERS := $(CORE_HEADERS) $(wildcard host/*.h)
HOST_FLAGS := -O2 -g $(WARNINGS) -Ihost -Icore
SANITIZE := -fsanitize=address,undefined -fno-sanitize-recover=all
CLANG ?= clang
PROOFS := $(BUILD)/flips $(BUILD)/bit_errors

.PHONY: proofs full-proofs fuzzer lint

FLIPS := 100000000
FUZZ_RUNS := 10000000

check: lint  ## Whatever checks the C sources; boards add to it

host: $(BUILD)/libfirmware_host.so  ## The core for this computer
proofs: $(PROOFS)  ## Noise and bit errors against the core
fuzzer: $(BUILD)/fuzz  ## The core under sanitizers, driven by libFuzzer

# A quarter of an hour, on an idle computer.
full-proofs: proofs fuzzer  ## All lines with noise (FLIPS=...), all bit errors, all runs of the fuzzer (FUZZ_RUNS=...)
	$(BUILD)/bit_errors
	$(BUILD)/flips $(FLIPS) 2
	@mkdir -p $(BUILD)/corpus
	$(BUILD)/fuzz -max_len=160 -runs=$(FUZZ_RUNS) -verbosity=0 -artifact_prefix=$(BUILD)/ $(BUILD)/corpus

$(BUILD)/libfirmware_host.so: $(CORE) $(HOST) $(HOST_HEADERS)
	@mkdir -p $(@D)
	$(CC) $(HOST_FLAGS) -shared -fPIC -o $@ $(CORE) $(HOST)

$(PROOFS): $(BUILD)/%: host/%.c host/checks.c $(CORE) $(HOST) $(HOST_HEADERS)
	@mkdir -p $(@D)
	$(CC) $(HOST_FLAGS) -O3 -flto -o $@ $< host/checks.c $(CORE) $(HOST)

$(BUILD)/fuzz: host/fuzz.c host/checks.c $(CORE) $(HOST) $(HOST_HEADERS)
	@mkdir -p $(@D)
	$(CLANG) $(HOST_FLAGS) $(SANITIZE) -fsanitize=fuzzer -o $@ $< host/checks.c $(CORE) $(HOST)

CPPCHECK := cppcheck --quiet --std=c11 --error-exitcode=1 --inline-suppr --enable=warning,style,performance,portability

# Rules of MISRA C:2012 that the core knowingly does not keep: README.md has the reasons.
MISRA_DEVIATIONS := 2.5 5.7 5.9 8.7 8.9 9.2 9.3 9.4 10.1 10.4 10.7 10.8 11.4 11.5 15.4 15.5
MISRA := --addon=misra $(addprefix --suppress=misra-c2012-,$(MISRA_DEVIATIONS))

# Both compilers with all warnings as errors, and cppcheck.
lint:  ## Check the C sources
	$(CC) $(HOST_FLAGS) -fsyntax-only $(CORE) $(wildcard host/*.c)
	$(CLANG) $(HOST_FLAGS) -fsyntax-only $(CORE) $(wildcard host/*.c)
	$(CPPCHECK) -Ihost -Icore core host
	$(CPPCHECK) $(MISRA) -Ihost -Icore core
