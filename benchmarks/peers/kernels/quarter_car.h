/* A quarter car under the law LAW; included once for each law. Coordinates: heights of body and wheel, their rates. */

#define LAW_(suffix) JOIN(LAW, suffix)

typedef struct {
    Row zs, zu, vs, vu, s, sum, memory[2], before[2], p[MOST_PARAMETERS];
} LAW_(_Block);

/* Accelerations of body and wheel and the rate of the law's state; `z` is the height of the road. */
#define RATES(zs, zu, vs, vu, s, z, as, au, ds)                                                                        \
    double as, au, ds = LAW_(_rate)(p, i, (zs) - (zu), (vs) - (vu), s, &b->memory[0][i]);                              \
    {                                                                                                                  \
        double pull = ks * ((zs) - (zu)) + LAW_(_force)(p, i, (zs) - (zu), (vs) - (vu), s);                            \
        as = -pull * per_ms;                                                                                           \
        au = (pull - kt * ((zu) - (z))) * per_mu;                                                                      \
    }

/* Classic RK4 over a whole step of a linear road in `substeps` steps of h. Heights are integrals of rates, so their
   stages are written out. `count` is 1 where the first stage is at an instant. */
static inline void LAW_(_rk4_step)(LAW_(_Block) *restrict b, const Car *car, double h, double z0, double z1,
                                   double count)
{
    const double ks = car->spring_rate, kt = car->tyre_stiffness;
    const double per_ms = 1.0 / car->sprung_mass, per_mu = 1.0 / car->unsprung_mass;
    const double half = 0.5 * h, quarter = 0.25 * h * h, sixth = h / 6.0, zh = 0.5 * (z0 + z1);
    const Row *p = b->p;
    FOR_LANES
    {
        double zs = b->zs[i], zu = b->zu[i], vs = b->vs[i], vu = b->vu[i], s = b->s[i];
        RATES(zs, zu, vs, vu, s, z0, as1, au1, d1)
        b->sum[i] += count * as1 * as1;
        RATES(zs + half * vs, zu + half * vu, vs + half * as1, vu + half * au1, s + half * d1, zh, as2, au2, d2)
        RATES(zs + half * vs + quarter * as1, zu + half * vu + quarter * au1, vs + half * as2, vu + half * au2,
              s + half * d2, zh, as3, au3, d3)
        RATES(zs + h * vs + 2.0 * quarter * as2, zu + h * vu + 2.0 * quarter * au2, vs + h * as3, vu + h * au3,
              s + h * d3, z1, as4, au4, d4)
        b->zs[i] = zs + h * (vs + sixth * (as1 + as2 + as3));
        b->zu[i] = zu + h * (vu + sixth * (au1 + au2 + au3));
        b->vs[i] = vs + sixth * (as1 + 2.0 * (as2 + as3) + as4);
        b->vu[i] = vu + sixth * (au1 + 2.0 * (au2 + au3) + au4);
        b->s[i] = s + sixth * (d1 + 2.0 * (d2 + d3) + d4);
    }
}

/* The exponential step. `driven` is what the road adds to the motion, `m` the matrices; `force` is that now, then that
   one step earlier. The force at the end is predicted, from the motion under the forces extrapolated or, where the
   state of the law is smooth, from the state extrapolated over the last steps; then the motion is corrected by what the
   forces bend. b->sum takes the acceleration before the step. */
