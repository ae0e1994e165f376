"""The simulated RAVEN-II held against the papers: how it was fitted, and how well."""
