/* The same tests on the forms that the RCX runs. */
#define FIX_WITHOUT_LIBRARY
#include "core/fix.c"
#include "test_fix.c"
