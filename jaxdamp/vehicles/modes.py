"""Natural modes of a vehicle: frequencies, damping, shapes."""

import dataclasses
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from jaxdamp import _checks
from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._tables import Column, Contents, Table, plain, with_unit
from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.linear import LinearVehicle, as_linear, linearise


@dataclasses.dataclass(frozen=True, eq=False)
class Modes(AbstractResult):
    """Natural modes, lowest frequency first; prints as a table.

    Attributes:
        coordinates: names of the coordinates, the rows of the shapes.
        undamped_frequency: natural frequencies of the vehicle without damping [Hz], shape (q,).
        shapes: shapes of these modes, one column each, the largest entry +1 (metres and radians compared as numbers).
        poles: λ of the damped oscillations [1/s], with positive imaginary part, shape (oscillations,).
        frequency: |λ|/2π [Hz].
        damped_frequency: Im λ/2π [Hz].
        damping_ratio: −Re λ/|λ|.
        damped_shapes: complex shapes of the oscillations, one column each, the largest entry 1.
        decays: real poles [1/s], of overdamped modes and of states of laws; positive ones are unstable.
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

    plot = drawn_by("modes", "The shape of each oscillation.")

    def table(self) -> Table:
        """A row for each damped oscillation, with the coordinates of largest amplitude."""
        columns = (
            Column("frequency", "Hz", ".4f"),
            Column("damped frequency", "Hz", ".4f"),
            Column("damping ratio", "", ".4f"),
            Column("largest amplitudes"),
        )
        numbers = np.stack([self.frequency, self.damped_frequency, self.damping_ratio], axis=1)
        amplitudes = map(self._largest, np.abs(self.damped_shapes.T))
        return Table(
            "Modes", columns, tuple((*plain(row), words) for row, words in zip(numbers, amplitudes, strict=True))
        )

    def content(self) -> Contents:
        """Frequencies, damping ratios and shapes with units, ready for JSON; complex shapes as magnitude and phase."""
        magnitude, phase = np.abs(self.damped_shapes), np.angle(self.damped_shapes)
        return {
            "coordinates": list(self.coordinates),
            "undamped_frequency": with_unit(self.undamped_frequency, "Hz"),
            "shapes": plain(self.shapes),
            "frequency": with_unit(self.frequency, "Hz"),
            "damped_frequency": with_unit(self.damped_frequency, "Hz"),
            "damping_ratio": plain(self.damping_ratio),
            "damped_shapes": {"magnitude": plain(magnitude), "phase": with_unit(phase, "rad")},
            "decays": with_unit(self.decays, "1/s"),
        }

    @property
    def summary(self) -> str:
        """Frequencies and damping ratios of the oscillations."""
        each = zip(self.frequency, self.damping_ratio, strict=True)
        return "Oscillations: " + (", ".join(f"{f:.3g} Hz (damping ratio {d:.2g})" for f, d in each) or "none") + "."

    @property
    def warnings(self) -> tuple[str, ...]:
        """Motions that grow."""
        growing = [f"{f:.3g} Hz" for f, pole in zip(self.frequency, self.poles, strict=True) if pole.real > 0.0]
        growing += [f"{pole:.3g} 1/s" for pole in self.decays if pole > 0.0]
        return (f"Unstable: motion grows at {', '.join(growing)}.",) * bool(growing)

    def __str__(self) -> str:
        undamped = ", ".join(f"{f:.6g}" for f in self.undamped_frequency)
        lines = [self.table().to_text(), f"undamped frequencies [Hz]: {undamped}"]
        if self.decays.size:
            lines.append("real poles, without oscillation [1/s]: " + ", ".join(f"{d:.4g}" for d in self.decays))
        return "\n".join(lines)

    def _largest(self, amplitude: Float[np.ndarray, " q"]) -> str:
        largest = np.argsort(-amplitude)[:3]
        return ", ".join(f"{self.coordinates[i]} {amplitude[i]:.2f}" for i in largest if amplitude[i] > 0.05)


def modes(vehicle: AbstractVehicle | LinearVehicle) -> Modes:
    """Natural modes of a vehicle linearised about its static equilibrium, or of a result of `linearise`.

    Undamped modes solve K φ = ω² M φ with the stiffness of the laws at rest in K, to which their states have settled;
    damped ones are the eigenvalues of the state matrix. The results are NumPy arrays and not differentiable.

    Arguments:
        vehicle: a vehicle, or a result of `linearise`.

    >>> from jaxdamp.vehicles.presets import half_car_002
    >>> print(modes(half_car_002()))
    Modes
    frequency [Hz]  damped frequency [Hz]  damping ratio  largest amplitudes
            1.1707                 1.1430         0.2161  pitch 1.00, z_sprung 0.94, z_front_unsprung 0.22
            1.4589                 1.4053         0.2685  z_sprung 1.00, pitch 0.49, z_rear_unsprung 0.20
           11.4182                10.9627         0.2796  z_rear_unsprung 1.00, z_front_unsprung 0.29
           11.4949                11.0508         0.2753  z_front_unsprung 1.00, z_rear_unsprung 0.29
    undamped frequencies [Hz]: 1.15663, 1.43125, 11.6348, 11.6387
    """
    linear = as_linear(vehicle)
    remedy = "In compiled or differentiated code take the eigenvalues of `linearise(vehicle).state_matrix`."
    _checks.untraced("vehicle", linear.state_matrix, remedy)
    a, n = np.asarray(linear.state_matrix), len(linear.coordinates)
    squares, shapes = np.linalg.eig(-_settled_acceleration(a, n))
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


_STILL = 1e-6  # 1/s, below which a state of a law stands still, such as that of friction


def _settled_acceleration(a: np.ndarray, n: int) -> np.ndarray:
    """Accelerations per coordinate without velocity, the states of the laws where they settle."""
    of_states = a[2 * n :, 2 * n :].astype(float) - _STILL * np.eye(a.shape[0] - 2 * n)
    return a[n : 2 * n, :n] - a[n : 2 * n, 2 * n :] @ np.linalg.solve(of_states, a[2 * n :, :n])


def _scaled(shapes: np.ndarray) -> np.ndarray:
    """Columns divided by their largest entry."""
    largest = np.argmax(np.abs(shapes), axis=0)
    return shapes / shapes[largest, np.arange(shapes.shape[1])]


class Oscillations(NamedTuple):
    """Damped oscillations, lowest frequency first; NaN where a mode does not oscillate.

    Attributes:
        frequency: |λ|/2π [Hz], shape (q,).
        damping_ratio: −Re λ/|λ|, shape (q,).
    """

    frequency: Float[Array, " q"]
    damping_ratio: Float[Array, " q"]


def oscillations(vehicle: AbstractVehicle) -> Oscillations:
    """Frequencies and damping ratios of the linearised vehicle, differentiable by its parameters.

    The same numbers as `modes(vehicle)`, for targets and objectives; by forward derivatives.

    >>> from jaxdamp.vehicles.presets import golden_car
    >>> oscillations(golden_car()).frequency.round(3)
    Array([ 1.236, 10.755], dtype=float64)
    """
    poles = jnp.linalg.eigvals(linearise(vehicle).state_matrix)
    size = jnp.sqrt(jnp.real(poles) ** 2 + jnp.imag(poles) ** 2)
    swings = jnp.imag(poles) > 1e-9 * size
    order = jnp.argsort(jnp.where(swings, size, jnp.inf))[: len(vehicle.coordinates)]
    size, decay = jnp.where(swings, size, jnp.nan)[order], -jnp.real(poles)[order]
    return Oscillations(size / (2.0 * np.pi), decay / size)
