/* Cars advance in blocks: an inner loop over LANES of them, which the compiler turns into vector instructions, keeps
   the motion of a block in the first-level cache while it is driven over the whole road. Threads share the blocks. */
#ifndef LANES_H
#define LANES_H

#include <math.h>

#ifndef LANES
#define LANES 32
#endif

#define MOST_PARAMETERS 16

typedef struct { /* in SI units */
    double sprung_mass, unsprung_mass, spring_rate, tyre_stiffness;
    double pitch_inertia, front_distance, rear_distance; /* of the half car */
} Car;

typedef double Row[LANES]; /* one number of each car in a block */

#define ALIGNED __attribute__((aligned(64)))
#define FOR_LANES _Pragma("omp simd") for (int i = 0; i < LANES; i++)

#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)

#endif
