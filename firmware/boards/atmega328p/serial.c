/* The serial line: 115200 baud, 8N1, both directions by interrupts. */
#include "hal.h"

void serial_start(void)
{
    UCSR0A = _BV(U2X0);
    UBRR0 = 16U; /* 117647 baud: 2.1 % fast, 3.5 % slow without U2X */
    UCSR0C = (uint8_t)(_BV(UCSZ01) | _BV(UCSZ00));
    UCSR0B = (uint8_t)(_BV(RXCIE0) | _BV(RXEN0) | _BV(TXEN0));
}

void hal_start_sending(void)
{
    UCSR0B |= (uint8_t)_BV(UDRIE0);
}

void serial_drain(void)
{
    while ((UCSR0A & _BV(RXC0)) != 0U) {
        firmware_received_early(UDR0);
    }
}

#define QUIET_LOOKS 200U /* 0.1 ms of a line that is high: no byte is on its way */
#define MOST_LOOKS 8000U /* a host that never stops writing is not waited for: 4 ms */

void serial_await_quiet(void)
{
    uint8_t quiet = 0U;
    for (uint16_t look = 0U; (look < MOST_LOOKS) && (quiet < QUIET_LOOKS); look++) {
        serial_drain();
        quiet = ((PIND & _BV(PD0)) != 0U) ? (uint8_t)(quiet + 1U) : 0U;
    }
}

ISR(USART_RX_vect)
{
    const uint8_t status = UCSR0A;
    const uint8_t byte = UDR0;
    if ((status & (_BV(FE0) | _BV(DOR0))) != 0U) {
        firmware_receive_lost();
    }
    firmware_received(byte);
}

ISR(USART_UDRE_vect)
{
    uint8_t byte;
    if (firmware_next_byte(&byte)) {
        UDR0 = byte;
    } else {
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
    }
}
