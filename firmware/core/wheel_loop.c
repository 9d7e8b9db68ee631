#include "wheel_loop.h"

#include <string.h>

#include "encoder.h"
#include "motors.h"

#if HAS_WHEEL_LOOP

#define EDGES_KEPT 5U           /* milliseconds with edges: a whole period at low speed, as its phases differ */
#define WINDOW_US 10000U        /* older edges are not waited for: that would be late */
#define SILENT_EDGES 2U         /* in the time since the last edge at most: they need not be evenly apart */
#define STANDSTILL_US 250000U   /* no edge for that long: it stands */
#define MOST_MEASURED 100000    /* mrad/s */
#define MOST_DRIVE 65280L       /* 1/256 duty */
#define MOST_INTEGRATED 12500   /* mrad/s: a larger error is none of a load */
#define INTEGRAL_SCALE 4096     /* of 1/256 duty */
#define HALF_TURN_NANORAD 3141592654U
#define TURN_MRAD 6283U
#define LEAST_LOST_DUTY 128 /* less may not overcome the friction */
#define LOST_DUTY_MS 63750U   /* full duty for 250 ms, half of it for 500 */
#define LEAST_PROGRESS 2 /* counts: a channel that is dead leaves one, to and fro */

struct edge {
    uint32_t at_us;
    uint16_t count;
};

struct wheel {
    struct edge edges[EDGES_KEPT]; /* the newest is edges[newest] */
    uint8_t newest;
    int32_t aim;      /* mrad/s */
    int32_t ramp;     /* 1/1024 mrad/s: what the acceleration allows by now */
    int32_t integral; /* 1/256 duty / INTEGRAL_SCALE */
    uint16_t lost_duty_ms; /* duty times milliseconds that have not turned it their way, */
    uint16_t lost_count;   /* from this count on */
};

static struct wheel wheels[WHEELS];
static uint32_t loop_us; /* the time of the last measurement */

/* Parameters in binary fractions, so that a millisecond has no division but that of the speed. */
static struct {
    /* COUNTS: mrad us per count. KP, FEEDFORWARD: 1/256 duty per 1.024 rad/s. KI: the integral's unit a millisecond, per
     * 1/64 mrad/s. STATIC: 1/256 duty. ACCELERATION: the ramp's step in a millisecond; 0: at once. BATTERY: 1/256. */
    int32_t of[PARAMETERS];
    uint32_t most_counts; /* that can be multiplied with that of COUNTS */
    int32_t most_mrad_s;
    uint16_t counts;
    uint8_t set;          /* a bit for each parameter */
} gains;

static volatile bool is_beginning;

/* A wheel that stands: its edges grow no older, as the clock wraps after 71 minutes. */
static void stand(struct wheel *wheel, uint16_t count)
{
    for (uint8_t edge = 0; edge < EDGES_KEPT; edge++) {
        wheel->edges[edge].at_us = loop_us - STANDSTILL_US;
        wheel->edges[edge].count = count;
    }
}

void wheel_loop_start(void)
{
    (void)memset(&gains, 0, sizeof(gains));
    (void)memset(wheels, 0, sizeof(wheels));
    gains.of[PARAMETER_BATTERY] = 256;
    is_beginning = false;
    loop_us = hal_micros();
    for (uint8_t wheel = 0; wheel < WHEELS; wheel++) {
        stand(&wheels[wheel], 0);
    }
}

bool wheel_loop_is_set_up(void)
{
    const uint8_t needed = (uint8_t)((1U << PARAMETER_ACCELERATION) - 1U);
    return (gains.set & needed) == needed;
}

/* From thousandths to 1/1024: round(value * 1.024); value is 1000000 at most. */
static uint32_t binary(uint32_t value)
{
    return ((value * 128U) + 62U) / 125U;
}

static uint32_t converted(enum parameter parameter, uint32_t value)
{
    switch (parameter) {
    case PARAMETER_COUNTS:
        return (HALF_TURN_NANORAD / value) * 2U;
    case PARAMETER_KI:
        return ((value * 4096U) + 7812U) / 15625U; /* 0.262144: 4096 * 64 / 10^6 */
    case PARAMETER_STATIC:
    case PARAMETER_BATTERY:
        return value;
    default:
        return binary(value);
    }
}

