/* What the portable firmware offers its board. docs/firmware_wire.md says what it does; hal.h what it needs. */
#ifndef FIRMWARE_H
#define FIRMWARE_H

#include <stdbool.h>
#include <stdint.h>

#define FIRMWARE_PROTO 1
#define FIRMWARE_MAJOR 0
#define FIRMWARE_MINOR 1

#define WHEELS 2 /* left, right */

#define BOARD_ATMEGA328P 1
#define BOARD_TM4C123 2
#define BOARD_LM3S6965 3
#define BOARD_HOST 4

#define CAPABILITY_WHEEL_LOOP 1
#define CAPABILITY_ULTRASONIC 2
#define CAPABILITY_IMU 4
#define CAPABILITY_BATTERY 8
#define CAPABILITY_CURRENT 16

/* Why the program starts. A board gives the first five; the firmware itself notes why it restarts by software. */
#define RESET_SOFTWARE 0 /* hal_restart, so see the note */
#define RESET_POWER_ON 1
#define RESET_PIN 2
#define RESET_BROWN_OUT 3
#define RESET_WATCHDOG 4
#define RESET_COMMAND 5
#define RESET_HUNG 6
#define RESET_DAMAGED 7 /* by software, and the note of its cause is damaged */

/* Starts with the motors off and the interrupts shut, and lets them in; starts the watchdog. */
void firmware_start(uint8_t reset_cause);

/* One pass of the main loop: takes what was received, runs a cycle when it is due. Never blocks. */
void firmware_pass(void);

/* The interrupt of the 1 kHz timer: dead-man, hung main loop, wheel loop. */
void firmware_tick(void);

/* The receive interrupt: one byte. */
void firmware_received(uint8_t byte);

/* A byte that comes in while the program restarts itself: no line, but an e-stop in it is obeyed after the start. */
void firmware_received_early(uint8_t byte);

/* The receive interrupt, when the UART lost a byte (overrun, framing): the line that it belongs to is refused. */
void firmware_receive_lost(void);

/* The transmit interrupt: the next byte to send; false when there is none. */
bool firmware_next_byte(uint8_t *byte);

/* The ultrasonic sensor's interrupt: its echo line rose or fell, at this hal_micros. */
void firmware_echo(bool rising, uint32_t micros);

/* The watchdog's interrupt: motors off, restart by software. */
void firmware_watchdog(void);

/* An encoder's interrupt is encoder_edge(wheel, levels), inline in encoder.h. */

#endif
