/*
 * An MPU-6050 at its power-on ranges (2 g, 250 degrees/s), read 100 times a second by the two-wire interface's
 * interrupt, so that the newest is new. A bus that hangs costs the readings, never time: after 10 ms it is given up until the
 * next one is due. It sleeps from its power-on until its power register is written, and reads as zeros then: whenever it
 * does not answer, or has nothing but zeros, it is woken before it is read again.
 */
#include <util/delay.h>
#include <util/twi.h>

#include "hal.h"

#define ADDRESS 0x68U
#define ACCEL_XOUT_H 0x3BU
#define PWR_MGMT_1 0x6BU
#define READING_BYTES 14U /* three accelerations, the temperature, three rates */

#define PERIOD_US 10000UL
#define GIVE_UP_US 10000UL
#define WAKE_AGAIN_US 100000UL
#define SETTLES_US 50000UL /* its rates after a sleep: 30 ms (PS-MPU-6000A, 6.1) */
#define MOST_CLOCKS 9U     /* a byte and its acknowledgement */
#define HALF_CLOCK_US 5.0
#define SDA _BV(PC4)
#define SCL _BV(PC5)
#define SPIN 1000U /* 1.5 ms at 16 MHz, where a byte takes 23 us */

#define NEXT (_BV(TWINT) | _BV(TWEN))

enum state { IDLE, BUSY, READY, WOKEN, FAILED };

static volatile uint8_t progress;
static volatile uint8_t received;
static uint8_t sent; /* bytes after the address */
static bool is_awake;
static uint8_t bytes[READING_BYTES];
static uint32_t begun_us;
static uint32_t wait_us = PERIOD_US; /* from begun_us until the next reading, or the next try to wake it */

static void pull_low(uint8_t pin)
{
    PORTC &= (uint8_t)~pin;
    DDRC |= pin;
    _delay_us(HALF_CLOCK_US);
}

static void release(uint8_t pin)
{
    DDRC &= (uint8_t)~pin;
    PORTC |= pin; /* weak pull-ups, beside the breakout's own */
    _delay_us(HALF_CLOCK_US);
}

/* A reset in the middle of a reading leaves the IMU in its byte, with SDA low: clocks end that byte, and a stop ends the reading. */
static void free_bus(void)
{
    release(SDA);
    release(SCL);
    for (uint8_t clock = 0U; (clock < MOST_CLOCKS) && ((PINC & SDA) == 0U); clock++) {
        pull_low(SCL);
        release(SCL);
    }
    pull_low(SCL);
    pull_low(SDA);
    release(SCL);
    release(SDA);
}

static void bus_start(void)
{
    TWCR = 0U;
    free_bus();
    TWSR = 0U;
    TWBR = 12U; /* 400 kHz */
    progress = IDLE;
}

static uint8_t status_after(uint8_t control)
{
    TWCR = control;
    for (uint16_t spin = SPIN; (spin > 0U) && ((TWCR & _BV(TWINT)) == 0U); spin--) {
    }
    return TW_STATUS;
}

/* Of an address as of data: simavr 1.6 has one status for both. */
static bool is_acknowledged(uint8_t status)
{
    return (status == TW_MT_SLA_ACK) || (status == TW_MT_DATA_ACK);
}

static bool wrote(uint8_t byte)
{
    TWDR = byte;
    return is_acknowledged(status_after(NEXT));
}

bool hal_imu_present(void)
{
    bus_start();
    is_awake = (status_after((uint8_t)(NEXT | _BV(TWSTA))) == TW_START) &&
                            wrote((uint8_t)(ADDRESS << 1U) | TW_WRITE) && wrote(PWR_MGMT_1) && wrote(0U);
    TWCR = (uint8_t)(NEXT | _BV(TWSTO));
    begun_us = hal_micros();
    wait_us = is_awake ? SETTLES_US : WAKE_AGAIN_US;
    return is_awake;
}

