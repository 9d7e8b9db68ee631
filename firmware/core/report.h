/* The cycle: when it begins, and the lines that it sends. Main loop only. */
#ifndef REPORT_H
#define REPORT_H

#include <stdbool.h>
#include <stdint.h>

/* Banner and the board's name; the first cycle of the classic mode is due in 20 ms. */
void report_start(uint8_t reset_cause);

/* Sends a sealed line with what the board counts, and with which program. */
void report_about(void);

/* The mode has changed: its first cycle is due one period after this millisecond. */
void report_begin(bool is_checked);

/* A millisecond has begun, which is when cycles begin: from the timer's interrupt. */
void report_tick(void);

/* In how many milliseconds the next cycle is due, for a host whose time goes on in steps; 0: it is. */
uint16_t report_due_in_ms(void);

/* Sends a cycle's lines if it is due; true if it was. */
bool report_run(void);

#endif
