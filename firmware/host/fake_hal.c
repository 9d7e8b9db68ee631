/* The host build's hardware: variables, and time that is told. Python sets and reads it through these functions. */
#include "fake_hal.h"
#include "simulated.h"

#include <string.h>

struct fake_hal fake;

uint32_t hal_micros(void)
{
    return fake.micros;
}

uint16_t hal_edge_micros(void)
{
    return (uint16_t)fake.micros;
}

/* A real interrupt may come just before a lock: the one that is asked for comes before the lock of that number. */
hal_lock_t hal_lock(void)
{
    fake.locks++;
    if ((fake.tick_at_lock != 0U) && (fake.locks == fake.tick_at_lock) && (fake.depth == 0U)) {
        fake.tick_at_lock = 0;
        fake.micros = fake.tick_micros;
        firmware_tick();
    }
    fake.depth++;
    return fake.depth;
}

void hal_unlock(hal_lock_t state)
{
    if (state != fake.depth) {
        fake.lock_errors++;
    }
    fake.depth--;
}

void hal_motors_write(const int16_t duty[WHEELS])
{
    memcpy(fake.duty, duty, sizeof(fake.duty));
    fake.motor_writes++;
}

void hal_motors_off(void)
{
    memset(fake.duty, 0, sizeof(fake.duty));
}

uint8_t hal_encoder_levels(uint8_t wheel)
{
    return fake.levels[wheel];
}

uint8_t hal_encoders_tick(void)
{
    return fake.shut;
}

void hal_encoders_open(void)
{
    fake.shut = 0;
    fake.opened++;
}

void hal_start_sending(void)
{
    fake.is_sending = true;
    simulated_line_ended();
}

void hal_ultrasonic_trigger(void)
{
    fake.pings++;
}

bool hal_imu_present(void)
{
    return fake.has_imu;
}

bool hal_battery(uint16_t *adc)
{
    const bool is_new = fake.is_new_battery;
    fake.is_new_battery = false;
    *adc = fake.battery;
    return is_new;
}

bool hal_current(uint8_t wheel, uint16_t *adc)
{
    const bool is_new = fake.is_new_current[wheel];
    fake.is_new_current[wheel] = false;
    *adc = fake.current[wheel];
    return is_new;
}

bool hal_imu(int16_t counts[6], uint32_t *at_us)
{
    if (!fake.is_new_imu) {
        return false;
    }
    fake.is_new_imu = false;
    memcpy(counts, fake.imu, sizeof(fake.imu));
    *at_us = fake.imu_us;
    return true;
}

void hal_let_interrupts_in(void) {}

void hal_say_for_ever(const char *text)
{
    (void)text;
}

void hal_watchdog_start(void)
{
    fake.has_watchdog = true;
}

void hal_watchdog_feed(void)
{
    fake.feeds++;
}

void hal_restart(void)
{
    fake.restarts++;
}
