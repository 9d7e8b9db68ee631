#include "simavr_board.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <simavr/avr_adc.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>

#include "simavr_mpu6050.h"

enum {
    FREQUENCY_HZ = 16000000,
    BYTE_CYCLES = 1389, /* ten bits at 115200 baud */
    POLL_CYCLES = 800,  /* 50 us */
    SETTLED_CYCLES = 400, /* of a duty: the program takes the PWM off for microseconds while it changes the inputs */
    PING_TO_ECHO_CYCLES = 7200, /* 450 us: HC-SR04, from the trigger's end to the echo's begin */
    QUEUE = 8192,
    WHEELS = 2,
    UNCONNECTED = 255
};

/* ATmega328P: addresses in data memory, data sheet section 36. */
enum { PORTB_AT = 0x25, PORTD_AT = 0x2B, TCCR0A_AT = 0x44, OCR0A_AT = 0x47, TCCR1A_AT = 0x80, OCR1AL_AT = 0x88,
       MCUSR_AT = 0x54, WDTCSR_AT = 0x60 };

typedef enum { RECEIVED, ENCODER, ECHO } event_kind_t;

typedef struct {
    uint64_t at_cycle;
    uint64_t order;
    event_kind_t kind;
    uint8_t wheel;
    uint8_t value;
} event_t;

struct board {
    avr_t *avr;
    mpu6050_t imu;
    board_echo_t echo;
    event_t heap[QUEUE];
    size_t events;
    uint64_t order;
    board_byte_t bytes[QUEUE];
    size_t bytes_in, bytes_out;
    board_duty_t duties[QUEUE];
    size_t duties_in, duties_out;
    int16_t duty[WHEELS]; /* that has settled */
    int16_t seen[WHEELS]; /* at the last look, since seen_cycle */
    uint64_t seen_cycle;
    uint64_t bites_at_cycle;
    uint64_t slept_cycles;
    uint32_t pings;
    uint32_t lost;
    bool trigger;
    bool scl_driven;
    uint8_t levels[WHEELS];
};

/* A forward turn: A before B. The left encoder is mounted the other way round (see the pin table). */
static const uint8_t LEVELS[4] = {0, 2, 3, 1};

typedef struct {
    char port;
    int pin;
} pin_t;

static const pin_t A_PIN[WHEELS] = {{'D', 2}, {'D', 3}};
static const pin_t B_PIN[WHEELS] = {{'D', 5}, {'D', 4}};
static const pin_t ECHO_PIN = {'B', 4};
static const pin_t SDA_PIN = {'C', 4}, SCL_PIN = {'C', 5};
static const pin_t TRIGGER_PIN = {'C', 1};

static avr_irq_t *pin_irq(const board_t *board, pin_t pin)
{
    return avr_io_getirq(board->avr, AVR_IOCTL_IOPORT_GETIRQ(pin.port), pin.pin);
}

/* Events in a binary heap: the earliest first, and of two at a time the one that was given first. */

static bool is_before(const event_t *one, const event_t *other)
{
    return one->at_cycle < other->at_cycle || (one->at_cycle == other->at_cycle && one->order < other->order);
}

static void push(board_t *board, event_t event)
{
    if (board->events == QUEUE) {
        board->lost++;
        return;
    }
    event.order = board->order++;
    size_t at = board->events++;
    while (at > 0 && is_before(&event, &board->heap[(at - 1) / 2])) {
        board->heap[at] = board->heap[(at - 1) / 2];
        at = (at - 1) / 2;
    }
    board->heap[at] = event;
}

static event_t pop(board_t *board)
{
    event_t first = board->heap[0];
    event_t last = board->heap[--board->events];
    size_t at = 0;
    for (size_t child = 1; child < board->events; child = 2 * at + 1) {
        if (child + 1 < board->events && is_before(&board->heap[child + 1], &board->heap[child])) {
            child++;
        }
        if (!is_before(&board->heap[child], &last)) {
            break;
        }
        board->heap[at] = board->heap[child];
        at = child;
    }
    board->heap[at] = last;
    return first;
}

