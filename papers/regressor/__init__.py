"""The gravity-regressor paper: a generalised regressor, and 19 joints that learn their gravity."""
