/* The simulator's board: its time goes on from one moment to a later one, and what happens between them happens at its own.
 *
 * Times are in microseconds since the power came on. The wheels turn evenly from one moment to the next, bytes leave
 * one after the other as on a line of some speed, and the timer's interrupt comes at every whole millisecond of the program, with
 * a pass of its main loop.
 */
#ifndef SIMULATED_H
#define SIMULATED_H

#include <stdint.h>

/* The power comes on: a byte takes so long on the line. */
void simulated_open(double byte_us);

/* The program begins now, with this cause and this value of hal_micros. */
void simulated_start(uint8_t cause, uint32_t micros);

/* Lets time go on to this moment, at which the wheels have turned so far (counts, fractions too), or until the ultrasonic sensor
 * is asked or the program wants to restart, if that is sooner. Returns the time that it is. */
uint64_t simulated_run(uint64_t to_us, double left, double right);

/* Bytes come in now, and the main loop takes them. Those that come while the program restarts itself are no lines. */
void simulated_receive(const uint8_t *bytes, uint32_t length);

/* The ultrasonic sensor's line rises and falls at these times. */
void simulated_echo(uint64_t rises_us, uint64_t falls_us);

/* When the next cycle is due, or the next line has left: nothing is sent before. */
uint64_t simulated_next_us(void);

/* Since when the duty is on the motors that is. */
uint64_t simulated_duty_since_us(void);

/* The oldest line that has left by now: its bytes (255 at most), and when its last one did. Returns how many bytes; 0: there is none. */
uint32_t simulated_take(uint8_t *bytes, uint64_t *left_us);

/* A line is complete in the transmit ring: the hardware layer's call. */
void simulated_line_ended(void);

#endif
