/* A loop over steps as a CUDA kernel: one thread for each point, the whole loop in one launch. The lines between the
   marks are printed, the same as those of lanes.c. Compiled as C, threads are a loop, and XLA calls it on a CPU. */
#ifdef __CUDACC__
typedef long long int64_t;
typedef unsigned long long uint64_t;
typedef int int32_t;
typedef unsigned int uint32_t;
#define KERNEL extern "C" __global__
#define restrict __restrict__
#define INFINITY __longlong_as_double(0x7ff0000000000000LL)
#define NAN __longlong_as_double(0x7ff8000000000000LL)
#define POINT ((int64_t)blockIdx.x * blockDim.x + threadIdx.x)
#define UNROLLED _Pragma("unroll")
#else
#include <math.h>
#include <stdbool.h>

#include "call.h"
#define KERNEL static
#define UNROLLED
#define POINT thread
static int64_t thread;
#endif
#define ROW(name, count) double name[(count) ? (count) : 1][1]

enum { SHARED = @shared@, OWN = @own@, NOW = @now@, STATE = @state@, ROWS = @rows@, HOISTED = @hoisted@, KEPT = @kept@ };

KERNEL void steps_of_points(const double *restrict shared, const double *restrict own_in, const double *restrict now_in,
                            const double *restrict state_in, const double *restrict rows, int64_t steps,
                            int64_t points, double *restrict now_out, double *restrict state_out)
{
    const int64_t point = POINT;
    const int lane = 0; /* of one: a thread has its point to itself, in registers */
    ROW(own, OWN);
    ROW(state, STATE);
    ROW(hoisted, HOISTED);
    ROW(kept, KEPT);
    double now[NOW ? NOW : 1];
    if (point >= points)
        return;
    (void)shared, (void)own, (void)hoisted, (void)kept;
    UNROLLED
    for (int i = 0; i < OWN; i++)
        own[i][lane] = own_in[i * points + point];
    UNROLLED
    for (int i = 0; i < STATE; i++)
        state[i][lane] = state_in[i * points + point];
    UNROLLED
    for (int i = 0; i < NOW; i++)
        now[i] = now_in[i];
@once@
    {
@of_point@
    }
    for (int64_t step = 0; step < steps; step++) {
        const double *restrict row = rows + step * ROWS;
        (void)row;
@of_step@
        if (@simple@) {
@of_simple@
        } else {
@of_both@
        }
@next@
    }
    UNROLLED
    for (int i = 0; i < STATE; i++)
        state_out[i * points + point] = state[i][lane];
    if (point == 0)
        for (int i = 0; i < NOW; i++)
            now_out[i] = now[i];
}

#ifndef __CUDACC__
XLA_FFI_Error *loop(XLA_FFI_CallFrame *frame)
{
    if (asks_version(frame))
        return 0;
    void **in = frame->args.args, **out = frame->rets.rets;
    const int64_t steps = size(in[4], 0), points = size(in[3], 1);
    for (thread = 0; thread < points; thread++)
        steps_of_points(numbers(in[0]), numbers(in[1]), numbers(in[2]), numbers(in[3]), numbers(in[4]), steps, points,
                        numbers(out[0]), numbers(out[1]));
    return 0;
}
#endif
