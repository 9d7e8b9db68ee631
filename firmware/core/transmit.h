/* Lines to the host: formatted without printf into a ring that the transmit interrupt empties.
 *
 * A line is begun, given its fields and ended. It appears in the ring when it ends, as a whole; a line that
 * does not fit is left out. Only the main loop writes lines.
 */
#ifndef TRANSMIT_H
#define TRANSMIT_H

#include <stdbool.h>
#include <stdint.h>

/* Empties the ring; sequence numbers begin with 0. */
void transmit_start(void);

/* Free bytes of the ring, which holds 255: the banner and the first cycle, or a whole cycle and an answer. */
uint8_t transmit_room(void);

/* Begins a line with a word, a string in program memory (HAL_FLASH). */
void line_begin(const char *word);

/* A TAB and a number. */
void line_signed(int32_t value);
void line_unsigned(uint32_t value);

/* A TAB and a number with a decimal point before its last digits: 1234 with 2 decimals is 12.34. */
void line_decimals(uint32_t value, uint8_t decimals);

/* More text, as it is, from program memory. */
void line_text(const char *text);

/* Ends a line with LF after its seal: sequence number and CRC. False if it had no room: then no number is spent. */
bool line_end_sealed(void);

/* Ends a line as it is, its end of line included. False if it had no room. */
bool line_end(void);

#endif
