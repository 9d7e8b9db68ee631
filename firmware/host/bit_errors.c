/* All errors of one, two and three bits in sample lines: each must be refused, and must change nothing but counters.
 *
 * Exits with 1 at the first error that changes the motion, the e-stop or the mode, or restarts the board.
 */
#include <stdio.h>
#include <string.h>

#include "checks.h"
#include "fake_hal.h"
#include "motors.h"

#define BITS_A_BYTE 8U

static const char *const samples[] = {"s 120 -80",    "s -255 255", "s 0 0",  "s 1 -1",      "w 3000 -2999", "r",
                                      "hello 1 2000", "arm 1",      "estop", "g 6 4095", "s 20 201"};

static uint64_t tried;

/* Whether the board is as it was before the error; the line end after it ends whatever was begun. */
static int is_unchanged(const char *line, uint32_t length, const struct motors_state *before)
{
    uint8_t ignored[256];
    take_line(line, length);
    take_line("\r", 1);
    firmware_pass();
    (void)host_drain(ignored, sizeof(ignored));
    tried++;
    const struct motors_state after = motors_state();
    const int is_same = (memcmp(after.duty, before->duty, sizeof(after.duty)) == 0) && (after.of == before->of) &&
                        (after.mode == before->mode) && (after.stops == before->stops) && (after.estop == before->estop);
    return is_same && (fake.restarts == 0U);
}

static void flip(char *line, uint32_t bit)
{
    line[bit / BITS_A_BYTE] = (char)((uint8_t)line[bit / BITS_A_BYTE] ^ (uint8_t)(1U << (bit % BITS_A_BYTE)));
}

/* All errors of exactly so many more bits from this bit on. */
static int try_errors(char *line, uint32_t length, uint32_t from, uint32_t bits, const struct motors_state *before)
{
    if (bits == 0U) {
        char copy[MOST_LINE];
        memcpy(copy, line, length);
        if (!is_unchanged(copy, length, before)) {
            printf("obeyed with an error: %.*s\n", (int)length - 1, copy);
            return 0;
        }
        return 1;
    }
    for (uint32_t bit = from; bit < (length * BITS_A_BYTE); bit++) {
        flip(line, bit);
        if (!try_errors(line, length, bit + 1U, bits - 1U, before)) {
            return 0;
        }
        flip(line, bit);
    }
    return 1;
}

int main(void)
{
    for (uint32_t sample = 0; sample < (sizeof(samples) / sizeof(samples[0])); sample++) {
        char line[MOST_LINE];
        begin_checked(2000);
        take_line(line, seal_line(line, "s 77 -78", 1));
        const struct motors_state before = motors_state();
        const uint32_t length = seal_line(line, samples[sample], (uint8_t)(200U + sample));
        for (uint32_t bits = 1; bits <= 3U; bits++) {
            if (!try_errors(line, length, 0, bits, &before)) {
                return 1;
            }
        }
    }
    printf("errors of 1, 2 and 3 bits: %llu, obeyed: 0\n", (unsigned long long)tried);
    return 0;
}
