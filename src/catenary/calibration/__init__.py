"""Where the joints of a cable-driven arm really are: models, fits, evaluation."""
