/* none.c: no law at all. What a program with it takes is the frame of all the others. */
#include "law.h"

void control_begin(void) {}

void control_law(const input_t *input, answer_t *answer)
{
    answer->left = answer->right = answer->left_duty = answer->right_duty = (num)input->phase;
}
