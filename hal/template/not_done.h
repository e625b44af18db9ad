/* not_done.h: marks the functions that a new port still lacks. The recipe's step 3 removes it when port and main
 * program do everything. */
#ifndef BRICKPILOT_TEMPLATE_NOT_DONE_H
#define BRICKPILOT_TEMPLATE_NOT_DONE_H

/* Reports that the function that contains it is not done yet; `what` says what it has to do. */
#define NOT_DONE(what) not_done(__func__, what)

/* The contract suite defines it in tests/contract/port_template.c: it prints a line, and the test that called it fails.
 * For a program on this machine, firmware/targets/template/not_done.c defines it. */
void not_done(const char *function, const char *what);

#endif
