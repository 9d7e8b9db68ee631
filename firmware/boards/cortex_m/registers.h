/*
 * Registers that LM3S6965 and TM4C123 have at the same addresses. Only what is used here. Each group names its chapter in
 * the TM4C123GH6PM's data sheet (SPMS376E), by which it was written; what QEMU does not have was never run.
 */
#ifndef REGISTERS_H
#define REGISTERS_H

#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))

/* Cortex-M's own: 3.1 System Timer, 3.2 NVIC, 3.3 System Control Block */
#define SYSTICK_CTRL REGISTER(0xE000E010U)
#define SYSTICK_LOAD REGISTER(0xE000E014U)
#define SYSTICK_VALUE REGISTER(0xE000E018U)
#define NVIC_ENABLE(irq) REGISTER(0xE000E100U + (4U * ((irq) / 32U)))
#define NVIC_DISABLE(irq) REGISTER(0xE000E180U + (4U * ((irq) / 32U)))
#define NVIC_PEND(irq) REGISTER(0xE000E200U + (4U * ((irq) / 32U)))
#define NVIC_UNPEND(irq) REGISTER(0xE000E280U + (4U * ((irq) / 32U)))
#define NVIC_PRIORITY(irq) (*(volatile uint8_t *)(0xE000E400U + (irq)))
#define IRQ_BIT(irq) (1U << ((irq) % 32U))
#define AIRCR REGISTER(0xE000ED0CU)
#define AIRCR_SYSRESETREQ 0x05FA0004U

/* Interrupts, by number: table 2-9 (its vector less 16) */
#define IRQ_GPIO_A 0U
#define IRQ_GPIO_C 2U
#define IRQ_GPIO_D 3U
#define IRQ_UART0 5U
#define IRQ_WATCHDOG 18U
#define IRQ_TIMER0A 19U
#define IRQ_GPIO_F 30U
#define IRQ_I2C3 69U /* TM4C123 only */

/* System control: 5.5 */
#define SYSCTL_PBORCTL REGISTER(0x400FE030U)
#define SYSCTL_RIS REGISTER(0x400FE050U)
#define SYSCTL_RESC REGISTER(0x400FE05CU)
#define SYSCTL_RCC REGISTER(0x400FE060U)
#define RIS_CRYSTAL_RUNS (1U << 8)
#define RIS_PLL_LOCKED (1U << 6)
#define RCC_BYPASS (1U << 11)
#define RCC_USE_DIVIDER (1U << 22)
#define RESC_EXTERNAL 1U
#define RESC_POWER_ON 2U
#define RESC_BROWN_OUT 4U
#define RESC_WATCHDOG 8U
#define RESC_SOFTWARE 16U

/* Serial line 0: 14.5 */
#define UART0_DATA REGISTER(0x4000C000U)
#define UART0_FLAGS REGISTER(0x4000C018U)
#define UART0_IBRD REGISTER(0x4000C024U)
#define UART0_FBRD REGISTER(0x4000C028U)
#define UART0_LCRH REGISTER(0x4000C02CU)
#define UART0_CTL REGISTER(0x4000C030U)
#define UART0_MASK REGISTER(0x4000C038U)
#define UART0_CLEAR REGISTER(0x4000C044U)
#define FLAG_TX_FULL (1U << 5)
#define FLAG_RX_EMPTY (1U << 4)
#define DATA_ERRORS 0xF00U
#define INTERRUPT_RX (1U << 4)
#define INTERRUPT_TX (1U << 5)
#define INTERRUPT_RX_TIMEOUT (1U << 6)

/* Timer 0: 11.5 */
#define TIMER0_CFG REGISTER(0x40030000U)
#define TIMER0_TAMR REGISTER(0x40030004U)
#define TIMER0_CTL REGISTER(0x4003000CU)
#define TIMER0_MASK REGISTER(0x40030018U)
#define TIMER0_CLEAR REGISTER(0x40030024U)
#define TIMER0_TAILR REGISTER(0x40030028U)

/* Watchdog 0: 12.4 */
#define WATCHDOG_LOAD REGISTER(0x40000000U)
#define WATCHDOG_CTL REGISTER(0x40000008U)
#define WATCHDOG_CLEAR REGISTER(0x4000000CU)
#define WATCHDOG_LOCK REGISTER(0x40000C00U)
#define WATCHDOG_UNLOCK 0x1ACCE551U
#define WATCHDOG_INTERRUPT 1U
#define WATCHDOG_RESET 2U

/* Ports: 10.5 */
#define PORT_A 0x40004000U
#define PORT_C 0x40006000U
#define PORT_D 0x40007000U
#define PORT_E 0x40024000U
#define PORT_F 0x40025000U
#define PIN(number) (1U << (number))
/* Reads and writes of these pins only: the address is the mask. */
#define GPIO_DATA(port, pins) REGISTER((port) + ((pins) << 2))
#define GPIO_DIR(port) REGISTER((port) + 0x400U)
#define GPIO_BOTH_EDGES(port) REGISTER((port) + 0x408U)
#define GPIO_MASK(port) REGISTER((port) + 0x410U)
#define GPIO_STATUS(port) REGISTER((port) + 0x418U)
#define GPIO_CLEAR(port) REGISTER((port) + 0x41CU)
#define GPIO_AFSEL(port) REGISTER((port) + 0x420U)
#define GPIO_PULL_UP(port) REGISTER((port) + 0x510U)
#define GPIO_DIGITAL(port) REGISTER((port) + 0x51CU)
#define GPIO_LOCK(port) REGISTER((port) + 0x520U)
#define GPIO_COMMIT(port) REGISTER((port) + 0x524U)
#define GPIO_ANALOGUE(port) REGISTER((port) + 0x528U)
#define GPIO_PCTL(port) REGISTER((port) + 0x52CU)

#endif
