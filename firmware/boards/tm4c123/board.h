/* The Tiva-C LaunchPad (EK-TM4C123GXL). Never run on a physical board: see firmware/README.md. */
#ifndef BOARD_H
#define BOARD_H

#include "cortex_m.h"

#define HAL_BOARD BOARD_TM4C123
#define HAL_CAPABILITIES \
    (CAPABILITY_WHEEL_LOOP | CAPABILITY_ULTRASONIC | CAPABILITY_IMU | CAPABILITY_BATTERY)

#endif