/* No division with the interrupts shut: it is so long on an AVR that edges would be lost. */
void wheel_loop_set(enum parameter parameter, uint32_t value)
{
    const uint32_t next = converted(parameter, value);
    uint32_t most_counts = gains.most_counts;
    int32_t most_mrad_s = gains.most_mrad_s;
    if (parameter == PARAMETER_COUNTS) {
        most_counts = UINT32_MAX / next;
        most_mrad_s = (int32_t)((HAL_MOST_EDGES_S * TURN_MRAD) / value);
    }
    const hal_lock_t lock = hal_lock();
    gains.of[parameter] = (int32_t)next;
    gains.most_counts = most_counts;
    gains.most_mrad_s = most_mrad_s;
    if (parameter == PARAMETER_COUNTS) {
        gains.counts = (uint16_t)value;
    }
    gains.set = (uint8_t)(gains.set | (1U << (uint8_t)parameter));
    hal_unlock(lock);
}

uint16_t wheel_loop_counts(void)
{
    return gains.counts;
}

int32_t wheel_loop_most_mrad_s(void)
{
    return gains.most_mrad_s;
}

void wheel_loop_measure(void)
{
    for (uint8_t index = 0; index < WHEELS; index++) {
        struct wheel *wheel = &wheels[index];
        const hal_lock_t lock = hal_lock();
        const uint16_t count = encoders[index].count;
        const uint16_t edge_micros = encoders[index].edge_micros;
        loop_us = hal_micros(); /* after the edge, whenever that came */
        hal_unlock(lock);
        if (count == wheel->edges[wheel->newest].count) {
            if ((loop_us - wheel->edges[wheel->newest].at_us) >= STANDSTILL_US) {
                stand(wheel, count);
            }
        } else {
            wheel->newest = (uint8_t)((wheel->newest + 1U) % EDGES_KEPT);
            wheel->edges[wheel->newest].count = count;
            wheel->edges[wheel->newest].at_us = loop_us - (uint16_t)((uint16_t)loop_us - edge_micros);
        }
    }
}

static int32_t between(int32_t value, int32_t most)
{
    if (value > most) {
        return most;
    }
    return (value < -most) ? -most : value;
}

/* Counts over microseconds in mrad/s, MOST_MEASURED at most. */
static int32_t speed_of(uint16_t counts, uint32_t micros)
{
    if ((micros == 0U) || (counts > gains.most_counts)) {
        return MOST_MEASURED;
    }
    const uint32_t speed = (counts * (uint32_t)gains.of[PARAMETER_COUNTS]) / micros;
    return (speed > (uint32_t)MOST_MEASURED) ? MOST_MEASURED : (int32_t)speed;
}

/* By the edges of the last milliseconds that had some, in mrad/s. */
static int32_t measured(const struct wheel *wheel)
{
    const struct edge *newest = &wheel->edges[wheel->newest];
    const uint32_t silent_us = loop_us - newest->at_us;
    if ((silent_us >= STANDSTILL_US) || (gains.of[PARAMETER_COUNTS] == 0)) {
        return 0;
    }
    int16_t step = 0;
    uint32_t span_us = 0;
    for (uint8_t back = 1; back < EDGES_KEPT; back++) {
        const struct edge *edge = &wheel->edges[(wheel->newest + EDGES_KEPT - back) % EDGES_KEPT];
        const uint32_t age_us = newest->at_us - edge->at_us;
        if ((back > 1U) && (age_us > WINDOW_US)) {
            break;
        }
        step = (int16_t)(uint16_t)(newest->count - edge->count);
        span_us = age_us;
        if ((step >= 4) || (step <= -4)) {
            break;
        }
    }
    if (step == 0) {
        return 0;
    }
    const uint16_t counts = (uint16_t)((step < 0) ? -step : step);
    int32_t speed = speed_of(counts, span_us);
    const int32_t most = speed_of(SILENT_EDGES, silent_us);
    speed = (speed > most) ? most : speed;
    return (step < 0) ? -speed : speed;
}

void wheel_loop_begin(void)
{
    is_beginning = true;
}

static void begin(struct wheel *wheel)
{
    wheel->ramp = between(measured(wheel), MOST_SPEED_MRAD_S) * 1024;
    wheel->integral = 0;
    wheel->lost_duty_ms = 0;
}

