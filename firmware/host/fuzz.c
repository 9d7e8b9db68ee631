/* The core under sanitizers with libFuzzer: the input is what the interrupts, the clock and the line do.
 *
 * An input is operations of one byte, some with bytes behind. A duty beyond full scale, one in spite of a stop, or a lock
 * that is not given back ends the run.
 */
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "checks.h"
#include "fake_hal.h"
#include "motors.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

struct input {
    const uint8_t *bytes;
    size_t left;
};

static uint8_t next(struct input *input)
{
    if (input->left == 0U) {
        return 0;
    }
    input->left--;
    return *input->bytes++;
}

static void check(void)
{
    const struct motors_state state = motors_state();
    for (uint8_t wheel = 0; wheel < WHEELS; wheel++) {
        const int is_beyond = (fake.duty[wheel] > FULL_DUTY) || (fake.duty[wheel] < -FULL_DUTY);
        if (is_beyond || ((state.stops != 0U) && (fake.duty[wheel] != 0))) {
            abort();
        }
    }
    if ((fake.lock_errors != 0U) || (fake.depth != 0U)) {
        abort();
    }
}

static void measure(struct input *input)
{
    fake.battery = next(input);
    fake.is_new_battery = true;
    fake.current[0] = (uint16_t)(next(input) * 16U);
    fake.is_new_current[0] = true;
    fake.imu[0] = (int16_t)(next(input) * 257);
    fake.imu_us = fake.micros;
    fake.is_new_imu = true;
}

/* A sealed line: of bytes as they come, or of a word and numbers. */
static void write_sealed(struct input *input)
{
    static const char *const words[] = {"s", "w", "g", "hello 1", "hello", "arm", "r", "estop"};
    char body[MOST_LINE - 16U] = "";
    char line[MOST_LINE];
    const uint8_t kind = next(input);
    if (kind < 32U) {
        for (uint8_t index = 0; index < kind; index++) {
            body[index] = (char)next(input);
        }
    } else {
        int length = snprintf(body, sizeof(body), "%s", words[kind % 8U]);
        for (uint8_t numbers = (kind >> 3) % 3U; numbers > 0U; numbers--) {
            const int value = (next(input) - 128) * (((kind >> 6) == 3) ? 300 : 1 + (next(input) % 8));
            length += snprintf(&body[length], sizeof(body) - (size_t)length, " %d", value);
        }
    }
    host_receive((const uint8_t *)line, seal_line(line, body, next(input)));
}

static void run(struct input *input)
{
    static const uint8_t causes[] = {RESET_SOFTWARE, RESET_POWER_ON, RESET_PIN, RESET_WATCHDOG};
    uint8_t bytes[255];
    const uint8_t operation = next(input);
    if (operation >= 16U) { /* bytes of the line, and the line end where it is one */
        host_receive(&operation, 1);
        return;
    }
    switch (operation) {
    case 0:
        firmware_pass();
        break;
    case 1:
        host_run(100U * (next(input) % 24U));
        break;
    case 2:
        host_encoder(next(input) % WHEELS, next(input) % 4U);
        break;
    case 3:
        fake.micros += (uint32_t)next(input) * 16843009U;
        break;
    case 4:
        (void)host_drain(bytes, next(input));
        break;
    case 5:
        firmware_echo((next(input) % 2U) != 0U, fake.micros);
        break;
    case 6:
        measure(input);
        break;
    case 7:
        firmware_receive_lost();
        break;
    case 8:
        fake.tick_at_lock = fake.locks + 1U + (next(input) % 16U);
        fake.tick_micros = fake.micros + (100U * next(input));
        break;
    case 9:
        firmware_start(causes[next(input) % sizeof(causes)]);
        break;
    case 10:
        fake.micros += next(input);
        firmware_tick();
        break;
    case 11:
        write_sealed(input);
        firmware_pass();
        break;
    default: /* among them LF and CR */
        host_receive(&operation, 1);
        break;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct input input = {data, size};
    memset(&fake, 0, sizeof(fake));
    fake.has_imu = (next(&input) % 2U) != 0U;
    firmware_start(RESET_POWER_ON);
    while (input.left > 0U) {
        run(&input);
        check();
    }
    firmware_pass();
    check();
    return 0;
}
