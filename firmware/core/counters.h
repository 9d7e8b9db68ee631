/* What was refused, lost and late since the start; all wrap. Interrupts add to some: read them under a lock. */
#ifndef COUNTERS_H
#define COUNTERS_H

#include <stdint.h>

struct counters {
    uint16_t crc;     /* lines with a wrong CRC */
    uint16_t refused; /* other lines that were not obeyed */
    uint16_t overrun; /* received bytes lost: by the receive interrupt */
    uint16_t gaps;    /* sequence numbers that were left out */
    uint16_t deadman; /* dead-man stops: by the timer's interrupt */
    uint16_t late;    /* cycles that began a millisecond late or more */
};

extern struct counters counters;

#endif
