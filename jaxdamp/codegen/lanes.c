/* A loop over steps for many points side by side, called by XLA. The lines between the marks are printed. */
#include <math.h>
#include <stdbool.h>

#include "call.h"

#define LANES 32 /* points of a block, which the compiler turns into vectors */
#ifdef __AVX512F__
#define VECTOR 8
#else
#define VECTOR 4
#endif
/* Over all points of a block in groups of four vectors, which take turns or come one after the other. */
#define GROUP (4 * VECTOR)
#define GROUPS for (int base = 0; base < LANES; base += GROUP)
#define PRAGMA(text) _Pragma(#text)
#define IN_TURN(...) PRAGMA(omp simd __VA_ARGS__) for (int lanea = base; lanea < base + VECTOR; lanea++)
#define ONE_BY_ONE(...) PRAGMA(omp simd __VA_ARGS__) for (int lanea = base; lanea < base + GROUP; lanea++)
#define OTHERS const int laneb = lanea + VECTOR, lanec = laneb + VECTOR, laned = lanec + VECTOR
#define ROW(name, count) double name[(count) ? (count) : 1][LANES] __attribute__((aligned(64)))

#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
#define VECTORS __attribute__((simd("notinbranch"))) /* of the C library's libmvec */
VECTORS double exp(double);
VECTORS double log(double);
VECTORS double pow(double, double);
VECTORS double sin(double);
VECTORS double cos(double);
VECTORS double tan(double);
VECTORS double tanh(double);
VECTORS double sinh(double);
VECTORS double cosh(double);
VECTORS double atan(double);
VECTORS double expm1(double);
VECTORS double log1p(double);
#endif

enum { SHARED = @shared@, OWN = @own@, NOW = @now@, STATE = @state@, ROWS = @rows@, HOISTED = @hoisted@, KEPT = @kept@ };
enum { PASSED = @passed@ };

/* shared and own: numbers of all points, and of each point; now and state: what is carried from step to step, the same
   for all points, and of each. Numbers of points lie one after the other, (number, point). */
static void run(const double *restrict shared, const double *restrict own_in, const double *restrict now_in,
                const double *restrict state_in, const double *restrict rows, int64_t steps, int64_t points,
                double *restrict now_out, double *restrict state_out)
{
    (void)shared;
@once@
    for (int64_t first = 0; first < points; first += LANES) {
        const int64_t count = points - first < LANES ? points - first : LANES;
        ROW(own, OWN);
        ROW(state, STATE);
        ROW(hoisted, HOISTED);
        ROW(kept, KEPT); /* of the step before */
        ROW(passed, PASSED); /* from before a loop inside a step to after it */
        double now[NOW ? NOW : 1];
        /* lanes without a point of their own repeat the last */
        for (int i = 0; i < OWN; i++)
            for (int lane = 0; lane < LANES; lane++)
                own[i][lane] = own_in[i * points + first + (lane < count ? lane : count - 1)];
        for (int i = 0; i < STATE; i++)
            for (int lane = 0; lane < LANES; lane++)
                state[i][lane] = state_in[i * points + first + (lane < count ? lane : count - 1)];
        for (int i = 0; i < NOW; i++)
            now[i] = now_in[i];
        for (int lane = 0; lane < LANES; lane++) {
            (void)own, (void)kept, (void)passed;
@of_point@
        }
        for (int64_t step = 0; step < steps; step++) {
            const double *restrict row = rows + step * ROWS;
            (void)row;
@of_step@
            if (@simple@) {
                GROUPS {
@of_simple@
                }
            } else {
                GROUPS {
@of_both@
                }
            }
@next@
        }
        for (int i = 0; i < STATE; i++)
            for (int lane = 0; lane < count; lane++)
                state_out[i * points + first + lane] = state[i][lane];
        for (int i = 0; i < NOW; i++)
            now_out[i] = now[i];
    }
}

XLA_FFI_Error *loop(XLA_FFI_CallFrame *frame)
{
    if (asks_version(frame))
        return 0;
    void **in = frame->args.args, **out = frame->rets.rets;
    run(numbers(in[0]), numbers(in[1]), numbers(in[2]), numbers(in[3]), numbers(in[4]), size(in[4], 0), size(in[3], 1),
        numbers(out[0]), numbers(out[1]));
    return 0;
}
