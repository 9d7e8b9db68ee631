# simavr's own macros mix signs, so its shim is built without those two warnings.
# What Python drives the images with: the ATmega328P in simavr, wired as on the robot.

emulators: $(BUILD)/libsimavr_board.so

$(BUILD)/libsimavr_board.so: $(wildcard emulators/*.c emulators/*.h)
	@mkdir -p $(@D)
	$(CC) $(filter-out -Wconversion -Wsign-conversion,$(WARNINGS)) -O2 -shared -fPIC -o $@ $(wildcard emulators/*.c) -lsimavr -lm
