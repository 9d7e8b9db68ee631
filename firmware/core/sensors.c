#include "sensors.h"

#include <string.h>

#include "hal.h"

#define PING_PERIOD_US 50000U
#define ECHO_US_PER_CM 58U
#define STALL_MS 500U

struct sensors sensors;

static struct {
    uint32_t pinged_us;
    uint32_t rose_us;  /* these four belong to the echo's interrupt */
    uint32_t width_us;
    bool is_high;
    bool is_complete;
    bool is_awaited;
} echo;

static struct {
    uint16_t limit;
    uint16_t above_ms[WHEELS];
} current;

void sensors_start(void)
{
    (void)memset(&sensors, 0, sizeof(sensors));
    (void)memset(&echo, 0, sizeof(echo));
    (void)memset(&current, 0, sizeof(current));
    echo.pinged_us = hal_micros();
}

void firmware_echo(bool rising, uint32_t micros)
{
    if (rising) {
        echo.rose_us = micros;
    } else if (echo.is_high) {
        echo.width_us = micros - echo.rose_us;
        echo.is_complete = true;
    } else {
        /* A fall without a rise: the board started in the middle of an echo. */
    }
    echo.is_high = rising;
}

static void note_distance(uint32_t width_us, uint32_t at_us)
{
    const uint32_t cm = width_us / ECHO_US_PER_CM;
    sensors.distance_cm = (cm > (uint32_t)INT16_MAX) ? (uint16_t)INT16_MAX : (uint16_t)cm;
    sensors.distance_us = at_us;
    sensors.is_new_distance = true;
    echo.is_awaited = false;
}

static void run_ultrasonic(void)
{
    const hal_lock_t lock = hal_lock();
    const bool is_complete = echo.is_complete;
    const bool is_high = echo.is_high;
    const uint32_t width_us = echo.width_us;
    const uint32_t fell_us = echo.rose_us + width_us;
    echo.is_complete = false;
    hal_unlock(lock);
    if (is_complete && echo.is_awaited) {
        note_distance(width_us, fell_us);
    }
    const uint32_t now_us = hal_micros();
    if ((uint32_t)(now_us - echo.pinged_us) < PING_PERIOD_US) {
        return;
    }
    echo.pinged_us = now_us;
    if (echo.is_awaited) {
        note_distance(0, now_us);
    }
    if (!is_high) {
        echo.is_awaited = true;
        hal_ultrasonic_trigger();
    }
}

void sensors_run(void)
{
    if ((HAL_CAPABILITIES & CAPABILITY_ULTRASONIC) != 0) {
        run_ultrasonic();
    }
    if (hal_imu(sensors.imu, &sensors.imu_us)) {
        sensors.has_imu = true;
        sensors.is_new_imu = true;
    }
    if (hal_battery(&sensors.battery)) {
        sensors.has_battery = true;
    }
    for (uint8_t wheel = 0; wheel < WHEELS; wheel++) {
        if (hal_current(wheel, &sensors.current[wheel])) {
            sensors.has_current[wheel] = true;
        }
    }
}

void sensors_limit_current(uint16_t adc)
{
    current.limit = adc;
}

bool sensors_find_stall(uint8_t cycle_ms)
{
    bool is_stalled = false;
    for (uint8_t wheel = 0; wheel < WHEELS; wheel++) {
        const bool is_above = (current.limit != 0U) && (sensors.current[wheel] > current.limit);
        current.above_ms[wheel] = is_above ? (uint16_t)(current.above_ms[wheel] + cycle_ms) : 0U;
        if (current.above_ms[wheel] >= STALL_MS) {
            current.above_ms[wheel] = 0;
            is_stalled = true;
        }
    }
    return is_stalled;
}
