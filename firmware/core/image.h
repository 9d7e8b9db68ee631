/* The program's own image: whether it is whole, and which build it is. A tool writes its length and CRC into it after the
 * linker (seal_image.py), so that a half-written flash, or one of two builds, says so instead of running. */
#ifndef IMAGE_H
#define IMAGE_H

#include <stdbool.h>
#include <stdint.h>

/* The CRC over all of the image but the CRC itself: it names the build. */
uint16_t image_build(void);

/* Returns if the image is whole, or if the program has restarted itself, which changes no flash. Else says so for ever. */
void image_check(uint8_t reset_cause);

#endif
