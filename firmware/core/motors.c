#include "motors.h"

#include "counters.h"
#include "crc.h"
#include "hal.h"
#include "wheel_loop.h"

#define ARMED 0x5A3CU

/* What a restart leaves as it is, with the sum that tells whether it is whole. One of both alone does not unlatch. */
struct kept {
    uint16_t estop;
    uint16_t armed; /* ARMED, and nothing else, where no e-stop is in force */
    uint16_t check;
    uint8_t cause;
};

static struct kept kept HAL_KEPT;

static struct {
    struct motors_state now;
    uint32_t fed_us;
    uint32_t deadman_us; /* 0: none */
    uint8_t shut;        /* the stops of encoders that are shut out */
    uint8_t heard;       /* e-stops by the receive interrupt that are in force */
} motors;

static uint16_t check_of(const struct kept *value)
{
    uint16_t crc = crc_add(CRC_START, (uint8_t)(value->estop >> 8));
    crc = crc_add(crc, (uint8_t)(value->estop & 0xFFU));
    crc = crc_add(crc, (uint8_t)(value->armed >> 8));
    crc = crc_add(crc, (uint8_t)(value->armed & 0xFFU));
    return crc_add(crc, value->cause);
}

static void keep(uint16_t estop, bool is_stopped, uint8_t cause)
{
    kept.estop = estop;
    kept.armed = is_stopped ? 0U : ARMED;
    kept.cause = cause;
    kept.check = check_of(&kept);
}

static bool is_kept_stopped(void)
{
    return kept.armed != ARMED;
}

static void put(int16_t left, int16_t right)
{
    motors.now.duty[0] = left;
    motors.now.duty[1] = right;
    hal_motors_write(motors.now.duty);
}

/* With the interrupts shut, or in the timer's. */
static void stop(uint8_t stops)
{
    motors.now.stops |= stops;
    motors.now.mode = MODE_DUTY;
    put(0, 0);
}

uint8_t motors_start(uint8_t reset_cause)
{
    const bool is_whole = kept.check == check_of(&kept);
    uint8_t cause = reset_cause;
    if (reset_cause == (uint8_t)RESET_SOFTWARE) {
        cause = is_whole ? kept.cause : (uint8_t)RESET_DAMAGED;
    }
    if (reset_cause == (uint8_t)RESET_POWER_ON) {
        keep(0, false, cause);
    } else if (!is_whole) {
        keep(1, true, cause); /* nobody knows whether an e-stop was in force */
    } else {
        /* As it was left. */
    }
    motors.now.estop = kept.estop;
    motors.now.stops = is_kept_stopped() ? STOP_ESTOP : 0U;
    motors.now.mode = MODE_DUTY;
    motors.now.of = NO_SEQUENCE;
    motors.deadman_us = 0;
    motors.fed_us = 0;
    motors.heard = 0;
    motors.shut = 0;
    put(0, 0);
    return cause;
}

/* With the interrupts shut. A stop whose reason is still there stays. */
static void end_stops(uint8_t kept_stops)
{
    motors.now.stops = (uint8_t)((motors.now.stops & kept_stops) | motors.shut);
}

/* Whether a command may move the motors; it feeds the dead-man then. With the interrupts shut. */
static enum motion accept(bool is_stop, struct received received)
{
    const bool has_deadman = motors.deadman_us != 0U;
    const bool is_stale = has_deadman && ((uint32_t)(hal_micros() - received.at_us) >= motors.deadman_us);
    if (is_stale && !is_stop) {
        return MOTION_STALE;
    }
    if (is_stop) {
        end_stops((uint8_t)~(STOP_STALL | STOPS_OF_WHEELS));
    }
    if (!is_stop && ((motors.now.stops & (uint8_t)~STOP_DEADMAN) != 0U)) {
        return MOTION_STOPPED;
    }
    if ((received.has_sequence && !is_stale) || !has_deadman) {
        motors.fed_us = received.at_us;
        motors.now.stops &= (uint8_t)~STOP_DEADMAN;
    }
    if (received.has_sequence) {
        motors.now.of = received.sequence;
    }
    return MOTION_OBEYED;
}

