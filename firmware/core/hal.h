/* What a board must provide: its hardware, and nothing of what the firmware decides.
 *
 * A board's folder has a `board.h`, found by the include path, which defines before anything else is compiled:
 *
 *   HAL_BOARD            one of enum board (firmware.h)
 *   HAL_CAPABILITIES     sum of enum capability (firmware.h), a constant expression of the preprocessor
 *   HAL_KEPT             attribute of a variable that no start of the program clears (`.noinit`): the e-stop
 *   HAL_UNCLEARED        attribute of a large variable that need not be cleared by a start, to make it short
 *   HAL_FLASH            attribute of a constant that lives in program memory (AVR: PROGMEM; elsewhere empty)
 *   HAL_READ_CHAR(p)     reads a char of such a constant (AVR: (char)pgm_read_byte(p); elsewhere *(p))
 *   HAL_READ_U32(p)      reads a uint32_t of such a constant
 *   HAL_READ_IMAGE(at)   reads a byte of the program's image, from its first on
 *   HAL_IMAGE_OFFSET(p)  where in the image a constant of HAL_FLASH is
 *   hal_image_at_t       type of a place in the image; HAL_MOST_IMAGE_BYTES is the end of what it may fill
 *   hal_lock_t           type of the interrupts' state
 *   hal_lock(void)       static inline: shuts all interrupts out, returns the state before. A barrier for the compiler.
 *   hal_unlock(state)    static inline: puts that state back. Pairs may be nested, also in interrupts. A barrier, too.
 *   HAL_MOST_EDGES_S     edges a second of one wheel that the board counts without a loss, both wheels at once
 *   hal_edge_micros()    static inline, with the wheel loop: low 16 bits of hal_micros(), for encoder_edge's time
 *
 * The board's own program, in this order:
 *   1. its very first instructions turn the motors off;
 *   2. it sets up clocks, UART, timers, PWM, encoder pins, with the interrupts shut;
 *   3. image_check(cause), firmware_start(cause), which lets the interrupts in;
 *   4. for (;;) firmware_pass().
 *
 * Interrupts: firmware_tick may be interrupted by encoder_edge, firmware_received, firmware_next_byte and firmware_echo
 * (on the AVR it must be: it is longer than two edges are apart), never by itself. These do not interrupt each other, and
 * encoder_edge may also come after the tick, where a board keeps its edges until then.
 */
#ifndef HAL_H
#define HAL_H

#include <stdbool.h>
#include <stdint.h>

#include "firmware.h"

#include "board.h"

/* Microseconds since the start; wraps at 2^32. Callable from everywhere, also in interrupts and before firmware_start. */
uint32_t hal_micros(void);

/* Puts a duty from -255 to 255 on each motor; 0 brakes. Called with interrupts shut or from firmware_tick. */
void hal_motors_write(const int16_t duty[WHEELS]);

/* Motors off, whatever else is set up: safe as the first instruction of the program and in every interrupt. */
void hal_motors_off(void);

/* Levels of a wheel's encoder now: A in bit 1, B in bit 0. */
uint8_t hal_encoder_levels(uint8_t wheel);

/* Each tick: every channel of the encoders may have as many edges again as two wheels of HAL_MOST_EDGES_S can make in two
 * milliseconds. The interrupt of one that had more shuts itself, so that the tick runs whatever a loose wire does. Gives the
 * wheels, a sum of bits (1 left, 2 right), that have a shut channel now. */
uint8_t hal_encoders_tick(void);

/* Opens all channels again, with the levels as the pins are. From the tick. */
void hal_encoders_open(void);

/* The transmit ring has bytes: enables the interrupt that fetches them with firmware_next_byte. Shuts no interrupts. */
void hal_start_sending(void);

/* Sends the sensor its pulse of 10 us; the echo comes by firmware_echo. Without the capability: does nothing. */
void hal_ultrasonic_trigger(void);

/* Whether the IMU answers: asked once, at the start. Frees its bus, and wakes it. May wait 5 ms at most. */
bool hal_imu_present(void);

/* These never block. True with a reading that was not fetched before.
 * hal_battery, hal_current: 0 to 4095, whatever the width of the ADC (10 bits: times 4).
 * hal_imu: ax ay az gx gy gz in raw counts, and the hal_micros of the reading. One that answers again is woken first, and one
 * that has nothing but zeros sleeps: that is no reading. */
bool hal_battery(uint16_t *adc);
bool hal_current(uint8_t wheel, uint16_t *adc);
bool hal_imu(int16_t counts[6], uint32_t *at_us);

/* The end of what has to be set up undisturbed: interrupts come from now on. */
void hal_let_interrupts_in(void);

/* For an image that is not whole: motors off, interrupts shut, and this text (HAL_FLASH) about once a second. Does not return
 * on a board. Needs the serial line and nothing else. */
void hal_say_for_ever(const char *text);

/* The hardware watchdog, about 250 ms: its interrupt, if it has one, calls firmware_watchdog. */
void hal_watchdog_start(void);
void hal_watchdog_feed(void);

/* Starts the program from its beginning by software (on the AVR not by a watchdog: the boot loader would loop for ever);
 * the board's next firmware_start gets RESET_SOFTWARE. Callable from interrupts; does not return on a board. */
void hal_restart(void);

#endif
