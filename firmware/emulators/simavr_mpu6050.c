#include "simavr_mpu6050.h"

#include <stddef.h>

#include <simavr/avr_twi.h>

/* Register map RM-MPU-6000A: section 4.19 (readings), 4.32 (power), 4.35 (identity). */
enum { ADDRESS = 0x68, ACCEL_XOUT_H = 0x3B, TEMP_OUT_H = 0x41, PWR_MGMT_1 = 0x6B, WHO_AM_I = 0x75, ASLEEP = 0x40 };

static void sample(mpu6050_t *imu)
{
    int16_t readings[6] = {0};
    if (imu->read != NULL && (imu->registers[PWR_MGMT_1] & ASLEEP) == 0) {
        imu->read(readings);
    }
    /* Its temperature: 0 is 36.53 degrees. One that sleeps has zeros in all of them. */
    bool awake = (imu->registers[PWR_MGMT_1] & ASLEEP) == 0;
    imu->registers[TEMP_OUT_H] = awake ? 0xF0 : 0;
    imu->registers[TEMP_OUT_H + 1] = 0;
    for (unsigned number = 0; number < 6; number++) {
        /* The temperature stands between accelerations and rates. */
        unsigned at = ACCEL_XOUT_H + 2 * number + (number < 3 ? 0 : 2);
        imu->registers[at] = (uint8_t)((uint16_t)readings[number] >> 8);
        imu->registers[at + 1] = (uint8_t)readings[number];
    }
}

static void answer(mpu6050_t *imu, uint8_t message, uint8_t data)
{
    avr_raise_irq(imu->irq + TWI_IRQ_INPUT, avr_twi_irq_msg(message, (ADDRESS << 1) & 0xFF, data));
}

static void on_message(avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq;
    mpu6050_t *imu = param;
    avr_twi_msg_irq_t message = {.u.v = value};
    if ((message.u.twi.msg & TWI_COND_STOP) != 0) {
        imu->selected = false;
    }
    if ((message.u.twi.msg & TWI_COND_START) != 0) {
        imu->selected = imu->present && imu->held_clocks == 0 && message.u.twi.addr >> 1 == ADDRESS;
        imu->has_pointer = false;
        if (imu->selected) {
            answer(imu, TWI_COND_ACK, 1);
        }
    }
    if (!imu->selected) {
        return;
    }
    if ((message.u.twi.msg & TWI_COND_WRITE) != 0) {
        answer(imu, TWI_COND_ACK, 1);
        if (imu->has_pointer) {
            imu->registers[imu->pointer++ & 0x7F] = (uint8_t)message.u.twi.data;
        } else {
            imu->pointer = (uint8_t)message.u.twi.data;
            imu->has_pointer = true;
        }
    }
    if ((message.u.twi.msg & TWI_COND_READ) != 0) {
        if (imu->pointer == ACCEL_XOUT_H) {
            sample(imu);
        }
        answer(imu, TWI_COND_READ, imu->registers[imu->pointer++ & 0x7F]);
    }
}

void mpu6050_power(mpu6050_t *imu, bool present)
{
    if (present && !imu->present) {
        imu->registers[PWR_MGMT_1] = ASLEEP;
    }
    imu->present = present;
    imu->selected = imu->selected && present;
}

void mpu6050_attach(mpu6050_t *imu, avr_t *avr)
{
    static const char *names[2] = {"8>imu.out", "32<imu.in"};
    imu->registers[PWR_MGMT_1] = ASLEEP;
    imu->registers[WHO_AM_I] = ADDRESS;
    imu->irq = avr_alloc_irq(&avr->irq_pool, 0, 2, names);
    avr_irq_register_notify(imu->irq + TWI_IRQ_OUTPUT, on_message, imu);
    avr_connect_irq(imu->irq + TWI_IRQ_INPUT, avr_io_getirq(avr, AVR_IOCTL_TWI_GETIRQ(0), TWI_IRQ_INPUT));
    avr_connect_irq(avr_io_getirq(avr, AVR_IOCTL_TWI_GETIRQ(0), TWI_IRQ_OUTPUT), imu->irq + TWI_IRQ_OUTPUT);
}
