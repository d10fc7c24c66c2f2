"""Peers of the speed benchmarks: the same work as others would write it, with its error."""
