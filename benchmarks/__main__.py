"""All benchmarks, one process after the other: `python -m benchmarks`. Half an hour on two cores."""

import subprocess
import sys


QUESTIONS = (
    ["functions"],
    ["first_result"],
    ["one_car"],
    ["one_car", "--plain"],
    ["throughput"],
    ["gradients"],
    ["from_jax"],
    ["scaling"],
    ["memory"],
    ["work_precision"],
    ["fit"],
    ["printed"],
    ["identification"],
    ["pareto"],
    ["white_road"],
    ["explorer"],
)


def main() -> None:
    failed = [
        " ".join(words)
        for words in QUESTIONS
        if subprocess.run([sys.executable, "-m", f"benchmarks.{words[0]}", *words[1:]]).returncode
    ]
    sys.exit(f"failed: {', '.join(failed)}" if failed else 0)


if __name__ == "__main__":
    main()
