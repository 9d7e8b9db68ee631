#include "simulated.h"

#include <string.h>

#include "encoder.h"
#include "fake_hal.h"
#include "report.h"
#include "transmit.h"

#define TICK_US 1000U
#define ROUNDING_US 1e-3 /* of sums of the bytes' times */
#define RING_BYTES 255U
#define MOST_LINES 256U
#define MOST_WAITING 512U

struct sent_line {
    uint64_t leaves_us;
    uint32_t length;
};

/* The serial line: what waits in the ring, and what has left it and was not taken. Indices count on. */
static struct {
    double byte_us;
    double idle_us; /* when all of the ring has left */
    uint32_t in_ring;
    struct sent_line lines[MOST_LINES];
    uint32_t first_line, end_of_lines;
    uint8_t bytes[MOST_WAITING];
    uint32_t first_byte, end_of_bytes;
} wire;

static struct {
    uint64_t now_us;
    uint64_t tick_us; /* of the next interrupt of the timer */
    uint32_t micros_at_0;
    bool is_started;
    uint32_t restarts; /* that the program had asked for when it began */
    double counts[WHEELS];
    int16_t duty[WHEELS];
    uint64_t duty_since_us;
    uint64_t echo_us[2]; /* when it rises and falls; 0: it does not */
} board;

static bool is_running(void)
{
    return board.is_started && (fake.restarts == board.restarts);
}

static uint32_t micros_at(uint64_t at_us)
{
    return board.micros_at_0 + (uint32_t)at_us;
}

static uint64_t first(uint64_t one_us, uint64_t other_us)
{
    return (one_us < other_us) ? one_us : other_us;
}

static uint64_t rounded_up(double value)
{
    const uint64_t whole = (uint64_t)value;
    return ((double)whole < value) ? (whole + 1U) : whole;
}

static int64_t rounded_down(double value)
{
    const int64_t whole = (int64_t)value;
    return ((double)whole > value) ? (whole - 1) : whole;
}

void simulated_open(double byte_us)
{
    memset(&fake, 0, sizeof(fake));
    memset(&wire, 0, sizeof(wire));
    memset(&board, 0, sizeof(board));
    wire.byte_us = byte_us;
    board.tick_us = TICK_US;
}

void simulated_start(uint8_t cause, uint32_t micros)
{
    wire.in_ring = 0;
    wire.end_of_lines = wire.first_line;
    wire.end_of_bytes = wire.first_byte;
    wire.idle_us = (double)board.now_us;
    board.micros_at_0 = micros - (uint32_t)board.now_us;
    board.tick_us = board.now_us + TICK_US;
    board.is_started = true;
    board.restarts = fake.restarts;
    memset(board.echo_us, 0, sizeof(board.echo_us));
    fake.micros = micros;
    firmware_start(cause);
}

void simulated_line_ended(void)
{
    if (!board.is_started) {
        return; /* this board's time is not the simulator's */
    }
    const uint32_t in_ring = RING_BYTES - transmit_room();
    const uint32_t length = in_ring - wire.in_ring;
    const double now_us = (double)board.now_us;
    wire.idle_us = ((wire.idle_us > now_us) ? wire.idle_us : now_us) + ((double)length * wire.byte_us);
    wire.lines[wire.end_of_lines % MOST_LINES] = (struct sent_line){rounded_up(wire.idle_us - ROUNDING_US), length};
    wire.end_of_lines++;
    wire.in_ring = in_ring;
}

/* Takes out of the ring what has left it by now, as far as there is room for it. */
static void send_bytes(void)
{
    const double left_us = wire.idle_us - (double)board.now_us - ROUNDING_US;
    const uint64_t stay = (left_us > 0.0) ? rounded_up(left_us / wire.byte_us) : 0U;
    while ((wire.in_ring > stay) && ((wire.end_of_bytes - wire.first_byte) < MOST_WAITING)) {
        (void)firmware_next_byte(&wire.bytes[wire.end_of_bytes % MOST_WAITING]);
        wire.end_of_bytes++;
        wire.in_ring--;
    }
}

