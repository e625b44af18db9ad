/* not_done.h: marks the functions that a new port still lacks. The recipe's step 3 removes it when port and main
 * program do everything. */
#ifndef BRICKPILOT_TEMPLATE_NOT_DONE_H
#define BRICKPILOT_TEMPLATE_NOT_DONE_H

/* Reports that the function that contains it is not done yet; `what` says what it has to do. */
#define NOT_DONE(what) not_done(__func__, what)

/* The contract suite defines it (tests/contract/port_template.c): it prints a line, and the test that got here fails. So does
 * firmware/targets/template/not_done.c, for a program on this machine. */
void not_done(const char *function, const char *what);

#endif
