"""What runs beside a robot until somebody ends it."""
