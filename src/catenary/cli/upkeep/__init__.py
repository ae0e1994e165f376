"""Commands for a model after the day of its fit."""
