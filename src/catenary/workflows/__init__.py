"""What people do with the package, one workflow per file: fit, calibrate, identify, check, export."""
