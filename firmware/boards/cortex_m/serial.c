/* Serial line 0: 115200 baud, 8N1, both directions by interrupts, without the FIFOs, so that a line's time is its own. */
#include "hal.h"
#include "registers.h"

#define INTEGER 27U /* 50 MHz / 16 / 115200 = 27.127 */
#define FRACTION 8U
#define EIGHT_BITS 0x60U
#define ENABLED 0x301U

void on_uart0(void);

void serial_start(void)
{
    UART0_CTL = 0U;
    UART0_IBRD = INTEGER;
    UART0_FBRD = FRACTION;
    UART0_LCRH = EIGHT_BITS;
    UART0_MASK = INTERRUPT_RX | INTERRUPT_RX_TIMEOUT | INTERRUPT_TX;
    UART0_CTL = ENABLED;
    interrupt_enable(IRQ_UART0, PRIORITY_EDGES);
}

/* The line's interrupt comes when a byte has left: for the first one it is called by hand. */
void hal_start_sending(void)
{
    NVIC_PEND(IRQ_UART0) = IRQ_BIT(IRQ_UART0);
}

#ifdef HANGS
extern volatile uint32_t hang;

/* A byte from 1 to 4 is the command of the test image; no line has one. */
static void serial_test(uint8_t byte)
{
    if ((byte >= 1U) && (byte <= 4U)) {
        hang = byte;
    }
}
#else
static inline void serial_test(uint8_t byte)
{
    (void)byte;
}
#endif

void on_uart0(void)
{
    UART0_CLEAR = INTERRUPT_RX | INTERRUPT_RX_TIMEOUT | INTERRUPT_TX;
    while ((UART0_FLAGS & FLAG_RX_EMPTY) == 0U) {
        const uint32_t data = UART0_DATA;
        if ((data & DATA_ERRORS) != 0U) {
            firmware_receive_lost();
        }
        serial_test((uint8_t)data);
#ifdef HAL_OBSERVED
        observed.heard_us = hal_micros();
#endif
        firmware_received((uint8_t)data);
    }
    uint8_t byte;
    while (((UART0_FLAGS & FLAG_TX_FULL) == 0U) && firmware_next_byte(&byte)) {
        UART0_DATA = byte;
    }
}
