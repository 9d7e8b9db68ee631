/*
 * The encoders' interrupts, encoder_edge of core/encoder.h by hand: 110 cycles where the compiler takes 200, at up to 23,200 a
 * second. encoders.c holds the offsets to the C structure. The channels of the left encoder are swapped (see there).
 */
#include <avr/io.h>

#include "edges.h"
#include "pins.h"

#define SCRATCH r24
#define LEVELS r25
#define MS_COUNTS 250 /* of timer 2 */

/* r25 = levels of a wheel, from the pins of port D. */
.macro READ_LEVELS first second
    clr LEVELS
    sbic _SFR_IO_ADDR(PIND), \first
    ori LEVELS, 2
    sbic _SFR_IO_ADDR(PIND), \second
    ori LEVELS, 1
.endm

/* r31:r30 = low 16 bits of hal_micros(). A millisecond is over whose tick has not run where its flag is up. Uses r24. */
edge_time:
    lds r30, _SFR_MEM_ADDR(TCNT2)
    clr r31
    sbis _SFR_IO_ADDR(TIFR2), OCF2A
    rjmp 1f
    lds r30, _SFR_MEM_ADDR(TCNT2)
    ldi SCRATCH, MS_COUNTS
    add r30, SCRATCH
    rol r31
1:  lsl r30
    rol r31
    lsl r30
    rol r31
    lds SCRATCH, clock_ms_us
    add r30, SCRATCH
    lds SCRATCH, clock_ms_us + 1
    adc r31, SCRATCH
    ret

/* Counts the change to r25, and notes its time. Uses r24, r30, r31. */
.macro COUNT_EDGE encoder
    lds r30, \encoder + ENCODER_LEVELS_AT
    sts \encoder + ENCODER_LEVELS_AT, LEVELS
    lsl r30
    lsl r30
    or r30, LEVELS
    ldi r31, 0
    subi r30, lo8(-(encoder_steps))
    sbci r31, hi8(-(encoder_steps))
    ld LEVELS, Z
    clr SCRATCH
    sbrc LEVELS, 7
    dec SCRATCH
    lds r30, \encoder + ENCODER_COUNT_AT
    lds r31, \encoder + ENCODER_COUNT_AT + 1
    add r30, LEVELS
    adc r31, SCRATCH
    sts \encoder + ENCODER_COUNT_AT, r30
    sts \encoder + ENCODER_COUNT_AT + 1, r31
    rcall edge_time
    sts \encoder + ENCODER_MICROS_AT, r30
    sts \encoder + ENCODER_MICROS_AT + 1, r31
.endm

.macro ENTER
    push r24
    in r24, _SFR_IO_ADDR(SREG)
    push r24
    push r25
    push r30
    push r31
.endm

leave:
    pop r31
    pop r30
    pop r25
    pop r24
    out _SFR_IO_ADDR(SREG), r24
    pop r24
    reti

/* One edge less of a channel in this millisecond: 6 cycles, and at the last one on to where it is shut. Uses r30. */
.macro SPEND budget shut
    lds r30, edge_budgets + \budget
    dec r30
    sts edge_budgets + \budget, r30
    breq \shut
.endm

#define LEFT_LEVELS READ_LEVELS LEFT_ENCODER_B, LEFT_ENCODER_A
#define RIGHT_LEVELS READ_LEVELS RIGHT_ENCODER_A, RIGHT_ENCODER_B
#define LEFT encoders
#define RIGHT encoders + ENCODER_BYTES

.global INT0_vect
INT0_vect:
    ENTER
    SPEND LEFT_A_BUDGET shut_left_a
1:  LEFT_LEVELS
    rcall count_left
    rjmp leave

shut_left_a:
    cbi _SFR_IO_ADDR(EIMSK), INT0
    rjmp 1b

count_left:
    COUNT_EDGE LEFT
    ret

.global INT1_vect
INT1_vect:
    ENTER
    SPEND RIGHT_A_BUDGET shut_right_a
1:  RIGHT_LEVELS
right_edge:
    COUNT_EDGE RIGHT
    rjmp leave

shut_right_a:
    cbi _SFR_IO_ADDR(EIMSK), INT1
    rjmp 1b

/* No interrupt of this channel any more. Uses r30. */
.macro SHUT_B channel
    lds r30, _SFR_MEM_ADDR(PCMSK2)
    andi r30, ~(1 << \channel)
    sts _SFR_MEM_ADDR(PCMSK2), r30
.endm

/* One channel of each wheel: whichever has changed, or both; or neither, of pulses that are over before they are read. */
.global PCINT2_vect
PCINT2_vect:
    ENTER
    SPEND BOTH_B_BUDGET shut_both_b
1:  LEFT_LEVELS
    lds r30, LEFT + ENCODER_LEVELS_AT
    cpse r30, LEVELS
    rcall left_b
    RIGHT_LEVELS
    lds r30, RIGHT + ENCODER_LEVELS_AT
    cpse r30, LEVELS
    rjmp right_b
    rjmp leave

shut_both_b:
    SHUT_B LEFT_ENCODER_B
    SHUT_B RIGHT_ENCODER_B
    rjmp 1b

left_b:
    SPEND LEFT_B_BUDGET shut_left_b
    rjmp count_left

shut_left_b:
    SHUT_B LEFT_ENCODER_B
    rjmp count_left

right_b:
    SPEND RIGHT_B_BUDGET shut_right_b
    rjmp right_edge

shut_right_b:
    SHUT_B RIGHT_ENCODER_B
    rjmp right_edge
