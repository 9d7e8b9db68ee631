/* A noisy line: one byte in a hundred has one bit flipped. `flips LINES SEED` sends so many sealed lines, a line each 10 ms.
 *
 * After each line, the duty on the motors must be what it was, or what this line asks for if none of its bytes was
 * changed, or 0 by the dead-man. Anything else is a wrong motion, also a duty that was in force before. Duties and
 * speeds are new with each line, so none can be right by chance. Exits with 1 at a wrong motion or a restart.
 *
 * `flips LINES SEED plain` sends the same duties in the classic mode, without seals: what noise does there, and that it is seen.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "checks.h"
#include "fake_hal.h"
#include "motors.h"

#define NOISE_PER_BYTE 100U
#define DEADMAN_US 250000U
#define LINE_US 10000U
#define MOST_LINES_OF_ONE 6U
#define MOST_PRINTED 5U

struct tally {
    uint64_t lines;
    uint64_t motions; /* lines that ask for one */
    uint64_t obeyed;
    uint64_t wrong;
    uint64_t resets;
    uint64_t stops; /* by the dead-man */
    uint64_t noise_stops; /* a changed line that was read as a stop: not wrong, but worth to know */
};

struct line {
    char text[MOST_LINE];
    uint32_t length;
    int16_t duty[WHEELS]; /* that it asks for */
    int is_motion;
    int is_intact;
};

static uint64_t luck;
static int is_plain;
static uint64_t until_flip; /* bytes */

static uint64_t next_flip(void)
{
    uint64_t bytes = 0;
    while (dice_below(&luck, NOISE_PER_BYTE) != 0U) {
        bytes++;
    }
    return bytes;
}

static void add_noise(struct line *line)
{
    line->is_intact = 1;
    for (uint32_t index = 0; index < line->length; index++) {
        if (until_flip > 0U) {
            until_flip--;
            continue;
        }
        line->text[index] = (char)((uint8_t)line->text[index] ^ (uint8_t)(1U << dice_below(&luck, 8)));
        line->is_intact = 0;
        until_flip = next_flip();
    }
}

/* 20 * mrad/s / 256, rounded: what the wheel loop's feedforward of 20000 alone makes of a speed. */
static int16_t duty_of_speed(int32_t mrad_s)
{
    const int32_t drive = (20480 * mrad_s) / 1024;
    return (int16_t)((drive + ((drive < 0) ? -128 : 128)) / 256);
}

static int32_t asked(int32_t most)
{
    return (int32_t)dice_below(&luck, (uint32_t)(2 * most) + 1U) - most;
}

/* Of 1000 lines: 880 s, 100 w, and the others. */
static void make_line(struct line *line, uint8_t sequence)
{
    char body[MOST_LINE];
    const uint32_t kind = is_plain ? 0U : dice_below(&luck, 1000);
    line->is_motion = kind < 980U;
    if (kind < 880U) {
        line->duty[0] = (int16_t)asked(255);
        line->duty[1] = (int16_t)asked(255);
        (void)snprintf(body, sizeof(body), "s %d %d", line->duty[0], line->duty[1]);
    } else if (kind < 980U) {
        const int32_t left = asked(3200);
        const int32_t right = asked(3200);
        line->duty[0] = duty_of_speed(left);
        line->duty[1] = duty_of_speed(right);
        (void)snprintf(body, sizeof(body), "w %d %d", (int)left, (int)right);
    } else {
        static const char *const others[] = {"hello 1 250", "g 3 20000", "g 6 0", "arm 0"};
        (void)snprintf(body, sizeof(body), "%s", others[kind % 4U]);
    }
    line->length = is_plain ? (uint32_t)snprintf(line->text, MOST_LINE, "%s\r", body)
                            : seal_line(line->text, body, sequence);
}

static int is_duty(const int16_t duty[WHEELS])
{
    return (fake.duty[0] == duty[0]) && (fake.duty[1] == duty[1]);
}

static void judge(const struct line *line, const int16_t before[WHEELS], int was_dead, struct tally *tally)
{
    static const int16_t zeros[WHEELS] = {0, 0};
    const struct motors_state now = motors_state();
    const int is_dead = (now.stops & STOP_DEADMAN) != 0U;
    tally->lines++;
    tally->motions += (line->is_motion != 0) ? 1U : 0U;
    tally->stops += (is_dead && !was_dead) ? 1U : 0U;
    if (line->is_motion && line->is_intact && is_duty(line->duty) && !is_dead) {
        tally->obeyed++;
    } else if (is_dead) {
        tally->wrong += is_duty(zeros) ? 0U : 1U;
    } else if (is_duty(before)) {
        /* As it was. */
    } else if (is_duty(zeros)) {
        tally->noise_stops++;
    } else {
        tally->wrong++;
        if (tally->wrong <= MOST_PRINTED) {
            fprintf(stderr, "wrong motion: %.*s made %d %d of %d %d\n", (int)line->length - 1, line->text,
                    fake.duty[0], fake.duty[1], before[0], before[1]);
        }
    }
}

/* The time of a line: the main loop's passes, more than noise can make lines of one, and ticks of the timer. */
static void pass_time(void)
{
    uint8_t ignored[256];
    for (uint32_t pass = 0; pass < MOST_LINES_OF_ONE; pass++) {
        firmware_pass();
    }
    for (uint32_t millisecond = 0; millisecond < (LINE_US / 1000U); millisecond++) {
        fake.micros += 1000U;
        firmware_tick();
    }
    firmware_pass();
    (void)host_drain(ignored, sizeof(ignored));
}

/* The board just powered on: in the checked mode with a wheel loop, unless the lines are plain. */
static void set_up(void)
{
    if (is_plain) {
        memset(&fake, 0, sizeof(fake));
        firmware_start(RESET_POWER_ON);
        return;
    }
    static const char *const bodies[] = {"g 0 1000", "g 1 0", "g 2 0", "g 3 20000", "g 4 0"};
    char line[MOST_LINE];
    begin_checked(DEADMAN_US / 1000U);
    for (uint8_t index = 0; index < (sizeof(bodies) / sizeof(bodies[0])); index++) {
        take_line(line, seal_line(line, bodies[index], (uint8_t)(index + 1U)));
    }
}

int main(int count, char **arguments)
{
    struct tally tally = {0};
    const uint64_t lines = (count > 1) ? strtoull(arguments[1], NULL, 10) : 1000000U;
    luck = (count > 2) ? strtoull(arguments[2], NULL, 10) : 1U;
    is_plain = count > 3;
    set_up();
    until_flip = next_flip();
    for (uint64_t number = 0; number < lines; number++) {
        struct line line;
        int16_t before[WHEELS];
        const int was_dead = (motors_state().stops & STOP_DEADMAN) != 0U;
        memcpy(before, fake.duty, sizeof(before));
        make_line(&line, (uint8_t)(number + 6U));
        add_noise(&line);
        take_line(line.text, line.length);
        pass_time();
        judge(&line, before, was_dead, &tally);
        if (fake.restarts != 0U) {
            tally.resets++;
            set_up();
        }
    }
    printf("{\"lines\": %llu, \"wrong_motions\": %llu, \"resets\": %llu, \"obeyed\": %.4f, \"dead_man_stops\": %llu, "
           "\"stops_by_noise\": %llu}\n",
           (unsigned long long)tally.lines, (unsigned long long)tally.wrong, (unsigned long long)tally.resets,
           (double)tally.obeyed / (double)tally.motions, (unsigned long long)tally.stops,
           (unsigned long long)tally.noise_stops);
    return ((tally.wrong != 0U) || (tally.resets != 0U)) ? 1 : 0;
}
