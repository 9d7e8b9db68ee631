/*
 * SysTick runs freely and gives the time, timer 0 the tick. A tick that comes late makes up for those that were missed (an
 * emulator whose computer was busy), so milliseconds are counted as they pass.
 */
#include "hal.h"
#include "registers.h"

#define SYSTICK_SPAN 0x00FFFFFFU
#define ENABLED_BY_PROCESSOR_CLOCK 5U
#define TICK_US 1000U

static struct {
    uint32_t us;     /* at the last look */
    uint32_t value;  /* SysTick then */
    uint32_t cycles; /* less than a microsecond, not counted yet */
} now;

static uint32_t ticked_us;

void on_tick(void);
void on_watchdog(void);

void clock_start(void)
{
    SYSTICK_LOAD = SYSTICK_SPAN;
    SYSTICK_VALUE = 0U;
    SYSTICK_CTRL = ENABLED_BY_PROCESSOR_CLOCK;
    now.us = 0U;
    now.cycles = 0U;
    now.value = SYSTICK_VALUE;
    ticked_us = 0U;
    TIMER0_CTL = 0U;
    TIMER0_CFG = 0U;  /* 32 bits */
    TIMER0_TAMR = 2U; /* periodic */
    TIMER0_TAILR = (CLOCK_MHZ * TICK_US) - 1U;
    TIMER0_CLEAR = 1U;
    TIMER0_MASK = 1U;
    TIMER0_CTL = 1U;
    interrupt_enable(IRQ_TIMER0A, PRIORITY_TICK);
}

/* Called each millisecond at least: SysTick wraps in 335 ms. */
uint32_t hal_micros(void)
{
    const hal_lock_t state = hal_lock();
    const uint32_t value = SYSTICK_VALUE;
    now.cycles += (now.value - value) & SYSTICK_SPAN;
    now.value = value;
    now.us += now.cycles / CLOCK_MHZ;
    now.cycles %= CLOCK_MHZ;
    const uint32_t us = now.us;
    hal_unlock(state);
    return us;
}

void on_tick(void)
{
    TIMER0_CLEAR = 1U;
    while ((uint32_t)(hal_micros() + (TICK_US / 2U) - ticked_us) >= TICK_US) {
        ticked_us += TICK_US;
        firmware_tick();
    }
}

/* 125 ms to its interrupt, and as much again to a reset if that is not run, as when interrupts are shut. */
#define WATCHDOG_CYCLES (CLOCK_MHZ * 125000U)

void hal_watchdog_start(void)
{
    WATCHDOG_LOCK = WATCHDOG_UNLOCK;
    WATCHDOG_LOAD = WATCHDOG_CYCLES;
    WATCHDOG_CTL = WATCHDOG_INTERRUPT | WATCHDOG_RESET;
    WATCHDOG_LOCK = 0U;
    interrupt_enable(IRQ_WATCHDOG, PRIORITY_WATCHDOG);
}

static uint32_t fed_ticked_us;

/* Clearing its interrupt begins both times anew; a new load alone leaves an interrupt that has come, and one time only. */
void hal_watchdog_feed(void)
{
    fed_ticked_us = ticked_us;
    WATCHDOG_LOCK = WATCHDOG_UNLOCK;
    WATCHDOG_CLEAR = 1U;
    WATCHDOG_LOCK = 0U;
    interrupt_enable(IRQ_WATCHDOG, PRIORITY_WATCHDOG);
}

#define TICK_RUNS_US 90000U

/* While the tick runs, it sees a main loop that hangs by itself, at 200 ms; the reset comes at 250. */
void on_watchdog(void)
{
    if ((ticked_us - fed_ticked_us) < TICK_RUNS_US) {
        firmware_watchdog();
    }
    interrupt_disable(IRQ_WATCHDOG);
}
