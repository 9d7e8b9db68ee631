/* From the reset to the main loop, and the two ways back: the watchdog and the restart by software. */
#include <avr/wdt.h>
#include <util/delay.h>

#include "hal.h"
#include "image.h"

#define RESTARTED_BY_SOFTWARE 0xA5U

static uint8_t reset_flags HAL_KEPT;
static uint8_t restarted HAL_KEPT;

/*
 * Runs before RAM is set up. A restart by software finds timers, interrupts and watchdog as they were; I/O registers are 0
 * after every reset, so GPIOR0 tells one from the other.
 */
void stop_everything(void) __attribute__((naked, used, section(".init3")));

void stop_everything(void)
{
    hal_motors_off();
    restarted = GPIOR0;
    GPIOR0 = 0U;
    reset_flags = MCUSR;
    MCUSR = 0U; /* else the watchdog cannot be turned off */
    __asm__ volatile("wdr");
    WDTCSR = (uint8_t)(_BV(WDCE) | _BV(WDE));
    WDTCSR = 0U;
}

/* A boot loader may have cleared the flags: then it counts as the reset pin, and a note that does not check as a stop. */
static uint8_t reset_cause(void)
{
    if (restarted == RESTARTED_BY_SOFTWARE) {
        return RESET_SOFTWARE;
    }
    if ((reset_flags & _BV(PORF)) != 0U) {
        return RESET_POWER_ON;
    }
    if ((reset_flags & _BV(BORF)) != 0U) {
        return RESET_BROWN_OUT;
    }
    return (reset_flags & _BV(WDRF)) != 0U ? RESET_WATCHDOG : RESET_PIN;
}

#ifdef HANGS
/* For tests, in an image of its own: an emulator writes GPIOR2. 1: the main loop hangs, 2: with interrupts shut, 3: no tick. */
static void hang_if_told(void)
{
    if (GPIOR2 == 2U) {
        cli();
    } else if (GPIOR2 == 3U) {
        TIMSK2 = 0U;
    }
    while (GPIOR2 != 0U) {
    }
}
#else
static inline void hang_if_told(void) {}
#endif

int main(void)
{
    const uint8_t cause = reset_cause();
    serial_drain();
    serial_start();
    image_check(cause);
    clock_start();
    encoders_start();
    ultrasonic_start();
    battery_start();
    firmware_start(cause);
    SMCR = _BV(SE); /* idle: everything but the processor goes on */
    for (;;) {
        clock_await_tick();
        hang_if_told();
        firmware_pass();
    }
}

void hal_let_interrupts_in(void)
{
    sei();
}

void hal_say_for_ever(const char *text)
{
    for (;;) {
        hal_motors_off();
        for (const char *next = text; HAL_READ_CHAR(next) != '\0'; next++) {
            while ((UCSR0A & _BV(UDRE0)) == 0U) {
            }
            UDR0 = (uint8_t)HAL_READ_CHAR(next);
        }
        _delay_ms(1000.0);
    }
}

void hal_restart(void)
{
    cli();
    hal_motors_off();
    __asm__ volatile("wdr");
    serial_await_quiet();
    GPIOR0 = RESTARTED_BY_SOFTWARE;
    __asm__ volatile("jmp 0");
    __builtin_unreachable();
}

/*
 * 125 ms to its interrupt, 250 ms to a reset: the interrupt is for a tick that has stopped, the reset for interrupts that are
 * shut. While the tick runs, it sees a main loop that hangs at 200 ms, between the two, and says so itself.
 */
#define WATCHDOG_125_MS (_BV(WDP1) | _BV(WDP0))

static uint32_t fed_ms_us;

void hal_watchdog_start(void)
{
    const hal_lock_t state = hal_lock();
    fed_ms_us = clock_ms_us;
    __asm__ volatile("wdr");
    WDTCSR = (uint8_t)(_BV(WDCE) | _BV(WDE));
    WDTCSR = (uint8_t)(_BV(WDIE) | _BV(WDE) | WATCHDOG_125_MS);
    hal_unlock(state);
}

void hal_watchdog_feed(void)
{
    const hal_lock_t state = hal_lock();
    fed_ms_us = clock_ms_us;
    __asm__ volatile("wdr");
    WDTCSR = (uint8_t)(_BV(WDIE) | _BV(WDE) | WATCHDOG_125_MS); /* its interrupt turns WDIE off */
    hal_unlock(state);
}

#define TICK_RUNS_US 90000UL

ISR(WDT_vect)
{
    if (clock_ms_us - fed_ms_us < TICK_RUNS_US) {
        firmware_watchdog();
    }
}
