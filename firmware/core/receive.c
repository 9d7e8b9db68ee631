#include "receive.h"

#include <stddef.h>

#include "counters.h"
#include "hal.h"

#define RING_BYTES 128U
#define MOST_ENDS 8U
#define DAMAGE 0U /* in the place of bytes that were lost */
#define END 13U   /* CR */
#define LINE_FEED 10U

static struct {
    volatile uint8_t bytes[RING_BYTES]; /* volatile: the order of these writes counts */
    volatile uint32_t ends_us[MOST_ENDS]; /* when the CRs came in that are in the ring */
    volatile uint8_t head;       /* these two and ends_us are written by the receive interrupt */
    volatile uint8_t ends_head;
    volatile uint8_t tail; /* these two by the main loop; all four count on and wrap at 256 */
    volatile uint8_t ends_tail;
    bool has_lost;
} ring;

static struct line line;
static bool is_done;

void receive_start(void)
{
    ring.head = 0;
    ring.tail = 0;
    ring.ends_head = 0;
    ring.ends_tail = 0;
    ring.has_lost = false;
    line.length = 0;
    line.is_damaged = false;
    line.has_line_feed = false;
    is_done = false;
}

static uint8_t room(void)
{
    return (uint8_t)(RING_BYTES - (uint8_t)(ring.head - ring.tail));
}

static void store(uint8_t byte)
{
    ring.bytes[ring.head % RING_BYTES] = byte;
    ring.head = (uint8_t)(ring.head + 1U);
}

void firmware_receive_lost(void)
{
    ring.has_lost = true;
    counters.overrun++;
}

void firmware_received(uint8_t byte)
{
    if (ring.has_lost && (room() >= 2U)) {
        store(DAMAGE);
        ring.has_lost = false;
    }
    const bool is_end = byte == END;
    const bool has_no_stamp = is_end && ((uint8_t)(ring.ends_head - ring.ends_tail) >= MOST_ENDS);
    if (ring.has_lost || (room() == 0U) || has_no_stamp) {
        firmware_receive_lost();
        return;
    }
    if (is_end) {
        ring.ends_us[ring.ends_head % MOST_ENDS] = hal_micros();
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

const struct line *receive_line(void)
{
    if (is_done) {
        is_done = false;
        line.length = 0;
        line.is_damaged = false;
        line.has_line_feed = false;
    }
    for (uint8_t left = (uint8_t)(ring.head - ring.tail); left > 0U; left--) {
        const uint8_t byte = ring.bytes[ring.tail % RING_BYTES];
        ring.tail = (uint8_t)(ring.tail + 1U);
        if (byte != END) {
            add(byte);
            continue;
        }
        line.at_us = ring.ends_us[ring.ends_tail % MOST_ENDS];
        ring.ends_tail = (uint8_t)(ring.ends_tail + 1U);
        if ((line.length > 0U) || line.is_damaged) {
            is_done = true;
            return &line;
        }
    }
    return NULL;
}
