/* Where edges.S finds what core/encoder.h declares; encoders.c holds both to each other. */
#ifndef EDGES_H
#define EDGES_H

#define ENCODER_COUNT_AT 0
#define ENCODER_MICROS_AT 2
#define ENCODER_LEVELS_AT 4
#define ENCODER_BYTES 5

#endif
