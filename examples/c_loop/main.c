/* Computed torque of the 3-RPS at 1 kHz, with the functions that `rps-pin export c rps` writes.

   In each tick the legs' lengths d and speeds are measured, and the forces are those of
       w = w_target + 2 b (d'_target - d') + b^2 (d_target - d),    b = 2 pi 15 Hz,
   by inverse dynamics. The robot is simulated, by rps_step, with a platform of another mass than the
   controller knows; replace `measure` and `drive` by your drives. Nothing is allocated.

       c_loop [-t SECONDS] [-m TRUE_MASS/KNOWN_MASS] [-r]

   -r asks for real-time priority. Ends with 0, or with 1 where a function's status was not 0. */
#define _POSIX_C_SOURCE 200809L
#include "rps.h"

#include <math.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#define LEGS RPS_NA
#define PERIOD 1000000L /* ns */
static const double pi = 3.14159265358979323846;
/* Of leg i in q and in v: see rps.h. */
static const int leg[LEGS] = {1, 3, 5};

static volatile sig_atomic_t interrupted;
static void interrupt(int signal)
{
    (void)signal;
    interrupted = 1;
}

static double seconds(struct timespec t) { return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec; }

static struct timespec now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t;
}

/* The simulated robot ------------------------------------------------------------------------- */

static double plant_q[RPS_NQ], plant_v[RPS_NV], plant_parameters[RPS_NP] = RPS_NOMINAL;

static void measure(double d[LEGS], double rate[LEGS])
{
    for (int i = 0; i < LEGS; ++i) {
        d[i] = plant_q[leg[i]];
        rate[i] = plant_v[leg[i]];
    }
}

static int drive(const double force[LEGS])
{
    static const double h[1] = {1e-9 * PERIOD};
    double q[RPS_NQ], v[RPS_NV], work[1];
    const int status = rps_step(plant_q, plant_v, force, h, plant_parameters, q, v, work);
    memcpy(plant_q, q, sizeof q);
    memcpy(plant_v, v, sizeof v);
    return status;
}

/* The controller ------------------------------------------------------------------------------ */

typedef struct {
    double d[LEGS], rate[LEGS], acceleration[LEGS];
} motion;

/* The legs go out and in by 20 mm, once a second, one after the other. */
static motion target(double t, const double start[LEGS])
{
    static const double amplitude[LEGS] = {0.010, 0.006, -0.004}, omega = 6.283185307179586;
    motion m;
    for (int i = 0; i < LEGS; ++i) {
        m.d[i] = start[i] + amplitude[i] * (1.0 - cos(omega * t));
        m.rate[i] = amplitude[i] * omega * sin(omega * t);
        m.acceleration[i] = amplitude[i] * omega * omega * cos(omega * t);
    }
    return m;
}

/* Sets the forces. q is the configuration of the tick before, and becomes that of this one. */
static int control(double q[RPS_NQ], const double d[LEGS], const double rate[LEGS],
                   const motion *wanted, const double parameters[RPS_NP], double force[LEGS])
{
    const double b = 2.0 * pi * 15.0;
    double guess[RPS_NQ], v[RPS_NV], a[RPS_NV], w[LEGS];
    double gap[1], multipliers[RPS_NC], residual[1];
    int status;

    memcpy(guess, q, sizeof guess);
    for (int i = 0; i < LEGS; ++i) {
        guess[leg[i]] = d[i];
        w[i] = wanted->acceleration[i] + 2.0 * b * (wanted->rate[i] - rate[i])
               + b * b * (wanted->d[i] - d[i]);
    }
    status = rps_closed(guess, parameters, q, gap);
    status |= rps_velocity(q, rate, parameters, v);
    status |= rps_acceleration(q, v, w, parameters, a);
    status |= rps_inverse_dynamics(q, v, a, parameters, force, multipliers, residual);
    return status;
}

/* The loop ------------------------------------------------------------------------------------ */

static void ask_for_real_time(void)
{
    const struct sched_param priority = {.sched_priority = 80};
    if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) perror("memory may be swapped");
    if (sched_setscheduler(0, SCHED_FIFO, &priority) != 0) perror("no real-time priority");
}

int main(int argc, char **argv)
{
    /* Legs of 0.55 m, the platform level above the base's centre: nearly closed. */
    static const double near_home[RPS_NQ] = {1.1, 0.55, 1.1, 0.55, 1.1, 0.55, 0, 0, 0.5, 0, 0, 0, 1};
    static const double parameters[RPS_NP] = RPS_NOMINAL;
    double duration = 3.0, share = 1.2, longest = 0.0, largest_error = 0.0, gap[1];
    double q[RPS_NQ], start[LEGS], still[LEGS], d[LEGS], rate[LEGS], force[LEGS] = {0};
    long ticks = 0, late = 0;
    int status, option;

    while ((option = getopt(argc, argv, "t:m:r")) != -1) switch (option) {
        case 't': duration = atof(optarg); break;
        case 'm': share = atof(optarg); break;
        case 'r': ask_for_real_time(); break;
        default: return 2;
        }
    if (!(duration > 0.0 && share > 0.0 && optind == argc)) {
        fprintf(stderr, "usage: %s [-t SECONDS] [-m TRUE_MASS/KNOWN_MASS] [-r]\n", argv[0]);
        return 2;
    }
    signal(SIGINT, interrupt);
    plant_parameters[0] *= share;
    status = rps_closed(near_home, parameters, plant_q, gap);
    memcpy(q, plant_q, sizeof q);
    measure(start, still);

    struct timespec next = now();
    while (!status && !interrupted && (double)ticks * 1e-9 * PERIOD < duration) {
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, NULL);
        const double begin = seconds(now());

        const motion wanted = target((double)ticks * 1e-9 * PERIOD, start);
        measure(d, rate);
        status = control(q, d, rate, &wanted, parameters, force);

        const double end = seconds(now());
        if (end - begin > longest) longest = end - begin;
        if (end - seconds(next) > 1e-9 * PERIOD) ++late;
        for (int i = 0; i < LEGS; ++i) largest_error = fmax(largest_error, fabs(wanted.d[i] - d[i]));
        if (!status) status = drive(force);
        ++ticks;
        next.tv_nsec += PERIOD;
        if (next.tv_nsec >= 1000000000L) {
            next.tv_nsec -= 1000000000L;
            ++next.tv_sec;
        }
    }
    if (status) {
        memset(force, 0, sizeof force);
        drive(force); /* here: switch the drives off */
        printf("STOPPED after %ld ticks: status %d\n", ticks, status);
        return EXIT_FAILURE;
    }
    printf("%ld ticks, %ld of them ended after the next one's time\n", ticks, late);
    printf("leg error: at most %.4g um\n", 1e6 * largest_error);
    printf("a tick's computation: at most %.1f us\n", 1e6 * longest);
    return EXIT_SUCCESS;
}
