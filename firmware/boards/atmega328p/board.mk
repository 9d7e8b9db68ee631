# The image of the Duemilanove.

AVR_CC := avr-gcc
AVR_DIR := boards/atmega328p
# Found by trying: 12 KB instead of 13.
AVR_SMALLER := -fno-gcse -fno-tree-loop-im -fno-tree-dominator-opts -fno-inline-small-functions -fno-jump-tables -mstrict-X
AVR_FLAGS := -mmcu=atmega328p -DF_CPU=16000000UL -Os -g $(filter-out -Wpedantic,$(WARNINGS)) -fno-common \
  -ffunction-sections -fdata-sections -fshort-enums -mcall-prologues -flto $(AVR_SMALLER) -I$(AVR_DIR) -Icore
AVR_LINK = $(AVR_FLAGS) -Wl,--gc-sections -Wl,--relax
AVR_SOURCES := $(CORE) $(sort $(wildcard $(AVR_DIR)/*.c $(AVR_DIR)/*.S))
AVR_OBJECTS := $(patsubst %,$(BUILD)/atmega328p/%.o,$(basename $(AVR_SOURCES)))

boards: $(BUILD)/atmega328p.elf $(BUILD)/atmega328p.hex

# The same with a main loop that hangs when an emulator says so: for tests, no robot gets it.
emulators: $(BUILD)/atmega328p_hangs.elf

$(BUILD)/atmega328p/%.o: %.c $(CORE_HEADERS) $(AVR_DIR)/board.mk Makefile $(wildcard $(AVR_DIR)/*.h)
	@mkdir -p $(@D)
	$(AVR_CC) $(AVR_FLAGS) -c -o $@ $<

$(BUILD)/atmega328p/%.o: %.S $(AVR_DIR)/board.mk Makefile $(wildcard $(AVR_DIR)/*.h)
	@mkdir -p $(@D)
	$(AVR_CC) $(AVR_FLAGS) -c -o $@ $<

# A thousand times a second: -Os would call a division for each shift.
$(BUILD)/atmega328p/core/wheel_loop.o: AVR_FLAGS += -O2 -fno-inline
# Over the whole image at each start.
$(BUILD)/atmega328p/core/image.o: AVR_FLAGS += -O2

$(BUILD)/atmega328p.elf: $(AVR_OBJECTS) | seal_image.py
	$(AVR_CC) $(AVR_LINK) -o $@ $^
	python3 seal_image.py avr-objcopy $@ .text .data

$(BUILD)/atmega328p/startup_hangs.o: $(AVR_DIR)/startup.c $(CORE_HEADERS) $(wildcard $(AVR_DIR)/*.h)
	@mkdir -p $(@D)
	$(AVR_CC) $(AVR_FLAGS) -DHANGS -c -o $@ $<

$(BUILD)/atmega328p_hangs.elf: $(filter-out %/startup.o,$(AVR_OBJECTS)) $(BUILD)/atmega328p/startup_hangs.o
	$(AVR_CC) $(AVR_LINK) -o $@ $^
	python3 seal_image.py avr-objcopy $@ .text .data

# Nothing but what is in the sources goes into it: two builds are the same bytes.
$(BUILD)/atmega328p.hex: $(BUILD)/atmega328p.elf
	avr-objcopy -O ihex -j .text -j .data $< $@
