"""Doubts about recorded torques as hypotheses that compete: one regression, judged by evidence."""
