/* The ultrasonic sensor by pin changes, and the battery's voltage by the ADC. Neither waits. */
#include <util/delay.h>

#include "hal.h"
#include "pins.h"

void ultrasonic_start(void)
{
    DDRB &= (uint8_t)~_BV(ECHO);
    PORTB &= (uint8_t)~_BV(ECHO);
    PORTC &= (uint8_t)~_BV(TRIGGER);
    DDRC |= (uint8_t)_BV(TRIGGER);
    PCMSK0 = _BV(ECHO);
    PCIFR = _BV(PCIF0);
    PCICR |= (uint8_t)_BV(PCIE0);
}

/* The sensor wants its pulse 10 us long at least: longer, if an interrupt comes in between, does no harm. */
void hal_ultrasonic_trigger(void)
{
    PORTC |= (uint8_t)_BV(TRIGGER);
    _delay_us(10.0);
    PORTC &= (uint8_t)~_BV(TRIGGER);
}

ISR(PCINT0_vect)
{
    const uint32_t now_us = hal_micros();
    firmware_echo((PINB & _BV(ECHO)) != 0U, now_us);
}

void battery_start(void)
{
    ADMUX = (uint8_t)(_BV(REFS0) | BATTERY_CHANNEL);                                      /* AVcc, 5 V */
    ADCSRA = (uint8_t)(_BV(ADEN) | _BV(ADSC) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0)); /* 125 kHz */
    DIDR0 = _BV(BATTERY_CHANNEL);
}

/* The conversion that the call before has started; it takes 0.1 ms. */
bool hal_battery(uint16_t *adc)
{
    if ((ADCSRA & _BV(ADSC)) != 0U) {
        return false;
    }
    *adc = (uint16_t)(ADC * 4U);
    ADCSRA |= (uint8_t)_BV(ADSC);
    return true;
}

/* The drivers of this board do not tell. */
bool hal_current(uint8_t wheel, uint16_t *adc)
{
    (void)wheel;
    (void)adc;
    return false;
}
