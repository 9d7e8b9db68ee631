/*
 * Two drivers with two inputs and a PWM each: both inputs high brake, B alone is forward, A alone backwards, as in the
 * published sketch. 490 Hz, as its analogWrite makes it on D9 (on D6 that makes 976 Hz).
 */
#include "hal.h"
#include "pins.h"

#define PHASE_CORRECT_8_BIT _BV(WGM00)
#define PRESCALER_64 (_BV(CS01) | _BV(CS00))

/* The timers' outputs off the pins, the PWM pins low, all inputs of the drivers high. Needs no RAM, no interrupt. */
void hal_motors_off(void)
{
    TCCR0A = PHASE_CORRECT_8_BIT;
    TCCR1A = PHASE_CORRECT_8_BIT;
    PORTD = (uint8_t)((PORTD & ~_BV(LEFT_PWM)) | _BV(LEFT_A));
    PORTB = (uint8_t)((PORTB & ~_BV(RIGHT_PWM)) | _BV(LEFT_B) | _BV(RIGHT_A) | _BV(RIGHT_B));
    DDRD |= (uint8_t)(_BV(LEFT_PWM) | _BV(LEFT_A));
    DDRB |= (uint8_t)(_BV(LEFT_B) | _BV(RIGHT_A) | _BV(RIGHT_B) | _BV(RIGHT_PWM));
}

static uint8_t width(int16_t duty)
{
    const int16_t magnitude = duty < 0 ? (int16_t)-duty : duty;
    return magnitude > 255 ? 255U : (uint8_t)magnitude;
}

#define BRAKE_D _BV(LEFT_A)
#define BRAKE_B (_BV(LEFT_B) | _BV(RIGHT_A) | _BV(RIGHT_B))

/* The PWMs are taken off the drivers while their inputs change. No interrupt but the tick's writes to these ports. */
void hal_motors_write(const int16_t duty[WHEELS])
{
    const int16_t left = duty[0];
    const int16_t right = duty[1];
    uint8_t low_d = 0U;
    uint8_t low_b = 0U;
    if (left > 0) {
        low_d = BRAKE_D;
    } else if (left < 0) {
        low_b = _BV(LEFT_B);
    } else {
        /* Both high brake. */
    }
    if (right != 0) {
        low_b = (uint8_t)(low_b | ((right > 0) ? _BV(RIGHT_A) : _BV(RIGHT_B)));
    }
    TCCR0A = PHASE_CORRECT_8_BIT;
    TCCR1A = PHASE_CORRECT_8_BIT;
    TCCR0B = PRESCALER_64;
    TCCR1B = PRESCALER_64;
    PORTD = (uint8_t)((PORTD | BRAKE_D) & (uint8_t)~low_d);
    PORTB = (uint8_t)((PORTB | BRAKE_B) & (uint8_t)~low_b);
    OCR0A = width(left);
    OCR1AH = 0U;
    OCR1AL = width(right);
    if (left != 0) {
        TCCR0A = (uint8_t)(_BV(COM0A1) | PHASE_CORRECT_8_BIT);
    }
    if (right != 0) {
        TCCR1A = (uint8_t)(_BV(COM1A1) | PHASE_CORRECT_8_BIT);
    }
}
