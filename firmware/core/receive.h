/* Bytes from the host to lines: a ring that the receive interrupt fills, and a line of bounded length.
 *
 * A line that ends in the e-stop's word is known to the interrupt itself, so that it needs neither room nor the main loop.
 */
#ifndef RECEIVE_H
#define RECEIVE_H

#include <stdbool.h>
#include <stdint.h>

#define LINE_BYTES 64U

struct line {
    char text[LINE_BYTES]; /* without its CR; not terminated */
    uint8_t length;
    bool is_damaged; /* overlong, a byte that is not printable, or lost bytes */
    bool has_line_feed; /* a LF was skipped inside of it */
    uint32_t at_us;  /* when its CR came in */
};

/* Forgets all that was received; of the e-stop's word too, unless the program has restarted itself. */
void receive_start(bool is_continued);

/* How many lines ended in the e-stop's word since the start; wraps. Callable from everywhere. */
uint8_t receive_estops(void);

/* How many whole lines wait. Main loop only. */
uint8_t receive_waiting(void);

/* The next line that is not empty, until the next call; null while there is none. Main loop only. */
const struct line *receive_line(void);

#endif
