/*
 * Left A is PF4 and B is PD7, right A is PD6 and B is PC7, as in the published sketch: they do not pair with a quadrature
 * decoder of the part, so each edge is an interrupt. The left encoder is mounted the other way round: channels swapped.
 */
#include "encoder.h"
#include "hal.h"
#include "registers.h"

#define LEFT_A PIN(4U)  /* port F */
#define LEFT_B PIN(7U)  /* port D */
#define RIGHT_A PIN(6U) /* port D */
#define RIGHT_B PIN(7U) /* port C */
#define UNLOCK 0x4C4F434BU

void on_encoder(void);

struct channel {
    uint32_t port;
    uint32_t pin;
    uint8_t wheel;
};

#define CHANNELS 4U
#define CHANNEL_EDGES 64U /* in a millisecond: more than twice what a wheel at HAL_MOST_EDGES_S has of each of its two */

static const struct channel channels[CHANNELS] = {
    {PORT_F, LEFT_A, 0U}, {PORT_D, LEFT_B, 0U}, {PORT_D, RIGHT_A, 1U}, {PORT_C, RIGHT_B, 1U}};
static volatile uint8_t budgets[CHANNELS];

static void refill(void)
{
    for (uint32_t index = 0U; index < CHANNELS; index++) {
        budgets[index] = CHANNEL_EDGES;
    }
}

uint8_t hal_encoder_levels(uint8_t wheel)
{
    if (wheel == 0U) {
        const bool first = GPIO_DATA(PORT_D, LEFT_B) != 0U;
        const bool second = GPIO_DATA(PORT_F, LEFT_A) != 0U;
        return (uint8_t)((first ? 2U : 0U) | (second ? 1U : 0U));
    }
    const bool first = GPIO_DATA(PORT_D, RIGHT_A) != 0U;
    const bool second = GPIO_DATA(PORT_C, RIGHT_B) != 0U;
    return (uint8_t)((first ? 2U : 0U) | (second ? 1U : 0U));
}

static void input(uint32_t port, uint32_t pins)
{
    GPIO_DIR(port) &= ~pins;
    GPIO_AFSEL(port) &= ~pins;
    GPIO_PULL_UP(port) |= pins;
    GPIO_DIGITAL(port) |= pins;
    GPIO_BOTH_EDGES(port) |= pins;
    GPIO_CLEAR(port) = pins;
    GPIO_MASK(port) |= pins;
}

void encoders_start(void)
{
    /* PD7 is the NMI's unless it is unlocked. */
    GPIO_LOCK(PORT_D) = UNLOCK;
    GPIO_COMMIT(PORT_D) |= LEFT_B;
    GPIO_LOCK(PORT_D) = 0U;
    input(PORT_F, LEFT_A);
    input(PORT_D, LEFT_B | RIGHT_A);
    input(PORT_C, RIGHT_B);
    refill();
    interrupt_enable(IRQ_GPIO_F, PRIORITY_ENCODERS);
    interrupt_enable(IRQ_GPIO_D, PRIORITY_ENCODERS);
    interrupt_enable(IRQ_GPIO_C, PRIORITY_ENCODERS);
}

uint8_t hal_encoders_tick(void)
{
    refill();
    uint8_t shut = 0U;
    for (uint32_t index = 0U; index < CHANNELS; index++) {
        const struct channel *channel = &channels[index];
        if ((GPIO_MASK(channel->port) & channel->pin) == 0U) {
            shut = (uint8_t)(shut | (1U << channel->wheel));
        }
    }
    return shut;
}

void hal_encoders_open(void)
{
    refill();
    for (uint8_t wheel = 0U; wheel < WHEELS; wheel++) {
        encoders[wheel].levels = hal_encoder_levels(wheel);
    }
    for (uint32_t index = 0U; index < CHANNELS; index++) {
        GPIO_CLEAR(channels[index].port) = channels[index].pin;
        GPIO_MASK(channels[index].port) |= channels[index].pin;
    }
}

/* A channel that had all its edges of this millisecond is shut. */
static void spend(void)
{
    for (uint32_t index = 0U; index < CHANNELS; index++) {
        const struct channel *channel = &channels[index];
        if ((GPIO_STATUS(channel->port) & channel->pin) != 0U) {
            budgets[index]--;
            if (budgets[index] == 0U) {
                GPIO_MASK(channel->port) &= ~channel->pin;
            }
        }
    }
}

/* The flags are cleared before the levels are read: an edge in between comes again. */
void on_encoder(void)
{
    spend();
    GPIO_CLEAR(PORT_F) = LEFT_A;
    GPIO_CLEAR(PORT_D) = LEFT_B | RIGHT_A;
    GPIO_CLEAR(PORT_C) = RIGHT_B;
    for (uint8_t wheel = 0U; wheel < WHEELS; wheel++) {
        const uint8_t levels = hal_encoder_levels(wheel);
        if (levels != encoders[wheel].levels) {
            encoder_edge(wheel, levels);
        }
    }
}
