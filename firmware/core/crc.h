/* CRC-16/IBM-3740: polynomial 0x1021, initial value 0xFFFF, not reflected; of "123456789" it is 0x29B1. */
#ifndef CRC_H
#define CRC_H

#include <stdint.h>

#define CRC_START 0xFFFFU

/* The CRC with one more byte: without a table, as fast as with one on 8 bits. */
static inline uint16_t crc_add(uint16_t crc, uint8_t byte)
{
    uint8_t high = (uint8_t)((uint8_t)(crc >> 8) ^ byte);
    high ^= (uint8_t)(high >> 4);
    const uint16_t wide = high;
    return (uint16_t)((uint16_t)(crc << 8) ^ (uint16_t)(wide << 12) ^ (uint16_t)(wide << 5) ^ wide);
}

#endif