uint32_t simulated_take(uint8_t *bytes, uint64_t *left_us)
{
    const struct sent_line *line = &wire.lines[wire.first_line % MOST_LINES];
    if ((wire.first_line == wire.end_of_lines) || ((wire.end_of_bytes - wire.first_byte) < line->length)) {
        return 0;
    }
    for (uint32_t index = 0; index < line->length; index++) {
        bytes[index] = wire.bytes[(wire.first_byte + index) % MOST_WAITING];
    }
    wire.first_byte += line->length;
    wire.first_line++;
    *left_us = line->leaves_us;
    return line->length;
}

/* A wheel turns evenly from now on; its newest edge came where it crossed a whole count. */
static void turn(uint8_t wheel, double to, uint64_t to_us)
{
    const double from = board.counts[wheel];
    const int64_t step = rounded_down(to) - rounded_down(from);
    if (step != 0) {
        const double crossed = (double)((step > 0) ? rounded_down(to) : (rounded_down(to) + 1));
        const double since_us = (double)(to_us - board.now_us) * (crossed - from) / (to - from);
        encoders[wheel].count = (uint16_t)(encoders[wheel].count + (uint16_t)step);
        encoders[wheel].edge_micros = (uint16_t)(micros_at(board.now_us) + (uint32_t)(since_us + 0.5));
    }
    board.counts[wheel] = to;
}

static void take_echo(void)
{
    for (uint8_t edge = 0; edge < 2U; edge++) {
        if ((board.echo_us[edge] != 0U) && (board.echo_us[edge] <= board.now_us)) {
            firmware_echo(edge == 0U, micros_at(board.echo_us[edge]));
            board.echo_us[edge] = 0;
        }
    }
}

static void note_duty(void)
{
    if (memcmp(board.duty, fake.duty, sizeof(board.duty)) != 0) {
        memcpy(board.duty, fake.duty, sizeof(board.duty));
        board.duty_since_us = board.now_us;
    }
}

uint64_t simulated_duty_since_us(void)
{
    return board.duty_since_us;
}

/* To the next interrupt of the timer, or as far as is asked for. */
static void go_on(uint64_t to_us, const double counts[WHEELS])
{
    const uint64_t next_us = first(to_us, board.tick_us);
    const double share = (double)(next_us - board.now_us) / (double)(to_us - board.now_us);
    for (uint8_t wheel = 0; wheel < WHEELS; wheel++) {
        const double way = counts[wheel] - board.counts[wheel];
        turn(wheel, (next_us == to_us) ? counts[wheel] : (board.counts[wheel] + (way * share)), next_us);
    }
    board.now_us = next_us;
    fake.micros = micros_at(next_us);
    take_echo();
    send_bytes();
    if (is_running() && (next_us == board.tick_us)) {
        firmware_tick();
        firmware_pass();
        note_duty();
    }
    if (next_us == board.tick_us) {
        board.tick_us += TICK_US;
    }
}

uint64_t simulated_run(uint64_t to_us, double left, double right)
{
    const double counts[WHEELS] = {left, right};
    const uint32_t pings = fake.pings;
    const uint32_t restarts = fake.restarts;
    while ((board.now_us < to_us) && (fake.pings == pings) && (fake.restarts == restarts)) {
        go_on(to_us, counts);
    }
    return board.now_us;
}

void simulated_receive(const uint8_t *bytes, uint32_t length)
{
    if (!is_running()) {
        for (uint32_t index = 0; index < length; index++) {
            firmware_received_early(bytes[index]);
        }
        return;
    }
    host_receive(bytes, length);
    firmware_pass();
    note_duty();
}

void simulated_echo(uint64_t rises_us, uint64_t falls_us)
{
    board.echo_us[0] = rises_us;
    board.echo_us[1] = falls_us;
}

uint64_t simulated_next_us(void)
{
    const uint16_t wait_ms = report_due_in_ms();
    const uint64_t cycle_us = board.tick_us + ((wait_ms > 1U) ? ((wait_ms - 1U) * (uint64_t)TICK_US) : 0U);
    if (wire.first_line == wire.end_of_lines) {
        return cycle_us;
    }
    return first(cycle_us, wire.lines[wire.first_line % MOST_LINES].leaves_us);
}
