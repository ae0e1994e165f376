"""Programs that run beside a robot until somebody ends them."""
