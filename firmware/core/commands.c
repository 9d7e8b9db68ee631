#include "commands.h"

#include <string.h>

#include "counters.h"
#include "hal.h"
#include "motors.h"
#include "report.h"
#include "request.h"
#include "sensors.h"
#include "transmit.h"
#include "wheel_loop.h"

#define SILENCE_US 2000000U
#define RESET_DELAY_US 50000U
#define LEAST_DEADMAN_MS 50
#define MOST_DEADMAN_MS 2000

enum refusal {
    OBEYED,
    REFUSED_WORD,
    REFUSED_COUNT,
    REFUSED_RANGE,
    REFUSED_STOPPED,
    REFUSED_NOT_SET_UP,
    REFUSED_ESTOP_NUMBER,
    REFUSED_PROTO,
    REFUSED_STALE /* is not answered */
};

struct counters counters;

static struct {
    bool is_checked;
    bool is_resetting;
    uint8_t expected; /* sequence number of the next line */
    uint32_t valid_us;
    uint32_t reset_us;
} session;

static const char word_hello[] HAL_FLASH = "hello";
static const char word_refused[] HAL_FLASH = "refused";
static const char word_parameter[] HAL_FLASH = "g";
static const char reset_done[] HAL_FLASH = "Reset Done\r\n";

struct range {
    uint32_t least;
    uint32_t most;
};

static const struct range ranges[PARAMETERS] HAL_FLASH = {
    [PARAMETER_COUNTS] = {64, 65535},        [PARAMETER_KP] = {0, 20000},
    [PARAMETER_KI] = {0, 500000},            [PARAMETER_FEEDFORWARD] = {0, 20000},
    [PARAMETER_STATIC] = {0, 65280},         [PARAMETER_ACCELERATION] = {0, 1000000},
    [PARAMETER_CURRENT] = {0, 4095},         [PARAMETER_BATTERY] = {64, 1024},
};

void commands_start(void)
{
    (void)memset(&counters, 0, sizeof(counters));
    (void)memset(&session, 0, sizeof(session));
}

bool commands_is_checked(void)
{
    return session.is_checked;
}

bool commands_is_resetting(void)
{
    return session.is_resetting;
}

bool commands_is_reset_due(void)
{
    return session.is_resetting && ((uint32_t)(hal_micros() - session.reset_us) >= RESET_DELAY_US);
}

void commands_run(void)
{
    if (session.is_checked && ((uint32_t)(hal_micros() - session.valid_us) >= SILENCE_US)) {
        session.is_checked = false;
        motors_end_deadman();
        report_begin(false);
    }
}

static bool is_within(int32_t value, int32_t least, int32_t most)
{
    return (value >= least) && (value <= most);
}

static enum refusal refusal_of(enum motion motion)
{
    if (motion == MOTION_STALE) {
        return REFUSED_STALE;
    }
    return (motion == MOTION_OBEYED) ? OBEYED : REFUSED_STOPPED;
}

static bool are_within(const struct request *request, int32_t most, int32_t least)
{
    return is_within(request->numbers[0], least, most) && is_within(request->numbers[1], least, most);
}

static enum refusal take_duty(const struct request *request, struct received received)
{
    if (!are_within(request, INT16_MAX, INT16_MIN)) {
        return REFUSED_RANGE;
    }
    return refusal_of(motors_duty(request->numbers, received));
}

static enum refusal take_speed(const struct request *request, struct received received)
{
    if (!are_within(request, MOST_SPEED_MRAD_S, -MOST_SPEED_MRAD_S)) {
        return REFUSED_RANGE;
    }
    if (!wheel_loop_is_set_up()) {
        return ((motors_state().stops & (uint8_t)~STOP_DEADMAN) != 0U) ? REFUSED_STOPPED : REFUSED_NOT_SET_UP;
    }
    const int32_t most = wheel_loop_most_mrad_s();
    if (!are_within(request, most, -most)) {
        return REFUSED_RANGE;
    }
    return refusal_of(motors_speed(request->numbers, received));
}

static enum refusal take_parameter(const struct request *request)
{
    const int32_t parameter = request->numbers[0];
    const int32_t value = request->numbers[1];
    if (!is_within(parameter, 0, PARAMETERS - 1) || (value < 0)) {
        return REFUSED_RANGE;
    }
    const uint32_t least = HAL_READ_U32(&ranges[parameter].least);
    const uint32_t most = HAL_READ_U32(&ranges[parameter].most);
    if (((uint32_t)value < least) || ((uint32_t)value > most)) {
        return REFUSED_RANGE;
    }
    if (parameter == (int32_t)PARAMETER_CURRENT) {
        sensors_limit_current((uint16_t)value);
    } else {
        wheel_loop_set((enum parameter)parameter, (uint32_t)value);
    }
    line_begin(word_parameter);
    line_signed(parameter);
    line_signed(value);
    (void)line_end_sealed();
    return OBEYED;
}

