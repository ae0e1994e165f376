"""What gravity asks of every joint."""
