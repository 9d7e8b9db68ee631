/*
 * An MPU-6050 on I2C 3 (SCL is PD0, SDA is PD1: assumed), at its power-on ranges, read 100 times a second by the bus's
 * interrupt. A bus that hangs costs the readings, never time: after 10 ms it is given up until the next one is due. It sleeps
 * from its power-on until its power register is written, and reads as zeros then: whenever it does not answer, or has nothing
 * but zeros, it is woken before it is read again.
 */
#include "hal.h"
#include "registers.h"

#define I2C_ADDRESS REGISTER(0x40023000U)
#define I2C_CONTROL REGISTER(0x40023004U)
#define I2C_DATA REGISTER(0x40023008U)
#define I2C_PERIOD REGISTER(0x4002300CU)
#define I2C_MASK REGISTER(0x40023010U)
#define I2C_CLEAR REGISTER(0x4002301CU)
#define I2C_CONFIGURE REGISTER(0x40023020U)
#define MASTER 0x10U
#define RUN 1U
#define START 2U
#define STOP 4U
#define ACK 8U
#define BUSY_NOW 1U
#define FAILED 2U

#define SCL PIN(0U)
#define SDA PIN(1U)
#define PCTL_I2C 0x33U

#define WRITE_TO 0xD0U /* 0x68, shifted */
#define READ_FROM 0xD1U
#define ACCEL_XOUT_H 0x3BU
#define PWR_MGMT_1 0x6BU
#define READING_BYTES 14U /* three accelerations, the temperature, three rates */
#define PERIOD_US 10000U
#define GIVE_UP_US 10000U
#define MOST_WAIT_US 1000U /* a byte takes 23 us */
#define WAKE_AGAIN_US 100000U
#define SETTLES_US 50000U /* its rates after a sleep: 30 ms (PS-MPU-6000A, 6.1) */
#define MOST_CLOCKS 9U    /* a byte and its acknowledgement */
#define HALF_CLOCK_US 5U

enum state { IDLE, POINTING, READING, READY, WAKING, WOKEN, BROKEN };

static volatile uint8_t progress;
static volatile uint8_t received;
static uint8_t bytes[READING_BYTES];
static uint32_t begun_us;
static uint32_t wait_us = PERIOD_US; /* from begun_us until the next reading, or the next try to wake it */
static bool is_awake;

/* As an open drain: a pin is pulled low, or left to its pull-up. */
static void drive(uint32_t pin, bool is_low)
{
    const uint32_t from_us = hal_micros();
    GPIO_DATA(PORT_D, pin) = 0U;
    if (is_low) {
        GPIO_DIR(PORT_D) |= pin;
    } else {
        GPIO_DIR(PORT_D) &= ~pin;
    }
    while ((uint32_t)(hal_micros() - from_us) <= HALF_CLOCK_US) {
    }
}

/* A reset in the middle of a reading leaves the IMU in its byte, with SDA low: clocks end that byte, and a stop ends the reading. */
static void free_bus(void)
{
    GPIO_AFSEL(PORT_D) &= ~(SCL | SDA);
    GPIO_PULL_UP(PORT_D) |= SCL | SDA;
    GPIO_DIGITAL(PORT_D) |= SCL | SDA;
    drive(SDA, false);
    drive(SCL, false);
    for (uint32_t clock = 0U; (clock < MOST_CLOCKS) && (GPIO_DATA(PORT_D, SDA) == 0U); clock++) {
        drive(SCL, true);
        drive(SCL, false);
    }
    drive(SCL, true);
    drive(SDA, true);
    drive(SCL, false);
    drive(SDA, false);
}

static void bus_start(void)
{
    free_bus();
    GPIO_PCTL(PORT_D) = (GPIO_PCTL(PORT_D) & ~0xFFU) | PCTL_I2C;
    GPIO_AFSEL(PORT_D) |= SCL | SDA;
    REGISTER(PORT_D + 0x50CU) |= SDA; /* open drain, of the data line only */
    GPIO_PULL_UP(PORT_D) |= SCL | SDA;
    GPIO_DIGITAL(PORT_D) |= SCL | SDA;
    I2C_MASK = 0U;
    I2C_CONFIGURE = 0U;
    I2C_CONFIGURE = MASTER;
    I2C_PERIOD = 6U; /* 50 MHz / (20 * 7) = 357 kHz */
    I2C_CLEAR = 1U;
    progress = IDLE;
}

