/* A half car with a Besinger law at each end: heave, pitch (nose up), front and rear wheel, and their rates. The laws'
   parameters are the rows 0 to 5 and 6 to 11. Included once. */

typedef struct {
    Row q[8], sum, p[12];
} HalfCarBlock;

/* Accelerations of the four coordinates; `zf` and `zr` are the heights of the road. */
#define HALF_CAR_RATES(z, t, f, r, vz, vt, vf, vr, zf, zr, az, at, af, ar)                                             \
    double az, at, af, ar;                                                                                             \
    {                                                                                                                  \
        double z_ = (z), t_ = (t), f_ = (f), r_ = (r), vz_ = (vz), vt_ = (vt);                                         \
        double front = ks * (z_ + la * t_ - f_) + besinger(p, i, vz_ + la * vt_ - (vf));                               \
        double rear = ks * (z_ - lb * t_ - r_) + besinger(p + 6, i, vz_ - lb * vt_ - (vr));                            \
        az = -(front + rear) * per_m;                                                                                  \
        at = (lb * rear - la * front) * per_j;                                                                         \
        af = (front - kt * (f_ - (zf))) * per_mu;                                                                      \
        ar = (rear - kt * (r_ - (zr))) * per_mu;                                                                       \
    }

#define HALF_CAR_NUMBERS                                                                                               \
    const double ks = car->spring_rate, kt = car->tyre_stiffness;                                                      \
    const double la = car->front_distance, lb = car->rear_distance;                                                    \
    const double per_m = 1.0 / car->sprung_mass, per_j = 1.0 / car->pitch_inertia, per_mu = 1.0 / car->unsprung_mass;

static inline void half_car_rk4_step(HalfCarBlock *restrict b, const Car *car, double h, const double *z0,
                                     const double *z1, double count)
{
    HALF_CAR_NUMBERS
    const double half = 0.5 * h, quarter = 0.25 * h * h, whole = 0.5 * h * h, sixth = h / 6.0;
    const double zf0 = z0[0], zr0 = z0[1], zf1 = z1[0], zr1 = z1[1], zf = 0.5 * (zf0 + zf1), zr = 0.5 * (zr0 + zr1);
    const Row *p = b->p;
    FOR_LANES
    {
        double z = b->q[0][i], t = b->q[1][i], f = b->q[2][i], r = b->q[3][i];
        double vz = b->q[4][i], vt = b->q[5][i], vf = b->q[6][i], vr = b->q[7][i];
        HALF_CAR_RATES(z, t, f, r, vz, vt, vf, vr, zf0, zr0, az1, at1, af1, ar1)
        b->sum[i] += count * az1 * az1;
        HALF_CAR_RATES(z + half * vz, t + half * vt, f + half * vf, r + half * vr, vz + half * az1, vt + half * at1,
                       vf + half * af1, vr + half * ar1, zf, zr, az2, at2, af2, ar2)
        HALF_CAR_RATES(z + half * vz + quarter * az1, t + half * vt + quarter * at1, f + half * vf + quarter * af1,
                       r + half * vr + quarter * ar1, vz + half * az2, vt + half * at2, vf + half * af2,
                       vr + half * ar2, zf, zr, az3, at3, af3, ar3)
        HALF_CAR_RATES(z + h * vz + whole * az2, t + h * vt + whole * at2, f + h * vf + whole * af2,
                       r + h * vr + whole * ar2, vz + h * az3, vt + h * at3, vf + h * af3, vr + h * ar3, zf1, zr1, az4,
                       at4, af4, ar4)
        b->q[0][i] = z + h * (vz + sixth * (az1 + az2 + az3));
        b->q[1][i] = t + h * (vt + sixth * (at1 + at2 + at3));
        b->q[2][i] = f + h * (vf + sixth * (af1 + af2 + af3));
        b->q[3][i] = r + h * (vr + sixth * (ar1 + ar2 + ar3));
        b->q[4][i] = vz + sixth * (az1 + 2.0 * (az2 + az3) + az4);
        b->q[5][i] = vt + sixth * (at1 + 2.0 * (at2 + at3) + at4);
        b->q[6][i] = vf + sixth * (af1 + 2.0 * (af2 + af3) + af4);
        b->q[7][i] = vr + sixth * (ar1 + 2.0 * (ar2 + ar3) + ar4);
    }
}

/* One row of the matrices times motion and forces, and what the road adds. */
#define AHEAD(r)                                                                                                       \
    (driven[r] + m[8 * r] * z + m[8 * r + 1] * t + m[8 * r + 2] * f + m[8 * r + 3] * g + m[8 * r + 4] * vz +           \
     m[8 * r + 5] * vt + m[8 * r + 6] * vf + m[8 * r + 7] * vg + m[80 + 2 * r] * front_before +                        \
     m[81 + 2 * r] * rear_before + m[64 + 2 * r] * front + m[65 + 2 * r] * rear)
#define CORRECTED(r, h) (h + m[96 + 2 * r] * front_bend + m[97 + 2 * r] * rear_bend)