static inline void LAW_(_exponential_step)(LAW_(_Block) *restrict b, Row *restrict force, const Car *car, double dt,
                                           const double *restrict m, const double *restrict driven)
{
    const double ks = car->spring_rate, per_ms = 1.0 / car->sprung_mass;
    const double d0 = driven[0], d1 = driven[1], d2 = driven[2], d3 = driven[3];
    const Row *p = b->p;
    FOR_LANES
    {
        double zs = b->zs[i], zu = b->zu[i], vs = b->vs[i], vu = b->vu[i], s = b->s[i];
        double f = force[0][i], g = force[1][i];
        double a = (ks * (zs - zu) + f) * per_ms;
        b->sum[i] += a * a;
        double h0 = d0 + m[0] * zs + m[1] * zu + m[2] * vs + m[3] * vu + m[20] * g + m[16] * f;
        double h1 = d1 + m[4] * zs + m[5] * zu + m[6] * vs + m[7] * vu + m[21] * g + m[17] * f;
        double h2 = d2 + m[8] * zs + m[9] * zu + m[10] * vs + m[11] * vu + m[22] * g + m[18] * f;
        double h3 = d3 + m[12] * zs + m[13] * zu + m[14] * vs + m[15] * vu + m[23] * g + m[19] * f;
#if LAW_(_SMOOTH)
        double next = 3.0 * (s - b->before[0][i]) + b->before[1][i];
        b->before[1][i] = b->before[0][i];
        b->before[0][i] = s;
#else
        double next = LAW_(_predict)(p, i, h0 - h1, h2 - h3, s, vs - vu, dt, &b->memory[0][i]);
#endif
        double bend = LAW_(_force)(p, i, h0 - h1, h2 - h3, next) - 2.0 * f + g;
        h0 += m[24] * bend;
        h1 += m[25] * bend;
        h2 += m[26] * bend;
        h3 += m[27] * bend;
        next = LAW_(_advance)(p, i, h0 - h1, h2 - h3, s, vs - vu, dt, &b->memory[0][i]);
        force[0][i] = LAW_(_force)(p, i, h0 - h1, h2 - h3, next);
        force[1][i] = f;
        b->zs[i] = h0;
        b->zu[i] = h1;
        b->vs[i] = h2;
        b->vu[i] = h3;
        b->s[i] = next;
    }
}

/* The block of the cars from `first` on, at rest on the road; lanes without a car of their own repeat the last. */
static void LAW_(_begin)(LAW_(_Block) *b, const double *table, long first, long cars, double height, double dt)
{
    for (int i = 0; i < LANES; i++) {
        long row = first + i < cars ? first + i : cars - 1;
        LAW_(_prepare)(table + row * LAW_(_PARAMETERS), b->p, i, dt);
        b->zs[i] = b->zu[i] = height;
        b->vs[i] = b->vu[i] = b->s[i] = b->sum[i] = 0.0;
        b->memory[0][i] = b->memory[1][i] = b->before[0][i] = b->before[1][i] = 0.0;
    }
}

/* The mean over all instants: the last of them is not at the start of a step. */
static void LAW_(_end)(const LAW_(_Block) *b, const Car *car, long first, long cars, long steps, double *rms)
{
    const Row *p = b->p;
    for (int i = 0; i < LANES && first + i < cars; i++) {
        double x = b->zs[i] - b->zu[i];
        double a = (car->spring_rate * x + LAW_(_force)(p, i, x, b->vs[i] - b->vu[i], b->s[i])) / car->sprung_mass;
        rms[first + i] = sqrt((b->sum[i] + a * a) / (steps + 1));
    }
}

void LAW_(_rk4)(const Car *car, const double *table, long cars, const double *road, long steps, double dt, int substeps,
                int threads, double *rms)
{
#pragma omp parallel for schedule(static) num_threads(threads)
    for (long first = 0; first < cars; first += LANES) {
        LAW_(_Block) b ALIGNED;
        LAW_(_begin)(&b, table, first, cars, road[0], dt);
        for (long k = 0; k < steps; k++) {
            double rise = (road[k + 1] - road[k]) / substeps;
            for (int j = 0; j < substeps; j++)
                LAW_(_rk4_step)(&b, car, dt / substeps, road[k] + j * rise, road[k] + (j + 1) * rise, j == 0);
        }
        LAW_(_end)(&b, car, first, cars, steps, rms);
    }
}

/* `matrices`: Phi (4 x 4), then those of the forces now and one step earlier, of their bend, and of the road's heights
   before and after the step (4 each). */
void LAW_(_exponential)(const Car *car, const double *table, long cars, const double *road, long steps, double dt,
                        const double *matrices, int threads, double *rms)
{
#pragma omp parallel for schedule(static) num_threads(threads)
    for (long first = 0; first < cars; first += LANES) {
        LAW_(_Block) b ALIGNED;
        Row force[2] ALIGNED = {{0.0}, {0.0}};
        LAW_(_begin)(&b, table, first, cars, road[0], dt);
        for (long k = 0; k < steps; k++) {
            double driven[4];
            for (int r = 0; r < 4; r++)
                driven[r] = matrices[28 + r] * road[k] + matrices[32 + r] * road[k + 1];
            LAW_(_exponential_step)(&b, force, car, dt, matrices, driven);
        }
        LAW_(_end)(&b, car, first, cars, steps, rms);
    }
}

#undef RATES
#undef LAW_
#undef LAW
