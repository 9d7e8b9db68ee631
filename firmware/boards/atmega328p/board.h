/* The ATmega328P of the Duemilanove for firmware/core (see hal.h), and what the parts of its hardware layer share. */
#ifndef BOARD_H
#define BOARD_H

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/pgmspace.h>

#define HAL_BOARD BOARD_ATMEGA328P
#define HAL_CAPABILITIES \
    (CAPABILITY_WHEEL_LOOP | CAPABILITY_ULTRASONIC | CAPABILITY_IMU | CAPABILITY_BATTERY)
#define HAL_KEPT __attribute__((section(".noinit")))
#define HAL_UNCLEARED HAL_KEPT
#define HAL_FLASH PROGMEM
#define HAL_READ_CHAR(p) ((char)pgm_read_byte(p))
#define HAL_READ_U32(p) pgm_read_dword(p)
#define HAL_READ_IMAGE(at) pgm_read_byte((uint16_t)(at))
#define HAL_IMAGE_OFFSET(p) ((uint16_t)(p))

#define HAL_MOST_EDGES_S 12500UL

#define HAL_MOST_IMAGE_BYTES 0x7800UL

typedef uint16_t hal_image_at_t;
typedef uint8_t hal_lock_t;

static inline hal_lock_t hal_lock(void)
{
    const uint8_t state = SREG;
    __asm__ volatile("cli" ::: "memory");
    return state;
}

static inline void hal_unlock(hal_lock_t state)
{
    __asm__ volatile("" ::: "memory");
    SREG = state;
}

/* Timer 2 counts 250 times 4 us a millisecond. */
#define TICK_US 1000U
#define COUNT_US 4U

extern volatile uint32_t clock_ms_us; /* the whole milliseconds since the start, in microseconds */

/* For encoder_edge in C, which this board does not use: edges.S has its own. */
static inline uint16_t hal_edge_micros(void)
{
    return (uint16_t)((uint16_t)clock_ms_us + (uint16_t)(TCNT2 * COUNT_US));
}

/* Each is set up with the interrupts shut. */
void clock_start(void);
/* Sleeps until the next millisecond begins; not at all if one has begun since the last call. */
void clock_await_tick(void);

void serial_start(void);
/* For a restart by software, in which the UART holds two bytes: what has come, and a wait for the line to be quiet. */
void serial_drain(void);
void serial_await_quiet(void);
void encoders_start(void);
void ultrasonic_start(void);
void battery_start(void);

#endif