/* As for the quarter car; b->sum takes the acceleration before the step. */
static inline void half_car_exponential_step(HalfCarBlock *restrict b, Row *restrict force, const Car *car,
                                             const double *restrict m, const double *restrict driven)
{
    const double ks = car->spring_rate, la = car->front_distance, lb = car->rear_distance;
    const double per_m = 1.0 / car->sprung_mass;
    const Row *p = b->p;
    FOR_LANES
    {
        double z = b->q[0][i], t = b->q[1][i], f = b->q[2][i], g = b->q[3][i];
        double vz = b->q[4][i], vt = b->q[5][i], vf = b->q[6][i], vg = b->q[7][i];
        double front = force[0][i], rear = force[1][i];
        double front_before = force[2][i], rear_before = force[3][i];
        double a = (ks * (2.0 * z + (la - lb) * t - f - g) + front + rear) * per_m;
        b->sum[i] += a * a;
        double h4 = AHEAD(4), h5 = AHEAD(5), h6 = AHEAD(6), h7 = AHEAD(7);
        double front_bend = besinger(p, i, h4 + la * h5 - h6) - 2.0 * front + front_before;
        double rear_bend = besinger(p + 6, i, h4 - lb * h5 - h7) - 2.0 * rear + rear_before;
        b->q[0][i] = CORRECTED(0, AHEAD(0));
        b->q[1][i] = CORRECTED(1, AHEAD(1));
        b->q[2][i] = CORRECTED(2, AHEAD(2));
        b->q[3][i] = CORRECTED(3, AHEAD(3));
        h4 = CORRECTED(4, h4);
        h5 = CORRECTED(5, h5);
        h6 = CORRECTED(6, h6);
        h7 = CORRECTED(7, h7);
        force[0][i] = besinger(p, i, h4 + la * h5 - h6);
        force[1][i] = besinger(p + 6, i, h4 - lb * h5 - h7);
        force[2][i] = front;
        force[3][i] = rear;
        b->q[4][i] = h4;
        b->q[5][i] = h5;
        b->q[6][i] = h6;
        b->q[7][i] = h7;
    }
}

static void half_car_begin(HalfCarBlock *b, const Car *car, const double *table, long first, long cars,
                           const double *road)
{
    double pitch = (road[0] - road[1]) / (car->front_distance + car->rear_distance);
    for (int i = 0; i < LANES; i++) {
        long row = first + i < cars ? first + i : cars - 1;
        prepare_besinger(table + 10 * row, b->p, i);
        prepare_besinger(table + 10 * row + 5, b->p + 6, i);
        b->q[0][i] = road[0] - car->front_distance * pitch;
        b->q[1][i] = pitch;
        b->q[2][i] = road[0];
        b->q[3][i] = road[1];
        b->q[4][i] = b->q[5][i] = b->q[6][i] = b->q[7][i] = b->sum[i] = 0.0;
    }
}

static void half_car_end(const HalfCarBlock *b, const Car *car, long first, long cars, long steps, double *rms)
{
    HALF_CAR_NUMBERS
    const Row *p = b->p;
    for (int i = 0; i < LANES && first + i < cars; i++) {
        HALF_CAR_RATES(b->q[0][i], b->q[1][i], b->q[2][i], b->q[3][i], b->q[4][i], b->q[5][i], b->q[6][i], b->q[7][i],
                       0.0, 0.0, az, at, af, ar)
        (void)at, (void)af, (void)ar; /* the wheels' depend on the road, the body's does not */
        rms[first + i] = sqrt((b->sum[i] + az * az) / (steps + 1));
    }
}

void half_car_rk4(const Car *car, const double *table, long cars, const double *road, long steps, double dt,
                  int substeps, int threads, double *rms)
{
#pragma omp parallel for schedule(static) num_threads(threads)
    for (long first = 0; first < cars; first += LANES) {
        HalfCarBlock b ALIGNED;
        half_car_begin(&b, car, table, first, cars, road);
        for (long k = 0; k < steps; k++) {
            const double *z = road + 2 * k;
            double front = (z[2] - z[0]) / substeps, rear = (z[3] - z[1]) / substeps;
            for (int j = 0; j < substeps; j++) {
                double z0[2] = {z[0] + j * front, z[1] + j * rear}, z1[2] = {z0[0] + front, z0[1] + rear};
                half_car_rk4_step(&b, car, dt / substeps, z0, z1, j == 0);
            }
        }
        half_car_end(&b, car, first, cars, steps, rms);
    }
}

/* `matrices`: as for the quarter car, Phi (8 x 8) and the others (8 x 2 each). */
void half_car_exponential(const Car *car, const double *table, long cars, const double *road, long steps, double dt,
                          const double *matrices, int threads, double *rms)
{
#pragma omp parallel for schedule(static) num_threads(threads)
    for (long first = 0; first < cars; first += LANES) {
        HalfCarBlock b ALIGNED;
        Row force[4] ALIGNED = {{0.0}, {0.0}, {0.0}, {0.0}};
        half_car_begin(&b, car, table, first, cars, road);
        for (long k = 0; k < steps; k++) {
            const double *z = road + 2 * k, *before = matrices + 112, *after = matrices + 128;
            double driven[8];
            for (int r = 0; r < 8; r++)
                driven[r] = before[2 * r] * z[0] + before[2 * r + 1] * z[1] + after[2 * r] * z[2] +
                            after[2 * r + 1] * z[3];
            half_car_exponential_step(&b, force, car, matrices, driven);
        }
        half_car_end(&b, car, first, cars, steps, rms);
    }
}
