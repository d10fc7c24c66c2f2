/* Hand-written peers: many cars with dampers of their own over one road, RMS acceleration of the body. C99, double.

   Compile with -O3 -march=native -ffast-math -fopenmp. Exported for each law: <law>_rk4 and <law>_exponential; and
   skyhook_exponential. */

#include "laws.h"

#define LAW besinger
#include "quarter_car.h"

#define LAW lag
#include "quarter_car.h"

#define LAW series_spring
#include "quarter_car.h"

#define LAW bouc_wen
#include "quarter_car.h"

#include "half_car.h"
#include "skyhook.h"

int lanes(void) { return LANES; }
