/* A line from the host as a word and numbers, and whether its seal holds. Pure: no state. */
#ifndef REQUEST_H
#define REQUEST_H

#include <stdbool.h>
#include <stdint.h>

#define MOST_NUMBERS 2U /* besides the sequence number */
#define NO_NUMBER INT32_MIN

enum word { WORD_UNKNOWN, WORD_DUTY, WORD_SPEED, WORD_PARAMETER, WORD_ARM, WORD_RESET, WORD_HELLO, WORD_ABOUT, WORD_ESTOP };

enum seal { SEAL_NONE, SEAL_GOOD, SEAL_WRONG };

struct request {
    enum word word;
    uint8_t count;                 /* fields after the word */
    int32_t numbers[MOST_NUMBERS]; /* the first of them; NO_NUMBER for one that is none, or beyond int32 */
    int32_t last;                  /* the last of them */
};

/* Whether a line ends in its CRC. The body is the line without its last five characters if it is not SEAL_NONE. */
enum seal request_seal(const char *text, uint8_t length);

/* The fields of a body. */
struct request request_parse(const char *text, uint8_t length);

/* How many numbers a word has, without the sequence number. */
uint8_t request_numbers(enum word word);

/* The last number of a sealed request if it is a sequence number, else -1. */
int16_t request_sequence(const struct request *request);

#endif
