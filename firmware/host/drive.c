#include "encoder.h"
#include "fake_hal.h"

#define PASS_US 100U
#define TICK_US 1000U

void host_encoder(uint8_t wheel, uint8_t levels)
{
    fake.levels[wheel] = levels;
    encoder_edge(wheel, levels);
}

void host_turn(uint8_t wheel, int16_t counts)
{
    encoders[wheel].count = (uint16_t)(encoders[wheel].count + (uint16_t)counts);
}

void host_receive(const uint8_t *bytes, uint32_t length)
{
    for (uint32_t index = 0; index < length; index++) {
        firmware_received(bytes[index]);
    }
}

uint32_t host_drain(uint8_t *bytes, uint32_t most)
{
    uint32_t length = 0;
    while ((length < most) && firmware_next_byte(&bytes[length])) {
        length++;
    }
    return length;
}

void host_run(uint32_t micros)
{
    for (uint32_t passed = 0; passed < micros; passed += PASS_US) {
        fake.micros += PASS_US;
        fake.run_us += PASS_US;
        if ((fake.run_us % TICK_US) == 0U) {
            firmware_tick();
        }
        firmware_pass();
    }
}

uint32_t host_fake_size(void)
{
    return sizeof(fake);
}

/* The linker's, for a section that is named like an identifier. */
extern uint8_t __start_hal_kept[] __attribute__((visibility("hidden")));
extern uint8_t __stop_hal_kept[] __attribute__((visibility("hidden")));

uint32_t host_kept_bytes(void)
{
    // cppcheck-suppress comparePointers
    return (uint32_t)(__stop_hal_kept - __start_hal_kept);
}

void host_flip_kept(uint32_t bit)
{
    __start_hal_kept[bit / 8U] = (uint8_t)(__start_hal_kept[bit / 8U] ^ (1U << (bit % 8U)));
}