void wheel_loop_aim(const int32_t mrad_s[WHEELS])
{
    for (uint8_t index = 0; index < WHEELS; index++) {
        wheels[index].aim = mrad_s[index];
    }
}

static void run_ramp(struct wheel *wheel)
{
    const int32_t aim = wheel->aim * 1024;
    const int32_t step = gains.of[PARAMETER_ACCELERATION];
    wheel->ramp = (step == 0) ? aim : (wheel->ramp + between(aim - wheel->ramp, step));
}

/* One millisecond of one wheel. A wheel that is to stand gets no duty, which brakes. */
static int16_t run(struct wheel *wheel)
{
    run_ramp(wheel);
    const int32_t target = wheel->ramp / 1024;
    if (target == 0) {
        wheel->integral = 0;
        return 0;
    }
    const int32_t error = between(target - measured(wheel), MOST_MEASURED);
    const int32_t friction = (target > 0) ? gains.of[PARAMETER_STATIC] : -gains.of[PARAMETER_STATIC];
    const int32_t forward = ((gains.of[PARAMETER_FEEDFORWARD] * target) / 1024) + friction;
    const int32_t proportional = (gains.of[PARAMETER_KP] * error) / 1024;
    const int32_t drive = forward + proportional + (wheel->integral / INTEGRAL_SCALE);
    const bool is_saturated = (drive >= MOST_DRIVE) ? (error > 0) : ((drive <= -MOST_DRIVE) && (error < 0));
    if (!is_saturated) {
        const int32_t more = wheel->integral + ((gains.of[PARAMETER_KI] * between(error, MOST_INTEGRATED)) / 64);
        wheel->integral = between(more, MOST_DRIVE * INTEGRAL_SCALE);
    }
    const int32_t full = between(drive, MOST_DRIVE * 4) * gains.of[PARAMETER_BATTERY];
    const int32_t compensated = between(full / 256, MOST_DRIVE);
    return (int16_t)((compensated + ((compensated < 0) ? -128 : 128)) / 256);
}

/* A wheel that coasts against its duty comes to rest sooner, and then goes its way. */
static bool is_lost(struct wheel *wheel, int16_t duty)
{
    const uint16_t magnitude = (uint16_t)((duty < 0) ? -duty : duty);
    const uint16_t count = wheel->edges[wheel->newest].count;
    const int16_t step = (int16_t)(uint16_t)(count - wheel->lost_count);
    const bool has_turned = (duty < 0) ? (step <= -LEAST_PROGRESS) : (step >= LEAST_PROGRESS);
    if (magnitude < (uint16_t)LEAST_LOST_DUTY) {
        wheel->lost_duty_ms = 0;
        return false;
    }
    if ((wheel->lost_duty_ms == 0U) || has_turned) {
        wheel->lost_duty_ms = 0;
        wheel->lost_count = count;
    }
    wheel->lost_duty_ms = (uint16_t)(wheel->lost_duty_ms + magnitude);
    return wheel->lost_duty_ms > LOST_DUTY_MS;
}

uint8_t wheel_loop_run(int16_t duty[WHEELS])
{
    uint8_t lost = 0;
    for (uint8_t index = 0; index < WHEELS; index++) {
        if (is_beginning) {
            begin(&wheels[index]);
        }
        duty[index] = run(&wheels[index]);
        if (is_lost(&wheels[index], duty[index])) {
            lost = (uint8_t)(lost | (1U << index));
        }
    }
    is_beginning = false;
    return lost;
}

#else

void wheel_loop_start(void) {}

bool wheel_loop_is_set_up(void)
{
    return false;
}

void wheel_loop_set(enum parameter parameter, uint32_t value)
{
    (void)parameter;
    (void)value;
}

void wheel_loop_begin(void) {}

void wheel_loop_aim(const int32_t mrad_s[WHEELS])
{
    (void)mrad_s;
}

void wheel_loop_measure(void) {}

uint16_t wheel_loop_counts(void)
{
    return 0;
}

int32_t wheel_loop_most_mrad_s(void)
{
    return 0;
}

uint8_t wheel_loop_run(int16_t duty[WHEELS])
{
    for (uint8_t index = 0; index < WHEELS; index++) {
        duty[index] = 0;
    }
    return 0;
}

#endif
