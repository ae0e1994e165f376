"""What gravity asks of every joint, on any base."""
