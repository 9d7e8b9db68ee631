/* What the proofs share: a host that seals lines, and dice. */
#ifndef CHECKS_H
#define CHECKS_H

#include <stdint.h>

#define MOST_LINE 64U

/* xorshift64*: the same numbers from the same seed, everywhere. */
uint64_t dice(uint64_t *state);

/* A number from 0 to below - 1. */
uint32_t dice_below(uint64_t *state, uint32_t below);

/* Writes `<body> <sequence>*<CRC>\r`; returns its length. The CRC is bitwise, not the core's. */
uint32_t seal_line(char line[MOST_LINE], const char *body, uint8_t sequence);

/* Powers the board on, its e-stop too, and begins the checked mode; the sequence number 1 is next. */
void begin_checked(uint16_t deadman_ms);

/* Receives a line and lets the main loop read it. */
void take_line(const char *line, uint32_t length);

#endif
