/* What the parts of these boards' hardware layers share; a board's board.h includes it. */
#ifndef CORTEX_M_H
#define CORTEX_M_H

#include <stdint.h>

#define HAL_KEPT __attribute__((section(".noinit")))
#define HAL_UNCLEARED HAL_KEPT
#define HAL_FLASH
#define HAL_READ_CHAR(p) (*(p))
#define HAL_READ_U32(p) (*(p))
#define HAL_READ_IMAGE(at) (*(const volatile uint8_t *)(at))
#define HAL_IMAGE_OFFSET(p) ((uint32_t)(p))

#define HAL_MOST_EDGES_S 50000U

#define HAL_MOST_IMAGE_BYTES 0x40000UL

typedef uint32_t hal_image_at_t;
typedef uint32_t hal_lock_t;

static inline hal_lock_t hal_lock(void)
{
    uint32_t state;
    __asm__ volatile("mrs %0, primask\n\tcpsid i" : "=r"(state)::"memory");
    return state;
}

static inline void hal_unlock(hal_lock_t state)
{
    __asm__ volatile("msr primask, %0" ::"r"(state) : "memory");
}

#define CLOCK_MHZ 50U

uint32_t hal_micros(void);

static inline uint16_t hal_edge_micros(void)
{
    return (uint16_t)hal_micros();
}

/* The serial line and the echo interrupt the tick, and the tick the encoders: a storm of their edges cannot keep it off. */
#define PRIORITY_EDGES 0x20U
#define PRIORITY_ENCODERS 0x60U
#define PRIORITY_TICK 0x40U
#define PRIORITY_WATCHDOG 0x00U

void interrupt_enable(uint32_t irq, uint8_t priority);
void interrupt_disable(uint32_t irq);

/* Of the board: the clock of every part that is used, and 50 MHz; what its pins are for. Before RAM is set up. */
void system_start(void);
void pins_start(void);
void sensors_of_board_start(void);

/* Shared, with the interrupts shut. */
void clock_start(void);
void serial_start(void);
void encoders_start(void);

/* Handlers that a board may have. */
void on_gpio_a(void);
void on_i2c3(void);

#endif
