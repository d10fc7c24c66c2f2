"""What a GPU does: five kinds of cars by XLA, by XLA with its loop in a CUDA graph, and by the printed kernel.

    python -m benchmarks.gpu

Each way drives 10 s at 1 kHz in a process of its own. Besinger quarter cars: in float64 and float32 (the kernel in
float64 only), with 2¹⁰ to 2²⁰ cars, with and without gradients. With lag, with series spring, Bouc-Wen, and half cars:
in float64, with 2¹³ cars, by the kernel also with 2¹⁷. The difference is the largest of 16 cars from one core of the
processor in float64. What does not run is listed with the reason. Without a GPU only values of 1024 cars on the
processor are computed.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxdamp


STEPS, COMPARED, FEW, SEVERAL, MOST = 10_000, 16, 2**10, 2**13, 2**20
MANY = 2**17
SIZES = {"value": (FEW, SEVERAL, MANY, MOST), "forward": (FEW, SEVERAL), "reverse": (FEW, SEVERAL)}
WAYS = {
    "processor, XLA": {"JAX_PLATFORMS": "cpu"},
    "processor, printed as C": {"JAX_PLATFORMS": "cpu"},
    "GPU, XLA": {},
    "GPU, XLA, command buffer": {"XLA_FLAGS": "--xla_gpu_enable_command_buffer=+WHILE"},
    "GPU, kernel": {},
}
CASES = ("besinger", "lag", "series_spring", "bouc_wen", "half_car")
PRINTED = ("processor, printed as C", "GPU, kernel")
HEAD = ["car", "by", "numbers", "what", "cars", "M steps/s", "first call, s", "difference"]


def works(case: str, way: str, road: np.ndarray, *, slopes: bool) -> dict[str, Callable[[dict[str, Any]], Any]]:
    """What is measured: the RMS of the acceleration of the body at a point, and its slopes."""
    from benchmarks import ours

    ride = ours.ride(case, road, printed=way in PRINTED).side_by_side()

    def level(point: dict[str, Any]) -> Any:
        return ride(point)[ours.METRIC]

    if way in PRINTED or not slopes:
        return {"value": level}
    return {"value": level, "forward": jax.jacfwd(level), "reverse": jax.grad(level)}


def sizes(case: str, way: str, what: str, most: int) -> list[int]:
    """Numbers of cars."""
    if case == "besinger":
        return [size for size in SIZES[what] if size <= most]
    return [min(SEVERAL, most)] + [MANY] * (way == "GPU, kernel" and most > MANY)


def measured(case: str, way: str, numbers: str, most: int) -> Iterator[list[Any]]:
    """Rows of one way, with the first results; a text in place of figures where it does not run."""
    jaxdamp.configure(x64=numbers == "float64", cpu_devices=1, cache=False)
    from benchmarks import ours
    from benchmarks._timing import first_and_warm
    from benchmarks.peers import problem

    table, road = problem.draw(case, max(most, COMPARED)), problem.heights(case)
    for what, work in works(case, way, road, slopes=most > FEW and case == "besinger").items():
        for cars in sizes(case, way, what, most):
            point = {path: jnp.asarray(column) for path, column in ours.point(case, table[:cars]).items()}
            batch = 128 if way == "processor, XLA" else cars
            run = jax.jit(lambda point, w=work, b=batch: jax.lax.map(w, point, batch_size=b))
            try:
                first, warm = first_and_warm(lambda run=run, point=point: run(point), 3)
                found = np.asarray(run(point)) if what == "value" else None
            except Exception as error:  # whatever stops it is what the table tells
                yield [what, cars, f"not possible: {type(error).__name__}: {str(error).splitlines()[0][:160]}"]
                break
            yield [what, cars, cars * STEPS / warm / 1e6, first, None if found is None else found[:COMPARED].tolist()]


def in_a_process(*words: str, more: dict[str, str]) -> tuple[list[Any], str]:
    """The lines of JSON of a process, and why it failed."""
    command = [sys.executable, "-m", "benchmarks.gpu", *words]
    done = subprocess.run(command, env=os.environ | more, capture_output=True, text=True)
    rows = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("[")]
    return rows, "" if done.returncode == 0 else (done.stderr.strip().splitlines() or ["no reason given"])[-1]


def rows_of(case: str, *, has_gpu: bool) -> list[list[Any]]:
    """The rows of the table of one kind of car."""
    rows: list[list[Any]] = []
    exact = None
    for way, more in WAYS.items():
        if way.startswith("GPU") and not has_gpu:
            rows.append([case, way, "", "not possible: no GPU", "", "", "", ""])
            continue
        most = MOST if way.startswith("GPU") else SEVERAL if has_gpu else FEW
        both = way not in PRINTED and has_gpu and case == "besinger"
        for numbers in ("float64", "float32")[: 1 + both]:
            lines, failed = in_a_process("--way", case, way, numbers, str(most), more=more)
            for what, cars, *rest in lines:
                if len(rest) == 1:
                    rows.append([case, way, numbers, f"{what}: {rest[0]}", cars, "", "", ""])
                    continue
                rate, first, values = rest
                exact = np.array(values) if exact is None else exact
                difference = "" if values is None else float(np.abs(np.array(values) / exact - 1.0).max())
                rows.append([case, way, numbers, what, cars, rate, first, difference])
            if failed:
                rows.append([case, way, numbers, f"not possible: {failed}", "", "", "", ""])
    return rows


def main() -> None:
    found, _ = in_a_process("--find", more={})
    has_gpu = found == [["gpu"]]
    if not has_gpu:
        print(f"There is no GPU that JAX can use: only the processor is measured, with {FEW} cars.")
    rows: list[list[Any]] = []
    for case in CASES:
        rows += rows_of(case, has_gpu=has_gpu)
    from benchmarks._timing import report

    report("gpu", "Cars, 10 s at 1 kHz, million car-steps a second", HEAD, rows)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--find"]:
        print(json.dumps([jax.default_backend()]))
    elif sys.argv[1:2] == ["--way"]:
        for line in measured(sys.argv[2], sys.argv[3], sys.argv[4], int(sys.argv[5])):
            print(json.dumps(line), flush=True)
    else:
        main()
