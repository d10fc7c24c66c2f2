"""Natural modes of a vehicle: frequencies, damping, shapes."""

import dataclasses

import numpy as np
from jaxtyping import Complex, Float

from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.linear import LinearVehicle, as_linear


@dataclasses.dataclass(frozen=True)
class Modes:
    """Natural modes, slowest first; prints as a table.

    Arguments:
        coordinates: what the rows of the shapes are.
        undamped_frequency: of the vehicle with all damping taken off [Hz], shape (q,).
        shapes: of those modes, a column for each, the largest entry +1; metres and radians are compared as they are.
        poles: λ of the damped oscillations [1/s], with positive imaginary part, shape (oscillations,).
        frequency: |λ|/2π [Hz].
        damped_frequency: Im λ/2π [Hz].
        damping_ratio: −Re λ/|λ|.
        damped_shapes: complex shapes of the oscillations, a column for each, the largest entry 1.
        decays: real poles [1/s], of overdamped modes and of states of laws; positive ones grow.
    """

    coordinates: tuple[str, ...]
    undamped_frequency: Float[np.ndarray, " q"]
    shapes: Float[np.ndarray, "q q"]
    poles: Complex[np.ndarray, " oscillations"]
    damped_shapes: Complex[np.ndarray, "q oscillations"]
    decays: Float[np.ndarray, " decays"]

    @property
    def frequency(self) -> Float[np.ndarray, " oscillations"]:
        """|λ|/2π [Hz]."""
        return np.abs(self.poles) / (2 * np.pi)

    @property
    def damped_frequency(self) -> Float[np.ndarray, " oscillations"]:
        """Im λ/2π [Hz]."""
        return np.imag(self.poles) / (2 * np.pi)

    @property
    def damping_ratio(self) -> Float[np.ndarray, " oscillations"]:
        """−Re λ/|λ|."""
        return -np.real(self.poles) / np.abs(self.poles)

    def __str__(self) -> str:
        undamped = ", ".join(f"{f:.6g}" for f in self.undamped_frequency)
        lines = [f"undamped modes [Hz]: {undamped}"]
        lines.append(f"{'frequency [Hz]':>15}{'damped [Hz]':>13}{'damping ratio':>15}   moves most")
        rows = zip(self.frequency, self.damped_frequency, self.damping_ratio, self.damped_shapes.T, strict=True)
        for frequency, damped, ratio, shape in rows:
            lines.append(f"{frequency:15.4f}{damped:13.4f}{ratio:15.4f}   {self._most(np.abs(shape))}")
        if self.decays.size:
            lines.append("without oscillation [1/s]: " + ", ".join(f"{d:.4g}" for d in self.decays))
        return "\n".join(lines)

    def _most(self, size: Float[np.ndarray, " q"]) -> str:
        largest = np.argsort(-size)[:3]
        return ", ".join(f"{self.coordinates[i]} {size[i]:.2f}" for i in largest if size[i] > 0.05)


def modes(vehicle: AbstractVehicle | LinearVehicle) -> Modes:
    """Natural modes of a vehicle linearised about its static equilibrium, or of what `linearise` made of it.

    Undamped modes solve K φ = ω² M φ with the stiffness of the laws at rest in K; damped ones are the eigenvalues of
    the state matrix. The result holds numbers of NumPy and takes no part in derivatives.

    >>> from jaxdamp.vehicles.presets import half_car_002
    >>> print(modes(half_car_002()))
    undamped modes [Hz]: 1.15663, 1.43125, 11.6348, 11.6387
     frequency [Hz]  damped [Hz]  damping ratio   moves most
             1.1707       1.1430         0.2161   pitch 1.00, z_sprung 0.94, z_front_unsprung 0.22
             1.4589       1.4053         0.2685   z_sprung 1.00, pitch 0.49, z_rear_unsprung 0.20
            11.4182      10.9627         0.2796   z_rear_unsprung 1.00, z_front_unsprung 0.29
            11.4949      11.0508         0.2753   z_front_unsprung 1.00, z_rear_unsprung 0.29
    """
    linear = as_linear(vehicle)
    a, n = np.asarray(linear.state_matrix), len(linear.coordinates)
    squares, shapes = np.linalg.eig(-a[n : 2 * n, :n])
    order = np.argsort(np.real(squares))
    frequency = np.sqrt(np.maximum(np.real(squares)[order], 0.0)) / (2 * np.pi)
    values, vectors = np.linalg.eig(a)
    turns = np.abs(np.imag(values)) > 1e-9 * np.abs(values)
    chosen = np.flatnonzero(turns & (np.imag(values) > 0))
    chosen = chosen[np.argsort(np.abs(values[chosen]))]
    return Modes(
        linear.coordinates,
        frequency,
        _scaled(np.real(shapes)[:, order]),
        values[chosen],
        _scaled(vectors[:n, chosen]),
        np.sort(np.real(values)[~turns]),
    )


def _scaled(shapes: np.ndarray) -> np.ndarray:
    """Columns divided by their largest entry."""
    largest = np.argmax(np.abs(shapes), axis=0)
    return shapes / shapes[largest, np.arange(shapes.shape[1])]
