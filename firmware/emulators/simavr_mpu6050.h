/* An MPU-6050 on the two-wire bus of a simavr part. */
#ifndef SIMAVR_MPU6050_H
#define SIMAVR_MPU6050_H

#include <stdbool.h>
#include <stdint.h>

#include <simavr/sim_avr.h>

typedef struct {
    avr_irq_t *irq;
    void (*read)(int16_t readings[6]);
    bool present;
    uint8_t held_clocks; /* it holds SDA low for so many clocks more, and answers nothing */
    bool selected;
    bool has_pointer;
    uint8_t pointer;
    uint8_t registers[128];
} mpu6050_t;

/* Plugs it in or out: it sleeps when it has been out. */
void mpu6050_power(mpu6050_t *imu, bool present);

void mpu6050_attach(mpu6050_t *imu, avr_t *avr);

#endif
