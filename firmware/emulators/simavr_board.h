/*
 * An ATmega328P in simavr, wired as the pin table of firmware/README.md says: a serial line, two encoders, two motor
 * drivers, an ultrasonic sensor, an MPU-6050 and a battery. Deterministic: nothing but the calls below moves its time,
 * which is counted in cycles of 1/16 us.
 */
#ifndef SIMAVR_BOARD_H
#define SIMAVR_BOARD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct board board_t;

typedef struct {
    uint64_t at_cycle;
    int16_t duty[2];
} board_duty_t;

typedef struct {
    uint64_t at_cycle;
    uint64_t byte;
} board_byte_t;

/* Called when the sensor is triggered: how long its echo is in us, 0 for none. */
typedef uint32_t (*board_echo_t)(void);

/* Called when the IMU's readings are about to be read: writes three accelerations and three rates, raw counts. */
typedef void (*board_imu_t)(int16_t readings[6]);

/* NULL where the image cannot be read. */
board_t *board_open(const char *elf_path, board_echo_t echo, board_imu_t imu);
void board_close(board_t *board);

/* Runs until this cycle (a few more for the last instruction); false when the program has crashed. */
bool board_run(board_t *board, uint64_t to_cycle);
uint64_t board_cycle(const board_t *board);

/* A byte from the host that is complete at this cycle. */
void board_receive(board_t *board, uint8_t byte, uint64_t at_cycle);

/* The wheel turns evenly from one angle to another, in quadrature counts, forward positive, during this time. */
void board_turn(board_t *board, unsigned wheel, double from_counts, double to_counts, uint64_t from_cycle,
                uint64_t to_cycle);

/* The voltage at the battery's ADC pin. */
void board_set_battery_mv(board_t *board, uint32_t millivolts);

/* Whether an MPU-6050 answers; one that comes anew sleeps. */
void board_set_imu(board_t *board, bool present);

/* The MPU-6050 holds SDA low for so many clocks of SCL, as one that a reset has cut off in a byte. */
void board_hold_sda(board_t *board, uint8_t clocks);

/* The reset pin, or with power_on the power: RAM keeps its content in the first case only. */
void board_reset(board_t *board, bool power_on);

/* What has left since the last call, each with the cycle at which it left; at most capacity entries. */
size_t board_take_bytes(board_t *board, board_byte_t *bytes, size_t capacity);

/*
 * Changes of what the motor drivers get, signed PWM of 255, oldest first: those that last 25 us at least, each with its time
 * within 50 us.
 */
size_t board_take_duties(board_t *board, board_duty_t *duties, size_t capacity);

/* What the drivers get now. */
void board_duty(const board_t *board, int16_t duty[2]);

/* How many cycles the processor has slept, with nothing to do. */
uint64_t board_slept_cycles(const board_t *board);

/* How many times the sensor was triggered. */
uint32_t board_pings(const board_t *board);

/* How many bytes or changes found their queue full and were lost: 0, or the caller has asked too seldom. */
uint32_t board_lost(const board_t *board);

/* The data memory (registers, I/O and SRAM), as the program sees it. */
uint8_t board_peek(const board_t *board, uint16_t address);
void board_poke(board_t *board, uint16_t address, uint8_t value);

#endif
