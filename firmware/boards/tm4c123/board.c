/* Clock, pins and motors of the LaunchPad, on the pins of the published sketch. Data sheet: TM4C123GH6PM, SPMS376E. */
#include "hal.h"
#include "registers.h"

#define SYSCTL_RCGCWD REGISTER(0x400FE600U)
#define SYSCTL_RCGCTIMER REGISTER(0x400FE604U)
#define SYSCTL_RCGCGPIO REGISTER(0x400FE608U)
#define SYSCTL_RCGCUART REGISTER(0x400FE618U)
#define SYSCTL_RCGCI2C REGISTER(0x400FE620U)
#define SYSCTL_RCGCADC REGISTER(0x400FE638U)
#define SYSCTL_RCGCWTIMER REGISTER(0x400FE65CU)
#define SYSCTL_PRWD REGISTER(0x400FEA00U)
#define SYSCTL_PRTIMER REGISTER(0x400FEA04U)
#define SYSCTL_PRGPIO REGISTER(0x400FEA08U)
#define SYSCTL_PRUART REGISTER(0x400FEA18U)
#define SYSCTL_PRI2C REGISTER(0x400FEA20U)
#define SYSCTL_PRADC REGISTER(0x400FEA38U)
#define SYSCTL_PRWTIMER REGISTER(0x400FEA5CU)
#define PORTS 0x3FU
#define WATCHDOG0 1U
#define TIMER0 1U
#define UART0 1U
#define I2C3 (1U << 3)
#define ADC0 1U
#define WIDE_TIMERS 3U /* 0 and 1 */

#define BROWN_OUTS_RESET 6U /* both thresholds, 3.02 V and 2.88 V: a reset, not an interrupt */

#define RCC_RESET 0x078E3AD1U /* the internal oscillator drives, PLL and crystal are off */
#define RCC_CRYSTAL_OFF 1U
#define RCC_INTERNAL (1U << 4)
#define RCC_50_MHZ 0x01C00540U /* 16 MHz from the crystal, PLL's 200 MHz by 4 */
#define MOST_LOOKS 100000U     /* some 50 ms; the crystal takes 18 at most */

/* The left motor: A is PE4, B is PE5, PWM is PC5 (wide timer 0 B). B alone is forward. */
#define LEFT_A PIN(4U)
#define LEFT_B PIN(5U)
#define LEFT_PWM PIN(5U)
/* The right motor: A is PA3, B is PA4, PWM is PC6 (wide timer 1 A). A alone is forward. */
#define RIGHT_A PIN(3U)
#define RIGHT_B PIN(4U)
#define RIGHT_PWM PIN(6U)

#define WTIMER0 0x40036000U
#define WTIMER1 0x40037000U
#define TIMER_CFG(timer) REGISTER((timer) + 0x00U)
#define TIMER_MODE_A(timer) REGISTER((timer) + 0x04U)
#define TIMER_MODE_B(timer) REGISTER((timer) + 0x08U)
#define TIMER_CTL(timer) REGISTER((timer) + 0x0CU)
#define TIMER_LOAD_A(timer) REGISTER((timer) + 0x28U)
#define TIMER_LOAD_B(timer) REGISTER((timer) + 0x2CU)
#define TIMER_MATCH_A(timer) REGISTER((timer) + 0x30U)
#define TIMER_MATCH_B(timer) REGISTER((timer) + 0x34U)
#define TWO_OF_32_BITS 4U
#define PWM_MODE 0x40AU /* TnAMS, periodic; TnMRSU: a new match counts from the next period on, so none is missed */
#define ENABLE_A 0x001U
#define ENABLE_B 0x100U
#define PERIOD 102000U /* 490 Hz of 50 MHz; 255 times 400 */
#define PERIOD_STEP (PERIOD / 255U)

#define PCTL_FIELD(pin, function) ((uint32_t)(function) << (4U * (pin)))
#define PCTL_WIDE_TIMER 7U
#define PCTL_UART 1U

static void await(volatile const uint32_t *ready, uint32_t parts)
{
    while ((*ready & parts) != parts) {
    }
}

/*
 * 50 MHz from the PLL, as 5.3 of the data sheet has it. A crystal that does not swing is left to the internal oscillator,
 * which has 16 MHz too, within 3 %. Without a PLL no time is right, the dead-man's neither: then the board stays off here.
 */
static void pll_start(void)
{
    SYSCTL_RCC = RCC_RESET & ~RCC_CRYSTAL_OFF;
    uint32_t looks = MOST_LOOKS;
    while (((SYSCTL_RIS & RIS_CRYSTAL_RUNS) == 0U) && (looks > 0U)) {
        looks--;
    }
    const uint32_t rcc = RCC_50_MHZ | ((looks == 0U) ? RCC_INTERNAL : 0U);
    SYSCTL_RCC = (rcc | RCC_BYPASS) & ~RCC_USE_DIVIDER;
    SYSCTL_RCC = rcc | RCC_BYPASS;
    await(&SYSCTL_RIS, RIS_PLL_LOCKED);
    SYSCTL_RCC = rcc;
}