static enum refusal take_hello(const struct request *request, struct received received)
{
    const int32_t deadman_ms = request->numbers[1];
    if (request->numbers[0] != FIRMWARE_PROTO) {
        return REFUSED_PROTO;
    }
    if (!is_within(deadman_ms, LEAST_DEADMAN_MS, MOST_DEADMAN_MS)) {
        return REFUSED_RANGE;
    }
    motors_begin_deadman((uint32_t)deadman_ms * 1000U, received.at_us);
    if (!session.is_checked) {
        session.is_checked = true;
        report_begin(true);
    }
    session.valid_us = received.at_us;
    session.expected = (uint8_t)(received.sequence + 1U);
    line_begin(word_hello);
    line_signed(FIRMWARE_PROTO);
    line_signed(deadman_ms);
    line_unsigned(received.at_us);
    line_unsigned(received.sequence);
    (void)line_end_sealed();
    return OBEYED;
}

static enum refusal take_reset(uint32_t at_us)
{
    const int32_t zeros[WHEELS] = {0, 0};
    const struct received received = {at_us, false, 0};
    (void)motors_duty(zeros, received);
    session.is_resetting = true;
    session.reset_us = at_us;
    line_begin(reset_done);
    (void)line_end();
    return OBEYED;
}

static enum refusal take_estop(void)
{
    motors_estop();
    return OBEYED;
}

/* A request with the right number of numbers. */
static enum refusal obey(const struct request *request, struct received received)
{
    switch (request->word) {
    case WORD_DUTY:
        return take_duty(request, received);
    case WORD_SPEED:
        return take_speed(request, received);
    case WORD_PARAMETER:
        return take_parameter(request);
    case WORD_ARM:
        return motors_arm(request->numbers[0]) ? OBEYED : REFUSED_ESTOP_NUMBER;
    case WORD_RESET:
        return take_reset(received.at_us);
    case WORD_HELLO:
        return take_hello(request, received);
    case WORD_ABOUT:
        report_about();
        return OBEYED;
    case WORD_ESTOP:
        return take_estop();
    default:
        return REFUSED_WORD;
    }
}

static bool is_known(enum word word)
{
    const bool is_of_checked = (word == WORD_DUTY) || (word == WORD_SPEED) || (word == WORD_PARAMETER);
    const bool needs_loop = (word == WORD_SPEED);
    return (session.is_checked || !is_of_checked) && (word != WORD_UNKNOWN) && (HAS_WHEEL_LOOP || !needs_loop);
}

static void note_sequence(const struct request *request, int16_t sequence)
{
    if (session.is_checked && (sequence >= 0) && (request->word != WORD_HELLO)) {
        counters.gaps = (uint16_t)(counters.gaps + (uint8_t)((uint8_t)sequence - session.expected));
        session.expected = (uint8_t)((uint8_t)sequence + 1U);
    }
}

static void take_sealed(const struct line *line)
{
    const struct request request = request_parse(line->text, (uint8_t)(line->length - 5U));
    const int16_t sequence = request_sequence(&request);
    enum refusal refusal = OBEYED;
    session.valid_us = line->at_us;
    note_sequence(&request, sequence);
    if (!is_known(request.word)) {
        refusal = REFUSED_WORD;
    } else if (request.count != (request_numbers(request.word) + 1U)) {
        refusal = REFUSED_COUNT;
    } else if (sequence < 0) {
        refusal = REFUSED_RANGE;
    } else {
        const struct received received = {line->at_us, true, (uint8_t)sequence};
        refusal = obey(&request, received);
    }
    if (refusal == OBEYED) {
        return;
    }
    counters.refused++;
    if (refusal != REFUSED_STALE) {
        line_begin(word_refused);
        line_signed((int32_t)refusal);
        line_signed((sequence < 0) ? (int32_t)UINT8_MAX : (int32_t)sequence);
        (void)line_end_sealed();
    }
}

/* The receive interrupt has heard it. */
static bool ends_in_estop(const struct line *line)
{
    static const char word[] = {'e', 's', 't', 'o', 'p'};
    bool is_same = line->length >= sizeof(word);
    for (uint8_t index = 0; is_same && (index < sizeof(word)); index++) {
        is_same = line->text[line->length - sizeof(word) + index] == word[index];
    }
    return is_same;
}

static bool is_plain_stop(const struct line *line)
{
    static const char stop[] = {'s', ' ', '0', ' ', '0'};
    bool is_same = line->length == sizeof(stop);
    for (uint8_t index = 0; is_same && (index < sizeof(stop)); index++) {
        is_same = line->text[index] == stop[index];
    }
    return is_same;
}

static void take_plain(const struct line *line)
{
    const struct request request = request_parse(line->text, line->length);
    const bool is_of_classic = (request.word == WORD_DUTY) || (request.word == WORD_RESET);
    const bool is_allowed = session.is_checked ? is_plain_stop(line) : is_of_classic;
    const struct received received = {line->at_us, false, 0};
    const bool is_complete = request.count == request_numbers(request.word);
    if (!is_allowed || !is_complete || (obey(&request, received) != OBEYED)) {
        counters.refused++;
    }
}

void commands_take(const struct line *line)
{
    const enum seal seal = request_seal(line->text, line->length);
    if (session.is_resetting) {
        return;
    }
    if (ends_in_estop(line)) {
        return;
    }
    if (line->is_damaged) {
        counters.refused++;
    } else if (seal == SEAL_NONE) {
        take_plain(line);
    } else if ((seal == SEAL_GOOD) && !line->has_line_feed) {
        take_sealed(line);
    } else {
        counters.crc++;
    }
}
