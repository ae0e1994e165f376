"""What simulated arms behind cables share, whatever robot they are of."""
