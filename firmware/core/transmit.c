#include "transmit.h"

#include "crc.h"
#include "hal.h"

#define MOST_DIGITS 10U

/* Not cleared at a start, in which nothing is heard. Indices of 8 bits wrap by themselves. */
static volatile uint8_t waiting[256] HAL_UNCLEARED;

static struct {
    volatile uint8_t head; /* written by the main loop */
    volatile uint8_t tail; /* written by the transmit interrupt */
    uint8_t writing;       /* where the line that is not ended goes on */
    bool is_full;
    uint8_t sequence;
    uint16_t crc;
} ring;

static const uint32_t powers[MOST_DIGITS] HAL_FLASH = {1000000000U, 100000000U, 10000000U, 1000000U, 100000U,
                                                       10000U,      1000U,      100U,      10U,      1U};

static const char new_line[] HAL_FLASH = "\n";

void transmit_start(void)
{
    ring.head = 0;
    ring.tail = 0;
    ring.writing = 0;
    ring.is_full = false;
    ring.sequence = 0;
    ring.crc = CRC_START;
}

uint8_t transmit_room(void)
{
    const uint8_t used = (uint8_t)(ring.head - ring.tail);
    return (uint8_t)(UINT8_MAX - used);
}

bool firmware_next_byte(uint8_t *byte)
{
    const uint8_t tail = ring.tail;
    if (tail == ring.head) {
        return false;
    }
    *byte = waiting[tail];
    ring.tail = (uint8_t)(tail + 1U);
    return true;
}

static void put(char character)
{
    const uint8_t next = (uint8_t)(ring.writing + 1U);
    if (next == ring.tail) {
        ring.is_full = true;
        return;
    }
    waiting[ring.writing] = (uint8_t)character;
    ring.writing = next;
    ring.crc = crc_add(ring.crc, (uint8_t)character);
}

void line_text(const char *text)
{
    for (const char *next = text; HAL_READ_CHAR(next) != '\0'; next++) {
        put(HAL_READ_CHAR(next));
    }
}

void line_begin(const char *word)
{
    ring.writing = ring.head;
    ring.is_full = false;
    ring.crc = CRC_START;
    line_text(word);
}

/* Digits by subtraction: a division of 32 bits takes 40 us on the AVR. */
static void put_digits(uint32_t value, uint8_t decimals)
{
    uint32_t rest = value;
    bool has_begun = false;
    for (uint8_t place = 0; place < MOST_DIGITS; place++) {
        const uint32_t power = HAL_READ_U32(&powers[place]);
        const uint8_t behind = (uint8_t)(MOST_DIGITS - 1U - place);
        char digit = '0';
        while (rest >= power) {
            rest -= power;
            digit++;
        }
        has_begun = has_begun || (digit != '0') || (behind <= decimals);
        if (has_begun) {
            put(digit);
        }
        if ((behind == decimals) && (behind != 0U)) {
            put('.');
        }
    }
}

void line_decimals(uint32_t value, uint8_t decimals)
{
    put('\t');
    put_digits(value, decimals);
}

void line_unsigned(uint32_t value)
{
    line_decimals(value, 0);
}

void line_signed(int32_t value)
{
    put('\t');
    if (value < 0) {
        put('-');
        put_digits(0U - (uint32_t)value, 0);
    } else {
        put_digits((uint32_t)value, 0);
    }
}

bool line_end(void)
{
    if (ring.is_full) {
        return false;
    }
    ring.head = ring.writing;
    hal_start_sending();
    return true;
}

bool line_end_sealed(void)
{
    line_unsigned(ring.sequence);
    const uint16_t crc = ring.crc;
    put('*');
    for (uint8_t digit = 0; digit < 4U; digit++) {
        const uint8_t nibble = (uint8_t)((uint16_t)(crc >> (12U - (4U * digit))) & 0xFU);
        put((char)((nibble < 10U) ? ('0' + nibble) : ('A' + nibble - 10)));
    }
    line_text(new_line);
    if (!line_end()) {
        return false;
    }
    ring.sequence++;
    return true;
}