static int16_t limited(int32_t duty)
{
    if (duty > FULL_DUTY) {
        return FULL_DUTY;
    }
    return (duty < -FULL_DUTY) ? (int16_t)-FULL_DUTY : (int16_t)duty;
}

enum motion motors_duty(const int32_t duty[WHEELS], struct received received)
{
    const hal_lock_t lock = hal_lock();
    const enum motion motion = accept((duty[0] == 0) && (duty[1] == 0), received);
    if (motion == MOTION_OBEYED) {
        motors.now.mode = MODE_DUTY;
        put(limited(duty[0]), limited(duty[1]));
    }
    hal_unlock(lock);
    return motion;
}

enum motion motors_speed(const int32_t mrad_s[WHEELS], struct received received)
{
    const hal_lock_t lock = hal_lock();
    const enum motion motion = accept(false, received);
    if (motion == MOTION_OBEYED) {
        if (motors.now.mode != MODE_WHEEL_LOOP) {
            wheel_loop_begin();
        }
        motors.now.mode = MODE_WHEEL_LOOP;
        wheel_loop_aim(mrad_s);
    }
    hal_unlock(lock);
    return motion;
}

static void latch(void)
{
    stop(STOP_ESTOP);
    motors.now.estop++;
    if (motors.now.estop == 0U) {
        motors.now.estop = 1;
    }
    keep(motors.now.estop, true, kept.cause);
}

void motors_estop(void)
{
    const hal_lock_t lock = hal_lock();
    latch();
    hal_unlock(lock);
}

void motors_hear(uint8_t heard)
{
    const hal_lock_t lock = hal_lock();
    while (motors.heard != heard) {
        motors.heard++;
        latch();
    }
    hal_unlock(lock);
}

bool motors_arm(int32_t number)
{
    if (number != (int32_t)motors.now.estop) {
        return false;
    }
    const hal_lock_t lock = hal_lock();
    end_stops(STOP_DEADMAN);
    keep(motors.now.estop, false, kept.cause);
    hal_unlock(lock);
    return true;
}

void motors_stall(void)
{
    const hal_lock_t lock = hal_lock();
    stop(STOP_STALL);
    hal_unlock(lock);
}

void motors_shut(uint8_t wheels)
{
    const hal_lock_t lock = hal_lock();
    motors.shut = (uint8_t)(wheels * STOP_STORM);
    if ((motors.now.stops & motors.shut) != motors.shut) {
        stop(motors.shut);
    }
    hal_unlock(lock);
}

void motors_begin_deadman(uint32_t deadman_us, uint32_t now_us)
{
    const hal_lock_t lock = hal_lock();
    if (motors.deadman_us == 0U) {
        motors.fed_us = now_us;
        motors.now.of = NO_SEQUENCE;
    }
    motors.deadman_us = deadman_us;
    hal_unlock(lock);
}

void motors_end_deadman(void)
{
    const hal_lock_t lock = hal_lock();
    motors.deadman_us = 0;
    stop(STOP_DEADMAN);
    hal_unlock(lock);
}

struct motors_state motors_state(void)
{
    const hal_lock_t lock = hal_lock();
    const struct motors_state state = motors.now;
    hal_unlock(lock);
    return state;
}

void motors_tick(uint32_t now_us)
{
    wheel_loop_measure();
    const bool is_dead = (motors.now.stops & STOP_DEADMAN) != 0U;
    if ((motors.deadman_us != 0U) && !is_dead && ((uint32_t)(now_us - motors.fed_us) >= motors.deadman_us)) {
        stop(STOP_DEADMAN);
        counters.deadman++;
    }
    if (motors.now.mode == MODE_WHEEL_LOOP) {
        int16_t duty[WHEELS];
        const uint8_t lost = wheel_loop_run(duty);
        if (lost != 0U) {
            stop((uint8_t)(lost * STOP_LOST));
        } else {
            put(duty[0], duty[1]);
        }
    }
}

void motors_off_and_restart(uint8_t cause)
{
    const hal_lock_t lock = hal_lock();
    hal_motors_off();
    keep(kept.estop, is_kept_stopped(), cause);
    hal_unlock(lock);
    hal_restart();
}
