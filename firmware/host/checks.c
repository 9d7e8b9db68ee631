#include "checks.h"

#include <stdio.h>
#include <string.h>

#include "fake_hal.h"

uint64_t dice(uint64_t *state)
{
    *state ^= *state >> 12;
    *state ^= *state << 25;
    *state ^= *state >> 27;
    return *state * 2685821657736338717ULL;
}

uint32_t dice_below(uint64_t *state, uint32_t below)
{
    return (uint32_t)(((dice(state) >> 32) * below) >> 32);
}

static uint16_t crc_of(const char *text, uint32_t length)
{
    uint32_t crc = 0xFFFFU;
    for (uint32_t index = 0; index < length; index++) {
        crc ^= (uint32_t)(uint8_t)text[index] << 8;
        for (uint32_t bit = 0; bit < 8U; bit++) {
            crc = ((crc & 0x8000U) != 0U) ? ((crc << 1) ^ 0x1021U) : (crc << 1);
        }
    }
    return (uint16_t)crc;
}

uint32_t seal_line(char line[MOST_LINE], const char *body, uint8_t sequence)
{
    const int length = snprintf(line, MOST_LINE, "%s %u", body, (unsigned)sequence);
    const uint16_t crc = crc_of(line, (uint32_t)length);
    return (uint32_t)length + (uint32_t)snprintf(&line[length], MOST_LINE - (uint32_t)length, "*%04X\r", (unsigned)crc);
}

void take_line(const char *line, uint32_t length)
{
    host_receive((const uint8_t *)line, length);
    firmware_pass();
}

void begin_checked(uint16_t deadman_ms)
{
    char body[MOST_LINE];
    char line[MOST_LINE];
    uint8_t ignored[256];
    memset(&fake, 0, sizeof(fake));
    firmware_start(RESET_POWER_ON);
    (void)snprintf(body, sizeof(body), "hello 1 %u", (unsigned)deadman_ms);
    take_line(line, seal_line(line, body, 0));
    (void)host_drain(ignored, sizeof(ignored));
}
