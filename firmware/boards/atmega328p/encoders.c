/*
 * Both channels of both encoders by pin interrupts, which are in edges.S. The left encoder is mounted the other way round, as the published sketch
 * has it: its channels are swapped here, so that forward is forward.
 */
#include <stddef.h>

#include "edges.h"
#include "encoder.h"
#include "hal.h"
#include "pins.h"

static inline uint8_t left_levels(uint8_t pins)
{
    return (uint8_t)(((pins & _BV(LEFT_ENCODER_B)) != 0U ? 2U : 0U) | ((pins & _BV(LEFT_ENCODER_A)) != 0U ? 1U : 0U));
}

static inline uint8_t right_levels(uint8_t pins)
{
    return (uint8_t)(((pins & _BV(RIGHT_ENCODER_A)) != 0U ? 2U : 0U) | ((pins & _BV(RIGHT_ENCODER_B)) != 0U ? 1U : 0U));
}

#define CHANNEL_EDGES 16U /* in a millisecond: twice what a wheel at HAL_MOST_EDGES_S has of each of its two */

volatile uint8_t edge_budgets[BUDGETS]; /* see edges.S */

static void refill(void)
{
    edge_budgets[LEFT_A_BUDGET] = CHANNEL_EDGES;
    edge_budgets[RIGHT_A_BUDGET] = CHANNEL_EDGES;
    edge_budgets[LEFT_B_BUDGET] = CHANNEL_EDGES;
    edge_budgets[RIGHT_B_BUDGET] = CHANNEL_EDGES;
    edge_budgets[BOTH_B_BUDGET] = 2U * CHANNEL_EDGES;
}

uint8_t hal_encoders_tick(void)
{
    const hal_lock_t state = hal_lock();
    refill();
    const uint8_t first = EIMSK;
    const uint8_t second = PCMSK2;
    hal_unlock(state);
    const bool left = ((first & _BV(INT0)) != 0U) && ((second & _BV(LEFT_ENCODER_B)) != 0U);
    const bool right = ((first & _BV(INT1)) != 0U) && ((second & _BV(RIGHT_ENCODER_B)) != 0U);
    return (uint8_t)((left ? 0U : 1U) | (right ? 0U : 2U));
}

void hal_encoders_open(void)
{
    const hal_lock_t state = hal_lock();
    refill();
    EIFR = (uint8_t)(_BV(INTF0) | _BV(INTF1));
    PCIFR = _BV(PCIF2);
    for (uint8_t wheel = 0U; wheel < WHEELS; wheel++) {
        encoders[wheel].levels = hal_encoder_levels(wheel);
    }
    PCMSK2 = (uint8_t)(_BV(LEFT_ENCODER_B) | _BV(RIGHT_ENCODER_B));
    EIMSK = (uint8_t)(_BV(INT0) | _BV(INT1));
    hal_unlock(state);
}

void encoders_start(void)
{
    refill();
    const uint8_t pins =
        (uint8_t)(_BV(LEFT_ENCODER_A) | _BV(LEFT_ENCODER_B) | _BV(RIGHT_ENCODER_A) | _BV(RIGHT_ENCODER_B));
    DDRD &= (uint8_t)~pins;
    PORTD |= pins; /* pull-ups */
    EICRA = (uint8_t)(_BV(ISC00) | _BV(ISC10)); /* any edge */
    PCMSK2 = (uint8_t)(_BV(LEFT_ENCODER_B) | _BV(RIGHT_ENCODER_B));
    EIFR = (uint8_t)(_BV(INTF0) | _BV(INTF1));
    PCIFR = _BV(PCIF2);
    EIMSK = (uint8_t)(_BV(INT0) | _BV(INT1));
    PCICR |= (uint8_t)_BV(PCIE2);
}

uint8_t hal_encoder_levels(uint8_t wheel)
{
    return wheel == 0U ? left_levels(PIND) : right_levels(PIND);
}

_Static_assert(offsetof(struct encoder, count) == ENCODER_COUNT_AT, "edges.S");
_Static_assert(offsetof(struct encoder, edge_micros) == ENCODER_MICROS_AT, "edges.S");
_Static_assert(offsetof(struct encoder, levels) == ENCODER_LEVELS_AT, "edges.S");
_Static_assert(sizeof(struct encoder) == ENCODER_BYTES, "edges.S");
