/* The LM3S6965 as QEMU's machine lm3s6965evb has it: for tests, no robot has this board. */
#ifndef BOARD_H
#define BOARD_H

#include "cortex_m.h"

#define HAL_BOARD BOARD_LM3S6965
#define HAL_CAPABILITIES CAPABILITY_WHEEL_LOOP

#define HAL_OBSERVED /* the serial line notes when it receives */

/*
 * What the motor drivers would get. QEMU has no PWM and its pins cannot be read, so this stands for them: written last in
 * hal_motors_write and hal_motors_off, and read by the tests through the emulator.
 */
struct observed {
    int16_t duty[2];
    uint32_t began_us; /* hal_micros when they last left a standstill, */
    uint32_t ended_us; /* and when they came to one, */
    uint32_t heard_us; /* and when the last byte came in */
};

extern volatile struct observed observed;

#endif
