#include "firmware.h"

#include <stddef.h>

#include "commands.h"
#include "encoder.h"
#include "hal.h"
#include "motors.h"
#include "receive.h"
#include "report.h"
#include "sensors.h"
#include "transmit.h"
#include "wheel_loop.h"

#define HUNG_US 200000U
#define SHUT_MS 1000U

/* The proof of life of each half for the other: both are needed to go on. */
static struct {
    uint32_t cycle_us;       /* when the main loop completed a cycle; read by the tick */
    volatile bool has_ticked; /* since that cycle */
    uint16_t shut_ms;        /* for how long an encoder has been shut out; the tick's */
    volatile bool is_over;   /* a restart was asked for */
} life;

static void note_cycle(void)
{
    const hal_lock_t lock = hal_lock();
    life.cycle_us = hal_micros();
    hal_unlock(lock);
}

/* What the receive interrupt has heard is in force a millisecond later at most, whatever the main loop does. */
static void obey_estops(void)
{
    motors_hear(receive_estops());
}

static void restart(uint8_t cause)
{
    life.is_over = true;
    obey_estops();
    motors_off_and_restart(cause);
}

void firmware_start(uint8_t reset_cause)
{
    life.is_over = false;
    life.has_ticked = false;
    life.shut_ms = 0;
    wheel_loop_start();
    const uint8_t cause = motors_start(reset_cause);
    transmit_start();
    receive_start(reset_cause == (uint8_t)RESET_SOFTWARE);
    encoder_start();
    sensors_start();
    commands_start();
    note_cycle();
    hal_watchdog_start();
    hal_let_interrupts_in(); /* before the IMU is asked: an e-stop may come in meanwhile */
    report_start(cause);
}

static void run_cycle(void)
{
    if (report_run()) {
        note_cycle();
        if (life.has_ticked) {
            life.has_ticked = false;
            hal_watchdog_feed();
        }
    }
}

/* The lines that wait now, each in its turn; a cycle that becomes due comes in between. */
static void take_lines(void)
{
    uint8_t left = receive_waiting();
    const struct line *line = receive_line(); /* also without a whole one: what came of it makes room */
    while (line != NULL) {
        commands_take(line);
        line = NULL;
        if ((left > 1U) && !commands_is_resetting()) {
            run_cycle();
            line = receive_line();
        }
        left--;
    }
}

/* The cycle comes before the lines, which take longer: so cycles begin with their millisecond. */
void firmware_pass(void)
{
    if (life.is_over) {
        return;
    }
    obey_estops();
    commands_run();
    sensors_run();
    if (commands_is_resetting()) {
        if (commands_is_reset_due()) {
            restart(RESET_COMMAND);
        }
        return;
    }
    run_cycle();
    take_lines();
}

/* A loose wire makes more edges than a processor can count: such a channel is shut out, and tried again after a second. */
static void shed_storms(void)
{
    const uint8_t shut = hal_encoders_tick();
    motors_shut(shut);
    life.shut_ms = (shut != 0U) ? (uint16_t)(life.shut_ms + 1U) : 0U;
    if (life.shut_ms >= SHUT_MS) {
        life.shut_ms = 0;
        hal_encoders_open();
    }
}

void firmware_tick(void)
{
    const uint32_t now_us = hal_micros();
    if (life.is_over) {
        return;
    }
    life.has_ticked = true;
    report_tick();
    shed_storms();
    obey_estops();
    motors_tick(now_us);
    const hal_lock_t lock = hal_lock();
    const uint32_t silent_us = now_us - life.cycle_us;
    hal_unlock(lock);
    if (silent_us >= HUNG_US) {
        restart(RESET_HUNG);
    }
}

void firmware_watchdog(void)
{
    restart(RESET_WATCHDOG);
}
