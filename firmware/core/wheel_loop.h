/* Speed control of each wheel at 1 kHz, in integers: feedforward, static friction, proportional and integral.
 *
 * The speed comes from the times of edges: counts between two edges over the time between them. So it is exact at few
 * edges a second, and without any it is at most what two edges by now would make it.
 *
 * A board without the capability has none of it: `w` and `g` are then refused.
 */
#ifndef WHEEL_LOOP_H
#define WHEEL_LOOP_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"

#define HAS_WHEEL_LOOP ((HAL_CAPABILITIES & CAPABILITY_WHEEL_LOOP) != 0)

#define MOST_SPEED_MRAD_S 50000

/* Parameters of `g` (docs/firmware_wire.md); the current limit is the sensors'. */
enum parameter {
    PARAMETER_COUNTS,
    PARAMETER_KP,
    PARAMETER_KI,
    PARAMETER_FEEDFORWARD,
    PARAMETER_STATIC,
    PARAMETER_ACCELERATION,
    PARAMETER_CURRENT,
    PARAMETER_BATTERY,
    PARAMETERS
};

/* Nothing is set up. */
void wheel_loop_start(void);

/* Whether the parameters before PARAMETER_ACCELERATION were all set. */
bool wheel_loop_is_set_up(void);

/* Sets a parameter whose range was checked. */
void wheel_loop_set(enum parameter parameter, uint32_t value);

/* The counts of a wheel's turn that were set; 0: none. */
uint16_t wheel_loop_counts(void);

/* The fastest that can be asked for: by its parameters no wheel has more than HAL_MOST_EDGES_S edges a second then. */
int32_t wheel_loop_most_mrad_s(void);

/* With the interrupts shut: the next wheel_loop_run begins at the speeds that the wheels have then. */
void wheel_loop_begin(void);

/* With the interrupts shut: the speeds to reach, at most MOST_SPEED_MRAD_S either way. */
void wheel_loop_aim(const int32_t mrad_s[WHEELS]);

/* Each millisecond, from the timer's interrupt, whether the loop is in force or not: notes edges. */
void wheel_loop_measure(void);

/* Each millisecond after that, while it is in force: the duty. Gives the wheels, a sum of bits (1 left, 2 right), that full
 * duty has not turned its way for 250 ms, or half of it for 500: a dead encoder, one with the wrong sign, a wheel that is held. */
uint8_t wheel_loop_run(int16_t duty[WHEELS]);

#endif