/* Every write to a port makes simavr put its pull-ups' 1 on the inputs, unless it is told what drives them. */
static void set_encoder(board_t *board, unsigned wheel, uint8_t levels)
{
    static const uint8_t A_MASK[WHEELS] = {1U << 2, 1U << 3}, B_MASK[WHEELS] = {1U << 5, 1U << 4};
    avr_ioport_external_t external = {.name = 'D'};
    board->levels[wheel] = levels;
    for (unsigned each = 0; each < WHEELS; each++) {
        external.mask |= A_MASK[each] | B_MASK[each];
        external.value |= (board->levels[each] & 2 ? A_MASK[each] : 0U) | (board->levels[each] & 1 ? B_MASK[each] : 0U);
    }
    avr_ioctl(board->avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('D'), &external);
    avr_raise_irq(pin_irq(board, A_PIN[wheel]), levels >> 1);
    avr_raise_irq(pin_irq(board, B_PIN[wheel]), levels & 1);
}

static void deliver(board_t *board, event_t event)
{
    avr_t *avr = board->avr;
    switch (event.kind) {
    case RECEIVED:
        avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT), event.value);
        break;
    case ENCODER:
        set_encoder(board, event.wheel, event.value);
        break;
    case ECHO:
        avr_raise_irq(pin_irq(board, ECHO_PIN), event.value);
        break;
    default:
        break;
    }
}

/* What the drivers get */

static int16_t driven(bool a, bool b, bool connected, uint8_t width)
{
    /* Both inputs alike brake; B alone is forward, as in the published sketch. */
    if (a == b || !connected) {
        return 0;
    }
    return b ? (int16_t)width : (int16_t)-width;
}

static void read_duty(const board_t *board, int16_t duty[WHEELS])
{
    const uint8_t *data = board->avr->data;
    uint8_t port_b = data[PORTB_AT], port_d = data[PORTD_AT];
    bool left = (data[TCCR0A_AT] & 0x80) != 0, right = (data[TCCR1A_AT] & 0x80) != 0;
    duty[0] = driven((port_d & 0x80) != 0, (port_b & 0x01) != 0, left, data[OCR0A_AT]);
    duty[1] = driven((port_b & 0x04) != 0, (port_b & 0x08) != 0, right, data[OCR1AL_AT]);
}

static void note_duty(board_t *board)
{
    int16_t duty[WHEELS];
    read_duty(board, duty);
    if (memcmp(duty, board->seen, sizeof duty) != 0) {
        memcpy(board->seen, duty, sizeof duty);
        board->seen_cycle = board->avr->cycle;
        return;
    }
    if (memcmp(duty, board->duty, sizeof duty) == 0 || board->avr->cycle - board->seen_cycle < SETTLED_CYCLES) {
        return;
    }
    memcpy(board->duty, duty, sizeof duty);
    if (board->duties_in - board->duties_out == QUEUE) {
        board->lost++;
        return;
    }
    board_duty_t *entry = &board->duties[board->duties_in++ % QUEUE];
    entry->at_cycle = board->seen_cycle;
    memcpy(entry->duty, duty, sizeof duty);
}

/*
 * In its interrupt-and-reset mode the watchdog resets the part if its interrupt is not run before the next time-out (data
 * sheet, section 11.9.2). simavr 1.6 does not: it waits for the interrupt for ever.
 */
static bool bites(board_t *board)
{
    enum { WDIF = 0x80, WDIE = 0x40, WDE = 0x08, DIVIDER = 0x07, KHZ_128_CYCLES = 125 };
    avr_t *avr = board->avr;
    uint8_t control = avr->data[WDTCSR_AT];
    if ((control & (WDIF | WDIE | WDE)) != (WDIF | WDIE | WDE)) {
        board->bites_at_cycle = 0;
    } else if (board->bites_at_cycle == 0) {
        board->bites_at_cycle = avr->cycle + ((uint64_t)KHZ_128_CYCLES * 2048 << (control & DIVIDER));
    }
    return board->bites_at_cycle != 0 && avr->cycle >= board->bites_at_cycle;
}

static void reset_by_watchdog(board_t *board)
{
    avr_t *avr = board->avr;
    board->bites_at_cycle = 0;
    avr_reset(avr);
    avr->data[MCUSR_AT] = 0;
    avr_regbit_set(avr, avr->reset_flags.wdrf);
}

