/* test_link.h: the tests of the infrared link, which test_port.c runs with its own. */
#ifndef BRICKPILOT_RCX_TEST_LINK_H
#define BRICKPILOT_RCX_TEST_LINK_H

void run_link_tests(void);

#endif
