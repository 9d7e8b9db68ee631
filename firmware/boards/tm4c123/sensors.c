/* The LaunchPad's ultrasonic sensor by pin interrupts, and the battery's voltage by the ADC. Neither waits. */
#include "hal.h"
#include "registers.h"

/* Echo is PA6, trigger is PA7, as in the published sketch. */
#define ECHO PIN(6U)
#define TRIGGER PIN(7U)

/* The battery's divider is on PE3 (AIN0): its published pin, PC4, has no ADC, so this wire has to move. */
#define BATTERY PIN(3U)

#define ADC_ACTIVE REGISTER(0x40038000U)
#define ADC_RIS REGISTER(0x40038004U)
#define ADC_CLEAR REGISTER(0x4003800CU)
#define ADC_TRIGGERS REGISTER(0x40038014U)
#define ADC_BEGIN REGISTER(0x40038028U)
#define ADC_MUX_3 REGISTER(0x400380A0U)
#define ADC_CTL_3 REGISTER(0x400380A4U)
#define ADC_FIFO_3 REGISTER(0x400380A8U)
#define SEQUENCER_3 (1U << 3)
#define ONE_SAMPLE 6U /* its end, and its interrupt flag */

void sensors_of_board_start(void)
{
    GPIO_DIR(PORT_A) = (GPIO_DIR(PORT_A) & ~ECHO) | TRIGGER;
    GPIO_DATA(PORT_A, TRIGGER) = 0U;
    GPIO_DIGITAL(PORT_A) |= ECHO | TRIGGER;
    GPIO_BOTH_EDGES(PORT_A) |= ECHO;
    GPIO_CLEAR(PORT_A) = ECHO;
    GPIO_MASK(PORT_A) |= ECHO;
    interrupt_enable(IRQ_GPIO_A, PRIORITY_EDGES);
    GPIO_AFSEL(PORT_E) |= BATTERY;
    GPIO_DIGITAL(PORT_E) &= ~BATTERY;
    GPIO_ANALOGUE(PORT_E) |= BATTERY;
    ADC_ACTIVE &= ~SEQUENCER_3;
    ADC_TRIGGERS &= ~0xF000U; /* by the processor */
    ADC_MUX_3 = 0U;
    ADC_CTL_3 = ONE_SAMPLE;
    ADC_ACTIVE |= SEQUENCER_3;
    ADC_BEGIN = SEQUENCER_3;
}

/* The sensor wants its pulse 10 us long at least: longer, if an interrupt comes in between, does no harm. */
void hal_ultrasonic_trigger(void)
{
    const uint32_t begun_us = hal_micros();
    GPIO_DATA(PORT_A, TRIGGER) = TRIGGER;
    while ((uint32_t)(hal_micros() - begun_us) <= 10U) {
    }
    GPIO_DATA(PORT_A, TRIGGER) = 0U;
}

void on_gpio_a(void)
{
    const uint32_t now_us = hal_micros();
    GPIO_CLEAR(PORT_A) = ECHO;
    firmware_echo(GPIO_DATA(PORT_A, ECHO) != 0U, now_us);
}

/* The conversion that the call before has begun. */
bool hal_battery(uint16_t *adc)
{
    if ((ADC_RIS & SEQUENCER_3) == 0U) {
        return false;
    }
    *adc = (uint16_t)(ADC_FIFO_3 & 0xFFFU);
    ADC_CLEAR = SEQUENCER_3;
    ADC_BEGIN = SEQUENCER_3;
    return true;
}

/* The drivers of the published robot do not tell. */
bool hal_current(uint8_t wheel, uint16_t *adc)
{
    (void)wheel;
    (void)adc;
    return false;
}
