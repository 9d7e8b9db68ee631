#include "request.h"

#include "crc.h"
#include "hal.h"

#define SEAL_CHARACTERS 5U

struct spelling {
    char text[6];
    uint8_t numbers;
};

static const struct spelling words[WORD_ESTOP + 1] HAL_FLASH = {
    [WORD_UNKNOWN] = {"", 0}, [WORD_DUTY] = {"s", 2},  [WORD_SPEED] = {"w", 2}, [WORD_PARAMETER] = {"g", 2},
    [WORD_ARM] = {"arm", 1},  [WORD_RESET] = {"r", 0}, [WORD_HELLO] = {"hello", 2}, [WORD_ABOUT] = {"about", 0},
    [WORD_ESTOP] = {"estop", 0},
};

/* The value of an upper-case hexadecimal digit; 16 for another character. */
static uint8_t hexadecimal(char character)
{
    if ((character >= '0') && (character <= '9')) {
        return (uint8_t)(character - '0');
    }
    return ((character >= 'A') && (character <= 'F')) ? (uint8_t)(character - 'A' + 10) : 16U;
}

enum seal request_seal(const char *text, uint8_t length)
{
    if ((length < SEAL_CHARACTERS) || (text[length - SEAL_CHARACTERS] != '*')) {
        return SEAL_NONE;
    }
    const uint8_t body = (uint8_t)(length - SEAL_CHARACTERS);
    uint16_t crc = CRC_START;
    for (uint8_t index = 0; index < body; index++) {
        crc = crc_add(crc, (uint8_t)text[index]);
    }
    for (uint8_t digit = 0; digit < 4U; digit++) {
        const uint8_t nibble = (uint8_t)((uint16_t)(crc >> (12U - (4U * digit))) & 0xFU);
        if (hexadecimal(text[body + 1U + digit]) != nibble) {
            return SEAL_WRONG;
        }
    }
    return SEAL_GOOD;
}

/* Digits with an optional minus in front, as a number of 32 bits. */
static int32_t number_of(const char *text, uint8_t length)
{
    const bool is_negative = (length > 0U) && (text[0] == '-');
    uint8_t index = is_negative ? 1U : 0U;
    if (index >= length) {
        return NO_NUMBER;
    }
    uint32_t value = 0;
    for (; index < length; index++) {
        const uint8_t digit = hexadecimal(text[index]);
        if ((digit > 9U) || (value > (((uint32_t)INT32_MAX - digit) / 10U))) {
            return NO_NUMBER;
        }
        value = (value * 10U) + digit;
    }
    return is_negative ? -(int32_t)value : (int32_t)value;
}

static bool is_spelled(const char *spelling, const char *text, uint8_t length)
{
    for (uint8_t index = 0; index < length; index++) {
        const char character = HAL_READ_CHAR(&spelling[index]);
        if ((character == '\0') || (character != text[index])) {
            return false;
        }
    }
    return HAL_READ_CHAR(&spelling[length]) == '\0';
}

static enum word word_of(const char *text, uint8_t length)
{
    for (uint8_t word = WORD_DUTY; word <= (uint8_t)WORD_ESTOP; word++) {
        if ((length < sizeof(words[0].text)) && is_spelled(words[word].text, text, length)) {
            return (enum word)word;
        }
    }
    return WORD_UNKNOWN;
}

uint8_t request_numbers(enum word word)
{
    return (uint8_t)HAL_READ_CHAR((const char *)&words[word].numbers);
}

struct request request_parse(const char *text, uint8_t length)
{
    struct request request = {WORD_UNKNOWN, 0, {NO_NUMBER, NO_NUMBER}, NO_NUMBER};
    uint8_t start = 0;
    bool is_word = true;
    for (uint8_t index = 0; index <= length; index++) {
        if ((index < length) && (text[index] != ' ')) {
            continue;
        }
        const uint8_t size = (uint8_t)(index - start);
        if (is_word) {
            request.word = word_of(text, size);
        } else {
            request.last = number_of(&text[start], size);
            if (request.count < MOST_NUMBERS) {
                request.numbers[request.count] = request.last;
            }
            request.count++;
        }
        is_word = false;
        start = (uint8_t)(index + 1U);
    }
    return request;
}

int16_t request_sequence(const struct request *request)
{
    const int32_t last = request->last;
    return ((last >= 0) && (last <= (int32_t)UINT8_MAX)) ? (int16_t)last : (int16_t)-1;
}
