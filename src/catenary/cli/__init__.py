"""The catenary command."""
