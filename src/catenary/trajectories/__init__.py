"""Motions as functions of time: where every joint should be, how fast, and how it accelerates."""
