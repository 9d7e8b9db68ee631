/*
 * Pins of the Duemilanove, as the published sketch for it has them. The published sketch has the ultrasonic sensor on pins
 * of the right motor (a copy of another board's); its pins here, and the battery's, are assumed. See firmware/README.md.
 */
#ifndef PINS_H
#define PINS_H

#include <avr/io.h>

/* Left motor: A is D7, B is D8, PWM is D6 (OC0A). */
#define LEFT_A PD7 /* port D */
#define LEFT_B PB0 /* port B */
#define LEFT_PWM PD6 /* port D */

/* Right motor: A is D10, B is D11, PWM is D9 (OC1A). */
#define RIGHT_A PB2 /* port B */
#define RIGHT_B PB3 /* port B */
#define RIGHT_PWM PB1 /* port B */

/* Encoders: left A is D2 (INT0), B is D5; right A is D3 (INT1), B is D4. */
#define LEFT_ENCODER_A PD2
#define LEFT_ENCODER_B PD5
#define RIGHT_ENCODER_A PD3
#define RIGHT_ENCODER_B PD4

/* Ultrasonic sensor (assumed): echo is D12, trigger is A1. */
#define ECHO PB4
#define TRIGGER PC1 /* port C */

/* The battery's divider is on A0 (assumed); the IMU is on A4 (SDA) and A5 (SCL). */
#define BATTERY_CHANNEL 0U

#endif
