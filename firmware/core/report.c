#include "report.h"

#include "commands.h"
#include "counters.h"
#include "encoder.h"
#include "hal.h"
#include "image.h"
#include "motors.h"
#include "sensors.h"
#include "transmit.h"
#include "wheel_loop.h"

#define EDGES_A_PERIOD 4U /* of each period of an encoder all four edges count */
#define CLASSIC_PERIOD_MS 20U
#define CHECKED_PERIOD_MS 10U
#define CLASSIC_CYCLES_A_SECOND 50U
#define CHECKED_CYCLES_A_SECOND 100U
#define MOST_BYTES_OF_MOTION 90U /* `t e s` of the checked mode: 28 + 35 + 25 */
#define MOST_BYTES_OF_CLASSIC 130U

static struct {
    volatile uint16_t ms; /* by the timer's interrupt */
    uint16_t due_ms;
    uint32_t previous_us;
    uint8_t number; /* of the cycle in its second */
    bool is_state_due;
    struct motors_state sent; /* with the last `state` */
    uint8_t reset_cause;
} report;

static const char banner[] HAL_FLASH = "Initializing I2C devices...\r\nTesting device connections...\r\n";
static const char imu_answers[] HAL_FLASH = "MPU6050 connection successful\r\n";
static const char imu_silent[] HAL_FLASH = "MPU6050 connection failed\r\n";
static const char new_line[] HAL_FLASH = "\n";
static const char no_decimals[] HAL_FLASH = ".00";
static const char end_of_imu[] HAL_FLASH = "\r\n\n";
static const char word_firmware[] HAL_FLASH = "firmware";
static const char word_time[] HAL_FLASH = "t";
static const char word_encoders[] HAL_FLASH = "e";
static const char word_duty[] HAL_FLASH = "s";
static const char word_ultrasonic[] HAL_FLASH = "u";
static const char word_imu[] HAL_FLASH = "i";
static const char word_battery[] HAL_FLASH = "b";
static const char word_current[] HAL_FLASH = "a";
static const char word_state[] HAL_FLASH = "state";
static const char word_counters[] HAL_FLASH = "counters";
static const char word_about[] HAL_FLASH = "about";

static void send_name(void)
{
    line_begin(word_firmware);
    line_unsigned(FIRMWARE_PROTO);
    line_unsigned(FIRMWARE_MAJOR);
    line_unsigned(FIRMWARE_MINOR);
    line_unsigned(HAL_BOARD);
    line_unsigned(HAL_CAPABILITIES);
    line_unsigned(report.reset_cause);
    line_text(new_line);
    (void)line_end();
}

void report_start(uint8_t reset_cause)
{
    report.reset_cause = reset_cause;
    report.previous_us = hal_micros();
    report_begin(false);
    line_begin(banner);
    line_text(hal_imu_present() ? imu_answers : imu_silent);
    (void)line_end();
    send_name();
}

void report_about(void)
{
    line_begin(word_about);
    line_unsigned(EDGES_A_PERIOD);
    line_unsigned(HAL_MOST_EDGES_S);
    line_unsigned(image_build());
    line_unsigned(wheel_loop_counts());
    (void)line_end_sealed();
}

void report_tick(void)
{
    report.ms++;
}

static uint16_t milliseconds(void)
{
    const hal_lock_t lock = hal_lock();
    const uint16_t ms = report.ms;
    hal_unlock(lock);
    return ms;
}

void report_begin(bool is_checked)
{
    report.due_ms = (uint16_t)(milliseconds() + (is_checked ? CHECKED_PERIOD_MS : CLASSIC_PERIOD_MS));
    report.number = 0;
    report.is_state_due = true;
}

uint16_t report_due_in_ms(void)
{
    const uint16_t wait_ms = (uint16_t)(report.due_ms - milliseconds());
    return (wait_ms > (UINT16_MAX / 2U)) ? 0U : wait_ms;
}

static void send_imu_axes(void)
{
    line_begin(word_imu);
    for (uint8_t axis = 0; axis < IMU_AXES; axis++) {
        line_signed(sensors.imu[axis]);
    }
}

static void send_classic_duty(const struct motors_state *motors)
{
    line_begin(word_duty);
    for (uint8_t wheel = 0; wheel < WHEELS; wheel++) {
        line_signed(motors->duty[wheel]);
        line_text(no_decimals);
    }
    line_text(new_line);
    (void)line_end();
}

static void send_encoders(void)
{
    int32_t counts[WHEELS];
    encoder_counts(counts);
    line_begin(word_encoders);
    for (uint8_t wheel = 0; wheel < WHEELS; wheel++) {
        line_signed(counts[wheel]);
    }
}

static void send_classic(uint32_t now_us, const struct motors_state *motors)
{
    line_begin(word_time);
    line_unsigned(now_us);
    line_decimals((now_us - report.previous_us + 5000U) / 10000U, 2);
    line_text(new_line);
    (void)line_end();
    send_encoders();
    line_text(new_line);
    (void)line_end();
    line_begin(word_ultrasonic);
    line_unsigned(sensors.distance_cm);
    line_text(new_line);
    (void)line_end();
    send_classic_duty(motors);
    if (sensors.has_imu) {
        send_imu_axes();
        line_text(end_of_imu);
        (void)line_end();
    }
    line_begin(word_battery);
    line_unsigned(sensors.battery);
    line_text(no_decimals);
    line_text(new_line);
    (void)line_end();
}

