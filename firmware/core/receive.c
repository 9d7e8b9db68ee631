#include "receive.h"

#include <stddef.h>

#include "counters.h"
#include "hal.h"

#define RING_BYTES 128U
#define MOST_ENDS 32U
#define PAUSE_US 1000000U /* longer than anybody waits between two letters */
#define DAMAGE 0U /* in the place of bytes that were lost */
#define END 13U   /* CR */
#define LINE_FEED 10U
#define WORD_LETTERS 5U
#define HEARD_EARLY 6U /* in the place of letters: the word came while nothing could obey it */

/* Not cleared, as a start is a time in which nothing is heard. Volatile: the order of these writes counts. */
static struct {
    volatile uint8_t bytes[RING_BYTES];
    volatile uint32_t ends_us[MOST_ENDS]; /* when the CRs came in that are in the ring */
} waiting HAL_UNCLEARED;

static struct {
    volatile uint8_t head;       /* these two and the bytes are written by the receive interrupt */
    volatile uint8_t ends_head;
    volatile uint8_t tail; /* these two by the main loop; all four count on and wrap at 256 */
    volatile uint8_t ends_tail;
    bool has_lost;
    bool is_inside; /* of a line: an empty one takes no room */
} ring;

/* The e-stop's word is known to the receive interrupt: no backlog, no lost byte before it and no main loop can hide it. */
static const char stop_word[WORD_LETTERS] = {'e', 's', 't', 'o', 'p'};
static uint8_t letters HAL_KEPT; /* of the word, that came last: a restart may come in the middle of it */
static volatile uint8_t estops;

static struct line line;
static bool is_done;
static uint32_t taken_us; /* when the main loop last found a byte */

static void clear_line(void)
{
    line.length = 0;
    line.is_damaged = false;
    line.has_line_feed = false;
}

void receive_start(bool is_continued)
{
    ring.head = 0;
    ring.tail = 0;
    ring.ends_head = 0;
    ring.ends_tail = 0;
    ring.has_lost = false;
    ring.is_inside = false;
    estops = (is_continued && (letters == HEARD_EARLY)) ? 1U : 0U;
    if (!is_continued || (letters > WORD_LETTERS)) {
        letters = 0;
    }
    clear_line();
    is_done = false;
    taken_us = hal_micros();
}

uint8_t receive_estops(void)
{
    return estops;
}

/* The letters of the word in a row, and the end of the line behind them: whatever the line began with. */
static void listen(uint8_t byte)
{
    if (byte == LINE_FEED) {
        return;
    }
    if ((letters < WORD_LETTERS) && (byte == (uint8_t)stop_word[letters])) {
        letters++;
        return;
    }
    if ((byte == END) && (letters == WORD_LETTERS)) {
        estops = (uint8_t)(estops + 1U);
    }
    letters = (byte == (uint8_t)'e') ? 1U : 0U;
}

static uint8_t room(void)
{
    return (uint8_t)(RING_BYTES - (uint8_t)(ring.head - ring.tail));
}

static void store(uint8_t byte)
{
    waiting.bytes[ring.head % RING_BYTES] = byte;
    ring.head = (uint8_t)(ring.head + 1U);
    ring.is_inside = byte != END;
}

void firmware_receive_lost(void)
{
    ring.has_lost = true;
    counters.overrun++;
}

void firmware_received_early(uint8_t byte)
{
    if (letters <= WORD_LETTERS) {
        const uint8_t before = estops;
        listen(byte);
        if (estops != before) {
            letters = HEARD_EARLY;
        }
    }
}

void firmware_received(uint8_t byte)
{
    listen(byte);
    if (ring.has_lost && (room() >= 2U)) {
        store(DAMAGE);
        ring.has_lost = false;
    }
    if (!ring.has_lost && !ring.is_inside && ((byte == END) || (byte == LINE_FEED))) {
        return;
    }
    const bool is_end = byte == END;
    const bool has_no_stamp = is_end && ((uint8_t)(ring.ends_head - ring.ends_tail) >= MOST_ENDS);
    if (ring.has_lost || (room() == 0U) || has_no_stamp) {
        firmware_receive_lost();
        return;
    }
    if (is_end) {
        waiting.ends_us[ring.ends_head % MOST_ENDS] = hal_micros();
        ring.ends_head = (uint8_t)(ring.ends_head + 1U);
    }
    store(byte);
}

static void add(uint8_t byte)
{
    if (byte == LINE_FEED) {
        line.has_line_feed = line.has_line_feed || (line.length > 0U);
        return;
    }
    if ((line.length >= LINE_BYTES) || (byte < 0x20U) || (byte > 0x7EU)) {
        line.is_damaged = true;
        return;
    }
    line.text[line.length] = (char)byte;
    line.length++;
}

uint8_t receive_waiting(void)
{
    return (uint8_t)(ring.ends_head - ring.ends_tail);
}

/* What a host that died in the middle of a line has left must not spoil the next one's. */
static void forget_cut_line(uint32_t now_us)
{
    if (((line.length > 0U) || line.is_damaged) && ((uint32_t)(now_us - taken_us) >= PAUSE_US)) {
        clear_line();
        counters.refused++;
    }
}

const struct line *receive_line(void)
{
    if (is_done) {
        is_done = false;
        clear_line();
    }
    if (ring.head != ring.tail) {
        const uint32_t now_us = hal_micros();
        forget_cut_line(now_us);
        taken_us = now_us;
    }
    for (uint8_t left = (uint8_t)(ring.head - ring.tail); left > 0U; left--) {
        const uint8_t byte = waiting.bytes[ring.tail % RING_BYTES];
        ring.tail = (uint8_t)(ring.tail + 1U);
        if (byte != END) {
            add(byte);
            continue;
        }
        line.at_us = waiting.ends_us[ring.ends_tail % MOST_ENDS];
        ring.ends_tail = (uint8_t)(ring.ends_tail + 1U);
        if ((line.length > 0U) || line.is_damaged) {
            is_done = true;
            return &line;
        }
    }
    return NULL;
}