static bool wrote(uint8_t byte, uint32_t control)
{
    const uint32_t from_us = hal_micros();
    I2C_DATA = byte;
    I2C_CONTROL = control;
    for (uint32_t settle = 0U; settle < 20U; settle++) {
        (void)I2C_CONTROL; /* BUSY rises a moment later */
    }
    while ((I2C_CONTROL & BUSY_NOW) != 0U) {
        if ((uint32_t)(hal_micros() - from_us) > MOST_WAIT_US) {
            return false;
        }
    }
    return (I2C_CONTROL & FAILED) == 0U;
}

bool hal_imu_present(void)
{
    bus_start();
    I2C_ADDRESS = WRITE_TO;
    is_awake = wrote(PWR_MGMT_1, START | RUN) && wrote(0U, RUN | STOP);
    if (!is_awake) {
        I2C_CONTROL = STOP;
    }
    begun_us = hal_micros();
    wait_us = is_awake ? SETTLES_US : WAKE_AGAIN_US;
    I2C_CLEAR = 1U;
    I2C_MASK = 1U;
    interrupt_enable(IRQ_I2C3, PRIORITY_TICK);
    return is_awake;
}

static int16_t word_at(uint32_t at)
{
    return (int16_t)(uint16_t)(((uint32_t)bytes[at] << 8U) | bytes[at + 1U]);
}

/* The temperature stands between accelerations and rates. Not all of it is 0 in one that is awake. */
static bool take(int16_t counts[6])
{
    uint32_t any = 0U;
    for (uint32_t at = 0U; at < READING_BYTES; at++) {
        any |= bytes[at];
    }
    if (any == 0U) {
        return false;
    }
    for (uint32_t number = 0U; number < 6U; number++) {
        counts[number] = word_at((2U * number) + ((number < 3U) ? 0U : 2U));
    }
    return true;
}

static void fall_asleep(void)
{
    is_awake = false;
    wait_us = WAKE_AGAIN_US;
    bus_start();
    I2C_MASK = 1U;
}

static void begin(uint32_t now_us)
{
    begun_us = now_us;
    wait_us = PERIOD_US;
    received = 0U;
    progress = is_awake ? POINTING : WAKING;
    I2C_ADDRESS = WRITE_TO;
    I2C_DATA = is_awake ? ACCEL_XOUT_H : PWR_MGMT_1;
    I2C_CONTROL = START | RUN;
}

bool hal_imu(int16_t counts[6], uint32_t *at_us)
{
    const uint32_t now_us = hal_micros();
    const uint32_t since_us = now_us - begun_us;
    const uint8_t done = progress;
    bool is_new = false;
    if (done == (uint8_t)READY) {
        is_new = take(counts);
        *at_us = begun_us;
        progress = IDLE;
        if (!is_new) {
            fall_asleep();
        }
    } else if (done == (uint8_t)WOKEN) {
        is_awake = true;
        wait_us = SETTLES_US;
        progress = IDLE;
    } else if ((done == (uint8_t)BROKEN) || ((done != (uint8_t)IDLE) && (since_us > GIVE_UP_US))) {
        fall_asleep();
    } else if ((done == (uint8_t)IDLE) && (since_us >= wait_us)) {
        begin(now_us);
    } else {
        /* It is being read, or not due. */
    }
    return is_new;
}

/* The second byte of a wake is its register's new value. */
static void wake_on(void)
{
    if (received == 0U) {
        received = 1U;
        I2C_DATA = 0U;
        I2C_CONTROL = RUN | STOP;
    } else {
        progress = WOKEN;
    }
}

static void read_on(void)
{
    bytes[received] = (uint8_t)I2C_DATA;
    received++;
    if (received == READING_BYTES) {
        progress = READY;
    } else {
        I2C_CONTROL = (received == (READING_BYTES - 1U)) ? (RUN | STOP) : (RUN | ACK);
    }
}

void on_i2c3(void)
{
    I2C_CLEAR = 1U;
    if ((I2C_CONTROL & FAILED) != 0U) {
        I2C_CONTROL = STOP;
        progress = BROKEN;
    } else if (progress == (uint8_t)WAKING) {
        wake_on();
    } else if (progress == (uint8_t)POINTING) {
        progress = READING;
        I2C_ADDRESS = READ_FROM;
        I2C_CONTROL = START | RUN | ACK;
    } else if (progress == (uint8_t)READING) {
        read_on();
    } else {
        /* The end of what was given up. */
    }
}
