/* What a Cortex-M4F begins with: the vector table, and the floating-point unit switched on. */

#include <stdint.h>

extern uint32_t stack_top;
extern void _start(void);

void reset(void);
void reset(void)
{
    *(volatile uint32_t *)0xe000ed88 |= 0xfu << 20; /* CPACR: coprocessors 10 and 11 */
    __asm__ volatile("dsb\n\tisb");
    _start();
}

static void fault(void)
{
    __asm__ volatile("bkpt 1");
    for (;;) {
    }
}

typedef void (*Handler)(void);
__attribute__((section(".vectors"), used)) static const Handler vectors[16] = {
    (Handler)&stack_top, reset, fault, fault, fault, fault, fault,
};
