/* A program without operating system on QEMU's boards mps2-an500 (Cortex-M7) and mps2-an386
   (Cortex-M4): start, output and end by semihosting, and a counter of instructions.

   With `-icount shift=10` QEMU's clock goes on by 1024 ns with each instruction, and the board's
   timer by 1024 / 40 ticks. A real board has DWT->CYCCNT instead, which QEMU has not. */
#include <stdint.h>
#include <stdio.h>
#include <string.h>

int main(void);
void _exit(int status);
int _write(int file, const char *text, int size);
unsigned long instructions(void);

extern char stack_top[], bss_start[], bss_end[]; /* of mps2.ld */

#define CPACR (*(volatile uint32_t *)0xE000ED88)
/* CMSDK timer 0, 25 MHz, counts down. */
#define TIMER_CONTROL (*(volatile uint32_t *)0x40000000)
#define TIMER_VALUE (*(volatile uint32_t *)0x40000004)
#define TIMER_RELOAD (*(volatile uint32_t *)0x40000008)

enum { SYS_WRITE0 = 0x04, SYS_EXIT_EXTENDED = 0x20, APPLICATION_EXIT = 0x20026 };

static void semihosting(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
}

/* Called by newlib's printf. */
int _write(int file, const char *text, int size)
{
    char part[65];
    (void)file;
    for (int at = 0; at < size; at += 64) {
        const int count = size - at < 64 ? size - at : 64;
        memcpy(part, text + at, (size_t)count);
        part[count] = 0;
        semihosting(SYS_WRITE0, part);
    }
    return size;
}

void _exit(int status)
{
    const uint32_t block[2] = {APPLICATION_EXIT, (uint32_t)status};
    semihosting(SYS_EXIT_EXTENDED, block);
    for (;;) {}
}

/* Instructions since the first call; it is to be called every 160 million at least. */
unsigned long instructions(void)
{
    static uint32_t last;
    static uint64_t ticks;
    const uint32_t now = ~TIMER_VALUE;
    ticks += (uint32_t)(now - last);
    last = now;
    return (unsigned long)((ticks * 40 + 512) / 1024);
}

static void reset(void)
{
    CPACR |= 0xFu << 20; /* the floating-point unit */
    __asm__ volatile("dsb\n\tisb");
    memset(bss_start, 0, (size_t)(bss_end - bss_start));
    TIMER_RELOAD = TIMER_VALUE = 0xFFFFFFFFu;
    TIMER_CONTROL = 1;
    const int status = main();
    fflush(stdout);
    _exit(status);
}

static void fault(void)
{
    semihosting(SYS_WRITE0, "error: the processor has faulted\n");
    _exit(70);
}

__attribute__((section(".vectors"), used)) static void (*const vectors[])(void) = {
    (void (*)(void))stack_top, reset, fault, fault, fault, fault, fault,
};
