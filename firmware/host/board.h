/* The host build: a board whose hardware is variables (fake_hal.c) and whose time is told, not measured. */
#ifndef BOARD_H
#define BOARD_H

#include <stdint.h>

#define HAL_BOARD BOARD_HOST
#ifndef HAL_CAPABILITIES /* the simulator gives those of the real boards */
#define HAL_CAPABILITIES                                                                                  \
    (CAPABILITY_WHEEL_LOOP + CAPABILITY_ULTRASONIC + CAPABILITY_IMU + CAPABILITY_BATTERY +                \
     CAPABILITY_CURRENT)
#endif
#define HAL_KEPT __attribute__((section("hal_kept"))) /* together, so that a test can damage it */
#define HAL_UNCLEARED
#define HAL_FLASH
#define HAL_READ_CHAR(p) (*(p))
#define HAL_READ_U32(p) (*(p))
#define HAL_READ_IMAGE(at) ((uint8_t)(at)) /* there is none */
#define HAL_IMAGE_OFFSET(p) ((uint32_t)(uintptr_t)(p))

#define HAL_MOST_EDGES_S 100000U

#define HAL_MOST_IMAGE_BYTES 0U

typedef uint32_t hal_image_at_t;
typedef uint8_t hal_lock_t;

/* Interrupts are plain calls here; fake_hal.c may let one in at each lock, as a real one could come in just before. */
hal_lock_t hal_lock(void);
void hal_unlock(hal_lock_t state);
uint16_t hal_edge_micros(void);

#endif
