/* Start of a Cortex-M4: its stack, and a reset that turns the floating-point unit on. */
#include <stdint.h>

extern void _start(void);
extern uint32_t end_of_memory;

static void reset(void) {
    *(volatile uint32_t *)0xE000ED88 |= 0xF << 20; /* CPACR: coprocessors 10 and 11 */
    __asm__ volatile("dsb\n isb");
    _start();
}

__attribute__((section(".vectors"), used)) static const void *const vectors[] = {
    &end_of_memory, (const void *)reset};
