/* Timer 2: 1 kHz for the tick, and the microseconds between. */
#include <avr/sleep.h>

#include "hal.h"

volatile uint32_t clock_ms_us;

static volatile bool has_ticked;

void clock_start(void)
{
    clock_ms_us = 0U;
    TCCR2A = _BV(WGM21); /* clear on compare */
    TCCR2B = _BV(CS22);  /* 16 MHz / 64 */
    OCR2A = (uint8_t)(TICK_US / COUNT_US - 1U);
    TCNT2 = 0U;
    TIFR2 = _BV(OCF2A);
    TIMSK2 = _BV(OCIE2A);
}

uint32_t hal_micros(void)
{
    const hal_lock_t state = hal_lock();
    uint8_t count = TCNT2;
    uint32_t ms_us = clock_ms_us;
    if ((TIFR2 & _BV(OCF2A)) != 0U) {
        /* A millisecond is over whose interrupt has not run. */
        ms_us += TICK_US;
        count = TCNT2;
    }
    hal_unlock(state);
    return ms_us + (uint16_t)(count * COUNT_US);
}

/* Longer than two edges of the encoders are apart: so it lets all interrupts in but itself. */
ISR(TIMER2_COMPA_vect)
{
    clock_ms_us += TICK_US;
    has_ticked = true;
    TIMSK2 = 0U;
    sei();
    firmware_tick();
    cli();
    TIMSK2 = _BV(OCIE2A);
}

/* One pass a tick, so that cycles begin evenly; the instruction after sei runs before any interrupt. */
void clock_await_tick(void)
{
    cli();
    while (!has_ticked) {
        sei();
        sleep_cpu();
        cli();
    }
    has_ticked = false;
    sei();
}
