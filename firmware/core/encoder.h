/* Quadrature decoding of all four edges, short enough for an interrupt at 23,200 edges a second on an AVR.
 *
 * Forward is A before B: levels 0, 2, 3, 1, 0 (A in bit 1, B in bit 0).
 */
#ifndef ENCODER_H
#define ENCODER_H

#include "hal.h"

struct encoder {
    uint16_t count;       /* wraps: encoder_count makes 32 bits of it */
    uint16_t edge_micros; /* low bits of the time of the last edge, with the wheel loop only */
    uint8_t levels;
};

extern volatile struct encoder encoders[WHEELS];

/* By (levels before) * 4 + levels: +1 forward, -1 back; 0 if nothing or both changed (an edge was missed). */
extern const int8_t encoder_steps[16];

/* The pin interrupt of a wheel's encoder, with its levels as read in the interrupt. */
static inline void encoder_edge(uint8_t wheel, uint8_t levels)
{
    volatile struct encoder *encoder = &encoders[wheel];
    const uint8_t index = (uint8_t)((uint8_t)(encoder->levels << 2) | levels);
    encoder->levels = levels;
    encoder->count = (uint16_t)(encoder->count + (uint16_t)encoder_steps[index]);
#if (HAL_CAPABILITIES & CAPABILITY_WHEEL_LOOP) != 0
    encoder->edge_micros = hal_edge_micros();
#endif
}

/* All counts 0, levels as the pins are: else the first edge would miscount. */
void encoder_start(void);

/* The counts of each wheel since the start, as of one moment; called at least every 32767 edges, by the main loop. */
void encoder_counts(int32_t counts[WHEELS]);

#endif
