/* The newest reading of each sensor, taken without waiting for any. Main loop only, but for firmware_echo. */
#ifndef SENSORS_H
#define SENSORS_H

#include <stdbool.h>
#include <stdint.h>

#include "firmware.h"

#define IMU_AXES 6U

struct sensors {
    bool has_imu; /* a reading, since the start */
    bool has_battery;
    bool has_current[WHEELS];
    bool is_new_imu; /* since the host was told */
    bool is_new_distance;
    int16_t imu[IMU_AXES];
    uint32_t imu_us;
    uint16_t distance_cm; /* 0: no echo */
    uint32_t distance_us;
    uint16_t battery;
    uint16_t current[WHEELS];
};

extern struct sensors sensors;

void sensors_start(void);

/* Takes what is ready, and asks the ultrasonic sensor 20 times a second. Each pass. */
void sensors_run(void);

/* Current above which a motor stalls, in ADC counts; 0: no limit. */
void sensors_limit_current(uint16_t adc);

/* Whether a motor has now been above the limit for half a second. Once a cycle, which takes this long. */
bool sensors_find_stall(uint8_t cycle_ms);

#endif
