/* Clock and motors of the LM3S6965; it has no sensors here. */
#include "hal.h"
#include "registers.h"

#define SYSCTL_RCGC0 REGISTER(0x400FE100U)
#define SYSCTL_RCGC1 REGISTER(0x400FE104U)
#define SYSCTL_RCGC2 REGISTER(0x400FE108U)
#define WATCHDOG_CLOCKED (1U << 3)
#define UART0_CLOCKED 1U
#define TIMER0_CLOCKED (1U << 16)
#define PORTS_CLOCKED 0x3FU

#define RCC_RESET 0x078E3AC0U
#define RCC_50_MHZ 0x01C00380U /* 8 MHz crystal, PLL's 200 MHz by 4 */

volatile struct observed observed HAL_KEPT;

void system_start(void)
{
    SYSCTL_RCGC0 |= WATCHDOG_CLOCKED;
    SYSCTL_RCGC1 |= UART0_CLOCKED | TIMER0_CLOCKED;
    SYSCTL_RCGC2 |= PORTS_CLOCKED;
    SYSCTL_RCC = (RCC_RESET | RCC_BYPASS) & ~RCC_USE_DIVIDER;
    SYSCTL_RCC = RCC_50_MHZ | RCC_BYPASS;
    for (uint32_t wait = 0U; ((SYSCTL_RIS & RIS_PLL_LOCKED) == 0U) && (wait < 100000U); wait++) {
    }
    SYSCTL_RCC = RCC_50_MHZ;
}

void pins_start(void)
{
    GPIO_AFSEL(PORT_A) |= PIN(0U) | PIN(1U);
    GPIO_DIGITAL(PORT_A) |= PIN(0U) | PIN(1U);
}

void sensors_of_board_start(void) {}

static void observe(int16_t left, int16_t right)
{
    const bool was_off = (observed.duty[0] == 0) && (observed.duty[1] == 0);
    const bool is_off = (left == 0) && (right == 0);
    if (was_off && !is_off) {
        observed.began_us = hal_micros();
    }
    if (is_off && !was_off) {
        observed.ended_us = hal_micros();
    }
    observed.duty[0] = left;
    observed.duty[1] = right;
}

void hal_motors_off(void)
{
    observe(0, 0);
}

void hal_motors_write(const int16_t duty[WHEELS])
{
    observe(duty[0], duty[1]);
}

void hal_ultrasonic_trigger(void) {}

bool hal_imu_present(void)
{
    return false;
}

bool hal_imu(int16_t counts[6], uint32_t *at_us)
{
    (void)counts;
    (void)at_us;
    return false;
}

bool hal_battery(uint16_t *adc)
{
    (void)adc;
    return false;
}

bool hal_current(uint8_t wheel, uint16_t *adc)
{
    (void)wheel;
    (void)adc;
    return false;
}
