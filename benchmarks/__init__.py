"""One script per question; each prints a table. Run them as `python -m benchmarks.one_car`."""
