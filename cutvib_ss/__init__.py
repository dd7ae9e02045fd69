"""Vibration of a Cartesian cutting machine: state-space models, and a diagnosis of the sim-to-real gap."""
