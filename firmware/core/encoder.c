#include "encoder.h"

volatile struct encoder encoders[WHEELS];

const int8_t encoder_steps[16] = {0, -1, 1, 0, 1, 0, 0, -1, -1, 0, 0, 1, 0, 1, -1, 0};

static struct {
    int32_t counts[WHEELS];
    uint16_t before[WHEELS];
} total;

void encoder_start(void)
{
    for (uint8_t wheel = 0; wheel < WHEELS; wheel++) {
        encoders[wheel].count = 0;
        encoders[wheel].edge_micros = 0;
        encoders[wheel].levels = hal_encoder_levels(wheel);
        total.counts[wheel] = 0;
        total.before[wheel] = 0;
    }
}

void encoder_counts(int32_t counts[WHEELS])
{
    uint16_t now[WHEELS];
    const hal_lock_t lock = hal_lock();
    for (uint8_t wheel = 0; wheel < WHEELS; wheel++) {
        now[wheel] = encoders[wheel].count;
    }
    hal_unlock(lock);
    for (uint8_t wheel = 0; wheel < WHEELS; wheel++) {
        const int16_t step = (int16_t)(uint16_t)(now[wheel] - total.before[wheel]);
        total.before[wheel] = now[wheel];
        total.counts[wheel] = (int32_t)((uint32_t)total.counts[wheel] + (uint32_t)(int32_t)step);
        counts[wheel] = total.counts[wheel];
    }
}
