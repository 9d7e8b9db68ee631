/* From the reset to the main loop: motors off, memory, parts, program. */
#include "hal.h"
#include "image.h"
#include "registers.h"

#define RESTARTED_BY_SOFTWARE 0x5AFE2E57U
#define HAS_RUN 0x0B0A2D01U

extern uint32_t stack_end[];
extern uint32_t data_begin[];
extern uint32_t data_end[];
extern const uint32_t data_image[];
extern uint32_t bss_begin[];
extern uint32_t bss_end[];

static uint32_t restarted HAL_KEPT;
static uint32_t has_run HAL_KEPT;

void on_reset(void);
int main(void);

/* An emulator that does not tell the cause has RAM that tells whether the program ran before. */
static uint8_t reset_cause(void)
{
    const uint32_t flags = SYSCTL_RESC;
    const uint32_t note = restarted;
    const uint32_t ran = has_run;
    SYSCTL_RESC = 0U;
    restarted = 0U;
    has_run = HAS_RUN;
    if ((flags & RESC_POWER_ON) != 0U) {
        return RESET_POWER_ON;
    }
    if ((note == RESTARTED_BY_SOFTWARE) || ((flags & RESC_SOFTWARE) != 0U)) {
        return RESET_SOFTWARE;
    }
    if ((flags & RESC_BROWN_OUT) != 0U) {
        return RESET_BROWN_OUT;
    }
    if ((flags & RESC_WATCHDOG) != 0U) {
        return RESET_WATCHDOG;
    }
    if ((flags & RESC_EXTERNAL) != 0U) {
        return RESET_PIN;
    }
    if (ran == HAS_RUN) {
        return RESET_WATCHDOG;
    }
    return (ran == 0U) ? RESET_POWER_ON : RESET_PIN; /* memory that was damaged is no power-on */
}

void on_reset(void)
{
    system_start();
    hal_motors_off();
    const uint32_t *from = data_image;
    /* The linker's symbols are the ends of one object each. */
    // cppcheck-suppress comparePointers
    for (uint32_t *to = data_begin; to < data_end; to++) {
        *to = *from;
        from++;
    }
    // cppcheck-suppress comparePointers
    for (uint32_t *to = bss_begin; to < bss_end; to++) {
        *to = 0U;
    }
    (void)main();
}

#ifdef HANGS
/*
 * For tests, in an image of its own: the serial line sets it. 1: the main loop hangs, 2: with interrupts shut, 3: no tick,
 * 4: for LATE_US only.
 */
extern volatile uint32_t hang;
volatile uint32_t hang;

#define LATE_US 150000U

static void hang_if_told(void)
{
    const uint32_t begun_us = hal_micros();
    if (hang == 2U) {
        (void)hal_lock();
    } else if (hang == 3U) {
        TIMER0_MASK = 0U;
    }
    while ((hang != 0U) && ((hang != 4U) || ((uint32_t)(hal_micros() - begun_us) < LATE_US))) {
    }
    hang = 0U;
}
#else
static inline void hang_if_told(void) {}
#endif

int main(void)
{
    const uint8_t cause = reset_cause();
    (void)hal_lock();
    pins_start();
    serial_start();
    image_check(cause);
    clock_start();
    encoders_start();
    sensors_of_board_start();
    firmware_start(cause);
    for (;;) {
        hang_if_told();
        firmware_pass();
        __asm__ volatile("wfi");
    }
}

void hal_let_interrupts_in(void)
{
    hal_unlock(0U);
}

#define LOOKS_A_SECOND 5000000U /* at 50 MHz, about */

void hal_say_for_ever(const char *text)
{
    for (;;) {
        hal_motors_off();
        for (const char *next = text; *next != '\0'; next++) {
            while ((UART0_FLAGS & FLAG_TX_FULL) != 0U) {
            }
            UART0_DATA = (uint32_t)*next;
        }
        for (uint32_t look = 0U; look < LOOKS_A_SECOND; look++) {
            (void)UART0_FLAGS;
        }
    }
}

void hal_restart(void)
{
    (void)hal_lock();
    restarted = RESTARTED_BY_SOFTWARE;
    AIRCR = AIRCR_SYSRESETREQ;
    for (;;) {
    }
}

/* What came while it was disabled is forgotten. */
void interrupt_enable(uint32_t irq, uint8_t priority)
{
    NVIC_PRIORITY(irq) = priority;
    NVIC_UNPEND(irq) = IRQ_BIT(irq);
    NVIC_ENABLE(irq) = IRQ_BIT(irq);
}

void interrupt_disable(uint32_t irq)
{
    NVIC_DISABLE(irq) = IRQ_BIT(irq);
}

/* A fault of the program: as its watchdog. */
static void on_fault(void)
{
    firmware_watchdog();
}

static void on_nothing(void) {}

void on_uart0(void);
void on_tick(void);
void on_watchdog(void);
void on_encoder(void);

__attribute__((weak)) void on_gpio_a(void) {}
__attribute__((weak)) void on_i2c3(void) {}

typedef void (*handler_t)(void);

#define FIRST_IRQ 16U

__attribute__((section(".vectors"), used)) static const handler_t vectors[FIRST_IRQ + IRQ_I2C3 + 1U] = {
    (handler_t)stack_end,
    on_reset,
    on_fault,
    on_fault,
    on_fault,
    on_fault,
    on_fault,
    [11] = on_nothing,
    [12] = on_nothing,
    [14] = on_nothing,
    [15] = on_nothing,
    [FIRST_IRQ + IRQ_GPIO_A] = on_gpio_a,
    [FIRST_IRQ + IRQ_GPIO_C] = on_encoder,
    [FIRST_IRQ + IRQ_GPIO_D] = on_encoder,
    [FIRST_IRQ + IRQ_UART0] = on_uart0,
    [FIRST_IRQ + IRQ_WATCHDOG] = on_watchdog,
    [FIRST_IRQ + IRQ_TIMER0A] = on_tick,
    [FIRST_IRQ + IRQ_GPIO_F] = on_encoder,
    [FIRST_IRQ + IRQ_I2C3] = on_i2c3,
};