static avr_cycle_count_t poll(avr_t *avr, avr_cycle_count_t when, void *param)
{
    (void)when;
    board_t *board = param;
    while (board->events > 0 && board->heap[0].at_cycle <= avr->cycle) {
        deliver(board, pop(board));
    }
    note_duty(board);
    uint64_t next = avr->cycle + POLL_CYCLES;
    return board->events > 0 && board->heap[0].at_cycle < next ? board->heap[0].at_cycle : next;
}

/* From the program */

static void on_byte(avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq;
    board_t *board = param;
    if (board->bytes_in - board->bytes_out == QUEUE) {
        board->lost++;
        return;
    }
    board_byte_t *entry = &board->bytes[board->bytes_in++ % QUEUE];
    entry->at_cycle = board->avr->cycle + BYTE_CYCLES;
    entry->byte = value & 0xFF;
}

static void on_trigger(avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq;
    board_t *board = param;
    bool was_high = board->trigger;
    board->trigger = value != 0;
    if (!was_high || board->trigger) {
        return;
    }
    board->pings++;
    uint32_t echo_us = board->echo == NULL ? 0 : board->echo();
    if (echo_us > 0) {
        uint64_t begin = board->avr->cycle + PING_TO_ECHO_CYCLES;
        push(board, (event_t){.at_cycle = begin, .kind = ECHO, .value = 1});
        push(board, (event_t){.at_cycle = begin + 16ULL * echo_us, .kind = ECHO, .value = 0});
    }
}

static void on_sleep(avr_t *avr, avr_cycle_count_t cycles)
{
    board_t *board = avr->custom.data;
    board->slept_cycles += cycles + 1;
}

static void be_quiet(avr_t *avr, const int level, const char *format, va_list arguments)
{
    (void)avr, (void)level, (void)format, (void)arguments;
}

/* The level of SDA, which is high but for the IMU: the program never drives it while it reads it. */
static void put_sda(board_t *board)
{
    const uint8_t mask = (uint8_t)(1U << SDA_PIN.pin);
    avr_ioport_external_t external = {.name = 'C', .mask = mask, .value = board->imu.held_clocks == 0 ? mask : 0};
    avr_ioctl(board->avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('C'), &external);
    avr_raise_irq(pin_irq(board, SDA_PIN), board->imu.held_clocks == 0);
}

/* SCL is an open drain: it rises when the program stops driving it. */
static void on_direction(avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq;
    board_t *board = param;
    const bool is_driven = (value >> SCL_PIN.pin & 1U) != 0;
    if (board->scl_driven && !is_driven && board->imu.held_clocks > 0) {
        board->imu.held_clocks--;
        put_sda(board);
    }
    board->scl_driven = is_driven;
}

static void wire(board_t *board)
{
    avr_t *avr = board->avr;
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= (uint32_t) ~(AVR_UART_FLAG_STDIO | AVR_UART_FLAG_POLL_SLEEP);
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), on_byte, board);
    avr_irq_register_notify(pin_irq(board, TRIGGER_PIN), on_trigger, board);
    for (unsigned wheel = 0; wheel < WHEELS; wheel++) {
        board_turn(board, wheel, 0.0, 0.0, 0, 0);
    }
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('C'), IOPORT_IRQ_DIRECTION_ALL), on_direction,
                            board);
    mpu6050_attach(&board->imu, avr);
}

board_t *board_open(const char *elf_path, board_echo_t echo, board_imu_t imu)
{
    avr_global_logger_set(be_quiet);
    elf_firmware_t image = {0};
    if (elf_read_firmware(elf_path, &image) != 0) {
        return NULL;
    }
    board_t *board = calloc(1, sizeof *board);
    avr_t *avr = board == NULL ? NULL : avr_make_mcu_by_name("atmega328p");
    if (avr == NULL) {
        free(board);
        return NULL;
    }
    avr_init(avr);
    avr_load_firmware(avr, &image);
    avr->frequency = FREQUENCY_HZ;
    avr->vcc = avr->avcc = avr->aref = 5000;
    board->avr = avr;
    avr->sleep = on_sleep;
    avr->custom.data = board;
    board->echo = echo;
    board->imu.read = imu;
    board->imu.present = true;
    wire(board);
    return board;
}

void board_close(board_t *board)
{
    avr_terminate(board->avr);
    free(board->avr);
    free(board);
}

