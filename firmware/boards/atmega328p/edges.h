/* Where edges.S finds what core/encoder.h declares; encoders.c holds both to each other. */
#ifndef EDGES_H
#define EDGES_H

#define ENCODER_COUNT_AT 0
#define ENCODER_MICROS_AT 2
#define ENCODER_LEVELS_AT 4
#define ENCODER_BYTES 5

/* How many edges are left in this millisecond: of each channel, and of the two that share an interrupt, seen or not. */
#define LEFT_A_BUDGET 0
#define RIGHT_A_BUDGET 1
#define LEFT_B_BUDGET 2
#define RIGHT_B_BUDGET 3
#define BOTH_B_BUDGET 4
#define BUDGETS 5

#endif
