/*
 * An MPU-6050 at its power-on ranges (2 g, 250 degrees/s), read 100 times a second by the two-wire interface's
 * interrupt, so that the newest is new. A bus that hangs costs the readings, never time: after 10 ms it is given up until the
 * next one is due.
 */
#include <util/twi.h>

#include "hal.h"

#define ADDRESS 0x68U
#define ACCEL_XOUT_H 0x3BU
#define PWR_MGMT_1 0x6BU
#define READING_BYTES 14U /* three accelerations, the temperature, three rates */

#define PERIOD_US 10000UL
#define GIVE_UP_US 10000UL
#define SPIN 1000U /* 1.5 ms at 16 MHz, where a byte takes 23 us */

#define NEXT (_BV(TWINT) | _BV(TWEN))

enum state { IDLE, BUSY, READY };

static volatile uint8_t progress;
static volatile uint8_t received;
static bool is_pointed; /* the register's number has been sent */
static uint8_t bytes[READING_BYTES];
static uint32_t begun_us;

static void bus_start(void)
{
    TWCR = 0U;
    DDRC &= (uint8_t) ~(_BV(PC4) | _BV(PC5));
    PORTC |= (uint8_t)(_BV(PC4) | _BV(PC5)); /* weak pull-ups, beside the breakout's own */
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

/* It sleeps from power-on until its power register is written. */
bool hal_imu_present(void)
{
    bus_start();
    const bool is_present = (status_after((uint8_t)(NEXT | _BV(TWSTA))) == TW_START) &&
                            wrote((uint8_t)(ADDRESS << 1U) | TW_WRITE) && wrote(PWR_MGMT_1) && wrote(0U);
    TWCR = (uint8_t)(NEXT | _BV(TWSTO));
    return is_present;
}

static int16_t word_at(uint8_t at)
{
    return (int16_t)(uint16_t)(((uint16_t)bytes[at] << 8U) | bytes[at + 1U]);
}

bool hal_imu(int16_t counts[6], uint32_t *at_us)
{
    const uint32_t now_us = hal_micros();
    const uint32_t since_us = now_us - begun_us;
    const bool is_ready = progress == READY;
    if (is_ready) {
        for (uint8_t number = 0U; number < 6U; number++) {
            counts[number] = word_at((uint8_t)(2U * number + (number < 3U ? 0U : 2U)));
        }
        *at_us = begun_us;
        progress = IDLE;
    } else if (progress == BUSY && since_us > GIVE_UP_US) {
        bus_start();
    }
    if (progress == IDLE && since_us >= PERIOD_US) {
        begun_us = now_us;
        received = 0U;
        is_pointed = false;
        progress = BUSY;
        TWCR = (uint8_t)(NEXT | _BV(TWSTA) | _BV(TWIE));
    }
    return is_ready;
}

static void stop(uint8_t next_state)
{
    TWCR = (uint8_t)(NEXT | _BV(TWSTO));
    progress = next_state;
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
        TWDR = ACCEL_XOUT_H;
        TWCR = (uint8_t)(NEXT | _BV(TWIE) | (is_pointed ? _BV(TWSTA) : 0U));
        is_pointed = true;
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
        stop(IDLE);
        break;
    }
}
