/* The state of the host build's hardware, and what Python drives it with (tests/firmware/host.py has the same). */
#ifndef FAKE_HAL_H
#define FAKE_HAL_H

#include "hal.h"

struct fake_hal {
    uint32_t micros;
    uint32_t run_us;       /* that host_run has run */
    uint32_t locks;        /* taken so far */
    uint32_t tick_at_lock; /* before which lock the timer's interrupt comes; 0: none */
    uint32_t tick_micros;  /* and at which time */
    uint32_t lock_errors;  /* locks that were not given back in turn */
    uint32_t motor_writes;
    uint32_t pings;
    uint32_t feeds; /* of the watchdog */
    uint32_t restarts;
    uint32_t imu_us;
    int16_t duty[WHEELS]; /* on the motors */
    int16_t imu[6];
    uint16_t battery;
    uint16_t current[WHEELS];
    uint8_t levels[WHEELS]; /* of the encoders' pins */
    uint8_t depth;          /* locks held */
    bool is_sending;
    bool has_imu;
    bool has_watchdog;
    bool is_new_imu;
    bool is_new_battery;
    bool is_new_current[WHEELS];
    uint8_t shut; /* wheels whose encoder has a shut channel */
    uint8_t opened; /* how often they were opened */
};

extern struct fake_hal fake;

/* Sets a pin pair of an encoder, as its interrupt does. */
void host_encoder(uint8_t wheel, uint8_t levels);

/* So many counts at once, as if their edges had come. */
void host_turn(uint8_t wheel, int16_t counts);

/* Received bytes, each by its interrupt. */
void host_receive(const uint8_t *bytes, uint32_t length);

/* Sends what is in the ring, as fast as the line could ever; returns how many bytes. */
uint32_t host_drain(uint8_t *bytes, uint32_t most);

/* Passes for so long, one every 100 us, and a tick at every whole millisecond of these, before its pass. */
void host_run(uint32_t micros);

/* What HAL_KEPT holds: how many bytes, and one of its bits that is flipped. */
uint32_t host_kept_bytes(void);
void host_flip_kept(uint32_t bit);

/* Bytes of struct fake_hal, for those who have it in another language. */
uint32_t host_fake_size(void);

#endif
