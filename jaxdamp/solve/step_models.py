"""The step of a constrained search: to the minimum of quadratic models of all rows in a box."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float


LARGE = 10.0  # penalty above which the sum is divided by it
ATTEMPTS = 3  # a search may end where limits are violated by more than the step gains, and goes on from there


class StepModels(NamedTuple):
    """Quadratic models of scaled rows around a point: objectives first, then limited functions.

    Attributes:
        level: rows at the point, objectives relative to the largest excess over an aim.
        slopes: derivatives there.
        curvature: second derivatives.
        planes: values at the point of further lower bounds of the rows, by row.
        plane_slopes: their derivatives.
        objectives: number of objectives.
        share: of the sum of the objectives in what is minimised.
        penalty: of the largest violation of a limit.
    """

    level: Float[np.ndarray, " rows"]
    slopes: Float[np.ndarray, "rows free"]
    curvature: Float[np.ndarray, "rows free free"]
    planes: Float[np.ndarray, " planes"]
    plane_slopes: Float[np.ndarray, "planes free"]
    objectives: int
    share: float
    penalty: float

    def change(self, step: Float[np.ndarray, " free"]) -> tuple[np.ndarray, np.ndarray]:
        """How much the rows change with a step, and the derivatives of that."""
        bent = self.curvature @ step
        return self.slopes @ step + 0.5 * bent @ step, self.slopes + bent

    def of_largest(self, box: Float[np.ndarray, " free"]) -> "StepModels":
        """The models without objectives that are the largest nowhere in a box: steps up to these sizes."""
        count, size = self.objectives, len(self.level)
        reach = np.abs(self.slopes[:count]) @ box
        highest = self.level[:count] + reach + 0.5 * np.abs(self.curvature[:count]) @ box @ box
        of_planes = (self.planes + np.abs(self.plane_slopes) @ box).reshape(-1, size)[:, :count]
        highest = np.maximum(highest, of_planes.max(axis=0, initial=-np.inf))
        chosen = np.append(~(highest < (self.level[:count] - reach).max()), np.full(size - count, True))
        planes = np.tile(chosen, len(self.planes) // size)
        return StepModels(
            self.level[chosen], self.slopes[chosen], self.curvature[chosen],
            self.planes[planes], self.plane_slopes[planes], int(chosen[:count].sum()), self.share, self.penalty,
        )  # fmt: skip

    def reached(self, step: Float[np.ndarray, " free"]) -> tuple[float, float, float]:
        """The improvement by a step, and the largest excess and violation after it."""
        count, change = self.objectives, self.change(step)[0]
        moved, below = self.level + change, (self.planes + self.plane_slopes @ step).reshape(-1, len(self.level))
        excess = max(moved[:count].max(), below[:, :count].max(initial=-np.inf))
        beyond = max(moved[count:].max(initial=0.0), below[:, count:].max(initial=0.0))
        violation = self.level[count:].max(initial=0.0)
        worse = excess + self.share * change[:count].sum() + self.penalty * (beyond - violation)
        return -float(worse), float(excess), float(beyond)

    def best_step(
        self,
        lower: Float[np.ndarray, " free"],
        upper: Float[np.ndarray, " free"],
        matrix: Float[np.ndarray, "constraints free"],
        least: Float[np.ndarray, " constraints"],
    ) -> tuple[Float[np.ndarray, " free"], float]:
        """The step s to the minimum in lower ≤ s ≤ upper with A s ≥ b, and the improvement.

        Solved for the step, the largest excess over the aims and the largest violation of a limit, all relative to
        their values at the point, so that small improvements are not lost by rounding.

        Arguments:
            lower: not positive.
            upper: not negative.
            matrix: A.
            least: b.
        """
        import scipy.optimize

        count, free = self.objectives, len(lower)
        slack = np.zeros((len(self.level), 2))
        slack[:count, 0] = slack[count:, 1] = 1.0
        plane_slack = np.tile(slack, (len(self.planes) // len(slack), 1))
        unit = max(1.0, self.penalty / LARGE)  # SLSQP ends early where its numbers are large
        weights, share = np.array([1.0, self.penalty]) / unit, self.share / unit
        order = np.concatenate([matrix, np.zeros((len(matrix), 2))], axis=1)

        def merit(z: np.ndarray) -> tuple[float, np.ndarray]:
            value, slope = (a[:count].sum(axis=0) for a in self.change(z[:free]))
            return weights @ z[free:] + share * value, np.concatenate([share * slope, weights])

        def room(z: np.ndarray) -> np.ndarray:
            below = plane_slack @ z[free:] - self.planes - self.plane_slopes @ z[:free]
            return np.concatenate([slack @ z[free:] - self.level - self.change(z[:free])[0], below, order @ z - least])

        def room_slope(z: np.ndarray) -> np.ndarray:
            below = np.concatenate([-self.plane_slopes, plane_slack], axis=1)
            return np.concatenate([np.concatenate([-self.change(z[:free])[1], slack], axis=1), below, order])

        best, promised = np.zeros(free), -np.inf
        start = np.array([*best, 0.0, self.level[count:].max(initial=0.0)])
        for _ in range(ATTEMPTS):
            solved = scipy.optimize.minimize(
                merit,
                start,
                jac=True,
                method="SLSQP",
                bounds=[*zip(lower, upper, strict=True), (None, None), (0.0, None)],
                constraints={"type": "ineq", "fun": room, "jac": room_slope},
                options={"ftol": 1e-12, "maxiter": 100},
            )
            step = np.clip(np.nan_to_num(solved.x[:free]), lower, upper)
            gain, *ends = self.reached(step)
            if not gain <= promised:  # nor where it is no number
                best, promised = step, gain
            if solved.success:
                break
            start = np.array([*step, *ends])
        return best, promised