/* `t e s`, the same in every cycle. */
static void send_motion(uint32_t now_us, const struct motors_state *motors)
{
    line_begin(word_time);
    line_unsigned(now_us);
    line_decimals((now_us - report.previous_us + 500U) / 1000U, 3);
    (void)line_end_sealed();
    send_encoders();
    (void)line_end_sealed();
    line_begin(word_duty);
    for (uint8_t wheel = 0; wheel < WHEELS; wheel++) {
        line_signed(motors->duty[wheel]);
    }
    line_unsigned(motors->of);
    (void)line_end_sealed();
}

static void send_state(const struct motors_state *motors)
{
    line_begin(word_state);
    line_unsigned(motors->mode);
    line_unsigned(motors->stops);
    line_unsigned(motors->estop);
    line_unsigned(report.reset_cause);
    if (line_end_sealed()) {
        report.sent = *motors;
        report.is_state_due = false;
    }
}

static void send_counters(void)
{
    const hal_lock_t lock = hal_lock();
    const struct counters now = counters;
    hal_unlock(lock);
    line_begin(word_counters);
    line_unsigned(now.crc);
    line_unsigned(now.refused);
    line_unsigned(now.overrun);
    line_unsigned(now.gaps);
    line_unsigned(now.deadman);
    line_unsigned(now.late);
    (void)line_end_sealed();
}

static void send_distance(uint32_t now_us)
{
    line_begin(word_ultrasonic);
    line_unsigned(sensors.distance_cm);
    line_unsigned(now_us - sensors.distance_us);
    if (line_end_sealed()) {
        sensors.is_new_distance = false;
    }
}

static void send_imu(uint32_t now_us)
{
    send_imu_axes();
    line_unsigned(now_us - sensors.imu_us);
    if (line_end_sealed()) {
        sensors.is_new_imu = false;
    }
}

static void send_level(const char *word, bool has_channel, uint8_t channel, uint16_t adc)
{
    line_begin(word);
    if (has_channel) {
        line_unsigned(channel);
    }
    line_unsigned(adc);
    (void)line_end_sealed();
}

/* Each in a cycle of its own, as far as possible: all at once would not fit the ring. */
static void send_readings(uint32_t now_us)
{
    const uint8_t number = report.number;
    if (sensors.is_new_distance && ((number % 5U) == 3U)) {
        send_distance(now_us);
    }
    if (sensors.is_new_imu && ((number % 4U) == 1U)) {
        send_imu(now_us);
    }
    if (sensors.has_battery && ((number % 20U) == 4U)) {
        send_level(word_battery, false, 0, sensors.battery);
    }
    for (uint8_t wheel = 0; wheel < WHEELS; wheel++) {
        if (sensors.has_current[wheel] && ((number % 10U) == (6U * wheel))) {
            send_level(word_current, true, wheel, sensors.current[wheel]);
        }
    }
    if (number == 14U) {
        send_counters();
    }
}

static void send_checked(uint32_t now_us, const struct motors_state *motors)
{
    if (transmit_room() >= MOST_BYTES_OF_MOTION) {
        send_motion(now_us, motors);
    }
    const bool is_changed = (motors->mode != report.sent.mode) || (motors->stops != report.sent.stops) ||
                            (motors->estop != report.sent.estop);
    if (is_changed || report.is_state_due || ((report.number % 20U) == 2U)) {
        send_state(motors);
    }
    send_readings(now_us);
}

/* Whether a cycle is due; then the next one is a period later, or from now if this one is as late as that. */
static bool take_due(uint16_t period_ms)
{
    const uint16_t now_ms = milliseconds();
    const uint16_t late_ms = (uint16_t)(now_ms - report.due_ms);
    if (late_ms > (UINT16_MAX / 2U)) {
        return false;
    }
    if (late_ms >= 1U) {
        counters.late++;
    }
    report.due_ms = (uint16_t)(((late_ms >= period_ms) ? now_ms : report.due_ms) + period_ms);
    return true;
}

bool report_run(void)
{
    const bool is_checked = commands_is_checked();
    if (!take_due(is_checked ? CHECKED_PERIOD_MS : CLASSIC_PERIOD_MS)) {
        return false;
    }
    const uint32_t now_us = hal_micros();
    if (sensors_find_stall(is_checked ? (uint8_t)10U : (uint8_t)20U)) {
        motors_stall();
    }
    const struct motors_state motors = motors_state();
    if (is_checked) {
        send_checked(now_us, &motors);
    } else if (transmit_room() >= MOST_BYTES_OF_CLASSIC) {
        send_classic(now_us, &motors);
        if (report.number == (CLASSIC_CYCLES_A_SECOND - 1U)) {
            send_name();
        }
    } else {
        /* The line is slower than the cycle: this one's lines are left out. */
    }
    report.previous_us = now_us;
    const uint8_t cycles = is_checked ? CHECKED_CYCLES_A_SECOND : CLASSIC_CYCLES_A_SECOND;
    report.number = (uint8_t)((report.number + 1U) % cycles);
    return true;
}
