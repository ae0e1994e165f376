"""What the day of training looked like to somebody without encoders."""
