# The Tiva-C LaunchPad's image, and that of QEMU's Stellaris board, from the same sources but for a folder each.

ARM_CC := arm-none-eabi-gcc
ARM_DIR := boards/cortex_m
ARM_FLAGS := -mthumb -Os -g $(filter-out -Wpedantic,$(WARNINGS)) -ffreestanding -fno-common -ffunction-sections -fdata-sections \
  -I$(ARM_DIR) -Icore
ARM_LINK := -nostartfiles --specs=nano.specs -Wl,--gc-sections -Wl,--no-warn-rwx-segments -T $(ARM_DIR)/memory.ld
ARM_SHARED := $(CORE) $(sort $(wildcard $(ARM_DIR)/*.c))

# $(1): the board, $(2): its processor
define ARM_BOARD
$(1)_SOURCES := $$(ARM_SHARED) $$(sort $$(wildcard boards/$(1)/*.c))
$(1)_OBJECTS := $$($(1)_SOURCES:%.c=$$(BUILD)/$(1)/%.o)
$(1)_FLAGS := -mcpu=$(2) $$(ARM_FLAGS) -Iboards/$(1)

$$(BUILD)/$(1)/%.o: %.c $$(CORE_HEADERS) $$(wildcard $$(ARM_DIR)/*.h boards/$(1)/*.h)
	@mkdir -p $$(@D)
	$$(ARM_CC) $$($(1)_FLAGS) -c -o $$@ $$<

$$(BUILD)/$(1).elf: $$($(1)_OBJECTS) $$(ARM_DIR)/memory.ld
	$$(ARM_CC) $$($(1)_FLAGS) $$(ARM_LINK) -o $$@ $$($(1)_OBJECTS)
	python3 seal_image.py arm-none-eabi-objcopy $$@
endef

$(eval $(call ARM_BOARD,lm3s6965,cortex-m3))
$(eval $(call ARM_BOARD,tm4c123,cortex-m4))

boards: $(BUILD)/lm3s6965.elf $(BUILD)/tm4c123.elf $(BUILD)/tm4c123.bin

# The program at address 0, as the flash has it.
$(BUILD)/tm4c123.bin: $(BUILD)/tm4c123.elf
	arm-none-eabi-objcopy -O binary $< $@

# With a main loop that hangs when the serial line says so: for tests, no robot gets it.
emulators: $(BUILD)/lm3s6965_hangs.elf

$(BUILD)/lm3s6965_hangs.elf: $(lm3s6965_SOURCES) $(CORE_HEADERS) $(wildcard $(ARM_DIR)/*.h boards/lm3s6965/*.h)
	@mkdir -p $(@D)
	$(ARM_CC) $(lm3s6965_FLAGS) $(ARM_LINK) -DHANGS -o $@ $(lm3s6965_SOURCES)
	python3 seal_image.py arm-none-eabi-objcopy $@

# Every board's sources and the emulators', by the checker that the core's go through.
.PHONY: lint-boards
check: lint-boards
lint-boards:  ## Check the boards' and emulators' C sources
	$(CPPCHECK) -Icore -Iboards/atmega328p boards/atmega328p
	$(CPPCHECK) -Icore -I$(ARM_DIR) -Iboards/lm3s6965 $(ARM_DIR) boards/lm3s6965
	$(CPPCHECK) -Icore -I$(ARM_DIR) -Iboards/tm4c123 boards/tm4c123
	$(CPPCHECK) -Iemulators emulators