bool board_run(board_t *board, uint64_t to_cycle)
{
    avr_t *avr = board->avr;
    while (avr->cycle < to_cycle) {
        /* A reset drops every timer; and what came in since may be due earlier than the next poll. */
        uint64_t next = poll(avr, avr->cycle, board);
        next = next < to_cycle ? next : to_cycle;
        avr_cycle_timer_register(avr, next - avr->cycle, poll, board);
        while (avr->cycle < next) {
            int state = avr_run(avr);
            if (state == cpu_Done || state == cpu_Crashed) {
                return false;
            }
        }
        if (bites(board)) {
            reset_by_watchdog(board);
        }
    }
    note_duty(board);
    return true;
}

uint64_t board_cycle(const board_t *board)
{
    return board->avr->cycle;
}

void board_receive(board_t *board, uint8_t byte, uint64_t at_cycle)
{
    push(board, (event_t){.at_cycle = at_cycle, .kind = RECEIVED, .value = byte});
}

static void push_levels(board_t *board, unsigned wheel, int64_t count, uint64_t at_cycle)
{
    uint8_t levels = LEVELS[(uint64_t)count & 3];
    if (wheel == 0) {
        levels = (uint8_t)((levels >> 1) | ((levels & 1) << 1));
    }
    push(board, (event_t){.at_cycle = at_cycle, .kind = ENCODER, .wheel = (uint8_t)wheel, .value = levels});
}

void board_turn(board_t *board, unsigned wheel, double from_counts, double to_counts, uint64_t from_cycle,
                uint64_t to_cycle)
{
    int64_t first = (int64_t)floor(from_counts), last = (int64_t)floor(to_counts);
    if (to_cycle == 0) {
        push_levels(board, wheel, last, 0);
        return;
    }
    double cycles_a_count = first == last ? 0.0 : (double)(to_cycle - from_cycle) / (to_counts - from_counts);
    int64_t step = last > first ? 1 : -1;
    for (int64_t count = first; count != last; count += step) {
        double crossed = (double)(step > 0 ? count + 1 : count);
        double after = (crossed - from_counts) * cycles_a_count;
        push_levels(board, wheel, count + step, from_cycle + (uint64_t)after);
    }
}

void board_set_battery_mv(board_t *board, uint32_t millivolts)
{
    avr_raise_irq(avr_io_getirq(board->avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC0), millivolts);
}

void board_set_imu(board_t *board, bool present)
{
    mpu6050_power(&board->imu, present);
}

void board_hold_sda(board_t *board, uint8_t clocks)
{
    board->imu.held_clocks = clocks;
    put_sda(board);
}

void board_reset(board_t *board, bool power_on)
{
    avr_t *avr = board->avr;
    if (power_on) {
        memset(avr->data + 0x100, 0xA5, (size_t)avr->ramend - 0xFF);
    }
    avr_reset(avr);
    avr_regbit_t flag = power_on ? avr->reset_flags.porf : avr->reset_flags.extrf;
    avr->data[MCUSR_AT] = 0;
    avr_regbit_set(avr, flag);
}

size_t board_take_bytes(board_t *board, board_byte_t *bytes, size_t capacity)
{
    size_t count = 0;
    while (count < capacity && board->bytes_out != board->bytes_in) {
        bytes[count++] = board->bytes[board->bytes_out++ % QUEUE];
    }
    return count;
}

size_t board_take_duties(board_t *board, board_duty_t *duties, size_t capacity)
{
    size_t count = 0;
    while (count < capacity && board->duties_out != board->duties_in) {
        duties[count++] = board->duties[board->duties_out++ % QUEUE];
    }
    return count;
}

void board_duty(const board_t *board, int16_t duty[WHEELS])
{
    memcpy(duty, board->duty, sizeof board->duty);
}

uint64_t board_slept_cycles(const board_t *board)
{
    return board->slept_cycles;
}

uint32_t board_pings(const board_t *board)
{
    return board->pings;
}

uint32_t board_lost(const board_t *board)
{
    return board->lost;
}

uint8_t board_peek(const board_t *board, uint16_t address)
{
    return board->avr->data[address];
}

void board_poke(board_t *board, uint16_t address, uint8_t value)
{
    board->avr->data[address] = value;
}
