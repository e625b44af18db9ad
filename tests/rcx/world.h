/* world.h: the surroundings of a program on the RCX, on gdb's H8/300 simulator. The kernel is Debian's brickOS itself.
 * LEGO's ROM, the interrupts, the converter and the other end of the infrared link are simulated here.
 *
 * Time passes only in world_run(). In each ms the interrupts come, and the other tasks run until they wait.
 * tests/gates/test_rcx_time.py runs the programs in simulated time.
 */
#ifndef BRICKPILOT_RCX_WORLD_H
#define BRICKPILOT_RCX_WORLD_H

#include <stdbool.h>
#include <stdint.h>

/* The program under test. It begins as a task of the kernel; its result is the simulator's exit status. */
int world_main(void);

/* Lets time pass. */
void world_run(uint16_t ms);

/* Sets the converter's reading of input 1, 2 or 3, or, as input 0, of the battery: 0..1023. */
void world_convert(uint8_t input, uint16_t raw);

/* Lets the kernel read the converter, three times at each input. */
void world_converted(void);

/* Holds these buttons from now on, KEY_ bits. */
void world_press(uint8_t keys);

/* Counts the pulses of motors A and C in 256 of the kernel's ticks (2 ms), forward less backward: -256..256. */
void world_pulses(int16_t *a, int16_t *c);

/* Send and receive one whole packet of LNP, with its sum. Receiving waits up to 300 ms and returns the size, or 0 if none came. */
void world_send(const uint8_t *bytes, uint8_t size);
uint8_t world_receive(uint8_t *bytes, uint8_t most);

/* Disturbs the next byte that the brick sends. */
void world_disturb(void);

/* True if the brick has sent something that nobody has received. */
bool world_waits(void);

/* Throws away what the brick has sent and nobody has received. */
void world_forget(void);

/* The size of the kernel's largest free block, measured before world_main(), with all tasks of the kernel running. */
extern uint16_t world_room;

/* Calls the interrupt handler that a vector of the kernel names. */
void world_interrupt(const void *handler);

/* Read from the simulator's standard input (0) and write to its output (1). Return the number of bytes, 0 at the end, or a negative
 * number after an error. */
int16_t world_read(int16_t descriptor, void *bytes, uint16_t size);
int16_t world_write(int16_t descriptor, const void *bytes, uint16_t size);

/* Ends the simulator. */
void world_exit(int16_t status);

/* Write to standard output. */
void world_say(const char *text);
void world_say_number(uint16_t number);

#endif
