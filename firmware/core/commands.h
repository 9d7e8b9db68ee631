/* What the host asks: the mode of the wire, and what each line does. Main loop only. */
#ifndef COMMANDS_H
#define COMMANDS_H

#include <stdbool.h>
#include <stdint.h>

#include "receive.h"

/* Classic mode; nothing was asked. */
void commands_start(void);

/* Obeys a line, or refuses and counts it. */
void commands_take(const struct line *line);

/* Back to the classic mode after 2 s without a valid line; call it each pass. */
void commands_run(void);

/* Whether the wire is in the checked mode. */
bool commands_is_checked(void);

/* Whether `r` was obeyed, and its 50 ms are over. */
bool commands_is_reset_due(void);

/* Whether `r` was obeyed: no cycle begins any more. */
bool commands_is_resetting(void);

#endif
