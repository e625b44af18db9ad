/* not_done.c: prints on this screen what a port and its main program still lack. The recipe's step 3 removes it. */
#include "template/not_done.h"

#include <stdio.h>

void not_done(const char *function, const char *what)
{
    fputs(function, stdout);
    fputs(": not done yet: ", stdout);
    puts(what);
}
