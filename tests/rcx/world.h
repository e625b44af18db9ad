/* world.h: what surrounds a program on the RCX, on gdb's H8/300 simulator: the kernel is Debian's brickOS itself, LEGO's ROM, the
 * interrupts, the converter and the other end of the infrared link are here.
 *
 * Time passes only in world_run(): a ms each, with its interrupts, and the other tasks run until they wait.
 */
#ifndef BRICKPILOT_RCX_WORLD_H
#define BRICKPILOT_RCX_WORLD_H

#include <stdbool.h>
#include <stdint.h>

/* The program under test: begins as a task of the kernel; what it returns is the simulator's exit status. */
int world_main(void);

void world_run(uint16_t ms);

/* Inputs 1 to 3 and, as 0, the battery: what the converter shows, 0..1023. */
void world_convert(uint8_t input, uint16_t raw);

/* The kernel looks at what the converter shows, at every input thrice. */
void world_converted(void);

/* Buttons held, KEY_ bits, from now on. */
void world_press(uint8_t keys);

/* Pulses of motors A and C in 256 ms, forward less backward, -256..256. */
void world_pulses(int16_t *a, int16_t *c);

/* One packet of LNP to and from the brick, whole, with its sum. Receiving waits for it for up to 300 ms; 0: none came. */
void world_send(const uint8_t *bytes, uint8_t size);
uint8_t world_receive(uint8_t *bytes, uint8_t most);

/* The next byte that the brick sends is disturbed on its way. */
void world_disturb(void);

/* Something has been sent and not received. */
bool world_waits(void);

/* What has been sent and not received is gone. */
void world_forget(void);

/* What the kernel's largest free block takes, counted before world_main() with all tasks of the kernel running. */
extern uint16_t world_room;

/* One byte time of the infrared line: true where the brick has sent a byte, which it hears itself, disturbed or not. */
bool world_line(bool disturbed, uint8_t *sent);

/* An interrupt, whose handler stands in the kernel's vector. */
void world_interrupt(const void *handler);

/* Bytes read from and written to the simulator's own standard input (0) and output (1); 0 at the end, below 0 on error. */
int16_t world_read(int16_t descriptor, void *bytes, uint16_t size);
int16_t world_write(int16_t descriptor, const void *bytes, uint16_t size);

/* The simulator ends. */
void world_exit(int16_t status);

void world_say(const char *text);
void world_say_number(uint16_t number);

#endif
