/* Bytes from the host to lines: a ring that the receive interrupt fills, and a line of bounded length. */
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

/* Forgets all that was received. */
void receive_start(void);

/* The next line that is not empty, until the next call; null while there is none. Main loop only. */
const struct line *receive_line(void);

#endif
