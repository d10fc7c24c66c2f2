"""Dampers as they are bought and sold: forces at stated velocities, rates, gas force, friction, energy, limits."""
