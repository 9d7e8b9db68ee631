/* The one place that says what the motors do: the duty in force, and what stops it.
 *
 * Main loop and timer interrupt share it; each change happens under a lock. Every stop leaves a duty of 0 behind and ends the
 * wheel loop, so what was asked for before it cannot come back.
 */
#ifndef MOTORS_H
#define MOTORS_H

#include <stdbool.h>
#include <stdint.h>

#include "firmware.h"

#define FULL_DUTY 255

#define MODE_DUTY 1U
#define MODE_WHEEL_LOOP 2U

#define STOP_DEADMAN 1U
#define STOP_ESTOP 2U
#define STOP_STALL 4U
#define STOP_LOST 8U   /* of the left wheel: its duty does not turn it its way; times 2 of the right one */
#define STOP_STORM 32U /* of the left encoder: more edges than a wheel can make; times 2 of the right one */
#define STOPS_OF_WHEELS ((STOP_LOST * 3U) | (STOP_STORM * 3U))

#define NO_SEQUENCE 255U

struct motors_state {
    int16_t duty[WHEELS]; /* in force */
    uint8_t mode;
    uint8_t stops;  /* in force, a sum */
    uint8_t of;     /* sequence number of the last obeyed s or w; NO_SEQUENCE before it */
    uint16_t estop; /* number of the newest e-stop, 0 before the first */
};

/* When a command came in, and its sequence number; commands without one keep the last. */
struct received {
    uint32_t at_us;
    bool has_sequence;
    uint8_t sequence;
};

/* What became of a command. */
enum motion { MOTION_OBEYED, MOTION_STOPPED, MOTION_STALE };

/* All off; the e-stop as it was left, unless the cause is the power. Where the note of it is damaged, stopped by e-stop 1.
 * Returns the cause, with the note of a software restart. */
uint8_t motors_start(uint8_t reset_cause);

/* Duty for each wheel, limited to FULL_DUTY. 0 for all ends a stall and what a wheel has stopped, and is obeyed whatever is in force. */
enum motion motors_duty(const int32_t duty[WHEELS], struct received received);

/* Speeds for the wheel loop, in mrad/s. */
enum motion motors_speed(const int32_t mrad_s[WHEELS], struct received received);

/* Latches, with the next number; also over a restart. */
void motors_estop(void);

/* Latches for each e-stop that was heard since the last call, of so many since the start. */
void motors_hear(uint8_t heard);

/* Ends e-stop, stall and what a wheel has stopped. False, and nothing else, if it is not the newest e-stop's number. */
bool motors_arm(int32_t number);

/* A motor has drawn too much current for too long. */
void motors_stall(void);

/* The wheels whose encoder is shut out now, for its edges: a sum of bits. They stop the motors. From the timer's interrupt. */
void motors_shut(uint8_t wheels);

/* Sets the dead-man. Where there was none, it counts from now_us, and no s or w has been obeyed yet. */
void motors_begin_deadman(uint32_t deadman_us, uint32_t now_us);

/* No dead-man any more: stops as if it had come. */
void motors_end_deadman(void);

/* The state now, as one. */
struct motors_state motors_state(void);

/* Each millisecond, from the timer's interrupt. */
void motors_tick(uint32_t now_us);

/* Motors off and a restart by software, noting its cause. Callable from interrupts. Returns on the host build only. */
void motors_off_and_restart(uint8_t cause);

#endif