static int16_t word_at(uint8_t at)
{
    return (int16_t)(uint16_t)(((uint16_t)bytes[at] << 8U) | bytes[at + 1U]);
}

/* The temperature stands between accelerations and rates. Not all of it is 0 in one that is awake. */
static bool take(int16_t counts[6])
{
    uint8_t any = 0U;
    for (uint8_t at = 0U; at < READING_BYTES; at++) {
        any |= bytes[at];
    }
    if (any == 0U) {
        return false;
    }
    for (uint8_t number = 0U; number < 6U; number++) {
        counts[number] = word_at((uint8_t)(2U * number + (number < 3U ? 0U : 2U)));
    }
    return true;
}

static void fall_asleep(void)
{
    is_awake = false;
    wait_us = WAKE_AGAIN_US;
    bus_start();
}

bool hal_imu(int16_t counts[6], uint32_t *at_us)
{
    const uint32_t now_us = hal_micros();
    const uint32_t since_us = now_us - begun_us;
    const uint8_t done = progress;
    bool is_new = false;
    if (done == READY) {
        is_new = take(counts);
        *at_us = begun_us;
        progress = IDLE;
        if (!is_new) {
            fall_asleep();
        }
    } else if (done == WOKEN) {
        is_awake = true;
        wait_us = SETTLES_US;
        progress = IDLE;
    } else if ((done == FAILED) || ((done == BUSY) && (since_us > GIVE_UP_US))) {
        fall_asleep();
    } else if ((done == IDLE) && (since_us >= wait_us)) {
        begun_us = now_us;
        wait_us = PERIOD_US;
        received = 0U;
        sent = 0U;
        progress = BUSY;
        TWCR = (uint8_t)(NEXT | _BV(TWSTA) | _BV(TWIE));
    } else {
        /* It is being read, or not due. */
    }
    return is_new;
}

static void stop(uint8_t next_state)
{
    TWCR = (uint8_t)(NEXT | _BV(TWSTO));
    progress = next_state;
}

/* The register's number; then, to wake it, its new value, else the other direction. */
static void send_on(void)
{
    if (sent == 0U) {
        TWDR = is_awake ? ACCEL_XOUT_H : PWR_MGMT_1;
        TWCR = (uint8_t)(NEXT | _BV(TWIE));
    } else if (is_awake) {
        TWCR = (uint8_t)(NEXT | _BV(TWIE) | _BV(TWSTA));
    } else if (sent == 1U) {
        TWDR = 0U;
        TWCR = (uint8_t)(NEXT | _BV(TWIE));
    } else {
        stop(WOKEN);
    }
    sent++;
}

static void receive(uint8_t byte)
{
    bytes[received] = byte;
    received++;
    const bool is_last_next = received == READING_BYTES - 1U;
    TWCR = (uint8_t)(NEXT | _BV(TWIE) | (is_last_next ? 0U : _BV(TWEA)));
}

ISR(TWI_vect)
{
    switch (TW_STATUS) {
    case TW_START:
        TWDR = (uint8_t)(ADDRESS << 1U) | TW_WRITE;
        TWCR = (uint8_t)(NEXT | _BV(TWIE));
        break;
    case TW_MT_SLA_ACK:
    case TW_MT_DATA_ACK:
        send_on();
        break;
    case TW_REP_START:
        TWDR = (uint8_t)(ADDRESS << 1U) | TW_READ;
        TWCR = (uint8_t)(NEXT | _BV(TWIE));
        break;
    case TW_MR_SLA_ACK:
        TWCR = (uint8_t)(NEXT | _BV(TWIE) | _BV(TWEA));
        break;
    case TW_MR_DATA_ACK:
        receive(TWDR);
        break;
    case TW_MR_DATA_NACK:
        bytes[received] = TWDR;
        stop(READY);
        break;
    default: /* nobody answers, or the bus was lost */
        stop(FAILED);
        break;
    }
}