/* The ports first, for the motors: a part without a clock answers with a fault. */
void system_start(void)
{
    SYSCTL_RCGCGPIO |= PORTS;
    await(&SYSCTL_PRGPIO, PORTS);
    hal_motors_off();
    SYSCTL_PBORCTL = BROWN_OUTS_RESET;
    pll_start();
    SYSCTL_RCGCWD |= WATCHDOG0;
    SYSCTL_RCGCTIMER |= TIMER0;
    SYSCTL_RCGCUART |= UART0;
    SYSCTL_RCGCI2C |= I2C3;
    SYSCTL_RCGCADC |= ADC0;
    SYSCTL_RCGCWTIMER |= WIDE_TIMERS;
    await(&SYSCTL_PRWD, WATCHDOG0);
    await(&SYSCTL_PRTIMER, TIMER0);
    await(&SYSCTL_PRUART, UART0);
    await(&SYSCTL_PRI2C, I2C3);
    await(&SYSCTL_PRADC, ADC0);
    await(&SYSCTL_PRWTIMER, WIDE_TIMERS);
}

static void pwm_start(void)
{
    TIMER_CTL(WTIMER0) = 0U;
    TIMER_CFG(WTIMER0) = TWO_OF_32_BITS;
    TIMER_MODE_B(WTIMER0) = PWM_MODE;
    TIMER_LOAD_B(WTIMER0) = PERIOD;
    TIMER_MATCH_B(WTIMER0) = PERIOD;
    TIMER_CTL(WTIMER0) = ENABLE_B;
    TIMER_CTL(WTIMER1) = 0U;
    TIMER_CFG(WTIMER1) = TWO_OF_32_BITS;
    TIMER_MODE_A(WTIMER1) = PWM_MODE;
    TIMER_LOAD_A(WTIMER1) = PERIOD;
    TIMER_MATCH_A(WTIMER1) = PERIOD;
    TIMER_CTL(WTIMER1) = ENABLE_A;
}

void pins_start(void)
{
    GPIO_PCTL(PORT_A) = (GPIO_PCTL(PORT_A) & ~0xFFU) | PCTL_FIELD(0U, PCTL_UART) | PCTL_FIELD(1U, PCTL_UART);
    GPIO_AFSEL(PORT_A) |= PIN(0U) | PIN(1U);
    GPIO_DIGITAL(PORT_A) |= PIN(0U) | PIN(1U);
    GPIO_PCTL(PORT_C) = (GPIO_PCTL(PORT_C) & ~(PCTL_FIELD(5U, 0xFU) | PCTL_FIELD(6U, 0xFU))) |
                        PCTL_FIELD(5U, PCTL_WIDE_TIMER) | PCTL_FIELD(6U, PCTL_WIDE_TIMER);
    pwm_start();
}

static void output(uint32_t port, uint32_t pins, uint32_t levels)
{
    GPIO_AFSEL(port) &= ~pins;
    GPIO_DATA(port, pins) = levels;
    GPIO_DIR(port) |= pins;
    GPIO_DATA(port, pins) = levels;
    GPIO_DIGITAL(port) |= pins;
}

/* The timers' outputs off the pins, the PWM pins low, all inputs of the drivers high, which brakes. Needs no RAM. */
void hal_motors_off(void)
{
    output(PORT_C, LEFT_PWM | RIGHT_PWM, 0U);
    output(PORT_E, LEFT_A | LEFT_B, LEFT_A | LEFT_B);
    output(PORT_A, RIGHT_A | RIGHT_B, RIGHT_A | RIGHT_B);
}

/* A PWM pin is high from the timer's load to its match. */
static uint32_t match_of(int16_t duty)
{
    const uint32_t magnitude = (uint32_t)((duty < 0) ? -duty : duty);
    return PERIOD - (((magnitude > 255U) ? 255U : magnitude) * PERIOD_STEP);
}

/* The PWM is taken off a driver while its inputs change. */
static void write_inputs(uint32_t port, uint32_t forward, uint32_t backward, uint32_t pwm, int16_t duty)
{
    const uint32_t levels = ((duty >= 0) ? forward : 0U) | ((duty <= 0) ? backward : 0U);
    GPIO_AFSEL(PORT_C) &= ~pwm;
    GPIO_DATA(port, forward | backward) = levels;
    if (duty != 0) {
        GPIO_AFSEL(PORT_C) |= pwm;
    }
}

void hal_motors_write(const int16_t duty[WHEELS])
{
    TIMER_MATCH_B(WTIMER0) = match_of(duty[0]);
    TIMER_MATCH_A(WTIMER1) = match_of(duty[1]);
    write_inputs(PORT_E, LEFT_B, LEFT_A, LEFT_PWM, duty[0]);
    write_inputs(PORT_A, RIGHT_A, RIGHT_B, RIGHT_PWM, duty[1]);
}
