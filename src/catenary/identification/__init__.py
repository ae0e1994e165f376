"""Dynamics of an arm from recordings of it: base parameters, physical consistency, excitation, payload."""
