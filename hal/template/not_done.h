/* not_done.h: marks the functions that a new port still lacks. The recipe's step 3 removes this file when port and main
 * program are complete. */
#ifndef BRICKPILOT_TEMPLATE_NOT_DONE_H
#define BRICKPILOT_TEMPLATE_NOT_DONE_H

/* Reports that the function that contains this macro is not written yet; `what` says what the function has to do. */
#define NOT_DONE(what) not_done(__func__, what)

/* Prints a line. The contract suite defines it in tests/contract/port_template.c, where it also fails the test that
 * called it. For a program on this machine, firmware/targets/template/not_done.c defines it. */
void not_done(const char *function, const char *what);

#endif
