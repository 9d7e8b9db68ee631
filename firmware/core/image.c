#include "image.h"

#include "crc.h"
#include "hal.h"

/* seal_image.py finds the mark, and fills in the rest; it stands once in the program. */
struct image {
    uint8_t mark[8];
    uint32_t length; /* of the image, from its first byte on */
    uint16_t crc;
};

#define MARK {0xC5, 'i', 'm', 'a', 'g', 'e', 0x5C, 0xA3}
#define MOST_BYTES HAL_MOST_IMAGE_BYTES

static const struct image image HAL_FLASH __attribute__((used)) = {MARK, 0, 0};

static const char damaged[] HAL_FLASH = "Image damaged: flash the board again\r\n";

/* Volatile: what the compiler sees here is not what the tool has put into the image. */
static uint8_t own_byte(const uint8_t *address)
{
    return (uint8_t)HAL_READ_CHAR((const volatile char *)address);
}

static uint32_t own_number(const uint8_t bytes[], uint8_t count)
{
    uint32_t value = 0;
    for (uint8_t index = count; index > 0U; index--) {
        value = (value << 8) | own_byte(&bytes[index - 1U]);
    }
    return value;
}

uint16_t image_build(void)
{
    return (uint16_t)own_number((const uint8_t *)&image.crc, sizeof(image.crc));
}

/* In the board's own width of an address: an AVR reads 14 KB in 40 ms then. */
static uint16_t add_span(uint16_t crc, hal_image_at_t from, hal_image_at_t to)
{
    uint16_t sum = crc;
    for (hal_image_at_t at = from; at < to; at++) {
        sum = crc_add(sum, HAL_READ_IMAGE(at));
    }
    return sum;
}

static bool is_whole(void)
{
    const uint32_t length = own_number((const uint8_t *)&image.length, sizeof(image.length));
    const uint32_t crc_at = HAL_IMAGE_OFFSET(&image.crc);
    if ((length <= crc_at) || (length > MOST_BYTES)) {
        return false;
    }
    uint16_t crc = add_span(CRC_START, 0, (hal_image_at_t)crc_at);
    crc = crc_add(crc_add(crc, 0), 0); /* in its own place */
    crc = add_span(crc, (hal_image_at_t)(crc_at + sizeof(image.crc)), (hal_image_at_t)length);
    return crc == image_build();
}

void image_check(uint8_t reset_cause)
{
    if ((reset_cause != (uint8_t)RESET_SOFTWARE) && !is_whole()) {
        hal_say_for_ever(damaged);
    }
}
